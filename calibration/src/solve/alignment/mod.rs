//! Rotation and time offset between the camera and the inertial unit, from both looking at the same motion.
//!
//! Nothing but rotation is used: the camera tells its orientation (a target board, far-off points without a target, or only the
//! horizon), the gyro its rate. Unknown are the rotation from the unit to the camera, the offset between both clocks, the gyro's bias, how
//! the target stands, and how large all noises are. No guess is needed:
//!
//! 1. Turns over 0.4 s are compared at every offset within the search range; the rotation comes from singular values (`start`).
//! 2. The gyro is integrated once over the whole recording (`track`) and asked at the camera's shifted stamps, so that the offset
//!    is a continuous unknown.
//! 3. Residuals are weighed by a filter that knows that the gyro drifts and the camera is noisy (`filter`); Levenberg's method
//!    finds the unknowns (`fit`), the likelihood the noises (`noise`). Outliers lose their weight.
//! 4. The covariance, a comparison of the recording's halves and of the gyro's scale say how good it is (`result`); whether camera and gyro
//!    saw the same movement, and what is left of pictures that follow each other, whether that can be believed (`observability`).
//!
//! Literature: Furgale, Rehder & Siegwart 2013 (offset as an unknown of a continuous trajectory); Forster et al. 2017 (pre-integrated
//! gyro and its bias Jacobian); Durbin & Koopman 2012 (the filter). Errors of rotations are rotation vectors in the camera's axes:
//! `true = exp(error) estimate`.

mod compare;
mod deviation;
mod error;
mod filter;
mod fit;
mod input;
mod noise;
mod observability;
mod problem;
mod result;
mod start;
mod track;

pub(crate) use compare::expected_ups;
pub use compare::{Compared, Comparison, LensEvidence, compare};
pub use deviation::{Deviation, Judgement, Parameter};
pub use error::{AlignmentError, Movement};
pub use input::{ImuReading, Increment, LeftOutCounts, Observation, chained};
pub use problem::{BySight, LENS_AND_DIP};
pub use result::{Alignment, AlignmentFinding, Checks, Grade, NoiseFound, Residual};
pub use start::AlignmentStart;

use glam::DVec3;
use problem::AlignmentProblem;

/// Options of the solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Offsets are searched up to this far to either side, seconds.
    pub offset_range_s: f64,
    /// Whether the rolling shutter's read-out time is an unknown too (observations then need their rows).
    pub estimate_readout: bool,
    /// The gyro's limit, rad/s; without it, plateaus tell it.
    pub gyro_range: Option<f64>,
    /// Standard deviation of the error of elevation that all horizons of the recording share, radians: refraction, and the dip of a height
    /// that is not well known.
    pub horizon_sigma: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self { offset_range_s: 0.6, estimate_readout: false, gyro_range: None, horizon_sigma: 0.0 }
    }
}

/// The longest recording that is taken, seconds: the bias counts as constant.
const SPAN_MOST_S: f64 = 1800.0;
/// The farthest that offsets are searched, seconds.
const OFFSET_MOST_S: f64 = 5.0;
/// Fewest pictures and readings.
const PICTURES_LEAST: usize = 8;
const READINGS_LEAST: usize = 100;
/// Orientations that scatter less than this (radians, median) are those of a camera at rest.
const SPREAD_LEAST: f64 = 0.006;
/// Rates that scatter less than this (rad/s, rms) may be noise.
const TURNED_LEAST: f64 = 0.02;

fn problem(
    readings: &[ImuReading],
    observations: &[Observation],
    sight: &[BySight],
    options: &Options,
) -> Result<AlignmentProblem, AlignmentError> {
    let mut left = LeftOutCounts::default();
    let range = if options.offset_range_s.is_finite() { options.offset_range_s } else { OFFSET_MOST_S };
    let shared = if options.horizon_sigma.is_finite() { options.horizon_sigma.clamp(0.0, 1.0) } else { 1.0 };
    let options =
        Options { offset_range_s: range.clamp(0.01, OFFSET_MOST_S), horizon_sigma: shared, ..*options };
    let gyro = input::clean_gyro(readings, options.gyro_range.filter(|r| *r > 0.0), &mut left);
    let (observations, numbers) = input::clean_observations(observations, &mut left);
    let sight = numbers.into_iter().filter_map(|i| sight.get(i).copied()).collect();
    let span_s = gyro.time.last().copied().unwrap_or(0.0);
    if gyro.time.len() < READINGS_LEAST {
        let (what, count) = ("sound gyro readings", gyro.time.len());
        return Err(AlignmentError::TooFew { what, count, least: READINGS_LEAST });
    }
    if span_s > SPAN_MOST_S {
        return Err(AlignmentError::TooLong { span_s, most_s: SPAN_MOST_S });
    }
    if observations.len() < PICTURES_LEAST {
        let (what, count) = ("pictures with a target or a horizon", observations.len());
        return Err(AlignmentError::TooFew { what, count, least: PICTURES_LEAST });
    }
    let seconds: Vec<f64> = observations.iter().map(|o| o.stamp().secs_since(gyro.epoch)).collect();
    let reach = options.offset_range_s;
    let within = seconds.iter().filter(|t| (-reach..=span_s + reach).contains(*t)).count();
    if within < PICTURES_LEAST {
        let (low, high) = seconds.iter().fold((f64::MAX, f64::MIN), |(l, h), t| (l.min(*t), h.max(*t)));
        return Err(AlignmentError::NoOverlap { camera_s: high - low, gyro_s: span_s });
    }
    let has_up = observations.iter().any(|o| matches!(o, Observation::Up { .. }));
    let levels = if has_up { input::levels(&gyro) } else { Vec::new() };
    Ok(AlignmentProblem { gyro, observations, levels, options, left, known: None, sight })
}

