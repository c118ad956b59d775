//! The horizon in the live picture tells the orientation which way is up.

use glam::DVec3;

use crate::{
    estimate::{
        attitude::{self, Attitude, UpSeen},
        horizon::{HorizonFinder, HorizonView, NoHorizon, Prior, lowered_by_haze},
        registration::UpSight,
        schedule::Schedule,
    },
    event::Picture,
    geometry::Lens,
    own_ship::Mask,
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
    /// Found although none should be seen in the scenario's visibility; not taken in.
    pub unexpected: u64,
}

/// Looks for the horizon in pictures, now and then.
#[derive(Debug)]
pub(super) struct HorizonAiding {
    finder: HorizonFinder,
    eye_height_m: f64,
    /// By how much lower than the true horizon the one that is seen stands, radians; absent: none is to be seen.
    lowered: Option<f64>,
    looks: Schedule,
    free_looks: Schedule,
    counts: HorizonCounts,
}

impl HorizonAiding {
    /// One for pictures by that lens, in haze that leaves `visibility_m` metres; `mask` hides the own ship.
    pub(super) fn new(lens: &Lens, eye_height_m: f64, visibility_m: f64, mask: Option<Mask>) -> Self {
        let (looks, free_looks) = (Schedule::new(), Schedule::new());
        let lowered = lowered_by_haze(lens, eye_height_m, visibility_m);
        let mut finder = HorizonFinder::new();
        finder.set_mask(mask);
        Self { finder, eye_height_m, lowered, looks, free_looks, counts: HorizonCounts::default() }
    }

    pub(super) const fn counts(&self) -> HorizonCounts {
        self.counts
    }

    /// A horizon is sought in a picture of `time`.
    pub(super) fn is_due(&self, time: Time) -> bool {
        self.looks.is_due(time)
    }

    /// Looks at a picture exposed at `time` on the inertial unit's clock, where `attitude` can be corrected at all. Gives where up was seen,
    /// which is sought without the prediction where there is nothing at it.
    pub(super) fn look(
        &mut self,
        time: Time,
        picture: &Picture,
        lens: &Lens,
        attitude: &mut Attitude,
    ) -> Option<UpSight> {
        /// A horizon is sought so often: it corrects what drifts in seconds.
        const EVERY_NS: i64 = 100_000_000;
        /// Chi squared with two degrees of freedom that a horizon exceeds once in a thousand: beyond it is a shore, a cloud or a ship's side.
        const NIS_GATE: f64 = 13.8;
        /// A horizon that is not where it is predicted is sought in all of the picture so often: that takes twice as long.
        const FREE_EVERY_NS: i64 = 200_000_000;
        /// One that is not to be seen is looked for so often.
        const UNEXPECTED_EVERY_NS: i64 = 2_000_000_000;
        if !self.is_due(time) {
            return None;
        }
        let (Some(covariance), Ok(then)) = (attitude.covariance(), attitude.at(time)) else { return None };
        self.looks.put_off(time, EVERY_NS);
        let world_from_camera = attitude.camera(then.world_from_imu);
        let tilt = covariance.x_axis.x.max(covariance.y_axis.y);
        let prior = Prior {
            up: world_from_camera.inverse() * DVec3::Z,
            sigma: (tilt + attitude::REFRACTION_SIGMA * attitude::REFRACTION_SIGMA).sqrt(),
        };
        let view = HorizonView { lens: *lens, eye_height_m: self.eye_height_m, prior: Some(prior) };
        let Some(lowered) = self.lowered else {
            self.looks.put_off(time, UNEXPECTED_EVERY_NS);
            self.counts.unexpected += u64::from(self.finder.find(picture, &view).is_ok());
            return None;
        };
        let predicted = self.finder.find(picture, &view);
        let is_predicted = predicted.is_ok();
        let found = predicted.or_else(|_| {
            self.counts.none += 1;
            if !self.free_looks.is_due(time) {
                return Err(NoHorizon::Featureless);
            }
            self.free_looks.put_off(time, FREE_EVERY_NS);
            self.finder.find(picture, &HorizonView { prior: None, ..view })
        });
        let horizon = found.ok()?;
        // An edge that stands too low tilts up towards where the camera looks.
        let right = DVec3::Z.cross(horizon.up).normalize_or_zero();
        let up_camera = (horizon.up + right.cross(horizon.up) * lowered).normalize_or_zero();
        let covariance = horizon.up_covariance();
        let seen = UpSight { seen: up_camera, predicted: prior.up, is_predicted };
        if !is_predicted {
            return Some(seen).filter(|seen| !may_be_shore(seen));
        }
        match attitude.update_vertical(&UpSeen { time, up_camera, covariance }, NIS_GATE) {
            Some(outcome) if outcome.taken => self.counts.taken += 1,
            _ => self.counts.refused += 1,
        }
        Some(seen)
    }
}

/// Whether a line that is no horizon may be where the water ends at a shore: that lies lower, and level.
fn may_be_shore(seen: &UpSight) -> bool {
    /// A shore is not nearer than some ten eye heights.
    const LOWER_MOST: f64 = 0.15;
    /// It is as level as this, radians.
    const LEVEL: f64 = 0.03;
    // The turn from the believed vertical to the one that was seen, about the picture's right and about where the camera looks.
    let turn = seen.predicted.cross(seen.seen);
    (0.0..LOWER_MOST).contains(&-turn.x) && turn.z.abs() < LEVEL && seen.predicted.dot(seen.seen) > 0.0
}
