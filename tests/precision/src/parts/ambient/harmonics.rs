//! Real spherical harmonics of any order, and the window that keeps low orders from ringing.

use std::{f64::consts::PI, sync::OnceLock};

use glam::DVec3;

use super::{STORED, spiral};

/// Most bands of the table.
pub const BANDS: usize = 5;

/// Coefficients of harmonics up to an order: bands 0 to `order - 1`.
pub const fn count(order: usize) -> usize {
    order * order
}

/// Values of all real harmonics up to an order at a unit direction, orthonormal over the sphere.
pub fn values(order: usize, d: DVec3) -> Vec<f64> {
    let mut out = vec![0.0; count(order)];
    // Legendre functions P_l^m over sin^m, by the usual recurrence; sin^m goes into the powers of x + i y.
    let (mut cos, mut sin) = (1.0, 0.0);
    let mut first = 1.0;
    for m in 0..order {
        if m > 0 {
            (cos, sin) = (cos * d.x - sin * d.y, sin * d.x + cos * d.y);
            first *= -((2 * m - 1) as f64);
        }
        let (mut before, mut here) = (0.0, first);
        for l in m..order {
            if l > m {
                let next = (d.z * (2 * l - 1) as f64 * here - (l + m - 1) as f64 * before) / (l - m) as f64;
                (before, here) = (here, next);
            }
            let falling: f64 = (l - m + 1..=l + m).map(|k| k as f64).product();
            let norm = ((2 * l + 1) as f64 / (4.0 * PI * falling)).sqrt();
            let middle = l * l + l;
            if m == 0 {
                out[middle] = norm * here;
            } else {
                let root = std::f64::consts::SQRT_2 * norm * here;
                (out[middle + m], out[middle - m]) = (root * cos, root * sin);
            }
        }
    }
    out
}

/// Values of [`BANDS`] bands at the directions by which light and transfers are stored. The first coefficients are those of fewer bands.
pub fn table() -> &'static [Vec<f64>] {
    static TABLE: OnceLock<Vec<Vec<f64>>> = OnceLock::new();
    TABLE.get_or_init(|| spiral(STORED).map(|d| values(BANDS, d)).collect())
}

/// Factor of each coefficient by the Hann window that ends one band beyond the last (Sloan 2008).
pub fn window(order: usize) -> Vec<f64> {
    let of_band = |l: usize| 0.5 * (1.0 + (PI * l as f64 / order as f64).cos());
    (0..order).flat_map(|l| std::iter::repeat_n(of_band(l), 2 * l + 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parts::ambient::spiral;

    #[test]
    fn harmonics_are_orthonormal() {
        const ORDER: usize = 5;
        let directions: Vec<DVec3> = spiral(20_000).collect();
        let mut sums = vec![0.0; count(ORDER) * count(ORDER)];
        for d in &directions {
            let y = values(ORDER, *d);
            for (i, a) in y.iter().enumerate() {
                for (j, b) in y.iter().enumerate() {
                    sums[i * count(ORDER) + j] += a * b * 4.0 * PI / directions.len() as f64;
                }
            }
        }
        for (at, sum) in sums.iter().enumerate() {
            let right = if at / count(ORDER) == at % count(ORDER) { 1.0 } else { 0.0 };
            assert!((sum - right).abs() < 2e-3, "{} {}: {sum}", at / count(ORDER), at % count(ORDER));
        }
    }

    #[test]
    fn the_window_begins_at_one_and_falls() {
        let window = window(4);
        assert_eq!((window.len(), window[0]), (16, 1.0));
        assert!(window.windows(2).all(|pair| pair[1] <= pair[0]) && window[15] > 0.1);
    }
}
