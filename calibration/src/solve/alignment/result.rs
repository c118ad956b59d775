//! Result, its covariance, and its consistency checks.

use std::fmt;

use bowwave_core::time::Time;
use glam::{DMat3, DQuat, DVec3};
use nalgebra::{Matrix3, Matrix4, Vector4};

use super::{
    error::{AlignmentError, Movement},
    filter::{ResidualKind, UnknownsStep, invert, place, whiten},
    fit::Fitted,
    input::{LeftOutCounts, Observation},
    noise::USUAL_WALK,
    observability::{HALVES_MOST, correlation, shared},
    problem::AlignmentProblem,
};
use crate::solve::so3::{dmat, dvec, vector};

/// How good a result is, in words that maintainers act on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Grade {
    /// Train with it, but it shows: measure again when there is time.
    Poor,
    /// Boats lie within a pixel or two.
    Usable,
    /// Nothing to be gained by measuring again.
    Good,
}

impl Grade {
    /// Largest standard deviation of the rotation about any axis, radians, of the grades good and usable.
    pub const ROTATION: [f64; 2] = [1e-3, 4e-3];
    /// Largest standard deviation of the offset, seconds, of the grades good and usable.
    pub const OFFSET_S: [f64; 2] = [0.3e-3, 2e-3];

    fn of(rotation: f64, offset_s: f64) -> Self {
        let within = |i: usize| rotation <= Self::ROTATION[i] && offset_s <= Self::OFFSET_S[i];
        if within(0) {
            Self::Good
        } else if within(1) {
            Self::Usable
        } else {
            Self::Poor
        }
    }
}

impl fmt::Display for Grade {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Poor => "poor",
            Self::Usable => "usable",
            Self::Good => "good",
        })
    }
}

/// Sizes of the noises, one standard deviation each, as the residuals tell them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseFound {
    /// The camera's orientations: times their stated sigma.
    pub orientation_scale: f64,
    /// The horizons: times their stated sigma.
    pub up_scale: f64,
    /// The camera's stamps, seconds.
    pub jitter_s: f64,
    /// The gyro's angle random walk, rad/sqrt(s).
    pub gyro_walk: f64,
}

/// Consistency checks beside the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checks {
    /// How far the recording's halves disagree, in standard deviations (1 is usual, beyond 2.2 one in a thousand); `None` where a half
    /// does not tell all.
    pub halves: Option<f64>,
    /// Share of the observations that are outliers.
    pub outliers: f64,
    /// Share of the gyro's movement that the camera has seen too, as far as it tells the time offset: 1 is usual; `None` where the movement
    /// tells that too poorly to be asked.
    pub shared: Option<f64>,
    /// Correlation of what is left of pictures that follow each other: about 0 is usual.
    pub correlation: f64,
    /// By what factor the covariances are larger than the noises alone make them, because halves disagree or pictures err alike.
    pub widened: f64,
    /// Relative error of the gyro's scale, each axis, and its standard deviation; `None` where the motion does not tell.
    pub gyro_scale: Option<(DVec3, DVec3)>,
}

/// Something that the maintainer should look into though there is a result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlignmentFinding {
    /// The halves disagree by so many standard deviations.
    Inconsistent(f64),
    /// Pictures that follow each other err alike, with that correlation.
    Alike(f64),
    /// So large a share of the observations are outliers.
    ManyOutliers(f64),
    /// The gyro's scale is off by that share about that axis (0, 1, 2).
    GyroScale(usize, f64),
}

impl fmt::Display for AlignmentFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Inconsistent(sigmas) => write!(
                f,
                "the first and the second half of the recording disagree by {sigmas:.1} standard deviations, so all are stated that much \
                 larger: something moved, or the stamps jump; fasten camera and inertial unit, record again"
            ),
            Self::Alike(correlation) => write!(
                f,
                "pictures that follow each other err alike (correlation {correlation:.2}), so deviations are stated larger: calibrate the \
                 lens first, light the target better"
            ),
            Self::ManyOutliers(share) => write!(
                f,
                "{:.0} % of the pictures do not fit: light the target better, move more slowly",
                share * 100.0
            ),
            Self::GyroScale(axis, share) => write!(
                f,
                "the gyro's {} axis reads {:.2} % {}: check the unit's scale setting or replace it",
                ["x", "y", "z"].get(*axis).copied().unwrap_or("?"),
                share.abs() * 100.0,
                if *share > 0.0 { "too little" } else { "too much" }
            ),
        }
    }
}

