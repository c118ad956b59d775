//! Maps the inertial unit's clock to the host's.
//!
//! Packets arrive late by a random, never negative delay, so the true line lies below all points (device time, arrival).
//! The lower convex hull of those points, taken at the edge under their middle, finds it: Zhang, Liu & Xia, "Clock
//! synchronization algorithms for network measurements", INFOCOM 2002. The least delay stays in the result; the calibrated
//! time offset absorbs it.
//!
//! A clock that speeds up pulls the line down at once. One that slows down leaves it standing as the bound that it is, for as long as the
//! middle lies before the change (5.8 ms after 29 s of 200 ppm); when not even the quickest arrivals come down to it (`floor`), the middle
//! is taken of the newest points alone.

mod floor;

use std::collections::VecDeque;

use floor::Floor;

use crate::time::{NS_PER_S, Time};

/// A hull is used for this long before the younger one takes over.
const WINDOW_NS: i64 = 60 * NS_PER_S;

/// The slope is fitted only once the points span this long; before, only the offset is.
const SLOPE_AFTER_NS: i64 = 5 * NS_PER_S;

/// Crystal clocks do not differ by more than 500 ppm, and a timer's beat tilts an edge by some more; a line that is steeper is an outlier.
const SLOPE_MAX: f64 = 600e-6;

/// A device time that disagrees with the map by more than this is a restart of the device, not a delay.
const RESTART_NS: i64 = 2 * NS_PER_S;

/// Mapped times are kept this far apart, to tell later how they jittered...
const KEEP_NS: i64 = NS_PER_S / 4;

/// ...and so many of them: a window's.
const KEPT: usize = 240;

/// Fewer tell nothing.
const KEPT_MIN: usize = 8;

/// A device's clock drifts by more than crystals do, parts per million.
pub const DRIFT_MUCH_PPM: f64 = 200.0;

/// Mapped times jitter by more than a picture can bear (1 ms at 40 deg/s is 1.3 pixels), seconds, one standard deviation.
pub const JITTER_MUCH_S: f64 = 0.5e-3;

/// How a device's clock does, by the last minute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockReport {
    /// How much faster than the host's it runs, parts per million.
    pub drift_ppm: f64,
    /// Standard deviation of that: half of what the hull's neighbouring edges differ by, which bracket the true slope, and what jitter makes
    /// of the line's ends.
    pub drift_sigma_ppm: f64,
    /// By how much mapped times differ from the line that is known by now, seconds, one standard deviation.
    pub jitter_s: f64,
    /// The most of that, seconds.
    pub jitter_max_s: f64,
    /// By how much arrivals do, for comparison: one standard deviation, seconds.
    pub arrival_jitter_s: f64,
    /// How often the clock started anew.
    pub restarts: u32,
}

impl ClockReport {
    /// Whether maintainers should look at it.
    pub fn is_bad(&self) -> bool {
        self.drift_ppm.abs().max(self.drift_sigma_ppm) > DRIFT_MUCH_PPM || self.jitter_s > JITTER_MUCH_S
    }
}

/// Lower convex hull of (device time, lag) points; lag is arrival less device time. Both relative to the first point, so
/// that f64 keeps nanoseconds.
#[derive(Clone, Debug)]
struct ConvexHull {
    device_origin: i64,
    lag_origin: i64,
    points: Vec<(f64, f64)>,
    /// The line is taken under the middle between here and the last point.
    begin_x: f64,
    last_x: f64,
}

impl ConvexHull {
    fn new(device_ns: i64, lag_ns: i64) -> Self {
        Self {
            device_origin: device_ns,
            lag_origin: lag_ns,
            points: vec![(0.0, 0.0)],
            begin_x: 0.0,
            last_x: 0.0,
        }
    }

    fn span_ns(&self) -> i64 {
        self.last_x as i64
    }

