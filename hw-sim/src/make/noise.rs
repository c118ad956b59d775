//! Random numbers: seeded streams for what is drawn once, hashed lattices for what is a function of place.

use rand_pcg::{Pcg64, rand_core::Rng};

/// A stream of its own for each purpose of a seed, so that adding a draw to one leaves the others as they were.
pub(super) fn stream(seed: u64, purpose: u64) -> Pcg64 {
    Pcg64::new(
        u128::from(mix(seed)) << 64 | u128::from(mix(seed ^ 0x9e37_79b9_7f4a_7c15)),
        u128::from(mix(purpose)),
    )
}

/// Uniform in [0, 1).
pub(super) fn uniform(rng: &mut Pcg64) -> f64 {
    (rng.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// Standard normal (Box and Muller 1958).
pub(super) fn gaussian(rng: &mut Pcg64) -> f64 {
    let radius = (-2.0 * (1.0 - uniform(rng)).ln()).sqrt();
    radius * (std::f64::consts::TAU * uniform(rng)).cos()
}

/// Bijective scrambling of 64 bits (Steele, Lea and Flood 2014, SplitMix64).
pub(super) fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Smooth noise on a unit lattice, mean 0, within -1 to 1 (Perlin 2002: gradients, quintic fade).
pub(super) fn gradient_noise(x: f32, y: f32, seed: u32) -> f32 {
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = (x - x0, y - y0);
    let (ix, iy) = (x0 as i32, y0 as i32);
    let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let corner = |dx: i32, dy: i32| {
        let (gx, gy) = lattice_gradient(ix.wrapping_add(dx), iy.wrapping_add(dy), seed);
        gx * (fx - dx as f32) + gy * (fy - dy as f32)
    };
    let (u, v) = (fade(fx), fade(fy));
    let top = corner(0, 0) + u * (corner(1, 0) - corner(0, 0));
    let bottom = corner(0, 1) + u * (corner(1, 1) - corner(0, 1));
    1.41 * (top + v * (bottom - top))
}

fn lattice_gradient(ix: i32, iy: i32, seed: u32) -> (f32, f32) {
    let mut h = (ix as u32).wrapping_mul(0x8da6_b343) ^ (iy as u32).wrapping_mul(0xd816_3841) ^ seed;
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
    h ^= h >> 15;
    // A point of the square, pushed to about unit length: cheaper than an angle and as good for clouds.
    let gx = (h & 0xffff) as f32 * (2.0 / 65_535.0) - 1.0;
    let gy = (h >> 16) as f32 * (2.0 / 65_535.0) - 1.0;
    let length = (gx * gx + gy * gy).sqrt().max(1e-3);
    (gx / length, gy / length)
}

/// Sum of `octaves` of [`gradient_noise`], each twice as fine and `gain` times as strong as the one before; about -1 to 1.
pub(super) fn fractal_noise(x: f32, y: f32, octaves: u32, gain: f32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut total) = (0.0, 1.0, 0.0);
    let (mut px, mut py) = (x, y);
    for octave in 0..octaves {
        sum += weight * gradient_noise(px, py, seed.wrapping_add(octave.wrapping_mul(0x68e3_1da4)));
        total += weight;
        weight *= gain;
        // Turned by an odd angle from octave to octave, so that lattice directions do not add up.
        (px, py) = (1.62 * px - 1.18 * py + 3.7, 1.18 * px + 1.62 * py - 1.3);
    }
    sum / total.max(1e-6)
}

/// Zero below `low`, one above `high`, smooth between.
pub(super) fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// How many deviations a normal variable exceeds with probability `p` (Abramowitz and Stegun 26.2.23), for p below 0.5.
pub(super) fn upper_quantile(p: f64) -> f64 {
    let t = (-2.0 * p.clamp(1e-9, 0.5).ln()).sqrt();
    t - (2.515_517 + t * (0.802_853 + t * 0.010_328))
        / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles() {
        for (p, expected) in [(0.158_655, 1.0), (0.022_750, 2.0), (0.001_350, 3.0)] {
            assert!((upper_quantile(p) - expected).abs() < 1e-3, "{p}");
        }
    }

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

    #[test]
    fn gradient_noise_is_continuous_across_lattice_lines() {
        for i in 0..200 {
            let y = i as f32 * 0.137 - 9.0;
            let x = (i % 11) as f32 - 5.0;
            let step = (gradient_noise(x - 1e-4, y, 5) - gradient_noise(x + 1e-4, y, 5)).abs();
            assert!(step < 2e-3, "{x} {y}: {step}");
        }
    }
}
