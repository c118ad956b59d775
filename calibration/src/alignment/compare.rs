//! Whether what was found before still fits a recording, also one that does not tell everything.

use bowwave_core::time::Time;
use glam::{DMat3, DQuat, DVec3};
use nalgebra::{Matrix3, Matrix4, Vector4};

use super::{
    Options,
    error::{AlignmentError, Movement},
    filter::{Row, place},
    fit::{Fitted, fit},
    input::{ImuReading, LeftOut, Observation},
    moved, problem,
    problem::{KNOWN_SIGMA, Problem, Weights},
    result::{NoiseFound, Residual, horizons_share, judge, missing, noise_found},
    start,
    start::Start,
};
use crate::so3::{dmat, dvec, log, matrix};

/// What was found before.
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

/// What a recording says of what was known. Differences are what the recording tells less what was known.
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
    /// What was known against what was seen: no step is taken from one to the next, so that all of a slow error shows.
    pub residuals: Vec<Residual>,
    /// What was not used.
    pub left_out: LeftOut,
}

impl Comparison {
    /// Standard deviation about each of the camera's axes of what the recording tells, radians.
    pub fn turn_sigma(&self) -> DVec3 {
        let c = self.turn_covariance;
        DVec3::new(c.x_axis.x, c.y_axis.y, c.z_axis.z).max(DVec3::ZERO).map(f64::sqrt)
    }
}

/// What the recording tells by itself, or, where it does not tell all, together with a rough knowledge of what was found before.
struct Told {
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

fn alone(problem: &Problem) -> Result<Told, AlignmentError> {
    let fitted = fit(problem, &start(problem)?)?;
    let found = judge(problem, &fitted)?;
    Ok(Told {
        camera_from_imu: found.camera_from_imu,
        rotation: matrix(found.rotation_covariance),
        offset: (found.offset_s, found.offset_sigma_s),
        bias: found.gyro_bias,
        noise: found.noise,
        missing: found.missing,
    })
}

fn together(problem: &mut Problem, known: &Known) -> Result<Told, AlignmentError> {
    let Known { camera_from_imu, offset_s, gyro_bias: bias, .. } = *known;
    let start = Start { camera_from_imu, offset_s, bias };
    problem.known = Some(start);
    let fitted: Fitted = fit(problem, &start)?;
    problem.known = None;
    let rotation: Matrix3<f64> =
        fitted.covariance.fixed_view::<3, 3>(place::ROTATION, place::ROTATION).into();
    let rotation = rotation + horizons_share(problem);
    let offset_sigma_s = fitted.covariance[(place::OFFSET, place::OFFSET)].max(0.0).sqrt();
    Ok(Told {
        camera_from_imu: fitted.unknowns.camera_from_imu,
        rotation,
        offset: (fitted.unknowns.offset_s, offset_sigma_s),
        bias: fitted.unknowns.bias,
        noise: noise_found(&fitted),
        missing: missing(problem, &fitted, &rotation),
    })
}

/// What is left with rotation and offset as known. The bias is the recording's own: it changes with the temperature, and the trainer learns
/// it.
fn residuals(problem: &Problem, known: &Known, told: &Told) -> Vec<Residual> {
    let start = Start { camera_from_imu: known.camera_from_imu, offset_s: known.offset_s, bias: told.bias };
    let rows = problem.rows(&problem.unknowns(&start), &Weights::default());
    let scale = |row: &Row| match row.blind {
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
