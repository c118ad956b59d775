//! Run time of a piece of work, as far as a noisy machine tells.

use std::{hint::black_box, time::Instant};

/// Median time of one call in nanoseconds, over `repeats` batches of about a millisecond each.
pub fn time_ns<T>(repeats: usize, mut work: impl FnMut() -> T) -> f64 {
    let start = Instant::now();
    black_box(work());
    let once = start.elapsed().as_nanos().max(1);
    let batch = (1_000_000 / once).clamp(1, 1_000_000) as usize;
    let mut times: Vec<f64> = (0..repeats.max(1))
        .map(|_| {
            let start = Instant::now();
            for _ in 0..batch {
                black_box(work());
            }
            start.elapsed().as_nanos() as f64 / batch as f64
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
