//! A clock for units that have none: it counts their packets and lets arrivals tell how fast they come.

use bowwave_core::time::Time;

/// Periods of units whose own is not known, nanoseconds.
const PERIODS_NS: (f64, f64) = (0.4e6, 250e6);
/// How far a period may leave the known one: resonators of such units are a few percent off.
const PULL: f64 = 0.1;
/// Time constant of the loop, nanoseconds: jitter of arrivals of 5 ms at 100 Hz becomes 0.4 ms.
const TAU_NS: f64 = 2e9;
/// Beyond this distance from the arrival (or eight periods) packets were lost or the counter jumped, nanoseconds.
const ASTRAY_NS: f64 = 250e6;

/// A line through the arrivals over the count of packets. At first it is the one of least squares through all of them
/// (the expanding-memory filter of Morrison, Introduction to Sequential Smoothing and Prediction, 1969), later one that
/// forgets with [`TAU_NS`], critically damped. Its time is that of the unit's own beat, on a scale that runs as the host's,
/// from 0 at the first packet. It never runs backward, and follows arrivals over gaps: a unit without a clock cannot tell
/// that it began anew.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PacketClock {
    /// Between these the period may be, nanoseconds.
    range_ns: (f64, f64),
    origin: Option<Time>,
    time_ns: f64,
    period_ns: f64,
    packets: u32,
}

impl PacketClock {
    /// A clock whose packets come every `nominal_ns`; `None`: that is to be found out.
    pub(crate) fn new(nominal_ns: Option<u32>) -> Self {
        let range = |ns| (f64::from(ns) * (1.0 - PULL), f64::from(ns) * (1.0 + PULL));
        Self {
            range_ns: nominal_ns.map_or(PERIODS_NS, range),
            origin: None,
            time_ns: 0.0,
            period_ns: nominal_ns.map_or(PERIODS_NS.0, f64::from),
            packets: 0,
        }
    }

    /// The time of a packet that arrived at `arrival`, `ticks` packets after the last one (1 where nothing is lost),
    /// nanoseconds since the first.
    pub(crate) fn tick(&mut self, ticks: i64, arrival: Time) -> i64 {
        let Some(origin) = self.origin else {
            self.origin = Some(arrival);
            return 0;
        };
        self.packets = self.packets.saturating_add(1);
        self.follow(arrival.ns_since(origin) as f64, ticks.max(1) as f64);
        self.time_ns as i64
    }

    fn follow(&mut self, arrived_ns: f64, ticks: f64) {
        let error_ns = arrived_ns - self.time_ns - ticks * self.period_ns;
        if error_ns.abs() > ASTRAY_NS.max(8.0 * self.period_ns) {
            self.time_ns = arrived_ns.max(self.time_ns + self.period_ns / 4.0);
            return;
        }
        let n = f64::from(self.packets);
        let steady = (self.period_ns / TAU_NS).min(0.5);
        let gain = (2.0 * (2.0 * n + 1.0) / ((n + 1.0) * (n + 2.0))).max(steady);
        let gain_period = (6.0 / ((n + 1.0) * (n + 2.0))).max(steady * steady / 4.0);
        let step_ns = ticks * self.period_ns + gain * error_ns;
        self.time_ns += step_ns.max(self.period_ns / 4.0);
        let (least, most) = self.range_ns;
        self.period_ns = (self.period_ns + gain_period * error_ns / ticks).clamp(least, most);
    }
}

#[cfg(test)]
mod tests {
    use bowwave_core::estimate::clock::ClockMap;

    use super::*;

    const MS: i64 = 1_000_000;

    /// Largest error of the mapped time after `settle` packets, milliseconds, its mean taken off, of a unit whose period is
    /// `period_ns`, read in batches of `batch_ns`.
    fn worst_ms(clock: &mut PacketClock, period_ns: i64, batch_ns: i64, packets: i64, settle: i64) -> f64 {
        let mut map = ClockMap::new();
        let mut errors = Vec::new();
        for n in 0..packets {
            let truth = n * period_ns;
            let arrival = (truth + batch_ns - 1) / batch_ns * batch_ns;
            let mapped = map.observe(clock.tick(1, Time::from_ns(arrival)), Time::from_ns(arrival));
            if n >= settle {
                errors.push((mapped.ns() - truth) as f64 * 1e-6);
            }
        }
        assert_eq!(map.restarts(), 0);
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        errors.iter().map(|e| (e - mean).abs()).fold(0.0, f64::max)
    }

    /// A resonator that is 3 % off, behind an adapter that hands bytes on every 16 ms: the clock's map alone would take the
    /// slope for an outlier and drift by 30 ms a second.
    #[test]
    fn a_unit_far_from_its_nominal_rate_is_followed() {
        let mut clock = PacketClock::new(Some(10 * MS as u32));
        let worst = worst_ms(&mut clock, 10_300_000, 16 * MS, 20_000, 100);
        assert!(worst < 3.0, "{worst} ms");
        let mut even = PacketClock::new(Some(10 * MS as u32));
        let worst = worst_ms(&mut even, 10 * MS, MS, 20_000, 1_000);
        assert!(worst < 0.2, "{worst} ms");
    }

    #[test]
    fn an_unknown_rate_is_learned() {
        for period_ns in [1_000_000, 2_500_000, 25_000_000, 100_000_000] {
            let mut clock = PacketClock::new(None);
            let worst = worst_ms(&mut clock, period_ns, MS, 10_000, 1_000);
            assert!(worst < 1.0, "{worst} ms at {period_ns} ns");
        }
    }

    #[test]
    fn time_goes_on_over_gaps_and_never_back() {
        let mut clock = PacketClock::new(Some(10 * MS as u32));
        let mut last = -1;
        let mut arrival = 0;
        for n in 0..5_000i64 {
            // Bursts of eight, an outage of five seconds, and a counter that jumps.
            arrival += if n == 1_000 {
                5_000 * MS
            } else if n % 8 == 0 {
                80 * MS
            } else {
                0
            };
            let ticks = if n % 700 == 699 { 201 } else { 1 };
            let time = clock.tick(ticks, Time::from_ns(arrival));
            assert!(time > last, "packet {n}: {time} after {last}");
            assert!((time - arrival).abs() < 300 * MS, "packet {n}: {time} at {arrival}");
            last = time;
        }
    }
}
