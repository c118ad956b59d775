//! Whether the water's mean brightness falls evenly towards the eye.
//!
//! Open water under any sky does; the sun's glitter, a shore, shallows or a wake do not. A smooth surface in depression and azimuth is
//! fitted; what differs from it is a measure of what does not belong.

use super::grid::Cell;

/// Terms of the fitted profile.
const TERMS: usize = 6;

fn basis(depression: f64, side: f64) -> [f64; TERMS] {
    let l = (depression / 0.2).ln();
    [1.0, l, l * l, l * l * l, side, side * side]
}

/// Root mean square misfit of the logarithms of the patches' mean luminances (NaN: not seen) to a smooth surface; `None` where
/// too few are seen.
pub(super) fn unevenness(cells: &[Cell], means: &[f64]) -> Option<f64> {
    let points: Vec<([f64; TERMS], f64)> = cells
        .iter()
        .zip(means)
        .filter(|(_, m)| m.is_finite() && **m > 0.0)
        .map(|(c, m)| (basis(c.depression, c.side), m.ln()))
        .collect();
    if points.len() < 4 * TERMS {
        return None;
    }
    let mut normal = [[0.0; TERMS + 1]; TERMS];
    for (b, log) in &points {
        for i in 0..TERMS {
            for j in 0..TERMS {
                normal[i][j] += b[i] * b[j];
            }
            normal[i][TERMS] += b[i] * log;
        }
    }
    for (i, row) in normal.iter_mut().enumerate() {
        // A long lens sees a narrow band: the higher powers are then held at nothing.
        row[i] += 1e-6 * points.len() as f64;
    }
    let coefficients = solve(normal)?;
    let misfit = |(b, log): &([f64; TERMS], f64)| {
        log - b.iter().zip(coefficients).map(|(b, c)| b * c).sum::<f64>()
    };
    Some((points.iter().map(|p| misfit(p).powi(2)).sum::<f64>() / points.len() as f64).sqrt())
}

/// Gauss and Jordan with pivots.
fn solve(mut m: [[f64; TERMS + 1]; TERMS]) -> Option<[f64; TERMS]> {
    for column in 0..TERMS {
        let pivot = (column..TERMS).max_by(|&a, &b| m[a][column].abs().total_cmp(&m[b][column].abs()))?;
        m.swap(column, pivot);
        let lead = m[column][column];
        if !lead.is_finite() || lead.abs() < 1e-12 {
            return None;
        }
        for row in 0..TERMS {
            if row != column {
                let factor = m[row][column] / lead;
                for k in column..=TERMS {
                    m[row][k] -= factor * m[column][k];
                }
            }
        }
    }
    Some(std::array::from_fn(|i| m[i][TERMS] / m[i][i]))
}