/// Refuses a camera at rest, whose noise would otherwise be taken for motion.
fn moved(problem: &AlignmentProblem) -> Result<(), AlignmentError> {
    // A horizon rests while the gun is only trained.
    let whole =
        |o: &&Observation| !problem.has_orientations() || matches!(o, Observation::Orientation { .. });
    let all: Vec<&Observation> = problem.observations.iter().filter(whole).collect();
    let off = |from: usize| {
        let mut off: Vec<f64> = all.iter().filter_map(|o| apart(o, all.get(from)?)).collect();
        off.sort_by(f64::total_cmp);
        off.get(off.len() / 2).copied().unwrap_or(f64::INFINITY)
    };
    // Seen from several, as one of them may be wild.
    let off = [1, 3, 5].map(|i| off(all.len() * i / 6)).into_iter().fold(f64::INFINITY, f64::min);
    if off < SPREAD_LEAST {
        // A horizon rests while the gun is only trained.
        let missing =
            if problem.has_orientations() || !turned(problem) { Movement::Any } else { Movement::Elevation };
        return Err(AlignmentError::NotObservable {
            missing,
            ratio: 0.0,
            sigma_mrad: 1e3 * std::f64::consts::PI,
        });
    }
    Ok(())
}

/// Whether the gyro turned by more than its bias does.
fn turned(problem: &AlignmentProblem) -> bool {
    let rates = &problem.gyro.rate;
    let count = rates.len().max(1) as f64;
    let mean = rates.iter().sum::<DVec3>() / count;
    let square = rates.iter().map(|rate| (*rate - mean).length_squared()).sum::<f64>() / count;
    square.sqrt() > TURNED_LEAST
}

/// Angle between observations of a kind, radians.
fn apart(a: &Observation, b: &Observation) -> Option<f64> {
    match (a, b) {
        (
            Observation::Orientation { reference_from_camera: a, chain, .. },
            Observation::Orientation { reference_from_camera: b, chain: same, .. },
        ) if chain == same => Some(crate::solve::so3::log(*a * b.inverse()).length()),
        (Observation::Up { up_in_camera: a, .. }, Observation::Up { up_in_camera: b, .. }) => {
            Some(a.cross(*b).length())
        }
        _ => None,
    }
}

fn start(problem: &AlignmentProblem) -> Result<AlignmentStart, AlignmentError> {
    if problem.has_orientations() { start::from_orientations(problem) } else { start::from_ups(problem) }
}

/// Rotation, offset and bias in closed form, without noise model and covariance: what [`solve`] begins with.
pub fn closed_form(
    readings: &[ImuReading],
    observations: &[Observation],
    options: &Options,
) -> Result<AlignmentStart, AlignmentError> {
    start(&problem(readings, observations, &[], options)?)
}

/// Finds rotation, time offset and gyro bias from `readings` (200 to 1000 Hz) and `observations` (any order, some tens of seconds
/// to half an hour). What is no number, repeats or runs backwards is left out and counted.
///
/// # Errors
/// Where there is too little, where the axes are mirrored, or where the movement does not tell all angles: the error names what is
/// missing.
pub fn solve(
    readings: &[ImuReading],
    observations: &[Observation],
    options: &Options,
) -> Result<Alignment, AlignmentError> {
    let problem = problem(readings, observations, &[], options)?;
    moved(&problem)?;
    let start = start(&problem)?;
    let fitted = fit::fit(&problem, &start)?;
    result::judge(&problem, &fitted)
}

#[cfg(test)]
mod compare_tests;
#[cfg(test)]
mod tests;
