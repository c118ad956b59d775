//! How large the noises are: most likely values by the filter's likelihood.

use super::filter::{Levels, ResidualRow, restricted};

/// Bounds: times the stated sigma, seconds of jitter, rad/sqrt(s) of walk.
const LOW: [f64; 3] = [1e-3, 1e-5, 1e-6];
const HIGH: [f64; 3] = [1e3, 0.05, 0.3];

fn levels(at: &[f64; 3], primary: usize, before: &Levels) -> Levels {
    let clamp = |i: usize| at[i].exp().clamp(LOW[i], HIGH[i]);
    let mut scale = before.scale;
    scale[primary] = clamp(0);
    Levels { scale, jitter_s: clamp(1), walk: clamp(2) }
}

/// Where the residuals tell nothing of the gyro's walk, because the camera is noisier by far, it is that of MEMS gyros: 0.1 to 1
/// deg/sqrt(h) from the best to the worst, here as the middle of a normal distribution of its logarithm and its standard deviation. Too
/// small a walk would make the bias look surer than it is.
pub(super) const USUAL_WALK: (f64, f64) = (1e-4, 1.0);

fn surprise(walk: f64) -> f64 {
    ((walk / USUAL_WALK.0).ln() / USUAL_WALK.1).powi(2)
}

/// Noises under which the residuals are most likely, from `start` on: the simplex method (Nelder & Mead 1965) over the
/// logarithms of the scale of the kind `primary`, the jitter and the walk.
pub(super) fn most_likely(rows: &[ResidualRow], primary: usize, start: Levels, evaluations: usize) -> Levels {
    let tell = |at: &[f64; 3]| {
        let levels = levels(at, primary, &start);
        restricted(rows, &levels) + surprise(levels.walk)
    };
    let first = [start.scale[primary].ln(), start.jitter_s.ln(), start.walk.ln()];
    let mut simplex = vec![(tell(&first), first)];
    for i in 0..3 {
        let mut at = first;
        at[i] += if i == 0 { 0.3 } else { 1.2 };
        simplex.push((tell(&at), at));
    }
    let mut left = evaluations;
    while left > 0 {
        simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (best, worst) = (simplex[0].0, simplex[3]);
        // A tenth of the log-likelihood's unit moves no noise by a tenth of its own error.
        if worst.0 - best < 0.02 {
            break;
        }
        let centre: [f64; 3] =
            std::array::from_fn(|i| simplex[..3].iter().map(|s| s.1[i]).sum::<f64>() / 3.0);
        let along =
            |k: f64| -> [f64; 3] { std::array::from_fn(|i| centre[i] + k * (worst.1[i] - centre[i])) };
        let mut tried = |k: f64| {
            left = left.saturating_sub(1);
            (tell(&along(k)), along(k))
        };
        let mirrored = tried(-1.0);
        if mirrored.0 < best {
            let far = tried(-2.0);
            simplex[3] = if far.0 < mirrored.0 { far } else { mirrored };
        } else if mirrored.0 < simplex[2].0 {
            simplex[3] = mirrored;
        } else {
            let inside = tried(if mirrored.0 < worst.0 { -0.5 } else { 0.5 });
            if inside.0 < worst.0.min(mirrored.0) {
                simplex[3] = inside;
            } else {
                let around = simplex[0].1;
                for s in &mut simplex[1..] {
                    s.1 = std::array::from_fn(|i| 0.5 * (s.1[i] + around[i]));
                    s.0 = tell(&s.1);
                }
                left = left.saturating_sub(3);
            }
        }
    }
    simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
    levels(&simplex[0].1, primary, &start)
}
