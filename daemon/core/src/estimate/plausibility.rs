//! Whether the samples of an inertial unit can be true: the one definition, with one set of limits, for the port that tells of a
//! unit that fails and for the orientation that leaves its samples out.

use std::fmt;

use crate::{event::ImuSample, time::Time};

/// Reasons why samples cannot be true.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Implausible {
    /// Numbers that are none.
    NotFinite,
    /// The fields that the trainer needs are missing.
    Unusable,
    /// The very same numbers again and again.
    Stuck,
    /// The unit's own clock does not advance.
    ClockStopped,
    /// A sensor is at its end stop.
    Saturated {
        /// Which.
        axis: &'static str,
        /// The value that it does not leave, rad/s or m/s^2.
        value: f64,
    },
}

impl fmt::Display for Implausible {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite => f.write_str("it sends numbers that are not finite; power-cycle it"),
            Self::Unusable => f.write_str(
                "its packets lack angular rate or acceleration: switch them on in its output (doctor says what it sends)",
            ),
            Self::Stuck => f.write_str("it repeats the very same numbers; power-cycle it"),
            Self::ClockStopped => f.write_str("its clock does not advance; power-cycle it"),
            Self::Saturated { axis, value } => {
                write!(f, "its {axis} stays at {value:.1}: saturated; look for what shakes it, then power-cycle it")
            }
        }
    }
}

/// Since when something has been as it is.
#[derive(Clone, Copy, Debug)]
struct Standstill {
    value: f64,
    since: Time,
    samples: u32,
}

impl Standstill {
    const fn new(value: f64, since: Time) -> Self {
        Self { value, since, samples: 1 }
    }

    fn take(&mut self, value: f64, now: Time, same: bool) {
        if same {
            self.samples = self.samples.saturating_add(1);
        } else {
            *self = Self::new(value, now);
        }
    }

    fn sure(&self, now: Time) -> bool {
        /// What repeats or stands still for this long does so for good: the noise of any sensor changes its last digits within a few
        /// samples, and the sailor is to be told within 300 ms.
        const SURE_NS: i64 = 250_000_000;
        /// Fewer samples than this say nothing, however long they take: two that are alike on both sides of a gap are no evidence.
        const SAMPLES_MIN: u32 = 5;
        self.samples >= SAMPLES_MIN && now.ns_since(self.since) >= SURE_NS
    }
}

#[derive(Clone, Copy, Debug)]
struct SampleHistory {
    sample: ImuSample,
    same: Standstill,
    clock: Standstill,
    axes: [Standstill; 6],
}

/// Looks at every sample. Time is the samples' arrival.
#[derive(Clone, Copy, Debug, Default)]
pub struct Plausibility {
    seen: Option<SampleHistory>,
    bad_since: Option<(Time, Implausible)>,
}

/// Whether the numbers of a sample are ones that a unit can measure.
pub fn is_possible(sample: &ImuSample) -> bool {
    /// Angular rate beyond which a sample is impossible, rad/s (4000 deg/s: twice what gun-mount units measure).
    const RATE_MAX: f64 = 70.0;
    sample.is_finite() && sample.rate.abs().max_element() <= RATE_MAX
}

const AXES: [&str; 6] = ["rate x", "rate y", "rate z", "acceleration x", "acceleration y", "acceleration z"];

fn axes(sample: &ImuSample) -> [f64; 6] {
    let (r, a) = (sample.rate, sample.accel);
    [r.x, r.y, r.z, a.x, a.y, a.z]
}

impl Plausibility {
    /// A sample whose numbers are finite.
    pub fn sample(&mut self, sample: &ImuSample) {
        /// How still a sensor at its end stop is, although the unit compensates bias and temperature, relative.
        const RAIL_STILL: f64 = 1e-3;
        self.bad_since = None;
        let now = sample.arrival;
        let values = axes(sample);
        let Some(seen) = &mut self.seen else {
            self.seen = Some(SampleHistory {
                sample: *sample,
                same: Standstill::new(0.0, now),
                clock: Standstill::new(0.0, now),
                axes: values.map(|v| Standstill::new(v, now)),
            });
            return;
        };
        let last = std::mem::replace(&mut seen.sample, *sample);
        // Rate and force alone: the attitude may be carried on by rates that are stuck themselves.
        let same = (last.rate, last.accel) == (sample.rate, sample.accel);
        seen.same.take(0.0, now, same);
        seen.clock.take(0.0, now, last.device_time_ns == sample.device_time_ns);
        for (run, value) in seen.axes.iter_mut().zip(values) {
            let still = (value - run.value).abs() <= RAIL_STILL * run.value.abs();
            run.take(value, now, still);
        }
    }

    /// A packet at `now` that gave no sample.
    pub fn bad(&mut self, now: Time, why: Implausible) {
        self.bad_since.get_or_insert((now, why));
    }

    /// The line was interrupted: what was the same before says nothing.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// Whether the newest sample repeats the very same rate and force as for some time before.
    pub fn is_stuck(&self) -> bool {
        self.seen.is_some_and(|seen| seen.same.sure(seen.sample.arrival))
    }

