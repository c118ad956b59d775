//! How brightness goes with slope, read off the picture itself.
//!
//! Stilwell 1969 (J. Geophys. Res. 74, 1974) took the slopes of waves from the brightness of photographs with a computed
//! reflection of the sky. Here the water's own mean brightness calibrates: water tilted towards the eye by a small angle is
//! met by the ray as level water is that lies by this angle deeper under the horizon, so the fall of mean brightness with
//! depression is the greater part of the fall with slope. What remains is that a tilted facet mirrors the sky at twice the
//! tilt: the sky's gradient once more, from the rows above the horizon.

use super::grid::Cell;

/// Terms of the fitted profile.
const TERMS: usize = 6;

/// Mean brightness of water by depression and azimuth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Profile {
    coefficients: [f64; TERMS],
    /// Root mean square misfit of the logarithm.
    pub misfit: f64,
}

fn basis(depression: f64, side: f64) -> [f64; TERMS] {
    let l = (depression / 0.2).ln();
    [1.0, l, l * l, l * l * l, side, side * side]
}

impl Profile {
    /// Least squares fit to the logarithms of the patches' mean luminances; patches without one are NaN.
    pub fn fit(cells: &[Cell], means: &[f64]) -> Option<Self> {
        let mut normal = [[0.0; TERMS + 1]; TERMS];
        let points = || {
            cells.iter().zip(means).filter(|(_, m)| m.is_finite() && **m > 0.0).map(|(c, m)| (c, m.ln()))
        };
        for (cell, log) in points() {
            let b = basis(cell.depression, cell.side);
            for i in 0..TERMS {
                for j in 0..TERMS {
                    normal[i][j] += b[i] * b[j];
                }
                normal[i][TERMS] += b[i] * log;
            }
        }
        let count = points().count();
        if count < 4 * TERMS {
            return None;
        }
        for (i, row) in normal.iter_mut().enumerate() {
            row[i] += 1e-6 * count as f64;
        }
        let coefficients = solve(normal)?;
        let mut profile = Self { coefficients, misfit: 0.0 };
        let square: f64 = points().map(|(c, log)| (log - profile.log_at(c)).powi(2)).sum();
        profile.misfit = (square / count as f64).sqrt();
        Some(profile)
    }

    fn log_at(&self, cell: &Cell) -> f64 {
        basis(cell.depression, cell.side).iter().zip(self.coefficients).map(|(b, c)| b * c).sum()
    }

    /// Derivative of the logarithm of brightness by the depression, per radian.
    pub fn by_depression(&self, depression: f64) -> f64 {
        let l = (depression / 0.2).ln();
        let c = &self.coefficients;
        (c[1] + 2.0 * c[2] * l + 3.0 * c[3] * l * l) / depression
    }
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
