//! Whether what was found before still fits a recording, also one that does not tell everything.

use std::collections::BTreeMap;

use bowwave_core::{calibration::Calibration, time::Time};
use glam::{DMat3, DVec3};
use nalgebra::{Matrix3, Matrix4, Vector4};

use super::{
    BySight, Options,
    deviation::{Deviation, Evidence, judge},
    error::{AlignmentError, Movement},
    filter::{ResidualKind, ResidualRow, UnknownsStep, place, whiten},
    fit::{Fitted, fit, with_usual_walk},
    input::{ImuReading, LeftOutCounts, Observation},
    moved, problem,
    problem::{AlignmentProblem, Weights},
    result::{NoiseFound, Residual, missing, noise_found},
    start,
    start::AlignmentStart,
};
use crate::solve::so3::{dmat, dvec, exp, log, vector};

/// What corners of boards tell of the lens: a quadratic form about the lens that was calibrated, over share of the focal length, principal point
/// right and down in focal lengths, and first coefficient of distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensEvidence {
    /// Information.
    pub information: Matrix4<f64>,
    /// Information times the most likely deviations.
    pub right: Vector4<f64>,
}

/// What is compared with a calibration.
#[derive(Clone, Copy, Debug)]
pub struct Compared<'a> {
    /// The unit's readings.
    pub readings: &'a [ImuReading],
    /// What the camera saw, through the calibration's lens and read-out.
    pub observations: &'a [Observation],
    /// How each of them turns with lens and read-out; empty where that is not asked.
    pub sight: &'a [BySight],
    /// What corners tell of the lens beside.
    pub lens: Option<LensEvidence>,
}

/// Comparison of a recording with a former calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Each number of the calibration, those that are wrong before the others, the most certain first.
    pub deviations: Vec<Deviation>,
    /// Covariance of what the recording alone tells of the rotation, camera's axes, rad^2: about 0.01 where that is nothing.
    pub turn_covariance: DMat3,
    /// The movement that would tell most of what the recording does not.
    pub missing: Movement,
    /// Noises as found.
    pub noise: NoiseFound,
    /// Residuals of the former calibration, not differenced, so that all of a slow error shows.
    pub residuals: Vec<Residual>,
    /// Counts of measurements that were not used.
    pub left_out: LeftOutCounts,
}

/// Holds `calibration` against a recording. Unlike [`super::solve`] it takes any movement: what that does not tell is not judged.
///
/// All numbers are solved for together, from where the calibration has them and held there by very little, so that the noises are told from what is
/// wrong. What the recording tells about that solution then judges each number alone.
///
/// # Errors
/// Where there is too little to look at, or the unit's axes are mirrored.
pub fn compare(
    compared: &Compared<'_>,
    calibration: &Calibration,
    options: &Options,
) -> Result<Comparison, AlignmentError> {
    let Compared { readings, observations, sight, lens } = *compared;
    let mut problem = problem(readings, observations, sight, options)?;
    let known = start_of(calibration);
    let is_moved = moved(&problem).is_ok();
    let other = match is_moved.then(|| start(&problem)) {
        Some(Err(why @ AlignmentError::Mirrored { .. })) => return Err(why),
        Some(Ok(other)) if is_far(&known, &other) => Some(other),
        _ => None,
    };
    problem.known = Some(known);
    let mut fitted = fit(&problem, &known)?;
    if let Some(far) = other.and_then(|other| fit(&problem, &other).ok()) {
        /// Twice the logarithm by which another solution must be likelier: errors that are alike make several of a hundred sound recordings look
        /// as if they had one.
        const LIKELIER: f64 = 200.0;
        let by_row = |f: &Fitted| f.whitened.cost / f.rows.len().max(1) as f64;
        if (by_row(&fitted) - by_row(&far)) * fitted.rows.len() as f64 > LIKELIER {
            fitted = far;
        }
    }
    let mut evidence = evidence(&problem, &fitted, &known)?;
    if !is_moved || super::observability::shared(&problem, &fitted).is_err() {
        // Of a camera at rest, or one that sees little of what the gyro feels, noise alone would tell it.
        evidence.forget(place::OFFSET);
        evidence.forget(place::READOUT);
    }
    if let Some(lens) = lens {
        let mut block = evidence.information.fixed_view_mut::<4, 4>(place::LENS, place::LENS);
        block += lens.information;
        let mut rows = evidence.right.fixed_rows_mut::<4>(place::LENS);
        rows += lens.right;
    }
    let rotation: Matrix3<f64> =
        fitted.covariance.fixed_view::<3, 3>(place::ROTATION, place::ROTATION).into();
    Ok(Comparison {
        deviations: judge(&evidence, calibration),
        turn_covariance: dmat(&rotation),
        missing: missing(&problem, &fitted, &rotation),
        noise: noise_found(&fitted),
        residuals: residuals(&problem, &known, &fitted),
        left_out: problem.left,
    })
}

