//! From a start to the best unknowns, the size of the noises and the covariance.

use bowwave_core::levenberg::{Damping, Improvement, levenberg_marquardt};

use super::{
    error::AlignmentError,
    filter::{Levels, NormalMatrix, ResidualKind, ResidualRow, Whitened, cost, invert, restricted, whiten},
    noise::{USUAL_WALK, most_likely},
    problem::{AlignmentProblem, AlignmentUnknowns, Weights},
    start::AlignmentStart,
};

/// End of the iteration.
#[derive(Clone, Debug)]
pub(super) struct Fitted {
    pub unknowns: AlignmentUnknowns,
    pub levels: Levels,
    pub rows: Vec<ResidualRow>,
    pub whitened: Whitened,
    pub active: Vec<usize>,
    pub covariance: NormalMatrix,
}

/// Squares of whitened innovations beyond which one in a thousand sound ones lies, for two and three axes (chi-squared).
const OUTLIER: [f64; 2] = [13.8, 16.3];
/// Rounds of solving, weighing and sizing of the noises.
const ROUNDS: usize = 4;

const NO_STEP: AlignmentError = AlignmentError::NoFit { problem: "the normal equations cannot be solved" };

/// Iterates from the start.
pub(super) fn fit(problem: &AlignmentProblem, start: &AlignmentStart) -> Result<Fitted, AlignmentError> {
    let active = problem.active();
    let mut weights = Weights::default();
    let mut unknowns = problem.unknowns(start);
    let mut rows = problem.rows(&unknowns, &weights);
    if rows.len() < 6 {
        return Err(AlignmentError::TooFew {
            what: "pictures within the gyro's recording",
            count: rows.len(),
            least: 6,
        });
    }
    let primary = if problem.has_orientations() { ResidualKind::Orientation } else { ResidualKind::Up };
    let mut levels = first_levels(&rows, primary);
    for round in 0..ROUNDS {
        weigh(&rows, &levels, &mut weights);
        unknowns = descend(problem, unknowns, &weights, &levels, &active)?;
        rows = problem.rows(&unknowns, &weights);
        if round > 0 {
            let evaluations = if round == 1 { 50 } else { 20 };
            levels = most_likely(&rows, primary as usize, levels, evaluations);
            rescale_others(&rows, primary, &mut levels);
        }
    }
    weigh(&rows, &levels, &mut weights);
    unknowns = descend(problem, unknowns, &weights, &levels, &active)?;
    rows = problem.rows(&unknowns, &weights);
    let whitened = whiten(&rows, &levels).ok_or(NO_STEP)?;
    let doubted = whiten(&rows, &with_usual_walk(&rows, &levels)).ok_or(NO_STEP)?;
    let covariance = invert(&doubted.normal, &active, 0.0).ok_or(NO_STEP)?;
    Ok(Fitted { unknowns, levels, rows, whitened, active, covariance })
}

/// A usual walk is believed instead of a smaller one that was found, unless the residuals are against it by three standard deviations, which
/// is what is held against the covariance: twice the logarithm of the likelihoods' ratio.
const AGAINST: f64 = 9.0;

/// The noises with the walk that the covariance is to be stated by. Where the movement is slow, rotation and offset take some of the walk for
/// movement; what they took is missing in the residuals, so that too little of it is found just where they err most.
pub(super) fn with_usual_walk(rows: &[ResidualRow], levels: &Levels) -> Levels {
    let usual = Levels { walk: levels.walk.max(USUAL_WALK.0), ..*levels };
    if restricted(rows, &usual) - restricted(rows, levels) < AGAINST { usual } else { *levels }
}

