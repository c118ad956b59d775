//! The ring of frames in flight, shared by the thread that submits and the thread that takes finished frames.
//!
//! Frame n (counted from 0) uses slot n modulo the ring's length and signals n + 1 on the timeline semaphore. A slot is free
//! again when its [`FinishedFrame`] is dropped. The submitting thread waits for a free slot and for nothing else.
//!
//! A device that is lost, or that does not finish a frame in time, fails both ends for good: the first to notice writes it down
//! in [`RingState::failed`], the other is woken and says the same.

use std::{
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use ash::vk;
use bowwave_core::{event::Picture, frame::scene::Pass};

use crate::{
    error::{Named, RenderError},
    gpu::Gpu,
    memory::{Access, Buffer},
    target::DrawTarget,
};

/// Most slots a ring can have.
pub(crate) const SLOTS_MAX: usize = 8;
/// A reader that gives no frame back for longer than this has stopped.
const STALL_S: u64 = 5;

/// How long the GPU may take before it counts as hung.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeOuts {
    /// For one frame, counted from when the reader has the frame before and waits for this one.
    pub frame: Duration,
    /// For a frame whose shaders may still have to be compiled: the first, and the first after the picture's shape changed.
    pub warm_up: Duration,
}

impl Default for TimeOuts {
    /// Half a second, fifteen frames at 30 Hz; and a minute for drivers that compile on a busy processor.
    fn default() -> Self {
        Self { frame: Duration::from_millis(500), warm_up: Duration::from_secs(60) }
    }
}

impl TimeOuts {
    fn of(&self, warm_up: bool) -> Duration {
        if warm_up { self.warm_up } else { self.frame }
    }
}

fn hung(after: Duration) -> RenderError {
    let after_ms = u64::try_from(after.as_millis()).unwrap_or(u64::MAX);
    RenderError::Hung { what: "a frame", after_ms }
}

/// A stretch of the command buffer that is timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Span {
    Video,
    Download,
    Shadow,
    Backdrop,
    Mirror,
    Soften,
    BoatLayer,
    Field,
    Layers,
    Water,
    Wake,
    Composite,
    Spray,
    Lamplight,
    Lights,
    Rounds,
    Kept,
    Phantoms,
    Hud,
}

impl Span {
    const ALL: [Self; 19] = [
        Self::Video,
        Self::Download,
        Self::Shadow,
        Self::Backdrop,
        Self::Mirror,
        Self::Soften,
        Self::BoatLayer,
        Self::Field,
        Self::Layers,
        Self::Water,
        Self::Wake,
        Self::Composite,
        Self::Spray,
        Self::Lamplight,
        Self::Lights,
        Self::Rounds,
        Self::Kept,
        Self::Phantoms,
        Self::Hud,
    ];

    /// The pass whose time it is part of.
    fn pass(self) -> Pass {
        match self {
            Self::Video | Self::Download => Pass::Video,
            Self::Shadow => Pass::Shadow,
            Self::Mirror | Self::Soften => Pass::Mirror,
            Self::Backdrop | Self::Field | Self::Layers | Self::Water => Pass::Water,
            Self::Wake | Self::Spray => Pass::Wake,
            Self::BoatLayer | Self::Composite => Pass::Boats,
            Self::Lamplight => Pass::Lamplight,
            Self::Lights => Pass::Lights,
            Self::Rounds => Pass::Rounds,
            Self::Kept | Self::Phantoms => Pass::Phantoms,
            Self::Hud => Pass::Hud,
        }
    }

    /// Query that is written where the stretch begins; the next one is written where it ends.
    pub(crate) fn first_query(self) -> u32 {
        self as u32 * 2
    }
}

/// Two queries a stretch, then two around the whole frame.
pub(crate) const QUERIES: u32 = Span::ALL.len() as u32 * 2 + 2;
/// The first of the two queries around the whole frame.
pub(crate) const FRAME_QUERY: u32 = QUERIES - 2;

