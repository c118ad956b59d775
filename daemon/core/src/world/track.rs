//! Tracks of boats, rounds and gun over a run, for its debrief.
//!
//! Boats and gun are sampled on a fixed grid of time; a round's path is given once it has ended. Numbers are f32: at 10 km from the gun they are
//! good to a millimetre.

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::{fleet::Fleet, gunnery::FlightState};
use crate::{
    geometry::{CameraPose, RigidPose},
    time::{NS_PER_S, Time},
};

/// Time between samples, nanoseconds. Of a boat at 25 kn in force 4 the cubic through four of them errs by 7 mm at most, a straight line by 15 mm.
pub const TRACK_STEP_NS: i64 = NS_PER_S / 20;
/// Samples lie this far back, nanoseconds: by then rounds that wait for a pose are fired, and late orders to boats are known.
const TRACK_LAG_NS: i64 = 8 * TRACK_STEP_NS;
/// Samples caught up with in one step; a longer gap stays one.
const CATCH_UP_MAX: i64 = 100;
/// Longest time between two points of a round's path, seconds.
const PATH_STEP_S: f64 = 0.1;

/// Place and attitude of a body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackPose {
    /// World, metres: x east, y north, z up.
    pub position: [f32; 3],
    /// Rotation from the body's axes to the world's: x, y, z, w.
    pub attitude: [f32; 4],
}

impl TrackPose {
    fn new(position: DVec3, attitude: DQuat) -> Self {
        Self { position: position.as_vec3().to_array(), attitude: attitude.as_quat().to_array() }
    }
}

impl From<RigidPose> for TrackPose {
    fn from(pose: RigidPose) -> Self {
        Self::new(pose.position, pose.world_from_body)
    }
}

impl From<CameraPose> for TrackPose {
    fn from(pose: CameraPose) -> Self {
        Self::new(pose.position, pose.world_from_camera)
    }
}

/// Boats and gun at one time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackSample {
    /// The time on the session's clock, nanoseconds.
    pub time_ns: i64,
    /// The camera on the gun (x right, y down, z forward); `None` where its pose was not known.
    pub camera: Option<TrackPose>,
    /// The scenario's boats in their order (x forward, y to port, z up); `None` for one that has sunk.
    pub boats: Vec<Option<TrackPose>>,
}

/// A point on a round's path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathPoint {
    /// Seconds since the round was fired.
    pub after_s: f32,
    /// World, metres.
    pub position: [f32; 3],
    /// World, m/s. A round that bounces has two points at that time, with the velocity before and after.
    pub velocity: [f32; 3],
}

/// The path of a round that has ended, from the muzzle to its end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoundPath {
    /// The round's number.
    pub shot: u64,
    /// When it was fired, nanoseconds of the session's clock.
    pub fired_ns: i64,
    /// Points in their order.
    pub points: Vec<PathPoint>,
}

impl RoundPath {
    /// The path of a round that is at the muzzle.
    pub(super) fn begin(shot: u64, fired: Time, muzzle: FlightState) -> Self {
        let mut path = Self { shot, fired_ns: fired.ns(), points: Vec::new() };
        path.push(0.0, muzzle);
        path
    }

    /// Adds where the round is, `after_s` seconds since it was fired, if the newest point is older than the step.
    pub(super) fn follow(&mut self, after_s: f64, state: FlightState) {
        if self.points.last().is_none_or(|last| after_s - f64::from(last.after_s) > PATH_STEP_S - 1e-3) {
            self.push(after_s, state);
        }
    }

    /// Adds where the round is.
    pub(super) fn push(&mut self, after_s: f64, state: FlightState) {
        self.points.push(PathPoint {
            after_s: after_s as f32,
            position: state.position.as_vec3().to_array(),
            velocity: state.velocity.as_vec3().to_array(),
        });
    }
}

/// A stretch of a run's tracks.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrackBlock {
    /// Boats and gun, oldest first.
    pub samples: Vec<TrackSample>,
    /// Rounds that ended meanwhile.
    pub rounds: Vec<RoundPath>,
}

impl TrackBlock {
    /// Tests whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty() && self.rounds.is_empty()
    }

    /// Adds all of `other` behind what this holds.
    pub fn append(&mut self, other: &Self) {
        self.samples.extend_from_slice(&other.samples);
        self.rounds.extend_from_slice(&other.rounds);
    }

    /// Forgets everything and keeps the memory.
    pub fn clear(&mut self) {
        self.samples.clear();
        self.rounds.clear();
    }
}

/// Samples boats on the grid.
#[derive(Clone, Copy, Debug)]
pub(super) struct TrackSampler {
    start: Time,
    /// Number of the next sample.
    next: i64,
}

impl TrackSampler {
    /// A sampler whose first sample is at `start`.
    pub(super) const fn new(start: Time) -> Self {
        Self { start, next: 0 }
    }

    /// Adds the samples that are due where boats were followed up to `now`.
    pub(super) fn sample(&mut self, now: Time, fleet: &Fleet, to: &mut Vec<TrackSample>) {
        self.sample_until(now.plus_ns(-TRACK_LAG_NS), fleet, to);
    }

    /// Adds all samples up to `now`.
    pub(super) fn finish(&mut self, now: Time, fleet: &Fleet, to: &mut Vec<TrackSample>) {
        self.sample_until(now, fleet, to);
    }

    fn sample_until(&mut self, until: Time, fleet: &Fleet, to: &mut Vec<TrackSample>) {
        let last = until.ns_since(self.start).div_euclid(TRACK_STEP_NS);
        self.next = self.next.max(last.saturating_sub(CATCH_UP_MAX - 1));
        while self.next <= last {
            let time = self.start.plus_ns(self.next * TRACK_STEP_NS);
            let pose = |boat| fleet.pose(boat, time).filter(|_| fleet.swims(boat, time)).map(TrackPose::from);
            let boats = (0..fleet.len()).map(pose).collect();
            to.push(TrackSample { time_ns: time.ns(), camera: None, boats });
            self.next += 1;
        }
    }
}

#[cfg(test)]
#[path = "track_tests.rs"]
mod tests;