/// Residual of one observation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// The camera's stamp.
    pub stamp: Time,
    /// From what was predicted from the observations before to what was seen, rotation vector in the camera's axes, radians.
    pub turn: DVec3,
    /// Its length in standard deviations, by the square root of the degrees of freedom: 1 is usual.
    pub normalised: f64,
    /// 1, or less for an outlier.
    pub weight: f64,
}

/// Rotation and time offset between a camera and an inertial unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignment {
    /// Rotation from the unit's axes to the camera's.
    pub camera_from_imu: DQuat,
    /// Covariance of its error, a rotation vector in the camera's axes, rad^2.
    pub rotation_covariance: DMat3,
    /// Add to a frame's mid-exposure stamp (of its middle row) to get the time on the unit's clock, seconds.
    pub offset_s: f64,
    /// Its standard deviation, seconds.
    pub offset_sigma_s: f64,
    /// Gyro bias, unit's axes, rad/s, to be subtracted.
    pub gyro_bias: DVec3,
    /// Its standard deviation.
    pub gyro_bias_sigma: DVec3,
    /// Read-out time of the whole picture and its standard deviation, seconds, where asked for.
    pub readout_s: Option<(f64, f64)>,
    /// Smallest singular value of the rotation's normalised information over the largest: 1 is even, 0 blind about an axis.
    pub information_ratio: f64,
    /// The movement that would tell most of the angle that is known least.
    pub missing: Movement,
    /// Noises as found.
    pub noise: NoiseFound,
    /// How good it is.
    pub grade: Grade,
    /// Consistency.
    pub checks: Checks,
    /// Residual of each observation, in order of time.
    pub residuals: Vec<Residual>,
    /// Counts of measurements that were not used.
    pub left_out: LeftOutCounts,
}

/// Beyond this standard deviation (radians) an angle is not known, nor beyond the lesser one where it is so much less known than the best.
const SIGMA_MOST: f64 = 0.1;
const SIGMA_UNEVEN: f64 = 0.03;
const RATIO_LEAST: f64 = 0.02;
/// A correlation that is worth a word.
const ALIKE_MOST: f64 = 0.1;

impl Alignment {
    /// Standard deviation about each of the camera's axes, radians.
    pub fn rotation_sigma(&self) -> DVec3 {
        let c = self.rotation_covariance;
        DVec3::new(c.x_axis.x, c.y_axis.y, c.z_axis.z).max(DVec3::ZERO).map(f64::sqrt)
    }

    /// Standard deviation of where a boat at `range_m` is drawn, metres: the rotations across the line of sight together.
    pub fn sigma_at(&self, range_m: f64) -> f64 {
        self.rotation_sigma().truncate().length() * range_m
    }

    /// Findings that the maintainer should look into.
    pub fn findings(&self) -> Vec<AlignmentFinding> {
        let mut out = Vec::new();
        if let Some(sigmas) = self.checks.halves.filter(|s| *s > HALVES_MOST) {
            out.push(AlignmentFinding::Inconsistent(sigmas));
        }
        if self.checks.correlation > ALIKE_MOST {
            out.push(AlignmentFinding::Alike(self.checks.correlation));
        }
        if self.checks.outliers > 0.1 {
            out.push(AlignmentFinding::ManyOutliers(self.checks.outliers));
        }
        if let Some((scale, sigma)) = self.checks.gyro_scale {
            for axis in 0..3 {
                if scale[axis].abs() > 4.5 * sigma[axis] && scale[axis].abs() > 2e-3 {
                    out.push(AlignmentFinding::GyroScale(axis, scale[axis]));
                }
            }
        }
        out
    }
}

