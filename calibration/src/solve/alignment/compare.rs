//! Whether what was found before still fits a recording, also one that does not tell everything.

use bowwave_core::{calibration::Calibration, time::Time};
use glam::{DMat3, DQuat, DVec3};
use nalgebra::{Matrix3, Matrix4, Vector4};

use super::{
    Options,
    error::{AlignmentError, Movement},
    filter::{ResidualRow, place},
    fit::{Fitted, fit},
    input::{ImuReading, LeftOutCounts, Observation},
    moved, problem,
    problem::{AlignmentProblem, KNOWN_SIGMA, Weights},
    result::{NoiseFound, Residual, horizons_share, judge, missing, noise_found},
    start,
    start::AlignmentStart,
};
use crate::solve::so3::{dmat, dvec, log, matrix};

/// Former calibration that a recording is compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    /// Rotation from the unit's axes to the camera's.
    pub camera_from_imu: DQuat,
    /// Its standard deviation about each of the camera's axes, radians.
    pub rotation_sigma: DVec3,
    /// Add to the camera's stamps to get times of the unit, seconds.
    pub offset_s: f64,
    /// Its standard deviation, seconds.
    pub offset_sigma_s: f64,
    /// Gyro bias, unit's axes, rad/s.
    pub gyro_bias: DVec3,
}

impl Known {
    /// What a calibration says.
    pub fn of(calibration: &Calibration) -> Self {
        Self {
            camera_from_imu: calibration.camera_from_imu,
            rotation_sigma: calibration.camera_from_imu_sigma,
            offset_s: calibration.time_offset_ns as f64 * 1e-9,
            offset_sigma_s: calibration.time_offset_sigma_ns as f64 * 1e-9,
            gyro_bias: calibration.gyro_bias,
        }
    }
}

/// Comparison of a recording with a former calibration. Differences are recording minus former.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Rotation vector in the camera's axes, radians: `told = exp(turn) known`. Near zero about an axis of which the recording tells nothing.
    pub turn: DVec3,
    /// Covariance of what the recording tells of it, rad^2: about 0.01 where that is nothing. What was known has its own beside it.
    pub turn_covariance: DMat3,
    /// Time offset, seconds.
    pub offset_s: f64,
    /// Standard deviation of what the recording tells of it.
    pub offset_sigma_s: f64,
    /// Gyro bias, unit's axes, rad/s.
    pub gyro_bias: DVec3,
    /// Square of rotation and offset, weighed by the covariances of both sides: chi-squared with four degrees of freedom where nothing has
    /// changed.
    pub surprise: f64,
    /// The movement that would tell most of what the recording does not.
    pub missing: Movement,
    /// Noises as found.
    pub noise: NoiseFound,
    /// Residuals of the former calibration, not differenced, so that all of a slow error shows.
    pub residuals: Vec<Residual>,
    /// Counts of measurements that were not used.
    pub left_out: LeftOutCounts,
}

impl Comparison {
    /// Standard deviation about each of the camera's axes of what the recording tells, radians.
    pub fn turn_sigma(&self) -> DVec3 {
        let c = self.turn_covariance;
        DVec3::new(c.x_axis.x, c.y_axis.y, c.z_axis.z).max(DVec3::ZERO).map(f64::sqrt)
    }
}

/// Extrinsics by the recording alone or, where that does not determine all, with the former ones as a weak prior.
struct ToldExtrinsics {
    camera_from_imu: DQuat,
    rotation: Matrix3<f64>,
    offset: (f64, f64),
    bias: DVec3,
    noise: NoiseFound,
    missing: Movement,
}