    fn push(&mut self, device_ns: i64, lag_ns: i64) {
        let since = |ns: i64, origin: i64| ns.saturating_sub(origin) as f64;
        let p = (since(device_ns, self.device_origin), since(lag_ns, self.lag_origin));
        if p.0 <= self.last_x {
            return;
        }
        self.last_x = p.0;
        while let [.., a, b] = self.points[..] {
            // b stays only where it lies below the line from a to p.
            if (b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0) > 0.0 {
                break;
            }
            self.points.pop();
        }
        self.points.push(p);
    }

    /// The line is that of the points since `device_ns`. Older ones stay: where the newest were only late, the next that is not makes
    /// the old line stand again.
    fn begin_at(&mut self, device_ns: i64) {
        self.begin_x = self.begin_x.max(device_ns.saturating_sub(self.device_origin) as f64);
    }

    /// Slope of the edge that begins at `at`.
    fn slope(&self, at: usize) -> Option<f64> {
        let (a, b) = (self.points.get(at)?, self.points.get(at + 1)?);
        Some((b.1 - a.1) / (b.0 - a.0))
    }

    /// The edge under the middle: where it begins, in `points`, and its slope. Where no clock differs by that much it is the next that
    /// one can, or the last.
    fn edge(&self) -> Option<(usize, f64)> {
        let middle = self.begin_x.midpoint(self.last_x);
        let mut last = None;
        for at in 0..self.points.len().saturating_sub(1) {
            let slope = self.slope(at)?;
            if slope.abs() <= SLOPE_MAX {
                last = Some((at, slope));
                if self.points.get(at + 1)?.0 >= middle {
                    break;
                }
            }
        }
        last
    }

    /// Slope of the line, half of what its neighbours' slopes differ by, and the line's length in seconds.
    fn slope_known(&self) -> Option<(f64, f64, f64)> {
        let (at, slope) = self.edge()?;
        let before = at.checked_sub(1).and_then(|before| self.slope(before));
        let spread = match (before, self.slope(at + 1)) {
            (Some(before), Some(after)) => (after - before) / 2.0,
            (Some(one), None) | (None, Some(one)) => (one - slope).abs(),
            (None, None) => return None,
        };
        let length_s = (self.points.get(at + 1)?.0 - self.points.get(at)?.0) * 1e-9;
        Some((slope, spread, length_s))
    }

    /// Lag at `device_ns` on the line of the hull's edge under the middle.
    fn lag_at(&self, device_ns: i64) -> i64 {
        let x = device_ns.saturating_sub(self.device_origin) as f64;
        let edge = self.edge().filter(|_| self.span_ns() >= SLOPE_AFTER_NS);
        let lag = match edge.and_then(|(at, slope)| Some((self.points.get(at)?, slope))) {
            Some((a, slope)) => a.1 + slope * (x - a.0),
            None => self.points.iter().map(|p| p.1).fold(f64::INFINITY, f64::min),
        };
        self.lag_origin.saturating_add(lag.round() as i64)
    }
}

/// Running map from the device's clock to the host's.
#[derive(Clone, Debug, Default)]
pub struct ClockMap {
    current: Option<ConvexHull>,
    younger: Option<ConvexHull>,
    restarts: u32,
    /// Tells when the line no longer is what arrivals come down to.
    floor: Floor,
    /// Device time and what it was mapped to, of the last packet.
    last: Option<(i64, Time)>,
    /// Device time, mapped lag and the arrival's own, now and then.
    kept: VecDeque<(i64, i64, i64)>,
}

impl ClockMap {
    /// A map that has seen nothing.
    pub fn new() -> Self {
        Self::default()
    }

    /// How often the device's clock was found to have started anew.
    pub const fn restarts(&self) -> u32 {
        self.restarts
    }

