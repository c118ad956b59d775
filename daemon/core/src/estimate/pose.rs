//! Orientation over time, and where the camera looked at a given instant.

use std::collections::VecDeque;

use glam::{DQuat, DVec3};

use crate::{
    geometry::{Lens, rotation_vector},
    time::{NS_PER_S, Time},
};

/// How far back a pose can be asked for.
const HISTORY_NS: i64 = 2 * NS_PER_S;

/// A prediction older than this is no pose any more: no round is scored and no boat is drawn on it.
pub const STALE_NS: i64 = 100_000_000;

/// One orientation of the inertial unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientationSample {
    /// When it was measured, on the host's clock.
    pub time: Time,
    /// Rotation from the unit's axes to the world's.
    pub world_from_imu: DQuat,
    /// Angular rate with the bias taken off, rad/s, in the unit's axes.
    pub rate: DVec3,
}

/// How an orientation came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Provenance {
    /// A sample at that very time.
    Measured,
    /// Between two samples that lie `gap_ns` apart.
    Interpolated {
        /// Time between the two samples, nanoseconds.
        gap_ns: i64,
    },
    /// Beyond the newest sample, by its rate.
    Predicted {
        /// Time since the newest sample, nanoseconds.
        age_ns: i64,
    },
}

impl Provenance {
    /// Age of the newest measurement used, nanoseconds; negative: that far inside the history.
    pub const fn age_ns(self) -> i64 {
        match self {
            Self::Measured => 0,
            Self::Interpolated { gap_ns } => -gap_ns,
            Self::Predicted { age_ns } => age_ns,
        }
    }
}

/// An orientation with how it came about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientationAt {
    /// Rotation from the unit's axes to the world's.
    pub world_from_imu: DQuat,
    /// How it came about.
    pub provenance: Provenance,
}

/// Why there is no orientation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoPose {
    /// Nothing was measured yet.
    #[error("the inertial unit has not reported an orientation yet")]
    Empty,
    /// The time lies before the kept history.
    #[error("the time lies {ns} ns before the oldest kept orientation")]
    TooOld {
        /// By how much, nanoseconds.
        ns: i64,
    },
    /// The newest measurement is too old.
    #[error("the newest orientation is {age_ns} ns old")]
    Stale {
        /// Its age, nanoseconds.
        age_ns: i64,
    },
}

impl NoPose {
    /// How old the newest orientation is, where it is too old to be used.
    pub const fn age_ns(self) -> i64 {
        match self {
            Self::Stale { age_ns } => age_ns,
            Self::TooOld { ns } => -ns,
            Self::Empty => i64::MAX,
        }
    }
}

/// Orientations of the last seconds, by time.
#[derive(Clone, Debug, Default)]
pub struct PoseHistory {
    /// Each turned back by what the world was turned until it came, so that to turn all of them is to turn one.
    samples: VecDeque<OrientationSample>,
    turned: DQuat,
}

impl PoseHistory {
    /// An empty history.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a sample. One that is not younger than the newest is dropped: the clock map may shift by microseconds, and
    /// time must not run backwards.
    pub fn push(&mut self, sample: OrientationSample) {
        if self.samples.back().is_some_and(|newest| sample.time <= newest.time) {
            return;
        }
        let world_from_imu = self.turned.inverse() * sample.world_from_imu;
        self.samples.push_back(OrientationSample { world_from_imu, ..sample });
        while self.samples.front().is_some_and(|s| sample.time.ns_since(s.time) > HISTORY_NS) {
            self.samples.pop_front();
        }
    }

    /// Forgets everything, as when the unit has restarted.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Turns all of it with the world: what is learnt now of how wrong it is holds for the seconds before, too.
    pub fn turn(&mut self, turn: DQuat) {
        self.turned = (turn * self.turned).normalize();
    }

    /// Time of the newest sample.
    pub fn newest(&self) -> Option<Time> {
        self.samples.back().map(|s| s.time)
    }

    /// The orientation at `time`.
    pub fn at(&self, time: Time) -> Result<OrientationAt, NoPose> {
        let OrientationAt { world_from_imu, provenance } = self.kept_at(time)?;
        Ok(OrientationAt { world_from_imu: (self.turned * world_from_imu).normalize(), provenance })
    }

    /// The turn from half of `span_ns` before `time` to half of it after, radians about the unit's axes at `time`; `None` where one end
    /// is not known.
    pub fn turn_over(&self, time: Time, span_ns: i64) -> Option<DVec3> {
        let end = |ns| self.kept_at(time.plus_ns(ns)).ok().map(|at| at.world_from_imu);
        let (from, to) = (end(-span_ns / 2)?, end(span_ns / 2)?);
        Some(rotation_vector(from.inverse() * to))
    }

    fn kept_at(&self, time: Time) -> Result<OrientationAt, NoPose> {
        let after = self.samples.partition_point(|s| s.time < time);
        match (after.checked_sub(1).and_then(|i| self.samples.get(i)), self.samples.get(after)) {
            (_, Some(b)) if b.time == time => {
                Ok(OrientationAt { world_from_imu: b.world_from_imu, provenance: Provenance::Measured })
            }
            (Some(a), Some(b)) => {
                let gap_ns = b.time.ns_since(a.time);
                let share = time.ns_since(a.time) as f64 / gap_ns as f64;
                let world_from_imu = a.world_from_imu.slerp(b.world_from_imu, share);
                Ok(OrientationAt { world_from_imu, provenance: Provenance::Interpolated { gap_ns } })
            }
            (Some(a), None) => predict(a, time),
            (None, Some(b)) => Err(NoPose::TooOld { ns: b.time.ns_since(time) }),
            (None, None) => Err(NoPose::Empty),
        }
    }
}

