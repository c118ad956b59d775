//! Where the barrel points in the camera's picture, from rounds fired at a mark.
//!
//! The gun is aimed at a mark at a known distance and three to five rounds are fired. Each hit, seen in the camera's picture as it was when
//! the round left (as the calibrated lens's direction), is a sample of where the barrel points. Camera and muzzle are apart, so that the
//! direction from the camera to a hit is not that of the barrel: the parallax is taken off by the distance. Rounds fall: the drop is
//! given by the ballistics and taken off too.

use bowwave_core::{calibration::Calibration, geometry::Lens, time::Time};
use glam::{DMat2, DVec2, DVec3};

/// One round fired at the mark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    /// Direction from the camera to the hit, camera's axes at the moment of firing (any length).
    pub hit_in_camera: DVec3,
    /// Distance from the camera to the hit, metres.
    pub range_m: f64,
    /// Fall of the round below the line of the bore at that range, camera's axes, metres (zero where the mark is near).
    pub drop_in_camera_m: DVec3,
}

/// A picture farther from a pull than this shows another aim, seconds.
const APART_MOST_S: f64 = 0.05;
/// How well the mark is found in a picture, pixels.
const MARK_PX: f64 = 0.5;

impl Shot {
    /// The bore aimed at a mark `range_m` away, seen at that pixel: nothing flies.
    pub fn aimed(lens: &Lens, pixel: DVec2, range_m: f64) -> Self {
        Self { hit_in_camera: lens.unproject(pixel), range_m, drop_in_camera_m: DVec3::ZERO }
    }
}

/// How well all directions are known alike: by the lens's focal length, and by the mark's place in a picture. For [`solve`].
pub fn pointing_sigma(calibration: &Calibration, shots: &[Shot]) -> f64 {
    let focal = calibration.lens.focal.y;
    let slope = |s: &Shot| s.hit_in_camera.truncate().length() / s.hit_in_camera.z.max(1e-3);
    let off_axis = shots.iter().map(slope).fold(0.0, f64::max);
    (MARK_PX / focal).hypot(off_axis * calibration.focal_sigma_px / focal)
}

/// A pull of the trigger, with what the picture nearest to it shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pull<T> {
    /// When the round left, by the trigger's calibrated latency.
    pub fired: Time,
    /// Seconds from there to the picture, and what it shows; `None` where no picture is near.
    pub nearest: Option<(f64, T)>,
}

impl<T> Pull<T> {
    /// A pull at the edge's time.
    pub fn new(edge: Time, calibration: &Calibration) -> Self {
        let latency_ns = calibration.trigger.map_or(0, |t| t.latency_ns);
        Self { fired: edge.plus_ns(latency_ns), nearest: None }
    }

    /// Takes over what a picture with that stamp shows, where it is nearer than those before.
    pub fn offer(&mut self, stamp: Time, calibration: &Calibration, shows: impl FnOnce() -> T) {
        let apart = stamp.plus_ns(calibration.time_offset_ns).secs_since(self.fired).abs();
        if apart < self.nearest.as_ref().map_or(APART_MOST_S, |n| n.0) {
            self.nearest = Some((apart, shows()));
        }
    }
}

/// Why there is no boresight.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum BoresightError {
    /// Fewer rounds than tell their scatter.
    #[error("only {count} rounds can be used, at least {least} are needed; fire more at the same mark")]
    TooFew {
        /// Usable rounds.
        count: usize,
        /// The least.
        least: usize,
    },
    /// The rounds scatter too much for a boresight.
    #[error(
        "the rounds scatter by {scatter_mrad:.1} mrad, more than {most_mrad:.0}: fix the mount, check that all hits belong to the mark, fire \
         again"
    )]
    Scattered {
        /// Standard deviation of one round, milliradians.
        scatter_mrad: f64,
        /// The most that is taken.
        most_mrad: f64,
    },
}

/// Where the barrel points.
#[derive(Clone, Debug, PartialEq)]
pub struct Boresight {
    /// Angles right of and below the optical axis, radians: [`bowwave_core::calibration::Calibration::boresight`].
    pub angles: DVec2,
    /// Covariance of their mean, rad^2.
    pub covariance: DMat2,
    /// Standard deviation of one round about each axis, radians, as pooled from both.
    pub scatter: f64,
    /// Each usable round's angles less the mean, radians.
    pub residuals: Vec<DVec2>,
}

impl Boresight {
    /// The larger standard deviation, radians: what the file holds.
    pub fn sigma(&self) -> f64 {
        self.covariance.x_axis.x.max(self.covariance.y_axis.y).max(0.0).sqrt()
    }
}

/// Fewest rounds: two would leave their scatter to chance.
const SHOTS_LEAST: usize = 3;
/// Most scatter of one round, radians.
const SCATTER_MOST: f64 = 0.02;

/// Direction of the bore by one round; `None` where a number is none or the hit lies behind.
fn angles(shot: &Shot, muzzle_in_camera: DVec3) -> Option<DVec2> {
    let hit = shot.hit_in_camera.try_normalize()? * shot.range_m;
    let bore = hit - shot.drop_in_camera_m - muzzle_in_camera;
    let sound = bore.is_finite() && (1.0..1e5).contains(&shot.range_m) && bore.z > 0.1 * bore.length();
    sound.then(|| DVec2::new((bore.x / bore.z).atan(), (bore.y / bore.z).atan()))
}

