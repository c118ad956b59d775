//! Drag of the G7 standard projectile.

/// Mach number and drag coefficient of the G7 standard projectile (public BRL/JBM tabulation).
#[allow(clippy::approx_constant)] // 0.3010 is a measured drag, not a logarithm.
#[rustfmt::skip] // Several pairs a line.
const G7: [(f64, f64); 84] = [
    (0.000, 0.1198), (0.050, 0.1197), (0.100, 0.1196), (0.150, 0.1194), (0.200, 0.1193), (0.250, 0.1194),
    (0.300, 0.1194), (0.350, 0.1194), (0.400, 0.1193), (0.450, 0.1193), (0.500, 0.1194), (0.550, 0.1193),
    (0.600, 0.1194), (0.650, 0.1197), (0.700, 0.1202), (0.725, 0.1207), (0.750, 0.1215), (0.775, 0.1226),
    (0.800, 0.1242), (0.825, 0.1266), (0.850, 0.1306), (0.875, 0.1368), (0.900, 0.1464), (0.925, 0.1660),
    (0.950, 0.2054), (0.975, 0.2993), (1.000, 0.3803), (1.025, 0.4015), (1.050, 0.4043), (1.075, 0.4034),
    (1.100, 0.4014), (1.125, 0.3987), (1.150, 0.3955), (1.200, 0.3884), (1.250, 0.3810), (1.300, 0.3732),
    (1.350, 0.3657), (1.400, 0.3580), (1.500, 0.3440), (1.550, 0.3376), (1.600, 0.3315), (1.650, 0.3260),
    (1.700, 0.3209), (1.750, 0.3160), (1.800, 0.3117), (1.850, 0.3078), (1.900, 0.3042), (1.950, 0.3010),
    (2.000, 0.2980), (2.050, 0.2951), (2.100, 0.2922), (2.150, 0.2892), (2.200, 0.2864), (2.250, 0.2835),
    (2.300, 0.2807), (2.350, 0.2779), (2.400, 0.2752), (2.450, 0.2725), (2.500, 0.2697), (2.550, 0.2670),
    (2.600, 0.2643), (2.650, 0.2615), (2.700, 0.2588), (2.750, 0.2561), (2.800, 0.2533), (2.850, 0.2506),
    (2.900, 0.2479), (2.950, 0.2451), (3.000, 0.2424), (3.100, 0.2368), (3.200, 0.2313), (3.300, 0.2258),
    (3.400, 0.2205), (3.500, 0.2154), (3.600, 0.2106), (3.700, 0.2060), (3.800, 0.2017), (3.900, 0.1975),
    (4.000, 0.1935), (4.200, 0.1861), (4.400, 0.1793), (4.600, 0.1730), (4.800, 0.1672), (5.000, 0.1618),
];

/// Slopes of the interpolant at the table's points: Fritsch and Butland 1984 (as SciPy's `PchipInterpolator`).
///
/// The interpolant has neither kinks, which would cost the integrator its order, nor overshoot in the steep rise at Mach 1.
const SLOPES: [f64; G7.len()] = slopes();

const fn slopes() -> [f64; G7.len()] {
    let mut slopes = [0.0; G7.len()];
    let last = G7.len() - 1;
    let mut i = 1;
    while i < last {
        let (left_h, left) = interval(i - 1);
        let (right_h, right) = interval(i);
        if left * right > 0.0 {
            let (w1, w2) = (2.0 * right_h + left_h, right_h + 2.0 * left_h);
            slopes[i] = (w1 + w2) / (w1 / left + w2 / right);
        }
        i += 1;
    }
    slopes[0] = end_slope(interval(0), interval(1));
    slopes[last] = end_slope(interval(last - 1), interval(last - 2));
    slopes
}

/// Width and chord slope of the interval that starts at point `i`.
const fn interval(i: usize) -> (f64, f64) {
    let width = G7[i + 1].0 - G7[i].0;
    (width, (G7[i + 1].1 - G7[i].1) / width)
}

/// One-sided three-point slope, limited so that the interpolant stays monotone.
const fn end_slope((h0, d0): (f64, f64), (h1, d1): (f64, f64)) -> f64 {
    let slope = ((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);
    if slope * d0 <= 0.0 {
        0.0
    } else if d0 * d1 <= 0.0 && slope.abs() > 3.0 * d0.abs() {
        3.0 * d0
    } else {
        slope
    }
}

/// Drag coefficient of the G7 standard projectile at `mach`; the table's end values beyond its ends (0 and 5).
pub fn g7_drag_coefficient(mach: f64) -> f64 {
    let upper = G7.partition_point(|&(m, _)| m <= mach);
    if upper == 0 {
        return G7[0].1;
    }
    if upper == G7.len() {
        return G7[G7.len() - 1].1;
    }
    let i = upper - 1;
    let (width, chord) = interval(i);
    let t = (mach - G7[i].0) / width;
    // Cubic Hermite on the interval, in the form that needs the fewest operations.
    let (m0, m1) = (SLOPES[i], SLOPES[i + 1]);
    let (c, d) = (3.0 * chord - 2.0 * m0 - m1, m0 + m1 - 2.0 * chord);
    G7[i].1 + width * t * (m0 + t * (c + t * d))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::rows;

    #[test]
    fn holds_the_published_table() {
        let table = rows(include_str!("../../../data/drag_g7.csv"));
        assert_eq!(table.len(), G7.len());
        for (row, &(mach, cd)) in table.iter().zip(&G7) {
            assert_eq!((row[0], row[1]), (mach, cd));
            assert_eq!(g7_drag_coefficient(mach), cd);
        }
    }

    #[test]
    fn is_bounded_by_its_neighbours_everywhere() {
        for pair in G7.windows(2) {
            let (low, high) = (pair[0].1.min(pair[1].1), pair[0].1.max(pair[1].1));
            for i in 0..=100 {
                let mach = pair[0].0 + (pair[1].0 - pair[0].0) * f64::from(i) / 100.0;
                let cd = g7_drag_coefficient(mach);
                assert!((low - 1e-12..=high + 1e-12).contains(&cd), "mach {mach}: {cd}");
            }
        }
    }

    #[test]
    fn has_no_kinks() {
        let slope = |mach: f64| (g7_drag_coefficient(mach + 5e-7) - g7_drag_coefficient(mach - 5e-7)) / 1e-6;
        for &(mach, _) in &G7[1..G7.len() - 1] {
            let (before, after) = (slope(mach - 1e-5), slope(mach + 1e-5));
            assert!((before - after).abs() < 0.05, "mach {mach}: slope {before} then {after}");
        }
    }

    #[test]
    fn beyond_the_table_its_ends_hold() {
        for (mach, cd) in [(-1.0, 0.1198), (9.0, 0.1618), (f64::INFINITY, 0.1618)] {
            assert_eq!(g7_drag_coefficient(mach), cd);
        }
        assert!(g7_drag_coefficient(f64::NAN).is_finite());
    }
}
