//! How evenly samples arrive.

use std::time::Duration;

use bowwave_core::{event::ImuSample, time::Time};

/// Gaps remembered: 1.3 s at 200 Hz.
const GAPS: usize = 256;
/// Fewer gaps say nothing.
const GAPS_MIN: usize = 40;
/// How much longer than a packet's period the 99th percentile of the gaps may be, where nothing else is asked for.
pub(super) const LATE: Duration = Duration::from_millis(5);
/// How often the gaps are looked at.
const LOOK_NS: i64 = 250_000_000;
/// Looks in a row that must agree before the unit is called late, and before it no longer is.
const LOOKS_BAD: u32 = 2;
const LOOKS_GOOD: u32 = 4;

/// How evenly samples arrive, by the newest 256 arrivals.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ArrivalTiming {
    /// Median of the unit's own period, milliseconds; 0 before enough is known.
    pub period_ms: f64,
    /// 99th percentile of the gaps between arrivals, milliseconds.
    pub gap_p99_ms: f64,
    /// Median of how far the gaps differ from the unit's own, milliseconds.
    pub jitter_p50_ms: f64,
    /// 99th percentile of that.
    pub jitter_p99_ms: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct ArrivalGap {
    /// Between this arrival and the one before, nanoseconds.
    host_ns: i64,
    /// Between the newest samples of both by the unit's clock.
    device_ns: i64,
    /// Samples that arrived together.
    samples: i64,
}

/// Collects arrivals. Samples read together are one arrival.
#[derive(Clone, Debug)]
pub(super) struct Arrivals {
    late_ms: f64,
    gaps: Vec<ArrivalGap>,
    next: usize,
    last: Option<(Time, i64)>,
    /// Of the arrival that is being taken in.
    current: Option<(Time, i64, i64)>,
    looked: Option<Time>,
    timing: ArrivalTiming,
    bad: u32,
    good: u32,
    late: bool,
    lost: u64,
}

impl Default for Arrivals {
    fn default() -> Self {
        Self::late_above(LATE)
    }
}

impl Arrivals {
    /// Nothing has arrived. The unit is late where the 99th percentile of the gaps is longer than its period by more than `late`.
    pub(super) fn late_above(late: Duration) -> Self {
        Self {
            late_ms: late.as_secs_f64() * 1e3,
            gaps: Vec::new(),
            next: 0,
            last: None,
            current: None,
            looked: None,
            timing: ArrivalTiming::default(),
            bad: 0,
            good: 0,
            late: false,
            lost: 0,
        }
    }

    /// A sample in the order of arrival.
    pub(super) fn sample(&mut self, sample: &ImuSample) {
        match &mut self.current {
            Some((arrival, device, samples)) if *arrival == sample.arrival => {
                *device = sample.device_time_ns;
                *samples += 1;
            }
            _ => {
                self.close();
                self.current = Some((sample.arrival, sample.device_time_ns, 1));
            }
        }
    }

    fn close(&mut self) {
        let Some((arrival, device, samples)) = self.current.take() else { return };
        if let Some((last, last_device)) = self.last.replace((arrival, device)) {
            let device_ns = device.saturating_sub(last_device);
            // A unit that began anew: no gap.
            if device_ns > 0 {
                self.push(ArrivalGap { host_ns: arrival.ns_since(last), device_ns, samples });
            }
        }
    }

    fn push(&mut self, gap: ArrivalGap) {
        let period_ns = (self.timing.period_ms * 1e6) as i64;
        if period_ns > 0 {
            // The unit's time may be anything.
            let missing =
                (gap.device_ns.saturating_add(period_ns / 2) / period_ns).saturating_sub(gap.samples);
            self.lost = self.lost.saturating_add(u64::try_from(missing).unwrap_or(0));
        }
        if self.gaps.len() < GAPS {
            self.gaps.push(gap);
        } else if let Some(oldest) = self.gaps.get_mut(self.next) {
            *oldest = gap;
        }
        self.next = (self.next + 1) % GAPS;
    }

    /// The line was interrupted.
    pub(super) fn forget(&mut self) {
        *self = Self { lost: self.lost, late: self.late, late_ms: self.late_ms, ..Self::default() };
    }