    /// What is wrong, by what came until `now`.
    pub fn verdict(&self, now: Time) -> Option<Implausible> {
        /// No good sample for this long while bad ones come.
        const BAD_NS: i64 = 150_000_000;
        /// Rates beyond this may be a sensor's end stop (the smallest usual range is 250 deg/s), rad/s.
        const RAIL_RATE: f64 = 4.0;
        /// Specific forces beyond this may be a sensor's end stop (the smallest usual range is 2 g), m/s^2.
        const RAIL_ACCEL: f64 = 19.0;
        if let Some((since, why)) = self.bad_since
            && now.ns_since(since) >= BAD_NS
        {
            return Some(why);
        }
        let seen = self.seen?;
        let last = seen.sample.arrival;
        if seen.same.sure(last) {
            return Some(Implausible::Stuck);
        }
        if seen.clock.sure(last) {
            return Some(Implausible::ClockStopped);
        }
        seen.axes.iter().zip(AXES).enumerate().find_map(|(i, (run, axis))| {
            let rail = if i < 3 { RAIL_RATE } else { RAIL_ACCEL };
            (run.value.abs() >= rail && run.sure(last))
                .then_some(Implausible::Saturated { axis, value: run.value })
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    const MS: i64 = 1_000_000;

    fn sample(n: i64, rate: DVec3, accel: DVec3) -> ImuSample {
        ImuSample {
            arrival: Time::from_ns(n * 5 * MS),
            device_time_ns: n * 5 * MS,
            rate,
            accel,
            world_from_imu: None,
        }
    }

    fn noise(n: i64) -> DVec3 {
        DVec3::new((n * 7 % 13) as f64, (n * 5 % 11) as f64, (n * 3 % 7) as f64) * 1e-3
    }

    /// When a verdict comes, in samples of 5 ms, if it does within a second.
    fn verdict_after(samples: impl Fn(i64) -> ImuSample) -> Option<(i64, Implausible)> {
        let mut plausibility = Plausibility::default();
        (0..200).find_map(|n| {
            plausibility.sample(&samples(n));
            plausibility.verdict(Time::from_ns(n * 5 * MS)).map(|v| (n, v))
        })
    }

    #[test]
    fn a_unit_that_lives_is_believed() {
        let up = DVec3::Z * -9.81;
        assert_eq!(verdict_after(|n| sample(n, noise(n), up + noise(n + 3))), None);
        // Two axes that are exactly still say nothing: small numbers may be quantised.
        assert_eq!(verdict_after(|n| sample(n, DVec3::Z * noise(n).x, up)), None);
        // A hard turn whose rate changes.
        assert_eq!(verdict_after(|n| sample(n, DVec3::Z * (5.0 + 0.01 * n as f64), up)), None);
    }

    #[test]
    fn the_same_numbers_again_are_noticed_within_300_ms() {
        let (n, what) = verdict_after(|n| sample(n, noise(1), noise(2))).expect("stuck");
        assert_eq!(what, Implausible::Stuck);
        assert!((50..60).contains(&n), "{n}");
        // An attitude that stuck rates carry on is no sign of life.
        let carried = |n: i64| ImuSample {
            world_from_imu: Some(glam::DQuat::from_rotation_z(0.001 * n as f64)),
            ..sample(n, noise(1), noise(2))
        };
        assert_eq!(verdict_after(carried), Some((n, Implausible::Stuck)));
    }

    #[test]
    fn impossible_numbers_are_known_by_themselves() {
        let good = sample(0, noise(1), noise(2));
        assert!(is_possible(&good));
        for rate in [DVec3::NAN, DVec3::Y * -100.0] {
            assert!(!is_possible(&ImuSample { rate, ..good }));
        }
    }

    #[test]
    fn a_clock_that_stands_is_noticed() {
        let still = |n| ImuSample { device_time_ns: 17, ..sample(n, noise(n), noise(n + 1)) };
        assert_eq!(verdict_after(still).map(|v| v.1), Some(Implausible::ClockStopped));
    }

    #[test]
    fn an_end_stop_is_noticed_and_left_again() {
        let railed = |n: i64| sample(n, noise(n) + DVec3::Y * (34.9 - noise(n).y), noise(n));
        let (n, what) = verdict_after(railed).expect("saturated");
        assert!(matches!(what, Implausible::Saturated { axis: "rate y", .. }), "{what}");
        assert!(n < 60, "{n}");
        let mut plausibility = Plausibility::default();
        (0..100).for_each(|n| plausibility.sample(&railed(n)));
        assert!(plausibility.verdict(Time::from_ns(500 * MS)).is_some());
        plausibility.sample(&sample(100, noise(5), noise(6)));
        assert_eq!(plausibility.verdict(Time::from_ns(505 * MS)), None);
        let shaken = |n: i64| sample(n, noise(n), noise(n) + DVec3::X * (-156.0 + noise(n).x));
        assert!(matches!(
            verdict_after(shaken),
            Some((_, Implausible::Saturated { axis: "acceleration x", .. }))
        ));
    }

    #[test]
    fn one_bad_packet_is_none_and_many_are() {
        let mut plausibility = Plausibility::default();
        let at = |ms: i64| Time::from_ns(ms * MS);
        plausibility.bad(at(0), Implausible::NotFinite);
        assert_eq!(plausibility.verdict(at(100)), None);
        plausibility.sample(&sample(22, noise(1), noise(2)));
        assert_eq!(plausibility.verdict(at(400)), None, "a good one between");
        for ms in (400..600).step_by(5) {
            plausibility.bad(at(ms), Implausible::NotFinite);
        }
        assert_eq!(plausibility.verdict(at(600)), Some(Implausible::NotFinite));
        plausibility.sample(&sample(121, noise(3), noise(4)));
        assert_eq!(plausibility.verdict(at(606)), None);
    }

    #[test]
    fn a_gap_is_no_evidence() {
        let mut plausibility = Plausibility::default();
        (0..10).for_each(|_| plausibility.sample(&sample(0, noise(1), noise(2))));
        plausibility.forget();
        plausibility.sample(&sample(1000, noise(1), noise(2)));
        assert_eq!(plausibility.verdict(Time::from_ns(5000 * MS)), None);
    }
}