/// Mean direction of the barrel with its covariance. `muzzle_in_camera` is the muzzle's place (right, down, forward, metres),
/// `pointing_sigma` how well a hit's direction and the aim are known for all rounds alike (lens, pixel of the mark), radians.
///
/// The scatter is pooled over both axes (2 n - 2 degrees of freedom) and widened to what three standard deviations of Student's
/// distribution hold, because a handful of rounds tells little of its own scatter.
///
/// # Errors
/// Where fewer than three rounds can be used or they scatter by more than 20 mrad.
pub fn solve(
    shots: &[Shot],
    muzzle_in_camera: DVec3,
    pointing_sigma: f64,
) -> Result<Boresight, BoresightError> {
    let all: Vec<DVec2> = shots.iter().filter_map(|s| angles(s, muzzle_in_camera)).collect();
    let n = all.len();
    if n < SHOTS_LEAST {
        return Err(BoresightError::TooFew { count: n, least: SHOTS_LEAST });
    }
    let mean = all.iter().sum::<DVec2>() / n as f64;
    let residuals: Vec<DVec2> = all.iter().map(|a| *a - mean).collect();
    let freedom = 2 * n - 2;
    let scatter = (residuals.iter().map(|r| r.length_squared()).sum::<f64>() / freedom as f64).sqrt();
    if scatter > SCATTER_MOST {
        return Err(BoresightError::Scattered { scatter_mrad: scatter * 1e3, most_mrad: SCATTER_MOST * 1e3 });
    }
    let common = if pointing_sigma.is_finite() { pointing_sigma.abs() } else { 0.0 };
    let variance = (student(freedom) * scatter).powi(2) / n as f64 + common * common;
    Ok(Boresight {
        angles: mean,
        covariance: DMat2::from_diagonal(DVec2::splat(variance)),
        scatter,
        residuals,
    })
}

/// A third of the quantile of Student's distribution that leaves 0.27 % outside (0.135 % on either side).
fn student(freedom: usize) -> f64 {
    // For 4, 6, 8 and 10 degrees of freedom: three to six rounds; beyond, Cornish and Fisher's expansion.
    const TABLE: [(usize, f64); 4] = [(4, 6.620), (6, 4.904), (8, 4.277), (10, 3.957)];
    let z: f64 = 3.0;
    let v = freedom as f64;
    let beyond =
        z + (z.powi(3) + z) / (4.0 * v) + (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * v * v);
    TABLE.iter().find(|(f, _)| *f == freedom).map_or(beyond, |(_, q)| *q) / z
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulated::Random;
    use proptest::prelude::*;

    const MUZZLE: DVec3 = DVec3::new(0.25, 0.4, 1.2);

    /// Rounds along a bore from the muzzle to a range, as the camera sees their hits.
    fn fired(truth: DVec2, scatter: f64, count: usize, range_m: f64, random: &mut Random) -> Vec<Shot> {
        (0..count)
            .map(|_| {
                let a = truth + DVec2::new(random.gauss(), random.gauss()) * scatter;
                let drop_in_camera_m = DVec3::new(0.0, 0.3, 0.0);
                let hit = MUZZLE + DVec3::new(a.x.tan(), a.y.tan(), 1.0) * range_m + drop_in_camera_m;
                Shot { hit_in_camera: hit, range_m: hit.length(), drop_in_camera_m }
            })
            .collect()
    }

    #[test]
    fn parallax_and_drop_are_taken_off() {
        let truth = DVec2::new(0.01, -0.004);
        for range in [50.0, 500.0] {
            let found = solve(&fired(truth, 0.0, 3, range, &mut Random::new(1)), MUZZLE, 0.0).unwrap();
            assert!(found.angles.distance(truth) < 1e-12, "{}", found.angles);
            // Without the parallax it would be off by milliradians at 50 m.
            let naive = solve(&fired(truth, 0.0, 3, range, &mut Random::new(1)), DVec3::ZERO, 0.0).unwrap();
            assert!(naive.angles.distance(truth) > 0.3 / range);
        }
    }

    #[test]
    fn three_sigmas_hold_from_three_rounds_on() {
        let truth = DVec2::new(-0.02, 0.03);
        for count in [3, 5] {
            let mut random = Random::new(7);
            let mut outside = 0;
            for _ in 0..4000 {
                let found = solve(&fired(truth, 1e-3, count, 200.0, &mut random), MUZZLE, 0.0).unwrap();
                outside += u32::from((found.angles.x - truth.x).abs() > 3.0 * found.sigma());
            }
            // 0.27 % of 4000 are 11; four standard deviations about that.
            assert!((1..=24).contains(&outside), "{count} rounds: {outside} of 4000");
        }
    }

    #[test]
    fn what_cannot_be_a_boresight_is_refused() {
        let mut random = Random::new(2);
        let two = fired(DVec2::ZERO, 1e-3, 2, 100.0, &mut random);
        assert_eq!(solve(&two, MUZZLE, 0.0), Err(BoresightError::TooFew { count: 2, least: 3 }));
        let wide = fired(DVec2::ZERO, 0.1, 5, 100.0, &mut random);
        assert!(matches!(solve(&wide, MUZZLE, 0.0), Err(BoresightError::Scattered { .. })));
        let mut behind = fired(DVec2::ZERO, 1e-3, 3, 100.0, &mut random);
        behind[0].hit_in_camera = DVec3::NEG_Z;
        behind[1].range_m = f64::NAN;
        assert_eq!(solve(&behind, MUZZLE, 0.0), Err(BoresightError::TooFew { count: 1, least: 3 }));
    }

    proptest! {
        #[test]
        fn nothing_from_outside_panics(v in proptest::array::uniform7(proptest::num::f64::ANY), sigma in proptest::num::f64::ANY) {
            let shot = Shot {
                hit_in_camera: DVec3::new(v[0], v[1], v[2]),
                range_m: v[3],
                drop_in_camera_m: DVec3::new(v[4], v[5], v[6]),
            };
            if let Ok(found) = solve(&[shot; 4], MUZZLE, sigma) {
                prop_assert!(found.angles.is_finite());
            }
        }
    }
}
