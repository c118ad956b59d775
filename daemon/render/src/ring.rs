//! The ring of frames in flight, shared by the thread that submits and the thread that takes finished frames.
//!
//! Frame n (counted from 0) uses slot n modulo the ring's length and signals n + 1 on the timeline semaphore. A slot is free
//! again when its [`Finished`] is dropped. The submitting thread waits for a free slot and for nothing else.
//!
//! A device that is lost, or that does not finish a frame in time, fails both ends for good: the first to notice writes it down
//! in [`State::failed`], the other is woken and says the same.

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
    pub rehearsal: Duration,
}

impl Default for TimeOuts {
    /// Half a second, fifteen frames at 30 Hz; and a minute for drivers that compile on a busy processor.
    fn default() -> Self {
        Self { frame: Duration::from_millis(500), rehearsal: Duration::from_secs(60) }
    }
}

impl TimeOuts {
    fn of(&self, rehearsal: bool) -> Duration {
        if rehearsal { self.rehearsal } else { self.frame }
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
    Rounds,
    Hud,
}

impl Span {
    const ALL: [Self; 14] = [
        Self::Video,
        Self::Download,
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
        Self::Rounds,
        Self::Hud,
    ];

    /// The pass whose time it is part of.
    fn pass(self) -> Pass {
        match self {
            Self::Video | Self::Download => Pass::Video,
            Self::Mirror | Self::Soften => Pass::Mirror,
            Self::Backdrop | Self::Field | Self::Layers | Self::Water => Pass::Water,
            Self::Wake | Self::Spray => Pass::Wake,
            Self::BoatLayer | Self::Composite => Pass::Boats,
            Self::Rounds => Pass::Rounds,
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

/// What one slot gives back.
pub(crate) struct SlotOut {
    /// Where the frame is copied to when it is drawn; without one, the target is the slot's own and finished in place.
    pub(crate) download: Option<Buffer>,
    pub(crate) queries: vk::QueryPool,
}

/// What both threads see.
pub(crate) struct Shared {
    pub(crate) gpu: Arc<Gpu>,
    pub(crate) timeline: vk::Semaphore,
    pub(crate) slots: Vec<SlotOut>,
    /// One for each slot, or one for all.
    targets: Vec<DrawTarget>,
    pub(crate) size: (u32, u32),
    time_outs: TimeOuts,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    /// Frames submitted so far.
    submitted: u64,
    /// Frames handed to the reader so far.
    taken: u64,
    /// Slots that the GPU or a `Finished` uses.
    busy: [bool; SLOTS_MAX],
    /// Scene's frame number by slot.
    frame: [u64; SLOTS_MAX],
    /// Whether shaders may have to be compiled for it, by slot.
    rehearsal: [bool; SLOTS_MAX],
    /// The picture whose memory the GPU reads where it lies, by slot, until the frame is finished: the camera's driver must not
    /// fill it again before.
    held: [Option<Picture>; SLOTS_MAX],
    /// Why no frame will come any more: the device was lost, or hangs.
    failed: Option<RenderError>,
    reader_gone: bool,
    renderer_gone: bool,
}

impl Shared {
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
            state: Mutex::default(),
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

    fn lock(&self) -> MutexGuard<'_, State> {
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
            if !state.busy.get(slot).copied().unwrap_or(false) {
                break;
            }
            waited = true;
            let compiling =
                state.busy.iter().zip(state.rehearsal).any(|(busy, rehearsal)| *busy && rehearsal);
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
                state.busy[slot] = false;
                continue;
            }
            let mut allowed = Duration::from_secs(STALL_S).max(self.time_outs.frame);
            if compiling {
                allowed = allowed.max(self.time_outs.rehearsal);
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

    /// Hands the frame just submitted to the reader. `held` is kept until the frame is finished.
    pub(crate) fn submitted(&self, slot: usize, frame: u64, rehearsal: bool, held: Option<Picture>) {
        let mut state = self.lock();
        state.busy[slot] = true;
        state.frame[slot] = frame;
        state.rehearsal[slot] = rehearsal;
        // Where nobody took the frame that was here before, its picture goes now, outside the lock.
        let before = std::mem::replace(&mut state.held[slot], held);
        state.submitted += 1;
        drop(state);
        self.changed.notify_all();
        drop(before);
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
        let compiling = state.busy.iter().zip(state.rehearsal).any(|(busy, rehearsal)| *busy && rehearsal);
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

impl Drop for Shared {
    fn drop(&mut self) {
        if self.gpu.is_abandoned() {
            // The GPU may still read them: the driver never gets them back.
            let state = self.state.get_mut().unwrap_or_else(PoisonError::into_inner);
            state.held.iter_mut().for_each(|picture| std::mem::forget(picture.take()));
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
pub struct Completions {
    shared: Arc<Shared>,
    /// How long the frame that comes next was waited for.
    waited: Duration,
}

impl Completions {
    pub(crate) fn new(shared: Arc<Shared>) -> Self {
        Self { shared, waited: Duration::ZERO }
    }

    /// The next frame, once the GPU has finished it; `None` after `timeout`, or when the renderer is gone and every frame was
    /// given (see [`Completions::is_over`]).
    ///
    /// [`RenderError::DeviceLost`] once the device is lost: drop both ends and make new ones, which neither waits nor leaks.
    /// [`RenderError::Hung`] once a frame was waited for, in one call or several, for longer than
    /// [`TimeOuts`] allow: dropping both ends does not wait for the device, but leaks what is on it. End the process soon.
    pub fn wait_next(&mut self, timeout: Duration) -> Result<Option<Finished>, RenderError> {
        let shared = &self.shared;
        let state = shared.lock();
        let waiting = |s: &mut State| s.submitted == s.taken && !s.renderer_gone && s.failed.is_none();
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
        let allowed = shared.time_outs.of(state.rehearsal[slot]);
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
        let frame = state.frame[slot];
        let held = state.held[slot].take();
        drop(state);
        // Back to the camera's driver, outside the lock.
        drop(held);
        Ok(Some(Finished { shared: shared.clone(), slot, frame, passes_ms, frame_ms }))
    }

    /// Whether the renderer is gone and every frame was given.
    pub fn is_over(&self) -> bool {
        let state = self.shared.lock();
        state.renderer_gone && state.submitted == state.taken
    }
}

impl Drop for Completions {
    fn drop(&mut self) {
        self.shared.lock().reader_gone = true;
        self.shared.changed.notify_all();
    }
}

/// A finished frame. Dropping it frees its slot of the ring.
pub struct Finished {
    shared: Arc<Shared>,
    slot: usize,
    /// The scene's frame number.
    pub frame: u64,
    /// GPU milliseconds by pass, in the order of [`Pass::ALL`]; `None` for passes that did not run or that the video pass did with
    /// its own work, in frames that were not timed (see [`crate::Renderer::time_every`]), and on devices without timestamps.
    pub passes_ms: [Option<f64>; Pass::COUNT],
    /// GPU milliseconds from the frame's first command to its last; `None` likewise.
    pub frame_ms: Option<f64>,
}

impl Finished {
    /// Width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        self.shared.size
    }

    /// The picture: sRGB codes, R, G, B, A, rows from the top, no padding.
    pub fn rgba(&self) -> &[u8] {
        // SAFETY: the GPU has finished this slot and does not write it again before `self` is dropped.
        match self.shared.slots.get(self.slot).and_then(|slot| slot.download.as_ref()) {
            Some(download) => unsafe { download.bytes() },
            None => unsafe { self.shared.target(self.slot).bytes() },
        }
    }
}

impl Drop for Finished {
    fn drop(&mut self) {
        self.shared.lock().busy[self.slot] = false;
        self.shared.changed.notify_all();
    }
}
