//! The 30 Hz frame clock, with time as an argument.

mod lock;
#[cfg(test)]
mod lock_tests;
mod train;

use crate::time::Time;

pub use lock::{FrameClock, Plan};
pub use train::Train;

/// The trainer's frame rate.
pub const FRAMES_PER_S: i64 = 30;

/// Ticks at a fixed rate from a start; late ticks are counted and never made up for in a burst.
#[derive(Clone, Debug)]
pub struct Pacer {
    start: Time,
    next: i64,
    missed: u64,
}

/// One tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// Counts from 0; jumps where ticks were skipped.
    pub index: i64,
    /// When the frame is begun.
    pub time: Time,
    /// When the frame must be complete: the next tick.
    pub deadline: Time,
}

impl Pacer {
    /// A clock whose tick 0 is at `start`.
    pub fn new(start: Time) -> Self {
        Self { start, next: 0, missed: 0 }
    }

    /// When tick `index` is: exact, without accumulating error.
    pub fn time_of(&self, index: i64) -> Time {
        let ns = i128::from(index) * 1_000_000_000 / i128::from(FRAMES_PER_S);
        self.start.plus_ns(i64::try_from(ns).unwrap_or(i64::MAX))
    }

    /// When the next tick is.
    pub fn next_time(&self) -> Time {
        self.time_of(self.next)
    }

    /// Ticks that were skipped since the start because the caller came too late.
    pub const fn missed(&self) -> u64 {
        self.missed
    }

    /// The tick to draw at `now`; `None` before it is due. A caller that comes a whole period or more late gets the latest
    /// due tick, and those in between count as missed.
    pub fn tick(&mut self, now: Time) -> Option<Tick> {
        if now < self.next_time() {
            return None;
        }
        let elapsed = i128::from(now.ns_since(self.start)) * i128::from(FRAMES_PER_S) / 1_000_000_000;
        let mut index = i64::try_from(elapsed).unwrap_or(i64::MAX - 1).max(self.next);
        // Flooring both ways can land a nanosecond before the tick.
        while self.time_of(index) > now && index > self.next {
            index -= 1;
        }
        self.missed += (index - self.next) as u64;
        self.next = index + 1;
        Some(Tick { index, time: self.time_of(index), deadline: self.time_of(index + 1) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_due_at_their_times_and_do_not_drift() {
        let mut pacer = Pacer::new(Time::from_ns(5));
        for i in 0..100_000 {
            let due = pacer.next_time();
            assert_eq!(due.ns_since(Time::from_ns(5)), i * 1_000_000_000 / 30);
            assert_eq!(pacer.tick(due.plus_ns(-1)), None);
            let tick = pacer.tick(due.plus_ns(i % 33_000_000)).unwrap();
            assert_eq!((tick.index, tick.time), (i, due));
            assert_eq!(tick.deadline, pacer.next_time());
        }
        assert_eq!(pacer.missed(), 0);
    }

    #[test]
    fn a_late_caller_skips_and_is_told() {
        let mut pacer = Pacer::new(Time::from_ns(0));
        pacer.tick(Time::from_ns(0)).unwrap();
        let tick = pacer.tick(Time::from_ns(0).plus_secs(0.105)).unwrap();
        assert_eq!(tick.index, 3);
        assert_eq!(pacer.missed(), 2);
        assert_eq!(pacer.tick(Time::from_ns(0).plus_secs(0.106)), None);
    }
}
