//! The horizon in the live picture tells the orientation which way is up.

use glam::DVec3;

use crate::{
    estimate::{
        attitude::{self, Attitude, UpSeen},
        horizon::{HorizonFinder, HorizonView, Mask, Prior, lowered_by_haze},
    },
    event::Picture,
    geometry::Lens,
    time::Time,
};

/// Counts of the horizons of a session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HorizonCounts {
    /// Taken in.
    pub taken: u64,
    /// Not believed.
    pub refused: u64,
    /// Pictures that were looked at and had none.
    pub none: u64,
}

/// Looks for the horizon in pictures, now and then.
#[derive(Debug)]
pub(super) struct HorizonAiding {
    finder: HorizonFinder,
    eye_height_m: f64,
    /// By how much lower than the true horizon the one that is seen stands, radians; absent: none is to be seen.
    lowered: Option<f64>,
    next: Time,
    counts: HorizonCounts,
}

impl HorizonAiding {
    /// One for pictures by that lens, in haze that leaves `visibility_m` metres; `mask` hides the own ship.
    pub(super) fn new(lens: &Lens, eye_height_m: f64, visibility_m: f64, mask: Option<Mask>) -> Self {
        let (next, counts) = (Time::MIN, HorizonCounts::default());
        let lowered = lowered_by_haze(lens, eye_height_m, visibility_m);
        let mut finder = HorizonFinder::new();
        finder.set_mask(mask);
        Self { finder, eye_height_m, lowered, next, counts }
    }

    pub(super) const fn counts(&self) -> HorizonCounts {
        self.counts
    }

    /// Looks at a picture exposed at `time` on the inertial unit's clock, where `attitude` can be corrected at all.
    pub(super) fn look(&mut self, time: Time, picture: &Picture, lens: &Lens, attitude: &mut Attitude) {
        /// A horizon is sought so often: it corrects what drifts in seconds.
        const EVERY_NS: i64 = 100_000_000;
        /// Chi squared with two degrees of freedom that a horizon exceeds once in a thousand: beyond it is a shore, a cloud or a ship's side.
        const NIS_GATE: f64 = 13.8;
        if time < self.next {
            return;
        }
        let Some(lowered) = self.lowered else { return };
        let (Some(covariance), Ok(then)) = (attitude.covariance(), attitude.at(time)) else { return };
        self.next = time.plus_ns(EVERY_NS);
        let world_from_camera = attitude.camera(then.world_from_imu);
        let tilt = covariance.x_axis.x.max(covariance.y_axis.y);
        let prior = Prior {
            up: world_from_camera.inverse() * DVec3::Z,
            sigma: (tilt + attitude::REFRACTION_SIGMA * attitude::REFRACTION_SIGMA).sqrt(),
        };
        let view = HorizonView { lens: *lens, eye_height_m: self.eye_height_m, prior: Some(prior) };
        let Ok(horizon) = self.finder.find(picture, &view) else {
            self.counts.none += 1;
            return;
        };
        // An edge that stands too low tilts up towards where the camera looks.
        let right = DVec3::Z.cross(horizon.up).normalize_or_zero();
        let up_camera = (horizon.up + right.cross(horizon.up) * lowered).normalize_or_zero();
        let seen = UpSeen { time, up_camera, covariance: horizon.up_covariance() };
        match attitude.update_vertical(&seen, NIS_GATE) {
            Some(outcome) if outcome.taken => self.counts.taken += 1,
            _ => self.counts.refused += 1,
        }
    }
}