/// Holds `known` against a recording. Unlike [`super::solve`] it takes any movement: what that does not tell has a large covariance.
///
/// # Errors
/// Where there is too little to look at, or the unit's axes are mirrored.
pub fn compare(
    readings: &[ImuReading],
    observations: &[Observation],
    known: &Known,
    options: &Options,
) -> Result<Comparison, AlignmentError> {
    let mut problem = problem(readings, observations, options)?;
    let told = match moved(&problem).and_then(|()| alone(&problem)) {
        Ok(told) => told,
        Err(
            why @ (AlignmentError::NotObservable { .. }
            | AlignmentError::NoFit { .. }
            | AlignmentError::NotShared { .. }),
        ) => {
            let mut told = together(&mut problem, known)?;
            if matches!(why, AlignmentError::NotShared { .. }) || moved(&problem).is_err() {
                // Of a camera at rest, or one that sees little of what the gyro feels, noise alone would tell it.
                told.offset = (known.offset_s, KNOWN_SIGMA);
            }
            told
        }
        Err(e) => return Err(e),
    };
    let turn = log(told.camera_from_imu * known.camera_from_imu.inverse());
    let offset_s = told.offset.0 - known.offset_s;
    let own = DMat3::from_diagonal(known.rotation_sigma * known.rotation_sigma);
    let both = told.rotation + matrix(own);
    let mut covariance = Matrix4::zeros();
    covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&both);
    covariance[(3, 3)] = told.offset.1.powi(2) + known.offset_sigma_s.powi(2);
    let difference = Vector4::new(turn.x, turn.y, turn.z, offset_s);
    let surprise = covariance.cholesky().map(|c| difference.dot(&c.solve(&difference)));
    Ok(Comparison {
        turn,
        turn_covariance: dmat(&told.rotation),
        offset_s,
        offset_sigma_s: told.offset.1,
        gyro_bias: told.bias - known.gyro_bias,
        surprise: surprise
            .filter(|s| s.is_finite())
            .ok_or(AlignmentError::NoFit { problem: "the covariance is no number" })?,
        missing: told.missing,
        noise: told.noise,
        residuals: residuals(&problem, known, &told),
        left_out: problem.left,
    })
}

fn alone(problem: &AlignmentProblem) -> Result<ToldExtrinsics, AlignmentError> {
    let fitted = fit(problem, &start(problem)?)?;
    let found = judge(problem, &fitted)?;
    Ok(ToldExtrinsics {
        camera_from_imu: found.camera_from_imu,
        rotation: matrix(found.rotation_covariance),
        offset: (found.offset_s, found.offset_sigma_s),
        bias: found.gyro_bias,
        noise: found.noise,
        missing: found.missing,
    })
}

fn together(problem: &mut AlignmentProblem, known: &Known) -> Result<ToldExtrinsics, AlignmentError> {
    let Known { camera_from_imu, offset_s, gyro_bias: bias, .. } = *known;
    let start = AlignmentStart { camera_from_imu, offset_s, bias };
    problem.known = Some(start);
    let fitted: Fitted = fit(problem, &start)?;
    problem.known = None;
    let rotation: Matrix3<f64> =
        fitted.covariance.fixed_view::<3, 3>(place::ROTATION, place::ROTATION).into();
    let rotation = rotation + horizons_share(problem);
    let offset_sigma_s = fitted.covariance[(place::OFFSET, place::OFFSET)].max(0.0).sqrt();
    Ok(ToldExtrinsics {
        camera_from_imu: fitted.unknowns.camera_from_imu,
        rotation,
        offset: (fitted.unknowns.offset_s, offset_sigma_s),
        bias: fitted.unknowns.bias,
        noise: noise_found(&fitted),
        missing: missing(problem, &fitted, &rotation),
    })
}

/// Residuals with rotation and offset of the former calibration. The bias is the recording's own: it changes with the temperature, and the trainer learns
/// it.
fn residuals(problem: &AlignmentProblem, known: &Known, told: &ToldExtrinsics) -> Vec<Residual> {
    let start =
        AlignmentStart { camera_from_imu: known.camera_from_imu, offset_s: known.offset_s, bias: told.bias };
    let rows = problem.rows(&problem.unknowns(&start), &Weights::default());
    let scale = |row: &ResidualRow| match row.blind {
        Some(_) => told.noise.up_scale,
        None => told.noise.orientation_scale,
    };
    rows.iter()
        .filter(|row| row.kind.is_seen())
        .filter_map(|row| {
            let stamp: Time = problem.observations.get(row.index)?.stamp();
            Some(Residual {
                stamp,
                turn: dvec(&(row.reference_from_camera().transpose() * row.residual)),
                normalised: row.residual.norm() / (scale(row) * row.sigma * row.freedom().sqrt()),
                weight: 1.0,
            })
        })
        .collect()
}
