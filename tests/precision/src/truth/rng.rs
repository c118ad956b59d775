//! Random numbers: by hash for waves (the same at every resolution), a shifted lattice with a generator behind it for paths.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_pcg::{Pcg32, rand_core::SeedableRng};

/// Numbers of a path that come from the lattice; later ones come from the generator.
const LATTICE: usize = 6;

/// Mixes all bits (Stafford's variant 13, as in SplitMix64).
pub fn mix(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

fn unit(bits: u64) -> f64 {
    ((bits >> 11) as f64 + 0.5) / (1u64 << 53) as f64
}

/// Two independent standard normal numbers that belong to `key` (Box and Muller).
pub fn gauss_pair(seed: u64, key: &[i64]) -> [f64; 2] {
    let hash = key.iter().fold(mix(seed), |h, &k| mix(h ^ k as u64));
    let radius = (-2.0 * unit(hash).ln()).sqrt();
    let (sin, cos) = (TAU * unit(mix(hash))).sin_cos();
    [radius * cos, radius * sin]
}

/// Numbers of one path.
pub struct Path {
    lattice: [f64; LATTICE],
    next: usize,
    generator: Pcg32,
}

impl Path {
    /// Path `index` through pixel number `pixel`: a Kronecker lattice (Roberts 2018, R_d sequence) shifted at random for each pixel.
    pub fn new(seed: u64, pixel: u64, index: u64) -> Self {
        // Root of x^7 = x + 1.
        const PHI: f64 = 1.112_775_684_278_706;
        let shift = mix(seed ^ mix(pixel));
        let lattice = std::array::from_fn(|d| {
            let step = PHI.powi(-(d as i32 + 1));
            (unit(mix(shift.wrapping_add(d as u64))) + step * index as f64).fract()
        });
        Self { lattice, next: 0, generator: Pcg32::seed_from_u64(mix(shift ^ mix(index.wrapping_add(77)))) }
    }

    /// The next number in (0, 1).
    pub fn unit(&mut self) -> f64 {
        let value = match self.lattice.get(self.next) {
            Some(&v) => v,
            None => self.generator.random::<f64>(),
        };
        self.next += 1;
        value.clamp(1e-12, 1.0 - 1e-12)
    }
}