    /// Takes in one packet and returns when, on the host's clock, its measurement was made: never before that of the packet before, unless
    /// its device time is.
    pub fn observe(&mut self, device_ns: i64, arrival: Time) -> Time {
        let lag = arrival.ns().saturating_sub(device_ns);
        let restarted = self
            .current
            .as_ref()
            .is_some_and(|h| lag.abs_diff(h.lag_at(device_ns)) > RESTART_NS.unsigned_abs());
        if restarted {
            *self = Self { restarts: self.restarts + 1, ..Self::default() };
        }
        let mapped = self.map(device_ns, lag);
        let time = Time::from_ns(device_ns.saturating_add(mapped));
        let time = match self.last {
            // The line falls when an arrival is earlier than any before, at the start of a burst by many packets' time.
            Some((last_ns, last)) if device_ns >= last_ns => time.max(last),
            _ => time,
        };
        self.last = Some((device_ns, time));
        time
    }

    /// Takes in a point and returns the lag that is taken for the least at its device time.
    fn map(&mut self, device_ns: i64, lag: i64) -> i64 {
        let current = self.current.get_or_insert_with(|| ConvexHull::new(device_ns, lag));
        current.push(device_ns, lag);
        let mut mapped = current.lag_at(device_ns);
        if current.span_ns() < SLOPE_AFTER_NS {
            return mapped;
        }
        let mut aged = false;
        if current.span_ns() >= WINDOW_NS / 2 {
            let younger = self.younger.get_or_insert_with(|| ConvexHull::new(device_ns, lag));
            younger.push(device_ns, lag);
            aged = younger.span_ns() >= WINDOW_NS / 2;
        }
        let left = self.floor.observe(device_ns, lag.saturating_sub(mapped));
        if let Some(begin_ns) = left {
            for hull in self.current.iter_mut().chain(&mut self.younger) {
                hull.begin_at(begin_ns);
            }
            // By a line of the new rate these were never mapped.
            self.kept.retain(|kept| kept.0 >= begin_ns);
        }
        if aged {
            self.current = self.younger.take();
        }
        if let Some(hull) = self.current.as_ref().filter(|_| aged || left.is_some()) {
            let before = std::mem::replace(&mut mapped, hull.lag_at(device_ns));
            self.floor.raise(mapped.saturating_sub(before));
        }
        if self.kept.back().is_none_or(|(last, ..)| device_ns.saturating_sub(*last) >= KEEP_NS) {
            self.kept.push_back((device_ns, mapped, lag));
            if self.kept.len() > KEPT {
                self.kept.pop_front();
            }
        }
        mapped
    }

