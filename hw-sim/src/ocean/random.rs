//! Random numbers: seeded streams for what is drawn once, hashes for what belongs to a key, and the numbers of a path of light.

use std::f64::consts::TAU;

use rand_pcg::{
    Pcg32, Pcg64,
    rand_core::{Rng, SeedableRng},
};

/// Numbers of a path that come from the lattice; later ones come from the generator.
const LATTICE: usize = 6;

/// The increment of SplitMix64, the golden ratio's fraction.
pub const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// Bijective scrambling of 64 bits (Steele, Lea and Flood 2014, SplitMix64; Stafford's variant 13).
pub fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(GOLDEN);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The number in [0, 1) that 53 of these bits stand for.
pub fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

/// The middle of the step that [`unit`] begins: never 0.
fn middle(bits: u64) -> f64 {
    ((bits >> 11) as f64 + 0.5) / (1u64 << 53) as f64
}

/// Two independent standard normal numbers from two uniform ones above 0 (Box and Muller 1958).
pub fn normal_pair(u: f64, v: f64) -> [f64; 2] {
    let radius = (-2.0 * u.ln()).sqrt();
    let (sin, cos) = (TAU * v).sin_cos();
    [radius * cos, radius * sin]
}

/// A stream of its own for each purpose of a seed, so that adding a draw to one leaves the others as they were.
pub fn stream(seed: u64, purpose: u64) -> Pcg64 {
    Pcg64::new(u128::from(mix(seed)) << 64 | u128::from(mix(seed ^ GOLDEN)), u128::from(mix(purpose)))
}

/// The next number of a stream, in [0, 1).
pub fn uniform(rng: &mut impl Rng) -> f64 {
    unit(rng.next_u64())
}

/// The next standard normal number of a stream. (Not the ziggurat of `rand_distr`: made recordings and published figures are those of
/// these draws.)
pub fn gaussian(rng: &mut impl Rng) -> f64 {
    let radius = (-2.0 * (1.0 - uniform(rng)).ln()).sqrt();
    radius * (TAU * uniform(rng)).cos()
}

/// Two independent standard normal numbers that belong to `key`.
pub fn gauss_pair(seed: u64, key: &[i64]) -> [f64; 2] {
    let hash = key.iter().fold(mix(seed), |h, &k| mix(h ^ k as u64));
    normal_pair(middle(hash), middle(mix(hash)))
}

/// The number in (0, 1) that belongs to `key`.
pub fn keyed_uniform(key: u64) -> f64 {
    unit(mix(key)) + f64::EPSILON / 8.0
}

/// Two independent standard normal numbers that belong to `key`.
pub fn keyed_normal(key: u64) -> [f64; 2] {
    let first = key.wrapping_mul(2);
    normal_pair(keyed_uniform(first), keyed_uniform(first.wrapping_add(1)))
}

/// Numbers of one path of light.
pub struct LightPath {
    lattice: [f64; LATTICE],
    next: usize,
    generator: Pcg32,
}

impl LightPath {
    /// Path `index` through pixel number `pixel`: a Kronecker lattice (Roberts 2018, R_d sequence) shifted at random for each pixel.
    pub fn new(seed: u64, pixel: u64, index: u64) -> Self {
        // Root of x^7 = x + 1.
        const PHI: f64 = 1.112_775_684_278_706;
        let shift = mix(seed ^ mix(pixel));
        let lattice = std::array::from_fn(|d| {
            let step = PHI.powi(-(d as i32 + 1));
            (middle(mix(shift.wrapping_add(d as u64))) + step * index as f64).fract()
        });
        Self { lattice, next: 0, generator: Pcg32::seed_from_u64(mix(shift ^ mix(index.wrapping_add(77)))) }
    }

    /// The next number in (0, 1).
    pub fn unit(&mut self) -> f64 {
        let value = match self.lattice.get(self.next) {
            Some(&v) => v,
            None => uniform(&mut self.generator),
        };
        self.next += 1;
        value.clamp(1e-12, 1.0 - 1e-12)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussians_have_unit_variance_and_streams_differ() {
        let mut a = stream(1, 2);
        let draws: Vec<f64> = (0..20_000).map(|_| gaussian(&mut a)).collect();
        let mean = draws.iter().sum::<f64>() / draws.len() as f64;
        let variance = draws.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / draws.len() as f64;
        assert!(mean.abs() < 0.03, "{mean}");
        assert!((variance - 1.0).abs() < 0.04, "{variance}");
        let first = |seed, purpose| stream(seed, purpose).next_u64();
        assert_ne!(first(1, 2), first(1, 3));
        assert_ne!(first(1, 2), first(2, 2));
        assert_eq!(first(7, 7), first(7, 7));
    }
}
