//! Time: nanoseconds of the host's monotonic clock. Nothing in this crate reads a clock.

use std::fmt;

/// An instant on the host's monotonic clock (`CLOCK_MONOTONIC`), in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Time(i64);

/// Nanoseconds in a second.
pub const NS_PER_S: i64 = 1_000_000_000;

impl Time {
    /// The earliest representable instant; older than every event.
    pub const MIN: Self = Self(i64::MIN);

    /// An instant `ns` nanoseconds after the clock's zero.
    pub const fn from_ns(ns: i64) -> Self {
        Self(ns)
    }

    /// Nanoseconds since the clock's zero.
    pub const fn ns(self) -> i64 {
        self.0
    }

    /// Signed seconds from `earlier` to `self`. Exact to the nanosecond for spans below 100 days.
    pub fn secs_since(self, earlier: Self) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 * 1e-9
    }

    /// Signed nanoseconds from `earlier` to `self`.
    pub const fn ns_since(self, earlier: Self) -> i64 {
        self.0.saturating_sub(earlier.0)
    }

    /// Share, 0 to 1, of the way to its input that a first-order low-pass filter goes from `earlier` to `self`, where its time
    /// constant is `constant_s` seconds. 0 where `self` is not later.
    pub fn smoothing_since(self, earlier: Self, constant_s: f64) -> f32 {
        -(-self.secs_since(earlier).max(0.0) / constant_s).exp_m1() as f32
    }

    /// The instant `ns` nanoseconds later (earlier where negative).
    #[must_use]
    pub const fn plus_ns(self, ns: i64) -> Self {
        Self(self.0.saturating_add(ns))
    }

    /// The instant `secs` seconds later, rounded to the nanosecond.
    #[must_use]
    pub fn plus_secs(self, secs: f64) -> Self {
        self.plus_ns(secs_to_ns(secs))
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.6} s", self.0 as f64 * 1e-9)
    }
}

/// Seconds as whole nanoseconds, rounded; out-of-range values saturate and NaN gives 0.
pub fn secs_to_ns(secs: f64) -> i64 {
    (secs * 1e9).round() as i64
}