    /// How the clock does; `None` before that can be told.
    pub fn report(&self) -> Option<ClockReport> {
        let hull = self.current.as_ref().filter(|_| self.kept.len() >= KEPT_MIN)?;
        let (slope, spread, length_s) = hull.slope_known()?;
        let off = |pick: fn(&(i64, i64, i64)) -> i64| {
            let off =
                move |kept: &(i64, i64, i64)| pick(kept).saturating_sub(hull.lag_at(kept.0)) as f64 * 1e-9;
            let mean = self.kept.iter().map(off).sum::<f64>() / self.kept.len() as f64;
            let square = self.kept.iter().map(|k| (off(k) - mean).powi(2)).sum::<f64>();
            let most = self.kept.iter().map(|k| (off(k) - mean).abs()).fold(0.0, f64::max);
            ((square / self.kept.len() as f64).sqrt(), most)
        };
        let (jitter_s, jitter_max_s) = off(|kept| kept.1);
        let (arrival_jitter_s, _) = off(|kept| kept.2);
        Some(ClockReport {
            // A device whose clock is fast gets less late by its own time.
            drift_ppm: -slope * 1e6,
            // Where neighbours agree by chance, its ends are still no better than what was mapped.
            drift_sigma_ppm: spread.hypot(2.0 * jitter_s / length_s) * 1e6,
            jitter_s,
            jitter_max_s,
            arrival_jitter_s,
            restarts: self.restarts,
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Arrival times of a 200 Hz device whose clock runs `ppm` fast, with one-sided delays from a fixed sequence.
    fn worst_error_ms(ppm: f64, seconds: i64, settle_s: i64, delay_ms: impl Fn(i64) -> f64) -> f64 {
        let mut map = ClockMap::new();
        let mut worst: f64 = 0.0;
        for i in 0..seconds * 200 {
            let host = 1_000_000_000_000 + i * 5_000_000;
            let device = 77 + ((i * 5_000_000) as f64 * (1.0 + ppm * 1e-6)) as i64;
            let arrival = Time::from_ns(host).plus_secs(delay_ms(i) * 1e-3);
            let mapped = map.observe(device, arrival);
            if i > settle_s * 200 {
                worst = worst.max((mapped.ns() - host).abs() as f64 * 1e-6);
            }
        }
        worst
    }

    fn noise(i: i64) -> f64 {
        // Weyl sequence: even, repeatable, no structure that favours the hull.
        let u = (i as f64 * 0.618_033_988_749_895).fract();
        0.05 - (1.0 - u * 0.999).ln() * 0.8
    }

    #[test]
    fn drift_and_exponential_delay() {
        for ppm in [-100.0, 0.0, 35.0, 100.0] {
            let worst = worst_error_ms(ppm, 600, 10, noise);
            assert!(worst < 0.12, "{ppm} ppm: {worst} ms");
        }
    }

    #[test]
    fn a_burst_of_late_packets_does_not_pull_the_map() {
        let worst = worst_error_ms(35.0, 120, 20, |i| if i % 2000 < 16 { 80.0 } else { noise(i) });
        assert!(worst < 0.15, "{worst} ms");
    }

    /// Errors in milliseconds, from ten seconds on, of a 200 Hz device whose clock runs fast by `ppm` of the second; the change is at 60 s.
    fn errors_ms(ppm: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut map = ClockMap::new();
        let mut ahead_ns = 0.0;
        let error = |i: i64| {
            let host = i * 5_000_000;
            let device = host + ahead_ns as i64;
            ahead_ns += 5.0 * ppm(host as f64 * 1e-9);
            (map.observe(device, Time::from_ns(host).plus_secs(noise(i) * 1e-3)).ns() - host) as f64 * 1e-6
        };
        (0..180 * 200).map(error).skip(2000).collect()
    }

    fn worst(errors: &[f64]) -> f64 {
        errors.iter().fold(0.0, |worst, e| worst.max(e.abs()))
    }

    #[test]
    fn a_rate_that_changes_at_once_is_followed_either_way() {
        for (from, to) in [(100.0, -100.0), (-100.0, 100.0), (20.0, -20.0)] {
            let errors = errors_ms(|s| if s < 60.0 { from } else { to });
            let (ever, later) = (worst(&errors), worst(&errors[55 * 200..]));
            assert!(ever < 0.5 && later < 0.15, "{from} to {to} ppm: {ever} ms, after 5 s {later}");
        }
    }

    #[test]
    fn a_rate_that_changes_with_the_temperature_is_followed_either_way() {
        for (from, to) in [(100.0, -100.0), (-100.0, 100.0)] {
            let ever = worst(&errors_ms(|s| to + (from - to) * (-(s - 60.0).max(0.0) / 25.0).exp()));
            assert!(ever < 0.2, "{from} to {to} ppm: {ever} ms");
        }
    }

    proptest! {
        #[test]
        fn mapped_times_never_run_backwards(
            steps in prop::collection::vec((1_i64..20_000_000, 0_i64..100_000_000), 100..3000),
            ppm in -500_i64..500,
            slower in 0_i64..500,
        ) {
            let mut map = ClockMap::new();
            let (mut device, mut host, mut last) = (0, 0, Time::MIN);
            let half = steps.len() / 2;
            for (i, (step, delay)) in steps.into_iter().enumerate() {
                host += step;
                device += step + step * (if i < half { ppm } else { ppm - slower }) / 1_000_000;
                let time = map.observe(device, Time::from_ns(host + delay));
                prop_assert!(time >= last, "{last} then {time}");
                prop_assert!(time.ns_since(last) >= 0 && (time.ns() - host).abs() < RESTART_NS);
                last = time;
            }
            prop_assert_eq!(map.restarts(), 0);
        }

        #[test]
        fn any_times_are_survived(times in prop::collection::vec((any::<i64>(), any::<i64>()), 1..200)) {
            let mut map = ClockMap::new();
            for (device, arrival) in times {
                map.observe(device, Time::from_ns(arrival));
                map.report();
            }
        }
    }

    /// A map after `seconds` of a 200 Hz device whose clock runs `ppm` fast.
    fn mapped(ppm: f64, seconds: i64, delay_ms: impl Fn(i64) -> f64) -> ClockMap {
        let mut map = ClockMap::new();
        for i in 0..seconds * 200 {
            let host = 1_000_000_000_000 + i * 5_000_000;
            let device = 77 + ((i * 5_000_000) as f64 * (1.0 + ppm * 1e-6)) as i64;
            map.observe(device, Time::from_ns(host).plus_secs(delay_ms(i) * 1e-3));
        }
        map
    }

    #[test]
    fn drift_and_jitter_are_told_as_they_are() {
        for ppm in [-300.0, -35.0, 0.0, 100.0, 450.0] {
            let report = mapped(ppm, 90, noise).report().expect("told");
            let off = report.drift_ppm - ppm;
            assert!(off.abs() < 0.5 && off.abs() <= 4.0 * report.drift_sigma_ppm, "{ppm}: {report:?}");
            assert!(report.drift_sigma_ppm < 2.0, "{ppm}: {report:?}");
            assert!(report.jitter_s < 3e-5 && report.jitter_max_s < 1e-4, "{report:?}");
            // Exponential delays scatter by their mean.
            assert!((0.6e-3..1.0e-3).contains(&report.arrival_jitter_s), "{report:?}");
            assert_eq!(report.is_bad(), ppm.abs() > DRIFT_MUCH_PPM);
        }
    }

    /// Arrivals that stand still for seconds and a slope that is thrown about by it: mapped times are shaken, too.
    #[test]
    fn a_line_that_shakes_is_bad() {
        let report = mapped(0.0, 60, |i| 200.0 * ((i / 200) % 9) as f64 / 9.0).report().expect("told");
        assert!(report.is_bad() && report.jitter_max_s >= report.jitter_s, "{report:?}");
    }

    #[test]
    fn a_clock_that_starts_anew_is_reported_anew() {
        let mut map = mapped(100.0, 30, noise);
        assert!(map.report().is_some());
        let later = |i: i64| Time::from_ns(1_050_000_000_000 + i * 5_000_000);
        map.observe(0, later(0));
        assert!(map.report().is_none(), "nothing is known of it yet");
        for i in 1..4000 {
            map.observe(((i * 5_000_000) as f64 * (1.0 - 50e-6)) as i64, later(i).plus_secs(noise(i) * 1e-3));
        }
        let report = map.report().expect("told");
        // Twenty seconds tell it to some ppm.
        let off = (report.drift_ppm + 50.0).abs();
        assert!(off < 5.0 && off < 3.0 * report.drift_sigma_ppm && report.restarts == 1, "{report:?}");
    }

    #[test]
    fn a_restarted_device_is_followed_at_once() {
        let mut map = ClockMap::new();
        for i in 0..1000 {
            map.observe(i * 5_000_000, Time::from_ns(i * 5_000_000 + 300_000));
        }
        let t = map.observe(0, Time::from_ns(9_000_000_000));
        assert_eq!(t.ns(), 9_000_000_000);
        assert_eq!(map.restarts(), 1);
    }
}
