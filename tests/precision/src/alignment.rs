//! Many simulated recordings solved, errors held against what the solver says of them.

use bowwave_calibration::{
    alignment::{Alignment, AlignmentError, Options, solve},
    simulated::{Motion, Recipe},
};
use glam::DVec3;
use rayon::prelude::*;

use crate::front::quantile;

/// One simulated recording and what became of it.
#[derive(Clone, Debug)]
pub struct Run {
    /// The truth.
    pub recipe: Recipe,
    /// What was found, or why nothing was.
    pub found: Result<Alignment, AlignmentError>,
}

impl Run {
    /// Simulates and solves.
    pub fn of(recipe: Recipe) -> Self {
        let recording = recipe.record();
        Self { recipe, found: solve(&recording.readings, &recording.orientations, &Options::default()) }
    }

    /// Error of the rotation, a rotation vector in the camera's axes, radians.
    pub fn turn(&self) -> Option<DVec3> {
        let found = self.found.as_ref().ok()?;
        let q = self.recipe.camera_from_imu * found.camera_from_imu.inverse();
        let q = if q.w < 0.0 { -q } else { q };
        // Twice the vector part: exact to the third power of small angles.
        Some(DVec3::new(q.x, q.y, q.z) * 2.0)
    }

    /// Length of the rotation's error, milliradians; NaN where there is no result.
    pub fn mrad(&self) -> f64 {
        self.turn().map_or(f64::NAN, |t| t.length() * 1e3)
    }

    /// Error of the offset, milliseconds; NaN where there is no result.
    pub fn ms(&self) -> f64 {
        self.found.as_ref().map_or(f64::NAN, |a| (a.offset_s - self.recipe.offset_s).abs() * 1e3)
    }

    /// Length of the bias's error, degrees a second; NaN where there is no result.
    pub fn bias_deg_per_s(&self) -> f64 {
        let off = |a: &Alignment| (a.gyro_bias - self.recipe.gyro_bias).length().to_degrees();
        self.found.as_ref().map_or(f64::NAN, off)
    }

    /// Whether rotation, offset and bias lie within three stated standard deviations: the rotation by the ellipsoid that holds
    /// 99.73 % too, the bias about each axis.
    pub fn within(&self) -> Option<[bool; 3]> {
        // Chi-squared with three degrees of freedom.
        const THREE_SIGMA: f64 = 14.16;
        let (found, turn) = (self.found.as_ref().ok()?, self.turn()?);
        let bias = (found.gyro_bias - self.recipe.gyro_bias) / found.gyro_bias_sigma;
        Some([
            turn.dot(found.rotation_covariance.inverse() * turn) <= THREE_SIGMA,
            (found.offset_s - self.recipe.offset_s).abs() <= 3.0 * found.offset_sigma_s,
            bias.abs().max_element() <= 3.0,
        ])
    }
}

/// Motions and noises (degrees of orientation, seconds of stamp jitter) that the goals are stated for.
pub const SERIES: [(&str, Motion, f64, f64); 8] = [
    ("by hand, 0.02 deg", Motion::ByHand, 0.02, 0.0),
    ("by hand, 0.1 deg, 2 ms", Motion::ByHand, 0.1, 2e-3),
    ("traverse and elevation, 0.02 deg", Motion::TraverseAndElevation, 0.02, 0.0),
    ("traverse and elevation, 0.1 deg, 2 ms", Motion::TraverseAndElevation, 0.1, 2e-3),
    ("slow on the mount, 0.1 deg, 2 ms", Motion::SlowMount, 0.1, 2e-3),
    ("traverse at sea, 0.1 deg, 2 ms", Motion::AtSea, 0.1, 2e-3),
    ("traverse only, 0.1 deg, 2 ms", Motion::TraverseOnly, 0.1, 2e-3),
    ("at rest, 0.1 deg, 2 ms", Motion::Rest, 0.1, 2e-3),
];

/// Solves seeds `first..first + runs` of one of the series, on all processors.
pub fn series(motion: Motion, degrees: f64, jitter_s: f64, first: u64, runs: u64) -> Vec<Run> {
    let recipe = |seed| Recipe::minute(motion, degrees.to_radians(), jitter_s, seed);
    (first..first + runs).into_par_iter().map(|seed| Run::of(recipe(seed))).collect()
}

/// A value below which that share of all numbers lies; NaN of none.
pub fn percentile(values: impl IntoIterator<Item = f64>, share: f64) -> f64 {
    let known: Vec<f64> = values.into_iter().filter(|v| !v.is_nan()).collect();
    quantile(&known, share)
}
