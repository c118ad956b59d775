//! Whether a fit deserves what its covariance says of it.
//!
//! The covariance counts every turn that the gyro felt as one that the camera could have told the time offset by. Where the gyro feels
//! vibration that the picture does not show (a gimbal, a loose mount, noise at every turn too small to be seen), that is wrong, and no
//! residual tells: they are white, halves observability, and the offset is a number by chance. So the offset is set wrong on purpose: what was
//! seen must then fit worse by as much as the gyro's movement says.

use std::collections::BTreeMap;

use super::{
    error::AlignmentError,
    filter::{ResidualRow, invert, place, whiten},
    fit::Fitted,
    problem::{AlignmentProblem, Weights},
};

/// By how much the offset is set wrong, seconds: within this movements by hand and on a mount are smooth.
const WRONG_S: [f64; 6] = [-0.05, -0.02, -0.01, 0.01, 0.02, 0.05];
/// An offset that is wrong by that must make a difference at all: chi-squared of ten standard deviations.
const TOLD_LEAST: f64 = 100.0;
/// Share of the movement that camera and gyro must have in common.
const SHARED_LEAST: f64 = 0.6;
/// Correlations of so many pictures that follow each other are looked at.
const LAGS: usize = 10;
/// A correlation beyond so many standard deviations is no chance.
const CHANCE: f64 = 4.0;
/// Halves that disagree by more standard deviations than this have something the matter: of ten thousand sound recordings less than one.
pub(super) const HALVES_MOST: f64 = 2.5;

/// Share of the gyro's movement that the camera has seen too, as far as that tells the time offset: 1 where both see the same, about 0 where
/// they have nothing in common. The least over some wrong offsets; `None` where the movement tells the offset too poorly to be asked.
///
/// # Errors
/// Where it is too little for what the covariance says.
pub(super) fn shared(problem: &AlignmentProblem, fitted: &Fitted) -> Result<Option<f64>, AlignmentError> {
    let told: Vec<(f64, f64)> = WRONG_S.iter().filter_map(|wrong| share(problem, fitted, *wrong)).collect();
    // A share is uncertain by 2 / sqrt(what the movement tells).
    let bound = |(share, told): &(f64, f64)| share + 3.0 * 2.0 / told.sqrt();
    let least = told.iter().min_by(|a, b| bound(a).total_cmp(&bound(b)));
    match least {
        Some(worst) if bound(worst) < SHARED_LEAST => {
            Err(AlignmentError::NotShared { share: worst.0.max(0.0) })
        }
        _ => Ok(least.map(|(share, _)| *share)),
    }
}

/// The share at an offset that is wrong by that much, and chi-squared by which the gyro's movement would tell it.
fn share(problem: &AlignmentProblem, fitted: &Fitted, wrong_s: f64) -> Option<(f64, f64)> {
    let mut weights = Weights::default();
    fitted.rows.iter().for_each(|row| weights.set(row, row.weight));
    let mut unknowns = fitted.unknowns.clone();
    unknowns.offset_s += wrong_s;
    let shifted = problem.rows(&unknowns, &weights);
    let by_number: BTreeMap<(usize, usize), &ResidualRow> =
        shifted.iter().map(|row| ((row.kind as usize, row.index), row)).collect();
    let (mut before, mut after, mut moved) = (Vec::new(), Vec::new(), Vec::new());
    for row in &fitted.rows {
        let Some(then) = by_number.get(&(row.kind as usize, row.index)) else { continue };
        before.push(row.clone());
        after.push(ResidualRow { residual: then.residual, ..row.clone() });
        moved.push(ResidualRow { residual: then.residual - row.residual, ..row.clone() });
    }
    let told = square(&moved, fitted)?;
    (told >= TOLD_LEAST).then_some(((square(&after, fitted)? - square(&before, fitted)?) / told, told))
}

/// Chi-squared of residuals after all unknowns but the offset have taken of them what they can.
fn square(rows: &[ResidualRow], fitted: &Fitted) -> Option<f64> {
    let others: Vec<usize> = fitted.active.iter().copied().filter(|i| *i != place::OFFSET).collect();
    let whitened = whiten(rows, &fitted.levels)?;
    let inverse = invert(&whitened.normal, &others, 0.0)?;
    let sum: f64 = whitened.white.iter().map(|w| w.norm_squared()).sum();
    Some(sum - whitened.gradient.dot(&(inverse * whitened.gradient)))
}

/// Correlation of what is left of pictures that follow each other, and by what factor variances are larger for it (Bayley & Hammersley 1946):
/// 1 where the correlation may be chance.
pub(super) fn correlation(fitted: &Fitted) -> (f64, f64) {
    let is_sound = |row: &ResidualRow| row.kind.is_seen() && row.weight >= 1.0;
    let white: Vec<_> = fitted
        .rows
        .iter()
        .zip(&fitted.whitened.white)
        .filter(|(row, _)| is_sound(row))
        .map(|(_, w)| w)
        .collect();
    let energy: f64 = white.iter().map(|w| w.norm_squared()).sum();
    let at = |lag: usize| white.windows(lag + 1).map(|w| w[0].dot(w[lag])).sum::<f64>() / energy.max(1e-300);
    let chance = 1.0 / (3.0 * white.len().max(1) as f64).sqrt();
    let first = at(1);
    if first < CHANCE * chance {
        return (first, 1.0);
    }
    let together: f64 = (1..=LAGS.min(white.len())).map(at).take_while(|r| *r > chance).sum();
    (first, 1.0 + 2.0 * together)
}