fn predict(newest: &OrientationSample, time: Time) -> Result<OrientationAt, NoPose> {
    let age_ns = time.ns_since(newest.time);
    if age_ns > STALE_NS {
        return Err(NoPose::Stale { age_ns });
    }
    let turn = DQuat::from_scaled_axis(newest.rate * (age_ns as f64 * 1e-9));
    let world_from_imu = (newest.world_from_imu * turn).normalize();
    Ok(OrientationAt { world_from_imu, provenance: Provenance::Predicted { age_ns } })
}

/// How far, in pixels, things far away are drawn from where they belong: root mean square over a 5 x 5 grid of the picture.
/// `None` where the poses differ so much that less than half of the grid can be seen by both.
pub fn registration_error_px(lens: &Lens, truth: DQuat, used: DQuat) -> Option<f64> {
    let used_from_truth = used.inverse() * truth;
    let (mut sum, mut count) = (0.0, 0);
    for iy in 0..5 {
        for ix in 0..5 {
            let share = glam::DVec2::new(f64::from(ix), f64::from(iy)) / 4.0;
            let pixel = share * glam::DVec2::new(f64::from(lens.width), f64::from(lens.height));
            if let Some(drawn) = lens.project(used_from_truth * lens.unproject(pixel)) {
                sum += drawn.distance_squared(pixel);
                count += 1;
            }
        }
    }
    (count >= 13).then(|| (sum / f64::from(count)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn turning(rate: f64, n: i64) -> PoseHistory {
        let mut history = PoseHistory::new();
        for i in 0..n {
            let t = i as f64 * 0.005;
            history.push(OrientationSample {
                time: Time::from_ns(i * 5_000_000),
                world_from_imu: DQuat::from_rotation_z(rate * t),
                rate: DVec3::Z * rate,
            });
        }
        history
    }

    #[test]
    fn says_how_the_answer_came_about() {
        let h = turning(1.0, 100);
        assert_eq!(h.at(Time::from_ns(50_000_000)).unwrap().provenance, Provenance::Measured);
        assert_eq!(
            h.at(Time::from_ns(52_000_000)).unwrap().provenance,
            Provenance::Interpolated { gap_ns: 5_000_000 }
        );
        let newest = 99 * 5_000_000;
        assert_eq!(
            h.at(Time::from_ns(newest + 20_000_000)).unwrap().provenance,
            Provenance::Predicted { age_ns: 20_000_000 }
        );
        assert_eq!(h.at(Time::from_ns(newest + STALE_NS + 1)), Err(NoPose::Stale { age_ns: STALE_NS + 1 }));
        assert_eq!(h.at(Time::from_ns(-5)), Err(NoPose::TooOld { ns: 5 }));
        assert_eq!(PoseHistory::new().at(Time::from_ns(0)), Err(NoPose::Empty));
    }

    proptest! {
        #[test]
        fn a_constant_turn_is_answered_exactly(rate in -3.0..3.0f64, ns in 0i64..590_000_000) {
            let h = turning(rate, 100);
            let q = h.at(Time::from_ns(ns)).unwrap().world_from_imu;
            let truth = DQuat::from_rotation_z(rate * ns as f64 * 1e-9);
            prop_assert!(q.angle_between(truth) < 1e-7);
            prop_assert!((q.length() - 1.0).abs() < 1e-12);
        }

        #[test]
        fn a_constant_turn_is_the_same_before_and_after(rate in -3.0..3.0f64, ns in 20_000_000i64..550_000_000) {
            let h = turning(rate, 100);
            let turn = h.turn_over(Time::from_ns(ns), 30_000_000).unwrap();
            prop_assert!((turn - DVec3::Z * rate * 0.03).length() < 1e-9);
            let back = h.turn_over(Time::from_ns(ns), -30_000_000).unwrap();
            prop_assert!((turn + back).length() < 1e-9);
            prop_assert!(h.turn_over(Time::from_ns(ns + 600_000_000), 30_000_000).is_none());
        }

        #[test]
        fn opposite_quaternions_are_the_same_orientation(ns in 0i64..5_000_000) {
            let mut h = PoseHistory::new();
            let q = DQuat::from_rotation_x(1.0);
            for (i, q) in [q, -q].into_iter().enumerate() {
                h.push(OrientationSample { time: Time::from_ns(i as i64 * 5_000_000), world_from_imu: q, rate: DVec3::ZERO });
            }
            prop_assert!(h.at(Time::from_ns(ns)).unwrap().world_from_imu.angle_between(q) < 1e-7);
        }
    }

    #[test]
    fn the_world_turns_with_all_that_was_before() {
        let mut h = turning(1.0, 10);
        let (before, turn) = (h.at(Time::from_ns(22_000_000)).unwrap(), DQuat::from_rotation_x(0.3));
        h.turn(turn);
        let after = h.at(Time::from_ns(22_000_000)).unwrap();
        assert!(after.world_from_imu.angle_between(turn * before.world_from_imu) < 1e-7);
        let new =
            OrientationSample { time: Time::from_ns(50_000_000), world_from_imu: turn, rate: DVec3::ZERO };
        h.push(new);
        assert!(h.at(new.time).unwrap().world_from_imu.angle_between(turn) < 1e-7);
    }

    #[test]
    fn a_small_yaw_error_is_its_focal_length_in_pixels() {
        let lens = Lens::pinhole(1280, 720, 60f64.to_radians());
        let truth = crate::geometry::look(0.3, -0.1, 0.0);
        let used = crate::geometry::look(0.301, -0.1, 0.0);
        let px = registration_error_px(&lens, truth, used).unwrap();
        // 1 mrad at the centre is 1.11 px; towards the edges a pixel covers less angle.
        assert!((1.1..1.4).contains(&px), "{px}");
    }
}
