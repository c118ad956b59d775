//! Records of rounds, which outlive a session.

use glam::DVec3;

use crate::{fault::NotScored, model::Zone, side::Side, time::Time};

/// One virtual round, from trigger to end.
#[derive(Clone, Debug, PartialEq)]
pub struct ShotRecord {
    /// Counts from 1 within a session.
    pub shot: u64,
    /// When the round left the muzzle (the kernel's time of the trigger edge plus the weapon's cycle).
    pub fired: Time,
    /// Muzzle in the world, metres.
    pub muzzle: DVec3,
    /// Unit direction of the barrel in the world at that time, dispersion not included.
    pub bore: DVec3,
    /// Age of the newest pose measurement at that time, nanoseconds; negative where the pose was interpolated.
    pub pose_age_ns: i64,
    /// Its end.
    pub outcome: Outcome,
}

/// Result of a virtual round.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// It struck a boat.
    Hit {
        /// The boat's name in the scenario.
        boat: String,
        /// Whom it belongs to; `None` in records of versions that did not keep it.
        side: Option<Side>,
        /// The part that was struck.
        zone: Zone,
        /// When it struck.
        time: Time,
        /// Distance from the muzzle, metres.
        range_m: f64,
        /// The point in the boat's space, metres.
        point: DVec3,
    },
    /// It struck the sea or flew out of range.
    Miss {
        /// The boat that it came closest to, where there was one.
        boat: Option<String>,
        /// Closest distance to that boat's hull, metres.
        miss_m: f64,
        /// When it was closest.
        time: Time,
        /// Distance of that boat from the muzzle at that time, metres; of the round's end where there was no boat.
        range_m: f64,
    },
    /// Fired while the trainer could not know where the barrel pointed.
    NotScored {
        /// Why, for the sailor.
        cause: NotScored,
    },
}
