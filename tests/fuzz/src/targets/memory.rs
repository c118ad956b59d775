//! Counts what is allocated: a length field must not make a reader ask for more than its input can fill.

use std::sync::{Mutex, PoisonError};

use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// The peak belongs to the process: two that measure wait for each other.
static MEASURING: Mutex<()> = Mutex::new(());

/// Runs `work`; panics if it held more than `limit_bytes` at once beyond what was held before.
pub fn within<T>(limit_bytes: usize, work: impl FnOnce() -> T) -> T {
    let _alone = MEASURING.lock().unwrap_or_else(PoisonError::into_inner);
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let result = work();
    let held = MEMORY.peak_usage().saturating_sub(before);
    assert!(held <= limit_bytes, "{held} bytes were held at once, the limit is {limit_bytes}");
    result
}
