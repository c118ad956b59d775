//! Chance that follows from a seed and what is drawn for: any draw can be made without those before it.

/// A number from 0 up to, but not, 1 that follows from a seed and two numbers of what is drawn for.
///
/// Each is mixed in by the finaliser of SplitMix64 (Steele, Lea and Flood 2014), so that neighbours in any of them are independent.
pub fn drawn(seed: u64, about: [u64; 2]) -> f64 {
    let mixed = about.into_iter().fold(mix(seed), |state, number| mix(state ^ mix(number)));
    // As many bits as a double has.
    (mixed >> 11) as f64 * (0.5_f64).powi(53)
}

const fn mix(number: u64) -> u64 {
    let mut z = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_of_neighbours_are_spread_evenly_and_independent() {
        let series: [fn(u64) -> f64; 3] = [|i| drawn(i, [3, 5]), |i| drawn(7, [i, 0]), |i| drawn(7, [0, i])];
        for draw in series {
            let values: Vec<f64> = (0..100_000).map(draw).collect();
            for tenth in 0..10 {
                let low = f64::from(tenth) / 10.0;
                let count = values.iter().filter(|v| (low..low + 0.1).contains(*v)).count();
                // Five standard deviations.
                assert!((9526..10_474).contains(&count), "{count} in {low}");
            }
            let product: f64 = values.windows(2).map(|w| (w[0] - 0.5) * (w[1] - 0.5)).sum::<f64>() / 1e5;
            assert!(product.abs() < 5.0 / 12.0 / 316.0, "{product}");
        }
    }
}