/// Judges the fit.
pub(super) fn judge(problem: &AlignmentProblem, fitted: &Fitted) -> Result<Alignment, AlignmentError> {
    let covariance: Matrix3<f64> =
        fitted.covariance.fixed_view::<3, 3>(place::ROTATION, place::ROTATION).into();
    let information_ratio = observe(problem, fitted, &covariance)?;
    let checks = Checks { shared: shared(problem, fitted)?, ..checks(fitted) };
    let sigma = |i: usize| (fitted.covariance[(i, i)].max(0.0) * checks.widened).sqrt();
    let rotation = covariance * checks.widened + horizons_share(problem);
    let unknowns = &fitted.unknowns;
    let mut left_out = problem.left;
    let used = fitted.rows.iter().filter(|r| r.kind.is_seen()).count();
    left_out.without_gyro = problem.observations.len() - used;
    let worst = rotation.symmetric_eigenvalues().max().max(0.0).sqrt();
    let offset_sigma_s = sigma(place::OFFSET);
    let mut alignment = Alignment {
        camera_from_imu: unknowns.camera_from_imu,
        rotation_covariance: dmat(&rotation),
        offset_s: unknowns.offset_s,
        offset_sigma_s,
        gyro_bias: unknowns.bias,
        gyro_bias_sigma: bias_sigma(fitted) * checks.widened.sqrt(),
        readout_s: problem.options.estimate_readout.then(|| (unknowns.readout_s, sigma(place::READOUT))),
        information_ratio,
        missing: missing(problem, fitted, &rotation),
        noise: noise_found(fitted),
        grade: Grade::of(worst, offset_sigma_s),
        checks,
        residuals: residuals(problem, fitted),
        left_out,
    };
    if alignment.findings().iter().any(|f| !matches!(f, AlignmentFinding::GyroScale(..))) {
        alignment.grade = alignment.grade.min(Grade::Usable);
    }
    Ok(alignment)
}

/// Sizes of the noises.
pub(super) fn noise_found(fitted: &Fitted) -> NoiseFound {
    let levels = &fitted.levels;
    NoiseFound {
        orientation_scale: levels.scale[ResidualKind::Orientation as usize],
        up_scale: levels.scale[ResidualKind::Up as usize],
        jitter_s: levels.jitter_s,
        gyro_walk: levels.walk,
    }
}

/// Covariance of what an error of elevation that all horizons share does to the rotation: where nothing but horizons was seen, it turns the
/// camera about the picture's horizontal. (Less where the camera rolled, by which it could be told.)
pub(super) fn horizons_share(problem: &AlignmentProblem) -> Matrix3<f64> {
    if problem.has_orientations() {
        return Matrix3::zeros();
    }
    let level = |o: &Observation| match o {
        Observation::Up { up_in_camera, .. } => up_in_camera.cross(DVec3::Z).normalize_or_zero(),
        Observation::Orientation { .. } => DVec3::ZERO,
    };
    let mean = vector(problem.observations.iter().map(level).sum::<DVec3>())
        / problem.observations.len().max(1) as f64;
    mean * mean.transpose() * problem.options.horizon_sigma.powi(2)
}

/// Standard deviation of the bias. A mean rate is as good as the walk over the recording allows; where the camera's noise hides that walk,
/// the one found may be too small, and a usual one is counted in its stead.
fn bias_sigma(fitted: &Fitted) -> DVec3 {
    let times = fitted.rows.first().zip(fitted.rows.last());
    let span_s = times.map_or(1.0, |(first, last)| (last.time - first.time).max(1.0));
    let hidden = (USUAL_WALK.0.powi(2) - fitted.levels.walk.powi(2)).max(0.0) / span_s;
    let own = |i: usize| fitted.covariance[(place::BIAS + i, place::BIAS + i)].max(0.0);
    DVec3::new(own(0), own(1), own(2)).map(|v| (v + hidden).sqrt())
}

/// Ratio of the information's singular values; an error with the missing movement where an angle is not told.
fn observe(
    problem: &AlignmentProblem,
    fitted: &Fitted,
    rotation: &Matrix3<f64>,
) -> Result<f64, AlignmentError> {
    let eigen = rotation.symmetric_eigen();
    let (worst, best) = (eigen.eigenvalues.imax(), eigen.eigenvalues.min().max(0.0).sqrt());
    let sigma = eigen.eigenvalues[worst].max(0.0).sqrt();
    let ratio = if sigma > 0.0 { best / sigma } else { 0.0 };
    if !(ratio.is_finite() && sigma.is_finite()) {
        return Err(AlignmentError::NoFit { problem: "the covariance is no number" });
    }
    if sigma <= if ratio < RATIO_LEAST { SIGMA_UNEVEN } else { SIGMA_MOST } {
        return Ok(ratio);
    }
    let missing = if best > SIGMA_MOST { Movement::Any } else { missing(problem, fitted, rotation) };
    Err(AlignmentError::NotObservable { missing, ratio, sigma_mrad: sigma * 1e3 })
}

