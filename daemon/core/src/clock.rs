//! Maps the inertial unit's clock to the host's.
//!
//! Packets arrive late by a random, never negative delay, so the true line lies below all points (device time, arrival).
//! The lower convex hull of those points, taken at the edge under their middle, finds it: Zhang, Liu & Xia, "Clock
//! synchronization algorithms for network measurements", INFOCOM 2002. The least delay stays in the result; the calibrated
//! time offset absorbs it.

use std::collections::VecDeque;

use crate::time::{NS_PER_S, Time};

/// A hull is used for this long before the younger one takes over.
const WINDOW_NS: i64 = 60 * NS_PER_S;

/// The slope is fitted only once the points span this long; before, only the offset is.
const SLOPE_AFTER_NS: i64 = 5 * NS_PER_S;

/// Crystal clocks do not differ by more than this, 500 ppm; a steeper line is an outlier.
const SLOPE_MAX: f64 = 500e-6;

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
struct Hull {
    device_origin: i64,
    lag_origin: i64,
    points: Vec<(f64, f64)>,
    sum_x: f64,
    count: u64,
    last_x: f64,
}

impl Hull {
    fn new(device_ns: i64, lag_ns: i64) -> Self {
        Self {
            device_origin: device_ns,
            lag_origin: lag_ns,
            points: vec![(0.0, 0.0)],
            sum_x: 0.0,
            count: 1,
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
        self.sum_x += p.0;
        self.count += 1;
        while let [.., a, b] = self.points[..] {
            // b stays only where it lies below the line from a to p.
            if (b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0) > 0.0 {
                break;
            }
            self.points.pop();
        }
        self.points.push(p);
    }

    /// Where the edge under the points' mean begins, in `points`.
    fn edge(&self) -> Option<usize> {
        let mean = self.sum_x / self.count as f64;
        self.points.windows(2).position(|w| w[1].0 >= mean)
    }

    /// Slope of the edge that begins at `at`.
    fn slope(&self, at: usize) -> Option<f64> {
        let (a, b) = (self.points.get(at)?, self.points.get(at + 1)?);
        Some((b.1 - a.1) / (b.0 - a.0))
    }

    /// Slope of the line, half of what its neighbours' slopes differ by, and the line's length in seconds.
    fn slope_known(&self) -> Option<(f64, f64, f64)> {
        let at = self.edge()?;
        let slope = self.slope(at)?;
        let before = at.checked_sub(1).and_then(|before| self.slope(before));
        let spread = match (before, self.slope(at + 1)) {
            (Some(before), Some(after)) => (after - before) / 2.0,
            (Some(one), None) | (None, Some(one)) => (one - slope).abs(),
            (None, None) => return None,
        };
        let length_s = (self.points.get(at + 1)?.0 - self.points.get(at)?.0) * 1e-9;
        Some((slope, spread, length_s))
    }

    /// Lag at `device_ns` on the line of the hull's edge under the points' mean.
    fn lag_at(&self, device_ns: i64) -> i64 {
        let x = device_ns.saturating_sub(self.device_origin) as f64;
        let lowest = self.points.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
        let lag = if self.span_ns() < SLOPE_AFTER_NS {
            lowest
        } else {
            let line = self.edge().and_then(|at| Some((self.points.get(at)?, self.slope(at)?)));
            match line {
                Some((a, slope)) if slope.abs() <= SLOPE_MAX => a.1 + slope * (x - a.0),
                _ => lowest,
            }
        };
        self.lag_origin.saturating_add(lag.round() as i64)
    }
}

/// Running map from the device's clock to the host's.
#[derive(Clone, Debug, Default)]
pub struct ClockMap {
    current: Option<Hull>,
    younger: Option<Hull>,
    restarts: u32,
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

    /// Takes in one packet and returns when, on the host's clock, its measurement was made.
    pub fn observe(&mut self, device_ns: i64, arrival: Time) -> Time {
        let lag = arrival.ns().saturating_sub(device_ns);
        let restarted = self
            .current
            .as_ref()
            .is_some_and(|h| lag.abs_diff(h.lag_at(device_ns)) > RESTART_NS.unsigned_abs());
        if restarted {
            self.restarts += 1;
            self.current = None;
            self.younger = None;
            self.kept.clear();
        }
        let current = self.current.get_or_insert_with(|| Hull::new(device_ns, lag));
        current.push(device_ns, lag);
        if current.span_ns() >= WINDOW_NS / 2 {
            let younger = self.younger.get_or_insert_with(|| Hull::new(device_ns, lag));
            younger.push(device_ns, lag);
            if younger.span_ns() >= WINDOW_NS / 2 {
                self.current = self.younger.take();
            }
        }
        let settled = self.current.as_ref().is_some_and(|h| h.span_ns() >= SLOPE_AFTER_NS);
        let mapped = self.current.as_ref().map_or(lag, |h| h.lag_at(device_ns));
        if settled && self.kept.back().is_none_or(|(last, ..)| device_ns.saturating_sub(*last) >= KEEP_NS) {
            self.kept.push_back((device_ns, mapped, lag));
            if self.kept.len() > KEPT {
                self.kept.pop_front();
            }
        }
        Time::from_ns(device_ns.saturating_add(mapped))
    }

    /// How the clock does; `None` before that can be told.
    pub fn report(&self) -> Option<ClockReport> {
        let hull = self.current.as_ref().filter(|_| self.kept.len() >= KEPT_MIN)?;
        let (slope, spread, length_s) = hull.slope_known()?;
        let off = |pick: fn(&(i64, i64, i64)) -> i64| {
            let off = move |kept: &(i64, i64, i64)| (pick(kept) - hull.lag_at(kept.0)) as f64 * 1e-9;
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
