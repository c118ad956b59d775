//! True poses of a recording, found by a frame's time in any round of a loop.

use bowwave_core::{geometry::CameraPose, time::Time};

/// A frame's stamp and its truth's are the same number, rounded at most once.
pub(crate) const STAMP_TOLERANCE_NS: i64 = 1_000;

/// The true poses met so far, by the replay's time.
#[derive(Clone, Debug)]
pub(super) struct Truth {
    /// Replay time at which the first round begins.
    origin: Time,
    period_ns: Option<i64>,
    /// By time within the first round.
    poses: Vec<(Time, CameraPose)>,
}

impl Truth {
    pub(super) const fn new(origin: Time, period_ns: Option<i64>) -> Self {
        Self { origin, period_ns, poses: Vec::new() }
    }

    /// Adds a pose of the first round; they come by time.
    pub(super) fn push(&mut self, time: Time, pose: CameraPose) {
        self.poses.push((time, pose));
    }

    pub(super) fn at(&self, time: Time) -> Option<CameraPose> {
        let Some(period) = self.period_ns else { return self.nearest(time) };
        let round = time.ns_since(self.origin).div_euclid(period);
        // Exposures just before the origin or just after the period's end belong to a neighbour round.
        [round, round - 1, round + 1]
            .into_iter()
            .find_map(|round| self.nearest(time.plus_ns(round.saturating_mul(-period))))
    }

    fn nearest(&self, time: Time) -> Option<CameraPose> {
        let after = self.poses.partition_point(|(t, _)| *t < time);
        [after.checked_sub(1), Some(after)]
            .into_iter()
            .flatten()
            .filter_map(|i| self.poses.get(i))
            .map(|(t, pose)| (t.ns_since(time).saturating_abs(), pose))
            .filter(|(distance, _)| *distance <= STAMP_TOLERANCE_NS)
            .min_by_key(|(distance, _)| *distance)
            .map(|(_, pose)| *pose)
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;

    fn pose(n: i64) -> CameraPose {
        CameraPose { world_from_camera: DQuat::IDENTITY, position: DVec3::splat(n as f64) }
    }

    #[test]
    fn a_pose_is_found_in_every_round_and_only_at_its_time() {
        let mut truth = Truth::new(Time::from_ns(1_000_000), Some(100_000_000));
        // The first is from just before the origin, as an exposure of a frame that arrives after it.
        for n in 0..10 {
            truth.push(Time::from_ns(995_000 + n * 10_000_000), pose(n));
        }
        for round in 0..3 {
            for n in 0..10 {
                let time = Time::from_ns(995_000 + n * 10_000_000 + round * 100_000_000);
                assert_eq!(truth.at(time), Some(pose(n)));
                assert_eq!(truth.at(time.plus_ns(900)), Some(pose(n)));
                assert_eq!(truth.at(time.plus_ns(5_000)), None);
            }
        }
    }

    #[test]
    fn a_recording_that_does_not_loop_has_one_round() {
        let mut truth = Truth::new(Time::from_ns(0), None);
        assert_eq!(truth.at(Time::from_ns(0)), None);
        truth.push(Time::from_ns(5), pose(1));
        assert_eq!(truth.at(Time::from_ns(5)), Some(pose(1)));
        assert_eq!(truth.at(Time::from_ns(100_000_005)), None);
        assert_eq!(truth.at(Time::MIN), None);
    }
}