/// The movement that would tell the angle of which `rotation`, a covariance in the camera's axes, knows least: one about another axis, of
/// which there is least.
pub(super) fn missing(problem: &AlignmentProblem, fitted: &Fitted, rotation: &Matrix3<f64>) -> Movement {
    let eigen = rotation.symmetric_eigen();
    let blind = dvec(&eigen.eigenvectors.column(eigen.eigenvalues.imax()).into());
    let mut energy = DVec3::ZERO;
    for rate in &problem.gyro.rate {
        let turned = fitted.unknowns.camera_from_imu * (*rate - fitted.unknowns.bias);
        energy += turned * turned;
    }
    // Elevation first: it is what every mount can do.
    let choices = [(0, Movement::Elevation), (1, Movement::Traverse), (2, Movement::Roll)];
    let helps = choices.into_iter().filter(|(axis, _)| blind[*axis].abs() < 0.7);
    let total = energy.element_sum().max(1e-300);
    // Differences below a hundredth of the whole are noise.
    let share = |axis: usize| (energy[axis] / total * 100.0).floor();
    helps.min_by(|a, b| share(a.0).total_cmp(&share(b.0))).map_or(Movement::Any, |(_, movement)| movement)
}

fn checks(fitted: &Fitted) -> Checks {
    let outliers = fitted.rows.iter().filter(|r| r.weight < 1.0 && r.kind.is_seen()).count();
    let (halves, (correlation, by_correlation)) = (halves(fitted), correlation(fitted));
    // Birge's ratio, where chance does not explain it.
    let by_halves = halves.filter(|s| *s > HALVES_MOST).map_or(1.0, |s| s * s);
    Checks {
        halves,
        shared: None,
        correlation,
        widened: by_correlation * by_halves,
        outliers: outliers as f64 / fitted.rows.len().max(1) as f64,
        gyro_scale: gyro_scale(fitted),
    }
}

/// Step from the common solution to that of some rows alone, and its covariance: rotation and offset.
fn alone(fitted: &Fitted, from: usize, to: usize) -> Option<(Vector4<f64>, Matrix4<f64>)> {
    let whitened = whiten(fitted.rows.get(from..to)?, &fitted.levels)?;
    let inverse = invert(&whitened.normal, &fitted.active, 0.0)?;
    let step: UnknownsStep = -(inverse * whitened.gradient);
    Some((step.fixed_rows::<4>(0).into(), inverse.fixed_view::<4, 4>(0, 0).into()))
}

fn halves(fitted: &Fitted) -> Option<f64> {
    let (n, middle) = (fitted.rows.len(), fitted.rows.len() / 2);
    let (first, second) = (alone(fitted, 0, middle)?, alone(fitted, middle, n)?);
    let difference = first.0 - second.0;
    let square = difference.dot(&(first.1 + second.1).cholesky()?.solve(&difference));
    let rotation: Matrix3<f64> = (first.1 + second.1).fixed_view::<3, 3>(0, 0).into();
    let known = rotation.symmetric_eigenvalues().max() < SIGMA_MOST * SIGMA_MOST;
    known.then(|| (square / 4.0).sqrt()).filter(|s| s.is_finite())
}

fn gyro_scale(fitted: &Fitted) -> Option<(DVec3, DVec3)> {
    let mut active = fitted.active.clone();
    active.extend([0, 1, 2].map(|i| place::SCALE + i));
    let inverse = invert(&fitted.whitened.normal, &active, 0.0)?;
    let step: UnknownsStep = -(inverse * fitted.whitened.gradient);
    let three = |f: &dyn Fn(usize) -> f64| DVec3::new(f(0), f(1), f(2));
    let scale = three(&|i| step[place::SCALE + i]);
    let sigma = three(&|i| inverse[(place::SCALE + i, place::SCALE + i)].max(0.0).sqrt());
    (scale.is_finite() && sigma.max_element() < 0.05).then_some((scale, sigma))
}

fn residuals(problem: &AlignmentProblem, fitted: &Fitted) -> Vec<Residual> {
    let of = |(i, row): (usize, &super::filter::ResidualRow)| {
        let observation: &Observation = problem.observations.get(row.index).filter(|_| row.kind.is_seen())?;
        let innovation = fitted.whitened.innovations.get(i)?;
        Some(Residual {
            stamp: observation.stamp(),
            turn: dvec(&(row.reference_from_camera().transpose() * innovation)),
            normalised: (fitted.whitened.squares.get(i)? / row.freedom()).sqrt(),
            weight: row.weight,
        })
    };
    let mut out: Vec<Residual> = fitted.rows.iter().enumerate().filter_map(of).collect();
    // The first of a segment has no prediction before it.
    if let Some(first) = out.first_mut() {
        first.turn = dvec(&vector(DVec3::ZERO));
    }
    out
}
