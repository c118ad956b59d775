//! The time from which the next picture is looked at, for those who look at pictures now and then.

use crate::time::Time;

/// The time from which a picture is looked at; the first one is at once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Schedule {
    next: Time,
}

impl Schedule {
    /// Nothing was looked at yet.
    pub(super) const fn new() -> Self {
        Self { next: Time::MIN }
    }

    /// A picture of `time` is to be looked at.
    pub(super) fn is_due(&self, time: Time) -> bool {
        time >= self.next
    }

    /// The next picture to be looked at is one of `interval_ns` after `time`.
    pub(super) fn put_off(&mut self, time: Time, interval_ns: i64) {
        self.next = time.plus_ns(interval_ns);
    }
}
