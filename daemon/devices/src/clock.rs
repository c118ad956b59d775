//! The host's monotonic clock.

use bowwave_core::time::{NS_PER_S, Time};
use rustix::{
    io::Errno,
    thread::clock_nanosleep_absolute,
    time::{ClockId, Timespec, clock_gettime},
};

/// `CLOCK_MONOTONIC` now: the clock of V4L2 buffers and GPIO edges, which no step of the wall clock touches.
pub fn now() -> Time {
    let t = clock_gettime(ClockId::Monotonic);
    Time::from_ns(t.tv_sec.saturating_mul(NS_PER_S).saturating_add(t.tv_nsec))
}

/// Blocks the calling thread until `CLOCK_MONOTONIC` reads `time`; returns at once where that is past. An absolute sleep:
/// pre-emption between reading the clock and sleeping adds no delay.
pub fn sleep_until(time: Time) {
    let ns = time.ns().max(0);
    let request = Timespec { tv_sec: ns / NS_PER_S, tv_nsec: ns % NS_PER_S };
    while clock_nanosleep_absolute(ClockId::Monotonic, &request) == Err(Errno::INTR) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_advances_and_sleeps_end_no_earlier_than_asked() {
        let due = now().plus_ns(3_000_000);
        sleep_until(due);
        assert!(now() >= due);
        let past = now();
        sleep_until(Time::MIN);
        assert!(now().ns_since(past) < 1_000_000_000);
    }
}