/// Where up is in the camera's axes in each of the observations, by the gyro alone once all of them have told how it began: without the noise of
/// each. `None` where the gyro has not been there; nothing at all where there is no solution.
///
/// How a horizon moves with the focal length is how far it is from the picture's middle. Taken from what was seen, its noise would be in
/// both the difference and what that is held against, and the longest lens would explain it best.
pub(crate) fn expected_ups(
    compared: &Compared<'_>,
    calibration: &Calibration,
    options: &Options,
) -> Option<Vec<Option<DVec3>>> {
    let count = compared.observations.len();
    let mut problem = problem(compared.readings, compared.observations, &[], options).ok()?;
    let known = start_of(calibration);
    problem.known = Some(known);
    let fitted = fit(&problem, &known).ok()?;
    let mut by_stamp = BTreeMap::new();
    for row in fitted.rows.iter().filter(|row| row.kind == ResidualKind::Up) {
        let Some(Observation::Up { stamp, up_in_camera, .. }) = problem.observations.get(row.index) else {
            continue;
        };
        let turn = dvec(&(row.reference_from_camera().transpose() * row.residual));
        by_stamp.insert(*stamp, exp(turn) * *up_in_camera);
    }
    let of = |i: usize| by_stamp.get(&compared.observations.get(i)?.stamp())?.try_normalize();
    Some((0..count).map(of).collect())
}

fn start_of(calibration: &Calibration) -> AlignmentStart {
    AlignmentStart {
        camera_from_imu: calibration.camera_from_imu,
        offset_s: calibration.time_offset_ns as f64 * 1e-9,
        bias: calibration.gyro_bias,
    }
}

/// Whether an estimate from nothing is so far from the calibration that no small step leads there.
fn is_far(known: &AlignmentStart, other: &AlignmentStart) -> bool {
    /// Radians and seconds.
    const FAR: (f64, f64) = (0.15, 0.06);
    let turn = log(other.camera_from_imu * known.camera_from_imu.inverse()).length();
    turn > FAR.0 || (other.offset_s - known.offset_s).abs() > FAR.1
}

/// What the recording alone tells, about `known`.
fn evidence(
    problem: &AlignmentProblem,
    fitted: &Fitted,
    known: &AlignmentStart,
) -> Result<Evidence, AlignmentError> {
    const NO_NUMBER: AlignmentError = AlignmentError::NoFit { problem: "the covariance is no number" };
    let rows: Vec<ResidualRow> =
        fitted.rows.iter().filter(|row| row.kind != ResidualKind::Known).cloned().collect();
    let whitened = whiten(&rows, &with_usual_walk(&rows, &fitted.levels)).ok_or(NO_NUMBER)?;
    let unknowns = &fitted.unknowns;
    let turn = log(unknowns.camera_from_imu * known.camera_from_imu.inverse());
    let mut off = UnknownsStep::zeros();
    off.fixed_rows_mut::<3>(place::ROTATION).copy_from(&vector(turn));
    off[place::OFFSET] = unknowns.offset_s - known.offset_s;
    off.fixed_rows_mut::<3>(place::BIAS).copy_from(&vector(unknowns.bias - known.bias));
    off[place::READOUT] = unknowns.readout_s;
    off.fixed_rows_mut::<3>(place::SCALE).copy_from(&vector(unknowns.scale));
    for (i, much) in unknowns.lens.iter().enumerate() {
        off[place::LENS + i] = *much;
    }
    let seconds = rows.first().zip(rows.last()).map_or(0.0, |(first, last)| last.time - first.time);
    Ok(Evidence {
        information: whitened.normal,
        right: whitened.normal * off - whitened.gradient,
        scores: whitened.scores,
        seconds,
        active: fitted.active.clone(),
        dip_sigma: problem.options.horizon_sigma,
    })
}

/// Residuals with rotation and offset of the former calibration. The bias is the recording's own, so that they show what is beside it.
fn residuals(problem: &AlignmentProblem, known: &AlignmentStart, fitted: &Fitted) -> Vec<Residual> {
    let start = AlignmentStart { bias: fitted.unknowns.bias, ..*known };
    let (rows, noise) = (problem.rows(&problem.unknowns(&start), &Weights::default()), noise_found(fitted));
    let scale = |row: &ResidualRow| match row.blind {
        Some(_) => noise.up_scale,
        None => noise.orientation_scale,
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