    /// To be called now and then. Whether samples arrive late.
    pub(super) fn look(&mut self, now: Time) -> bool {
        if self.looked.is_some_and(|t| now.ns_since(t) < LOOK_NS) {
            return self.late;
        }
        self.looked = Some(now);
        if self.gaps.len() < GAPS_MIN {
            return self.late;
        }
        self.timing = self.measure();
        if self.timing.gap_p99_ms - self.timing.period_ms > self.late_ms {
            (self.bad, self.good) = (self.bad + 1, 0);
            self.late |= self.bad >= LOOKS_BAD;
        } else {
            (self.bad, self.good) = (0, self.good + 1);
            self.late &= self.good < LOOKS_GOOD;
        }
        self.late
    }

    fn measure(&self) -> ArrivalTiming {
        let sorted = |of: &dyn Fn(&ArrivalGap) -> i64| {
            let mut values: Vec<i64> = self.gaps.iter().map(of).collect();
            values.sort_unstable();
            values
        };
        let ms = |values: &[i64], hundredth: usize| {
            let rank = (values.len() * hundredth).div_ceil(100).max(1) - 1;
            values.get(rank).map_or(0.0, |ns| *ns as f64 * 1e-6)
        };
        let jitter = sorted(&|g| g.host_ns.saturating_sub(g.device_ns).saturating_abs());
        ArrivalTiming {
            period_ms: ms(&sorted(&|g| g.device_ns / g.samples.max(1)), 50),
            gap_p99_ms: ms(&sorted(&|g| g.host_ns), 99),
            jitter_p50_ms: ms(&jitter, 50),
            jitter_p99_ms: ms(&jitter, 99),
        }
    }

    /// Result of the last look.
    pub(super) const fn timing(&self) -> ArrivalTiming {
        self.timing
    }

    /// Samples that the unit's clock shows to be missing.
    pub(super) const fn lost(&self) -> u64 {
        self.lost
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    const MS: i64 = 1_000_000;

    fn sample(arrival_ns: i64, n: i64) -> ImuSample {
        ImuSample {
            arrival: Time::from_ns(arrival_ns),
            device_time_ns: n * 5 * MS,
            rate: DVec3::ZERO,
            accel: DVec3::ZERO,
            world_from_imu: None,
        }
    }

    /// Samples `from` to `to` at 200 Hz, each seen at the end of the `batch_ms` it falls in.
    fn feed(arrivals: &mut Arrivals, samples: std::ops::Range<i64>, batch_ms: i64) -> bool {
        let mut late = false;
        for n in samples {
            let arrival_ns = (n * 5 + batch_ms - 1) / batch_ms * batch_ms * MS;
            arrivals.sample(&sample(arrival_ns, n));
            late = arrivals.look(Time::from_ns(arrival_ns));
        }
        late
    }

    #[test]
    fn batches_of_16_ms_are_late_and_single_packets_are_not() {
        let mut arrivals = Arrivals::default();
        assert!(!feed(&mut arrivals, 0..400, 5));
        let t = arrivals.timing();
        assert_eq!((t.period_ms, t.gap_p99_ms, t.jitter_p99_ms), (5.0, 5.0, 0.0));
        assert!(feed(&mut arrivals, 400..800, 16));
        assert!(arrivals.timing().gap_p99_ms >= 16.0 && arrivals.timing().period_ms <= 5.4);
        assert!(!feed(&mut arrivals, 800..1600, 5), "good again");
        assert_eq!(arrivals.lost(), 0);
    }

    #[test]
    fn a_hiccup_of_the_host_is_no_lateness() {
        let mut arrivals = Arrivals::default();
        for n in 0..1000 {
            let hiccup = if n % 200 == 0 { 30 } else { 0 };
            arrivals.sample(&sample((n * 5 + hiccup.min(4)) * MS, n));
            assert!(!arrivals.look(Time::from_ns(n * 5 * MS)));
        }
    }

    #[test]
    fn missing_samples_are_counted() {
        let mut arrivals = Arrivals::default();
        feed(&mut arrivals, 0..200, 5);
        feed(&mut arrivals, 203..300, 5);
        arrivals.sample(&sample(9999 * MS, 300));
        assert_eq!(arrivals.lost(), 3);
    }

    #[test]
    fn a_unit_that_begins_anew_loses_nothing() {
        let mut arrivals = Arrivals::default();
        feed(&mut arrivals, 10_000..10_200, 5);
        arrivals.forget();
        feed(&mut arrivals, 0..200, 5);
        assert_eq!(arrivals.lost(), 0);
        assert_eq!(arrivals.timing().period_ms, 5.0);
    }
}
