//! Order statistics and robust weights.

/// Tukey's biweight is 95 % efficient on normal errors where it ends at this many deviations (Holland & Welsch 1977).
pub const BIWEIGHT_END: f64 = 4.685;

/// Tukey's biweight of an error `off`, where errors have the deviation `scatter`: 1 for none, 0 from [`BIWEIGHT_END`] deviations on.
pub fn biweight(off: f64, scatter: f64) -> f64 {
    let share = off / (BIWEIGHT_END * scatter);
    if share.abs() < 1.0 { (1.0 - share * share).powi(2) } else { 0.0 }
}

/// The value below which `share` of those that are numbers lie, between neighbours by a line; zero of nothing.
pub fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut all: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    let place = share.clamp(0.0, 1.0) * all.len().saturating_sub(1) as f64;
    let (low, high) = (place.floor() as usize, place.ceil() as usize);
    match (all.get(low), all.get(high)) {
        (Some(a), Some(b)) => a + (b - a) * place.fract(),
        _ => 0.0,
    }
}

/// Share of a normal distribution that lies below so many deviations, within 2e-7 (Abramowitz & Stegun 1964, 7.1.26).
pub fn normal_share(deviations: f64) -> f64 {
    const SLOPE: f64 = 0.327_591_1;
    const TERMS: [f64; 5] = [0.254_829_592, -0.284_496_736, 1.421_413_741, -1.453_152_027, 1.061_405_429];
    let x = deviations.abs() * std::f64::consts::FRAC_1_SQRT_2;
    let t = 1.0 / (1.0 + SLOPE * x);
    let beyond = 0.5 * (-x * x).exp() * t * TERMS.iter().rev().fold(0.0, |sum, term| sum * t + term);
    if deviations < 0.0 { beyond } else { 1.0 - beyond }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_distribution_is_that_of_tables() {
        for (deviations, share) in
            [(0.0, 0.5), (1.0, 0.841_344_7), (-1.0, 0.158_655_3), (1.644_854, 0.95), (-3.0, 0.001_349_9)]
        {
            assert!((normal_share(deviations) - share).abs() < 3e-7, "{deviations}");
        }
        assert_eq!([normal_share(f64::NEG_INFINITY), normal_share(f64::INFINITY)], [0.0, 1.0]);
    }

    #[test]
    fn a_biweight_falls_to_nothing() {
        assert_eq!([biweight(0.0, 2.0), biweight(-9.37, 2.0), biweight(1e9, 2.0)], [1.0, 0.0, 0.0]);
        assert!((biweight(2.3425, 1.0) - 0.5625).abs() < 1e-12);
    }

    #[test]
    fn between_neighbours_by_a_line() {
        let of = |share| quantile([3.0, f64::NAN, 1.0, 2.0, 4.0].into_iter(), share);
        assert_eq!([of(0.0), of(0.5), of(1.0), of(0.1)], [1.0, 2.5, 4.0, 1.3]);
        assert_eq!(quantile([].into_iter(), 0.5), 0.0);
    }
}