/// Memory of one slot that its reader and its timings come from.
pub(crate) struct SlotOut {
    /// Where the frame is copied to when it is drawn; without one, the target is the slot's own and finished in place.
    pub(crate) download: Option<Buffer>,
    pub(crate) queries: vk::QueryPool,
}

/// The ring, as both threads see it. `T` is what the caller gives along with each frame.
pub(crate) struct Shared<T> {
    pub(crate) gpu: Arc<Gpu>,
    pub(crate) timeline: vk::Semaphore,
    pub(crate) slots: Vec<SlotOut>,
    /// One for each slot, or one for all.
    targets: Vec<DrawTarget>,
    pub(crate) size: (u32, u32),
    time_outs: TimeOuts,
    state: Mutex<RingState<T>>,
    changed: Condvar,
}

/// A frame between its submission and its reader.
pub(crate) struct InFlight<T> {
    /// The scene's frame number.
    pub(crate) frame: u64,
    /// Whether shaders may have to be compiled for it.
    pub(crate) warm_up: bool,
    /// The picture whose memory the GPU reads where it lies, until the frame is finished: the camera's driver must not fill it again
    /// before.
    pub(crate) picture: Option<Picture>,
    /// The caller's own.
    pub(crate) ticket: T,
}

/// Life of a slot: free, in flight, held, and free again.
enum SlotState<T> {
    /// Nobody uses it: the next frame that comes round may.
    Free,
    /// Its frame was submitted. The GPU draws it, or has and nobody took it yet.
    InFlight(InFlight<T>),
    /// The reader has its frame as a [`FinishedFrame`], whose drop frees it.
    Held {
        /// Whether shaders may have been compiled for it, so that its reader may have waited long.
        warm_up: bool,
    },
}

impl<T> SlotState<T> {
    fn is_free(&self) -> bool {
        matches!(self, Self::Free)
    }

    fn warms_up(&self) -> bool {
        matches!(self, Self::InFlight(InFlight { warm_up: true, .. }) | Self::Held { warm_up: true })
    }
}

struct RingState<T> {
    /// Frames submitted so far.
    submitted: u64,
    /// Frames handed to the reader so far.
    taken: u64,
    slots: [SlotState<T>; SLOTS_MAX],
    /// Why no frame will come any more: the device was lost, or hangs.
    failed: Option<RenderError>,
    reader_gone: bool,
    renderer_gone: bool,
}

impl<T> Default for RingState<T> {
    fn default() -> Self {
        Self {
            submitted: 0,
            taken: 0,
            slots: [const { SlotState::Free }; SLOTS_MAX],
            failed: None,
            reader_gone: false,
            renderer_gone: false,
        }
    }
}

