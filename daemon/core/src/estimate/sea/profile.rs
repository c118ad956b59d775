//! Whether the water's mean brightness falls evenly towards the eye.
//!
//! Open water under any sky does; the sun's glitter, a shore, shallows or a wake do not. A smooth surface in depression and azimuth is
//! fitted; what differs from it is a measure of what does not belong.

use super::{grid::SeaPatch, linear::solve};

/// Terms of the fitted profile.
const TERMS: usize = 6;

fn basis(depression: f64, side: f64) -> [f64; TERMS] {
    let l = (depression / 0.2).ln();
    [1.0, l, l * l, l * l * l, side, side * side]
}

/// Root mean square misfit of the logarithms of the patches' mean luminances (NaN: not seen) to a smooth surface; `None` where
/// too few are seen.
pub(super) fn unevenness(cells: &[SeaPatch], means: &[f64]) -> Option<f64> {
    let points: Vec<([f64; TERMS], f64)> = cells
        .iter()
        .zip(means)
        .filter(|(_, m)| m.is_finite() && **m > 0.0)
        .map(|(c, m)| (basis(c.depression, c.side), m.ln()))
        .collect();
    if points.len() < 4 * TERMS {
        return None;
    }
    let (mut normal, mut right) = ([[0.0; TERMS]; TERMS], [0.0; TERMS]);
    for (b, log) in &points {
        for i in 0..TERMS {
            for j in 0..TERMS {
                normal[i][j] += b[i] * b[j];
            }
            right[i] += b[i] * log;
        }
    }
    for (i, row) in normal.iter_mut().enumerate() {
        // A long lens sees a narrow band: the higher powers are then held at nothing.
        row[i] += 1e-6 * points.len() as f64;
    }
    let coefficients = solve(normal, right)?;
    let misfit =
        |(b, log): &([f64; TERMS], f64)| log - b.iter().zip(coefficients).map(|(b, c)| b * c).sum::<f64>();
    Some((points.iter().map(|p| misfit(p).powi(2)).sum::<f64>() / points.len() as f64).sqrt())
}