/// Noises to begin with: the camera's by the differences of residuals that follow each other, which no slow error enters.
fn first_levels(rows: &[ResidualRow], primary: ResidualKind) -> Levels {
    let own: Vec<&ResidualRow> = rows.iter().filter(|r| r.kind == primary).collect();
    let mut steps: Vec<f64> = own
        .windows(2)
        .filter(|w| w[0].segment == w[1].segment)
        .map(|w| (w[1].residual - w[0].residual).norm() / (2f64.sqrt() * w[1].sigma))
        .collect();
    steps.sort_by(f64::total_cmp);
    // The first quartile, and that of the length of three (or two) standard normal numbers: most differences are wild where a third
    // of the poses is.
    let usual = if primary == ResidualKind::Orientation { 1.101 } else { 0.759 };
    let scale = steps.get(steps.len() / 4).map_or(1.0, |m| (m / usual).clamp(0.01, 300.0));
    let mut levels = Levels { scale: [1.0; 4], jitter_s: 5e-4, walk: 2e-3 };
    levels.scale[primary as usize] = scale;
    levels
}

/// Outliers lose weight, so that what they pull with falls with their distance (Cauchy's tail); all others keep it whole, so that the
/// covariance holds.
fn weigh(rows: &[ResidualRow], levels: &Levels, weights: &mut Weights) {
    let Some(whitened) = whiten(rows, levels) else { return };
    for (row, square) in rows.iter().zip(&whitened.squares) {
        let limit = if row.blind.is_some() { OUTLIER[0] } else { OUTLIER[1] };
        weights.set(row, if *square > limit { limit / square } else { 1.0 });
    }
}

/// The scales of kinds that the likelihood was not asked about: by their own scatter.
fn rescale_others(rows: &[ResidualRow], primary: ResidualKind, levels: &mut Levels) {
    let Some(whitened) = whiten(rows, levels) else { return };
    for kind in [ResidualKind::Up, ResidualKind::Level] {
        let (mut sum, mut freedom) = (0.0, 0.0);
        for (row, square) in
            rows.iter().zip(&whitened.squares).filter(|(r, _)| r.kind == kind && kind != primary)
        {
            sum += square * row.weight;
            freedom += row.freedom();
        }
        if freedom > 8.0 {
            let scale = &mut levels.scale[kind as usize];
            *scale = (*scale * (sum / freedom).sqrt().clamp(0.2, 5.0)).clamp(0.01, 300.0);
        }
    }
}

/// Damping of the steps, which begin near the minimum.
const DAMPING: Damping =
    Damping { first: 1e-9, rise: 30.0, rise_least: 1e-6, fall: 0.1, fall_least: 1e-9, steps: 12, tries: 8 };

/// Damped steps on the whitened residuals.
fn descend(
    problem: &AlignmentProblem,
    start: AlignmentUnknowns,
    weights: &Weights,
    levels: &Levels,
    active: &[usize],
) -> Result<AlignmentUnknowns, AlignmentError> {
    let per_row = |rows: &[ResidualRow]| cost(rows, levels) / rows.len() as f64;
    let rows = problem.rows(&start, weights);
    let mut is_solvable = true;
    let (end, _) = levenberg_marquardt(
        (start, rows),
        DAMPING,
        |(_, rows)| {
            let whitened = whiten(rows, levels);
            is_solvable &= whitened.is_some();
            whitened
        },
        |(at, rows), whitened, damping| {
            let inverse = invert(&whitened.normal, active, damping)?;
            let step = -(inverse * whitened.gradient);
            let mut next = at.plus(&step);
            next.settle(&problem.rows(&next, weights));
            let next_rows = problem.rows(&next, weights);
            // An offset that pushes pictures out of the recording must not look like progress.
            let is_whole = next_rows.len() * 10 >= rows.len() * 9;
            let is_last = active.iter().all(|&i| step[i].powi(2) <= 1e-6 * inverse[(i, i)]);
            let is_better = is_whole && per_row(&next_rows) <= per_row(rows) + 1e-9;
            is_better.then_some(Improvement { state: (next, next_rows), is_last })
        },
    );
    if is_solvable { Ok(end) } else { Err(NO_STEP) }
}
