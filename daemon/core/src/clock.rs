//! Maps the inertial unit's clock to the host's.
//!
//! Packets arrive late by a random, never negative delay, so the true line lies below all points (device time, arrival).
//! The lower convex hull of those points, taken at the edge under their middle, finds it: Zhang, Liu & Xia, "Clock
//! synchronization algorithms for network measurements", INFOCOM 2002. The least delay stays in the result; the calibrated
//! time offset absorbs it.

use crate::time::{NS_PER_S, Time};

/// A hull is used for this long before the younger one takes over.
const WINDOW_NS: i64 = 60 * NS_PER_S;

/// The slope is fitted only once the points span this long; before, only the offset is.
const SLOPE_AFTER_NS: i64 = 5 * NS_PER_S;

/// Crystal clocks do not differ by more than this, 500 ppm; a steeper line is an outlier.
const SLOPE_MAX: f64 = 500e-6;

/// A device time that disagrees with the map by more than this is a restart of the device, not a delay.
const RESTART_NS: i64 = 2 * NS_PER_S;

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

    /// Lag at `device_ns` on the line of the hull's edge under the points' mean.
    fn lag_at(&self, device_ns: i64) -> i64 {
        let x = device_ns.saturating_sub(self.device_origin) as f64;
        let lowest = self.points.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
        let lag = if self.span_ns() < SLOPE_AFTER_NS {
            lowest
        } else {
            let mean = self.sum_x / self.count as f64;
            let edge = self.points.windows(2).find(|w| w[1].0 >= mean);
            match edge {
                Some(&[a, b]) => {
                    let slope = (b.1 - a.1) / (b.0 - a.0);
                    if slope.abs() <= SLOPE_MAX { a.1 + slope * (x - a.0) } else { lowest }
                }
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
        let lag = self.current.as_ref().map_or(lag, |h| h.lag_at(device_ns));
        Time::from_ns(device_ns.saturating_add(lag))
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
