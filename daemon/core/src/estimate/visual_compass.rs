//! Sky line, coast and clouds in the live picture hold the heading between aids.

use crate::{
    estimate::{
        attitude::{Attitude, HeadingSeen},
        schedule::Schedule,
        skyline::{SkyView, Skyline},
    },
    event::Picture,
    geometry::Lens,
    own_ship::Mask,
    time::Time,
};

/// What is anchored in may turn by so much itself, as clouds do and as a ship with little way on sees it, rad/s. Ten knots abeam of what is
/// 10 km off are six times as much. Where a gyro's bias is known better than this, the sky holds the heading little better than the gyro.
pub const SKY_DRIFT: f64 = 0.005 * std::f64::consts::PI / 180.0;

/// Chi squared with one degree of freedom that a heading exceeds once in a thousand.
const NIS_GATE: f64 = 10.8;

/// So many headings in a row that are not believed mean that it is the anchor that is wrong.
const REFUSED_MAX: u32 = 20;

/// Counts of the headings by the sky of a session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SkylineCounts {
    /// Taken in.
    pub taken: u64,
    /// Not believed.
    pub refused: u64,
    /// Pictures that were looked at and told none.
    pub none: u64,
    /// Pictures that became anchors: after the first one, what was held before was lost.
    pub anchors: u64,
}

/// Looks at the sky in pictures, now and then.
#[derive(Debug)]
pub(super) struct VisualCompass {
    skyline: Skyline,
    eye_height_m: f64,
    time_sigma_s: f64,
    drift: f64,
    /// How well the filter was told that the sky does not turn by itself, rad/s.
    told: f64,
    looks: Schedule,
    refused_in_a_row: u32,
    counts: SkylineCounts,
}

impl VisualCompass {
    /// Pictures' times are known to `time_sigma_s` seconds; the sky may turn by `drift` rad/s; `mask` hides the own ship.
    pub(super) fn new(eye_height_m: f64, time_sigma_s: f64, drift: f64, mask: Option<Mask>) -> Self {
        let mut skyline = Skyline::new();
        skyline.set_mask(mask);
        Self {
            skyline,
            eye_height_m,
            time_sigma_s,
            drift,
            told: 0.0,
            looks: Schedule::new(),
            refused_in_a_row: 0,
            counts: SkylineCounts::default(),
        }
    }

    pub(super) const fn counts(&self) -> SkylineCounts {
        self.counts
    }

    /// What was held is worth nothing any more, as when the unit has restarted.
    pub(super) fn forget(&mut self) {
        self.skyline.forget();
        self.told = 0.0;
    }

    /// The sky is sought in a picture of `time`.
    pub(super) fn is_due(&self, time: Time) -> bool {
        self.looks.is_due(time)
    }

    /// Looks at a picture exposed at `time` on the inertial unit's clock, where `attitude` can be corrected at all.
    pub(super) fn look(&mut self, time: Time, picture: &Picture, lens: &Lens, attitude: &mut Attitude) {
        /// The sky is looked at so often: at 60 deg/s nine tenths of it are still in view.
        const EVERY_NS: i64 = 100_000_000;
        /// By how much the change of the believed orientation since the last look is wrong at rest, about any axis, radians.
        const CHANGE_SIGMA: f64 = 2e-3;
        /// Looks are held against the same patches of the anchor, so that what one errs by the next ones err by, too, seconds: all of them in that
        /// time count as one.
        const LASTING_NS: i64 = 1_000_000_000;
        /// How fast the gun turns is told over so long.
        const TURN_NS: i64 = 20_000_000;
        if !self.is_due(time) {
            return;
        }
        let (Some(_), Ok(then)) = (attitude.covariance(), attitude.at(time)) else { return };
        self.looks.put_off(time, EVERY_NS);
        // A wrong time is a wrong heading while the gun is trained.
        let before = attitude.at(time.plus_ns(-TURN_NS)).map_or(then.world_from_imu, |b| b.world_from_imu);
        let rate = before.angle_between(then.world_from_imu) / (TURN_NS as f64 * 1e-9);
        let late = rate * self.time_sigma_s;
        let view = SkyView {
            lens: *lens,
            eye_height_m: self.eye_height_m,
            world_from_camera: attitude.camera(then.world_from_imu),
            sigma: CHANGE_SIGMA + late,
            drift: self.drift,
        };
        let Ok(yaw) = self.skyline.look(time, picture, &view) else {
            self.counts.none += 1;
            return;
        };
        if yaw.is_anchor() {
            self.counts.anchors += 1;
            self.refused_in_a_row = 0;
            self.told = self.told.max(yaw.drift_sigma);
            attitude.anchor_heading(yaw.drift_sigma);
            return;
        }
        self.tell_drift(yaw.drift_sigma, attitude);
        let alike = LASTING_NS as f64 / EVERY_NS as f64;
        let variance = alike * (yaw.sigma * yaw.sigma + late * late);
        let seen = HeadingSeen { time, off: yaw.off, variance };
        if attitude.update_anchored_heading(&seen, NIS_GATE).is_some_and(|outcome| outcome.taken) {
            self.counts.taken += 1;
            self.refused_in_a_row = 0;
            return;
        }
        self.counts.refused += 1;
        self.refused_in_a_row += 1;
        if self.refused_in_a_row >= REFUSED_MAX {
            self.forget();
        }
    }

    /// Tells the filter what the sky has shown of its own drift beyond what was told before.
    fn tell_drift(&mut self, sigma: f64, attitude: &mut Attitude) {
        /// What the sky shows of its own drift is told where it is so much better known than before: each time costs an update of the filter.
        const TOLD_ANEW: f64 = 0.9;
        let more = sigma.powi(-2) - self.told.powi(-2);
        if sigma < TOLD_ANEW * self.told && attitude.update_anchor_still(1.0 / more) {
            self.told = sigma;
        }
    }
}