impl<T> Shared<T> {
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        size: (u32, u32),
        slots: usize,
        time_outs: TimeOuts,
    ) -> Result<Self, RenderError> {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: `info` is complete; the feature is enabled.
        let timeline = unsafe { gpu.device.create_semaphore(&info, None) }.named("vkCreateSemaphore")?;
        let mut shared = Self {
            gpu: gpu.clone(),
            timeline,
            slots: Vec::with_capacity(slots),
            targets: Vec::with_capacity(slots),
            size,
            time_outs,
            state: Mutex::new(RingState::default()),
            changed: Condvar::new(),
        };
        for _ in 0..slots.clamp(1, SLOTS_MAX) {
            if shared.targets.is_empty() || shared.targets[0].is_finished_in_place() {
                shared.targets.push(DrawTarget::new(gpu, size)?);
            }
            let bytes = u64::from(size.0) * u64::from(size.1) * 4;
            let usage = vk::BufferUsageFlags::TRANSFER_DST;
            let download = (!shared.targets[0].is_finished_in_place())
                .then(|| Buffer::new(gpu, "finished frames", bytes, usage, Access::Download))
                .transpose()?;
            let info =
                vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(QUERIES);
            // SAFETY: `info` is complete.
            let queries = unsafe { gpu.device.create_query_pool(&info, None) }.named("vkCreateQueryPool")?;
            shared.slots.push(SlotOut { download, queries });
        }
        Ok(shared)
    }

    /// What a slot's frame is drawn to.
    pub(crate) fn target(&self, slot: usize) -> &DrawTarget {
        &self.targets[slot.min(self.targets.len() - 1)]
    }

    fn lock(&self) -> MutexGuard<'_, RingState<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn slot_of(&self, frame: u64) -> usize {
        usize::try_from(frame % self.slots.len() as u64).unwrap_or(0)
    }

    /// Writes down why no frame will come any more, and wakes the other thread. Returns the first such reason, which stays;
    /// what concerns one call alone is returned as it came.
    pub(crate) fn fail(&self, error: RenderError) -> RenderError {
        if !matches!(error, RenderError::DeviceLost { .. } | RenderError::Hung { .. }) {
            return error;
        }
        let first = self.lock().failed.get_or_insert(error).clone();
        self.changed.notify_all();
        first
    }

    /// Waits for the next slot. Returns it, and whether there was need to wait.
    pub(crate) fn acquire(&self) -> Result<(usize, bool), RenderError> {
        let mut state = self.lock();
        let slot = self.slot_of(state.submitted);
        let mut waited = false;
        loop {
            if let Some(error) = &state.failed {
                return Err(error.clone());
            }
            if state.slots[slot].is_free() {
                break;
            }
            waited = true;
            let compiling = state.slots.iter().any(SlotState::warms_up);
            if state.reader_gone && state.taken <= state.submitted.saturating_sub(self.slots.len() as u64) {
                // Nobody reads any more: the slot is free when the GPU is done with it.
                let value = state.submitted + 1 - self.slots.len() as u64;
                let allowed = self.time_outs.of(compiling);
                drop(state);
                if !self.wait_value(value, allowed)? {
                    return Err(hung(allowed));
                }
                state = self.lock();
                state.taken = state.taken.max(value);
                // What was in flight goes outside the lock: it may give a picture back to the camera's driver.
                let gone = std::mem::replace(&mut state.slots[slot], SlotState::Free);
                drop(state);
                drop(gone);
                state = self.lock();
                continue;
            }
            let mut allowed = Duration::from_secs(STALL_S).max(self.time_outs.frame);
            if compiling {
                allowed = allowed.max(self.time_outs.warm_up);
            }
            let (next, timeout) =
                self.changed.wait_timeout(state, allowed).unwrap_or_else(PoisonError::into_inner);
            state = next;
            if timeout.timed_out() {
                return Err(RenderError::Stalled { seconds: allowed.as_secs() });
            }
        }
        Ok((slot, waited))
    }

    /// The value that the frame now being recorded signals.
    pub(crate) fn next_value(&self) -> u64 {
        self.lock().submitted + 1
    }

    /// Hands the frame just submitted to the reader.
    pub(crate) fn submitted(&self, slot: usize, frame: InFlight<T>) {
        let mut state = self.lock();
        state.slots[slot] = SlotState::InFlight(frame);
        state.submitted += 1;
        drop(state);
        self.changed.notify_all();
    }

    /// How many frames the GPU has finished.
    pub(crate) fn finished(&self) -> Result<u64, RenderError> {
        // SAFETY: the semaphore lives as long as `self`.
        unsafe { self.gpu.device.get_semaphore_counter_value(self.timeline) }
            .named("vkGetSemaphoreCounterValue")
    }

    /// Waits until the GPU has finished all frames, but not for ever. On a lost device nothing runs any more, which is rest too.
    pub(crate) fn rest(&self) -> Result<(), RenderError> {
        let state = self.lock();
        let (value, failed) = (state.submitted, state.failed.clone());
        let compiling = state.slots.iter().any(SlotState::warms_up);
        drop(state);
        let allowed = self.time_outs.of(compiling);
        let result = match failed {
            Some(error) => Err(error),
            None if value == 0 => Ok(()),
            None => match self.wait_value(value, allowed) {
                Ok(true) => Ok(()),
                Ok(false) => Err(hung(allowed)),
                Err(error) => Err(error),
            },
        };
        match result.map_err(|e| self.fail(e)) {
            Err(RenderError::DeviceLost { .. }) => Ok(()),
            result => result,
        }
    }

    /// Waits for the timeline; `false` after `timeout`.
    fn wait_value(&self, value: u64, timeout: Duration) -> Result<bool, RenderError> {
        let (semaphores, values) = ([self.timeline], [value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        let timeout_ns = u64::try_from(timeout.as_nanos()).unwrap_or(u64::MAX);
        // SAFETY: the semaphore lives as long as `self`.
        match unsafe { self.gpu.device.wait_semaphores(&info, timeout_ns) } {
            Err(vk::Result::TIMEOUT) => Ok(false),
            result => result.named("vkWaitSemaphores").map(|()| true),
        }
    }

    /// Milliseconds by pass, and of the whole frame, of a finished slot.
    fn timings(&self, slot: usize) -> ([Option<f64>; Pass::COUNT], Option<f64>) {
        let mut passes = [None; Pass::COUNT];
        let Some(step_ns) = self.gpu.timestamp_ns else { return (passes, None) };
        let mut raw = [[0_u64; 2]; QUERIES as usize];
        let Some(out) = self.slots.get(slot) else { return (passes, None) };
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WITH_AVAILABILITY;
        // SAFETY: the frame is finished, so nothing writes the pool; the array has room for all queries with availability.
        // A pool with queries that this frame did not write answers NOT_READY and fills in the others.
        let _ = unsafe { self.gpu.device.get_query_pool_results(out.queries, 0, &mut raw, flags) };
        let between = |first: u32| {
            let [from, to] = [raw[first as usize], raw[first as usize + 1]];
            (from[1] != 0 && to[1] != 0).then(|| to[0].saturating_sub(from[0]) as f64 * step_ns * 1e-6)
        };
        for span in Span::ALL {
            if let Some(ms) = between(span.first_query()) {
                let entry = &mut passes[span.pass() as usize];
                *entry = Some(entry.unwrap_or(0.0) + ms);
            }
        }
        (passes, between(FRAME_QUERY))
    }

    /// Tells the reader that no further frame will come.
    pub(crate) fn close(&self) {
        self.lock().renderer_gone = true;
        self.changed.notify_all();
    }
}

impl<T> Drop for Shared<T> {
    fn drop(&mut self) {
        if self.gpu.is_abandoned() {
            // The GPU may still read them: the driver never gets them back.
            let state = self.state.get_mut().unwrap_or_else(PoisonError::into_inner);
            for slot in &mut state.slots {
                if let SlotState::InFlight(frame) = slot {
                    std::mem::forget(frame.picture.take());
                }
            }
            return;
        }
        // SAFETY: the renderer waits for the device before it lets go of `self`; a reader holds only finished frames.
        unsafe {
            for slot in &self.slots {
                self.gpu.device.destroy_query_pool(slot.queries, None);
            }
            self.gpu.device.destroy_semaphore(self.timeline, None);
        }
    }
}

/// The reading end: gives finished frames in order. For a thread of its own.
pub struct Completions<T = ()> {
    shared: Arc<Shared<T>>,
    /// How long the frame that comes next was waited for.
    waited: Duration,
}

impl<T> Completions<T> {
    pub(crate) fn new(shared: Arc<Shared<T>>) -> Self {
        Self { shared, waited: Duration::ZERO }
    }

    /// The next frame, once the GPU has finished it; `None` after `timeout`, or when the renderer is gone and every frame was
    /// given (see [`Completions::is_over`]).
    ///
    /// [`RenderError::DeviceLost`] once the device is lost: drop both ends and make new ones, which neither waits nor leaks.
    /// [`RenderError::Hung`] once a frame was waited for, in one call or several, for longer than
    /// [`TimeOuts`] allow: dropping both ends does not wait for the device, but leaks what is on it. End the process soon.
    pub fn wait_next(&mut self, timeout: Duration) -> Result<Option<FinishedFrame<T>>, RenderError> {
        let shared = &self.shared;
        let state = shared.lock();
        let waiting = |s: &mut RingState<T>| s.submitted == s.taken && !s.renderer_gone && s.failed.is_none();
        let (state, _) = shared
            .changed
            .wait_timeout_while(state, timeout, waiting)
            .unwrap_or_else(PoisonError::into_inner);
        if let Some(error) = &state.failed {
            return Err(error.clone());
        }
        if state.submitted == state.taken {
            return Ok(None);
        }
        let next = state.taken;
        let slot = shared.slot_of(next);
        let warm_up = state.slots[slot].warms_up();
        let allowed = shared.time_outs.of(warm_up);
        drop(state);
        let step = timeout.min(allowed.saturating_sub(self.waited));
        if !shared.wait_value(next + 1, step).map_err(|e| shared.fail(e))? {
            self.waited += step;
            if self.waited >= allowed {
                return Err(shared.fail(hung(allowed)));
            }
            return Ok(None);
        }
        self.waited = Duration::ZERO;
        let (passes_ms, frame_ms) = shared.timings(slot);
        let mut state = shared.lock();
        state.taken = next + 1;
        let taken = std::mem::replace(&mut state.slots[slot], SlotState::Held { warm_up });
        drop(state);
        let SlotState::InFlight(InFlight { frame, picture, ticket, .. }) = taken else { return Ok(None) };
        // Back to the camera's driver, outside the lock.
        drop(picture);
        Ok(Some(FinishedFrame { shared: shared.clone(), slot, frame, ticket, passes_ms, frame_ms }))
    }

    /// Whether the renderer is gone and every frame was given.
    pub fn is_over(&self) -> bool {
        let state = self.shared.lock();
        state.renderer_gone && state.submitted == state.taken
    }
}

impl<T> Drop for Completions<T> {
    fn drop(&mut self) {
        self.shared.lock().reader_gone = true;
        self.shared.changed.notify_all();
    }
}

/// A finished frame. Dropping it frees its slot of the ring.
pub struct FinishedFrame<T = ()> {
    shared: Arc<Shared<T>>,
    slot: usize,
    /// The scene's frame number.
    pub frame: u64,
    /// What the caller gave along with it.
    pub ticket: T,
    /// GPU milliseconds by pass, in the order of [`Pass::ALL`]; `None` for passes that did not run or that the video pass did with
    /// its own work, in frames that were not timed (see [`crate::Renderer::time_every`]), and on devices without timestamps.
    pub passes_ms: [Option<f64>; Pass::COUNT],
    /// GPU milliseconds from the frame's first command to its last; `None` likewise.
    pub frame_ms: Option<f64>,
}

impl<T> FinishedFrame<T> {
    /// Width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        self.shared.size
    }

    /// The picture: sRGB codes, R, G, B, A, rows from the top, no padding.
    pub fn rgba(&self) -> &[u8] {
        // SAFETY: the GPU has finished this slot and does not write it again before `self` is dropped.
        match self.shared.slots.get(self.slot).and_then(|slot| slot.download.as_ref()) {
            // SAFETY: as above.
            Some(download) => unsafe { download.bytes() },
            // SAFETY: as above.
            None => unsafe { self.shared.target(self.slot).bytes() },
        }
    }
}

impl<T> Drop for FinishedFrame<T> {
    fn drop(&mut self) {
        self.shared.lock().slots[self.slot] = SlotState::Free;
        self.shared.changed.notify_all();
    }
}
