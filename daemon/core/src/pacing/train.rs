//! An evenly spaced train of events seen through jitter: a camera's arrivals, a display's vertical blanks.

use crate::time::Time;

/// Share of the error by which phase and period follow: an alpha-beta filter whose phase settles in about ten events.
/// Critically damped: beta = alpha^2 / (2 - alpha) (Kalata, "The tracking index", IEEE Trans. AES-20, 1984).
const ALPHA: f64 = 0.2;
const BETA: f64 = ALPHA * ALPHA / (2.0 - ALPHA);
/// While few events have come, phase and period follow as a straight-line fit would.
const SETTLED: u32 = 10;
/// An event this far off, as a share of the period, is not of the train: missed ones are bridged, more than a few end it.
const STRAY_SHARE: f64 = 0.25;
/// So many stray events in a row and the train begins anew.
const STRAYS_MAX: u32 = 5;
/// Events that may be missing in a row.
const GAP_MAX: f64 = 30.0;

/// Phase and period of a train of events.
#[derive(Clone, Debug, Default)]
pub struct Train {
    last: Option<Time>,
    /// Estimated time of the last event, period and mean jitter, nanoseconds; the time relative to `last`.
    offset_ns: f64,
    period_ns: Option<f64>,
    jitter_ns: f64,
    seen: u32,
    strays: u32,
}

impl Train {
    /// A train of which nothing is known.
    pub fn new() -> Self {
        Self::default()
    }

    /// A train whose period is known beforehand.
    pub fn with_period(period_ns: f64) -> Self {
        Self { period_ns: Some(period_ns), ..Self::default() }
    }

    /// Takes in an event.
    pub fn observe(&mut self, time: Time) {
        let Some(last) = self.last else {
            // A period known beforehand is as good as two events.
            let seen = if self.period_ns.is_some() { 2 } else { 1 };
            *self = Self { last: Some(time), period_ns: self.period_ns, seen, ..Self::default() };
            return;
        };
        let since = time.ns_since(last) as f64 - self.offset_ns;
        if since <= 0.0 {
            return;
        }
        let Some(period) = self.period_ns else {
            *self = Self { last: Some(time), period_ns: Some(since), seen: 2, ..Self::default() };
            return;
        };
        let periods = (since / period).round().max(1.0);
        let error = since - periods * period;
        if periods > GAP_MAX || error.abs() > STRAY_SHARE * period && self.seen >= SETTLED {
            self.stray(time);
            return;
        }
        self.strays = 0;
        self.seen = self.seen.saturating_add(1);
        // A straight-line fit of n points has these gains (Bar-Shalom, Li, Kirubarajan 2001, 6.5).
        let n = f64::from(self.seen.min(SETTLED * 4));
        let alpha = (2.0 * (2.0 * n - 1.0) / (n * (n + 1.0))).max(ALPHA);
        let beta = (6.0 / (n * (n + 1.0))).clamp(BETA, 1.0);
        self.last = Some(time);
        // The estimate lies `error` before the event, less the share by which it follows.
        self.offset_ns = -(1.0 - alpha.min(1.0)) * error;
        self.period_ns = Some((period + beta * error / periods).max(1.0));
        self.jitter_ns += (error.abs() - self.jitter_ns) * 0.05;
    }

    fn stray(&mut self, time: Time) {
        self.strays += 1;
        if self.strays >= STRAYS_MAX {
            *self = Self { last: Some(time), seen: 1, ..Self::default() };
        }
    }

    /// The period, nanoseconds, once two events have come.
    pub fn period_ns(&self) -> Option<f64> {
        self.period_ns.filter(|_| self.seen >= 2)
    }

    /// Mean distance of events from where they were expected, nanoseconds.
    pub const fn jitter_ns(&self) -> f64 {
        self.jitter_ns
    }

    /// When the last event came.
    pub const fn last(&self) -> Option<Time> {
        self.last
    }

    /// When the first event after `time` is expected.
    pub fn next_after(&self, time: Time) -> Option<Time> {
        let (last, period) = (self.last?, self.period_ns?);
        let since = time.ns_since(last) as f64 - self.offset_ns;
        let ahead = (since / period).floor() + 1.0;
        Some(last.plus_ns((self.offset_ns + ahead * period).round() as i64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangular noise, mean 0, within +-`ms`.
    fn noise(i: i64, ms: f64) -> f64 {
        let u = |k: f64| (i as f64 * k).fract() - 0.5;
        (u(0.618_033_988_749_895) + u(0.754_877_666_246_693)) * ms
    }

    #[test]
    fn a_jittering_train_is_followed_to_a_third_of_its_jitter() {
        let mut train = Train::new();
        let period = 33.366_7e6;
        let true_time = |i: i64| (i as f64 * period) as i64;
        for i in 0..2000 {
            train.observe(Time::from_ns(true_time(i)).plus_secs(noise(i, 1.0) * 1e-3));
            if i > 100 {
                let next = train.next_after(Time::from_ns(true_time(i) + 5_000_000)).unwrap();
                assert!((next.ns() - true_time(i + 1)).abs() < 700_000, "{i}");
            }
        }
        assert!((train.period_ns().unwrap() - period).abs() < 40_000.0);
        assert!((100_000.0..500_000.0).contains(&train.jitter_ns()));
    }

    #[test]
    fn missing_events_are_bridged_and_a_new_train_is_taken_up() {
        let mut train = Train::new();
        (0..100).filter(|i| i % 7 != 3).for_each(|i| train.observe(Time::from_ns(i * 40_000_000)));
        assert!((train.period_ns().unwrap() - 40e6).abs() < 1e3);
        let moved = |i: i64| Time::from_ns(4_000_000_000 + 15_000_000 + i * 40_000_000);
        (0..40).for_each(|i| train.observe(moved(i)));
        assert_eq!(train.next_after(moved(39)).map(|t| t.ns_since(moved(40)).abs() < 100_000), Some(true));
        // A pause longer than can be bridged.
        train.observe(Time::from_ns(60_000_000_000));
        (0..10).for_each(|i| train.observe(Time::from_ns(60_000_000_000 + i * 16_666_667)));
        assert!((train.period_ns().unwrap() - 16_666_667.0).abs() < 1e4);
    }
}
