//! Where gusts ruffle the sea and where slicks smooth it: slow differences in roughness, tens to hundreds of metres long.

use std::f64::consts::TAU;

use crate::ocean::{
    looped::split,
    random::{stream, uniform},
};

const POINTS: usize = 256;
/// Side of the repeating square, metres.
const SIZE_M: f32 = 2400.0;
const WAVES: usize = 70;

/// Roughness relative to the mean, mean 0, deviation about 0.5, fixed in the world.
pub(super) struct Patches {
    values: Vec<f32>,
}

impl Patches {
    /// Metres from point to point.
    pub const SPACING_M: f32 = SIZE_M / POINTS as f32;

    /// Streaks along the wind, as gusts and windrows leave them.
    pub fn new(wind_from: f64, seed: u64) -> Self {
        let mut rng = stream(seed, 0x9a7c);
        let (along_e, along_n) = wind_from.sin_cos();
        let mut waves = Vec::with_capacity(WAVES);
        while waves.len() < WAVES {
            // Wavelengths from 45 m to the square's side, evenly over their logarithm.
            let cycles = (f64::from(SIZE_M) / 45.0).powf(uniform(&mut rng));
            let angle = TAU * uniform(&mut rng);
            let (i, j) = ((cycles * angle.cos()).round(), (cycles * angle.sin()).round());
            let length = i.hypot(j);
            if length < 1.0 {
                continue;
            }
            // Few waves with crests across the wind.
            let across = ((i * along_n - j * along_e) / length).abs();
            if uniform(&mut rng) > 0.15 + 0.85 * across.powi(2) {
                continue;
            }
            waves.push((i, j, TAU * uniform(&mut rng)));
        }
        let amplitude = 0.5 * (2.0 / WAVES as f64).sqrt();
        let values = (0..POINTS * POINTS)
            .map(|at| {
                let (x, y) = ((at % POINTS) as f64 / POINTS as f64, (at / POINTS) as f64 / POINTS as f64);
                let sum: f64 = waves.iter().map(|&(i, j, p)| (TAU * (i * x + j * y) + p).cos()).sum();
                (amplitude * sum) as f32
            })
            .collect();
        Self { values }
    }

    /// Bilinear value at a place in the world, metres.
    #[inline(always)]
    pub fn at(&self, east: f32, north: f32) -> f32 {
        const SCALE: f32 = POINTS as f32 / SIZE_M;
        let (u, v) = (east * SCALE, north * SCALE);
        let ((iu, fu), (iv, fv)) = (split(u), split(v));
        let values = &self.values[..POINTS * POINTS];
        let mask = POINTS - 1;
        let (x0, x1) = (iu & mask, iu.wrapping_add(1) & mask);
        let (y0, y1) = ((iv & mask) * POINTS, (iv.wrapping_add(1) & mask) * POINTS);
        let upper = values[y0 + x0] + fu * (values[y0 + x1] - values[y0 + x0]);
        let lower = values[y1 + x0] + fu * (values[y1 + x1] - values[y1 + x0]);
        upper + fv * (lower - upper)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_deviation_and_repetition() {
        let patches = Patches::new(0.3, 4);
        let n = patches.values.len() as f32;
        let mean = patches.values.iter().sum::<f32>() / n;
        let variance = patches.values.iter().map(|v| v * v).sum::<f32>() / n;
        assert!(mean.abs() < 1e-3 && (0.35..0.65).contains(&variance.sqrt()), "{mean} {variance}");
        assert!((patches.at(10.0, -700.0) - patches.at(10.0 + SIZE_M, -700.0)).abs() < 1e-3);
    }
}
