//! The ring of frames in flight, shared by the thread that submits and the thread that takes finished frames.
//!
//! Frame n (counted from 0) uses slot n modulo the ring's length and signals n + 1 on the timeline semaphore. A slot is free
//! again when its [`Finished`] is dropped. The submitting thread waits for a free slot and for nothing else.

use std::{
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use ash::vk;
use bowwave_core::scene::Pass;

use crate::{
    error::{Named, RenderError},
    gpu::Gpu,
    memory::{Access, Buffer},
};

/// Most slots a ring can have.
pub(crate) const SLOTS_MAX: usize = 8;
/// A GPU that takes longer than this for a frame hangs.
const STALL_S: u64 = 5;

/// A stretch of the command buffer that is timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Span {
    Video,
    VideoCopy,
    Mirror,
    Soften,
    BoatLayer,
    Field,
    Water,
    Composite,
    Rounds,
    Hud,
}

impl Span {
    const ALL: [Self; 10] = [
        Self::Video,
        Self::VideoCopy,
        Self::Mirror,
        Self::Soften,
        Self::BoatLayer,
        Self::Field,
        Self::Water,
        Self::Composite,
        Self::Rounds,
        Self::Hud,
    ];

    /// The pass whose time it is part of.
    fn pass(self) -> Pass {
        match self {
            Self::Video | Self::VideoCopy => Pass::Video,
            Self::Mirror | Self::Soften => Pass::Mirror,
            Self::Field | Self::Water => Pass::Water,
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
    pub(crate) download: Buffer,
    pub(crate) queries: vk::QueryPool,
}

/// What both threads see.
pub(crate) struct Shared {
    pub(crate) gpu: Arc<Gpu>,
    pub(crate) timeline: vk::Semaphore,
    pub(crate) slots: Vec<SlotOut>,
    pub(crate) size: (u32, u32),
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
    reader_gone: bool,
    renderer_gone: bool,
}

impl Shared {
    pub(crate) fn new(gpu: &Arc<Gpu>, size: (u32, u32), slots: usize) -> Result<Self, RenderError> {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: `info` is complete; the feature is enabled.
        let timeline = unsafe { gpu.device.create_semaphore(&info, None) }.named("vkCreateSemaphore")?;
        let mut shared = Self {
            gpu: gpu.clone(),
            timeline,
            slots: Vec::with_capacity(slots),
            size,
            state: Mutex::default(),
            changed: Condvar::new(),
        };
        for _ in 0..slots.clamp(1, SLOTS_MAX) {
            let bytes = u64::from(size.0) * u64::from(size.1) * 4;
            let usage = vk::BufferUsageFlags::TRANSFER_DST | vk::BufferUsageFlags::TRANSFER_SRC;
            let download = Buffer::new(gpu, "finished frames", bytes, usage, Access::Download)?;
            let info =
                vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(QUERIES);
            // SAFETY: `info` is complete.
            let queries = unsafe { gpu.device.create_query_pool(&info, None) }.named("vkCreateQueryPool")?;
            shared.slots.push(SlotOut { download, queries });
        }
        Ok(shared)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn slot_of(&self, frame: u64) -> usize {
        usize::try_from(frame % self.slots.len() as u64).unwrap_or(0)
    }

    /// Waits for the next slot. Returns it, and whether there was need to wait.
    pub(crate) fn acquire(&self) -> Result<(usize, bool), RenderError> {
        let stalled = RenderError::Stalled { seconds: STALL_S };
        let mut state = self.lock();
        let slot = self.slot_of(state.submitted);
        let mut waited = false;
        while state.busy.get(slot).copied().unwrap_or(false) {
            waited = true;
            if state.reader_gone && state.taken <= state.submitted.saturating_sub(self.slots.len() as u64) {
                // Nobody reads any more: the slot is free when the GPU is done with it.
                let value = state.submitted + 1 - self.slots.len() as u64;
                drop(state);
                if !self.wait_value(value, Duration::from_secs(STALL_S))? {
                    return Err(stalled);
                }
                state = self.lock();
                state.taken = state.taken.max(value);
                state.busy[slot] = false;
                continue;
            }
            let (next, timeout) = self
                .changed
                .wait_timeout(state, Duration::from_secs(STALL_S))
                .unwrap_or_else(PoisonError::into_inner);
            state = next;
            if timeout.timed_out() {
                return Err(stalled);
            }
        }
        Ok((slot, waited))
    }

    /// The value that the frame now being recorded signals.
    pub(crate) fn next_value(&self) -> u64 {
        self.lock().submitted + 1
    }

    /// Hands the frame just submitted to the reader.
    pub(crate) fn submitted(&self, slot: usize, frame: u64) {
        let mut state = self.lock();
        state.busy[slot] = true;
        state.frame[slot] = frame;
        state.submitted += 1;
        drop(state);
        self.changed.notify_all();
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
}

impl Completions {
    pub(crate) fn new(shared: Arc<Shared>) -> Self {
        Self { shared }
    }

    /// The next frame, once the GPU has finished it; `None` after `timeout`, or when the renderer is gone and every frame was
    /// given (see [`Completions::is_over`]).
    pub fn wait_next(&mut self, timeout: Duration) -> Result<Option<Finished>, RenderError> {
        let shared = &self.shared;
        let state = shared.lock();
        let waiting = |s: &mut State| s.submitted == s.taken && !s.renderer_gone;
        let (state, _) = shared
            .changed
            .wait_timeout_while(state, timeout, waiting)
            .unwrap_or_else(PoisonError::into_inner);
        if state.submitted == state.taken {
            return Ok(None);
        }
        let next = state.taken;
        drop(state);
        if !shared.wait_value(next + 1, timeout)? {
            return Ok(None);
        }
        let slot = shared.slot_of(next);
        let (passes_ms, frame_ms) = shared.timings(slot);
        let mut state = shared.lock();
        state.taken = next + 1;
        let frame = state.frame[slot];
        drop(state);
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
    /// GPU milliseconds by pass, in the order of [`Pass::ALL`]; `None` for passes that did not run, in frames that were not
    /// timed (all but one in [`crate::TIMED_EVERY`]), and on devices without timestamps.
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
        match self.shared.slots.get(self.slot) {
            // SAFETY: the GPU has finished this slot and does not write it again before `self` is dropped.
            Some(slot) => unsafe { slot.download.bytes() },
            None => &[],
        }
    }
}

impl Drop for Finished {
    fn drop(&mut self) {
        self.shared.lock().busy[self.slot] = false;
        self.shared.changed.notify_all();
    }
}
