//! The sky over the sea: Hosek and Wilkie's clear sky with a layer of clouds that stand still in the world, so that the
//! heading can be seen in the picture.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::{
    looped::split,
    noise::{fractal_noise, gradient_noise, smoothstep},
    random::mix,
    sky::ClearSky,
};

/// Linear colour; the fourth number is free for the user.
pub type Rgb = [f32; 3];

/// Sun, air and clouds of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyRecipe {
    /// Sun's azimuth, radians clockwise from north.
    pub sun_azimuth: f64,
    /// Sun's elevation, radians, above 0.
    pub sun_elevation: f64,
    /// How hazy the air is: 1 (pure) to 10.
    pub turbidity: f64,
    /// Share of the sky under clouds, 0 to 1.
    pub cloud_cover: f64,
}

/// Sine of the elevation below which the clear sky is a pale band.
const PALE: f32 = 0.07;

/// The sky as a function of direction.
pub struct CloudySky {
    clear: ClearSky,
    scale: f32,
    /// Unit vector towards the sun.
    pub sun: Vec3,
    /// Light of the sun on a surface that faces it, in the picture's units (radiance times steradians).
    pub sun_irradiance: Rgb,
    threshold: f32,
    seed: u32,
}

impl CloudySky {
    /// `None` where the recipe's numbers are outside what the model covers.
    pub fn new(recipe: &SkyRecipe, seed: u64) -> Option<Self> {
        let elevation = (recipe.sun_elevation as f32).clamp(0.01, FRAC_PI_2 - 0.01);
        let clear = ClearSky::new(elevation, recipe.turbidity as f32, [0.06, 0.08, 0.1])?;
        let (sin_a, cos_a) = (recipe.sun_azimuth as f32).sin_cos();
        let (sin_e, cos_e) = elevation.sin_cos();
        let sun = Vec3::new(sin_a * cos_e, cos_a * cos_e, sin_e);
        let mut sky = Self {
            clear,
            scale: 1.0,
            sun,
            sun_irradiance: [0.0; 3],
            // The noise's distribution is about normal with a deviation of 0.27.
            threshold: 0.62 * (0.5 - recipe.cloud_cover as f32),
            seed: mix(seed ^ 0xc10d) as u32,
        };
        // The camera's automatic exposure: the lower sky, all around, a little under middle white.
        let around: f32 = (0..72)
            .map(|i| {
                let a = i as f32 * TAU / 72.0;
                luminance(sky.clear(Vec3::new(a.sin(), a.cos(), 0.14).normalize()))
            })
            .sum();
        sky.scale = 0.55 / (around / 72.0).max(1e-6);
        // Direct light against the lower sky's radiance on a clear day: about 12 at a high sun, reddened by its path
        // (Bird and Riordan 1986 give the ratio; optical depths of 0.13, 0.20 and 0.33).
        let path = 1.0 / sin_e.max(0.05);
        sky.sun_irradiance = [0.13f32, 0.20, 0.33].map(|depth| 9.3 * (-depth * path).exp());
        Some(sky)
    }

    /// Radiance of the cloudless sky; directions below the horizon get the horizon's.
    pub fn clear(&self, direction: Vec3) -> Rgb {
        // The model yellows and darkens in its last degrees, where sea air scatters light into a pale band instead: below
        // `PALE` it is taken from there and whitened.
        let z = direction.z.clamp(0.0, 1.0);
        let theta = z.max(PALE).acos();
        let gamma = direction.dot(self.sun).clamp(-1.0, 1.0).acos();
        let model = self.clear.radiance(theta, gamma).map(|c| self.scale * c);
        let grey = 1.18 * luminance(model);
        let share = 0.75 * (1.0 - smoothstep(0.0, 2.2 * PALE, z));
        std::array::from_fn(|c| model[c] + share * (grey * [0.97, 1.05, 1.16][c] - model[c]))
    }

    /// Radiance with clouds; the sun's disc is not in it.
    pub fn radiance(&self, direction: Vec3) -> Rgb {
        let clear = self.clear(direction);
        let up = direction.z.max(0.0);
        // Distance to the layer over a round Earth, in units of its height.
        let reach = 1.0 / (up + 0.022);
        let (x, y) = (direction.x * reach, direction.y * reach);
        let (density, lit) = self.cloud(x, y);
        let horizon = self.haze(direction);
        // Far clouds drown in the haze.
        let fade = (-reach / 30.0).exp();
        let alpha = density * 0.92;
        let white = 0.60 + 0.62 * lit;
        let tint = [0.96, 0.99, 1.04];
        std::array::from_fn(|c| {
            let cloud = (0.86 * white * tint[c] + 0.10 * clear[c]) * fade + horizon[c] * (1.0 - fade);
            clear[c] + alpha * (cloud - clear[c])
        })
    }

    /// Light that haze adds along a long level line of sight.
    pub fn haze(&self, direction: Vec3) -> Rgb {
        let level = Vec3::new(direction.x, direction.y, 0.02).normalize_or(Vec3::Y);
        self.clear(level)
    }

    /// Opacity and brightness of the layer at a place in it (units of its height).
    fn cloud(&self, x: f32, y: f32) -> (f32, f32) {
        let s = self.seed;
        let warp = 0.35 * gradient_noise(x * 0.6, y * 0.6, s ^ 0x51);
        let shape = |x: f32, y: f32| {
            fractal_noise(x * 0.75 + warp, y * 0.75 - warp, 7, 0.55, s)
                + 0.40 * gradient_noise(x * 0.11, y * 0.11, s ^ 0x77)
        };
        let here = shape(x, y);
        let density = smoothstep(self.threshold, self.threshold + 0.30, here);
        if density <= 0.0 {
            return (0.0, 1.0);
        }
        // Less cloud towards the sun: more light.
        let step = 0.25;
        let towards = shape(x + step * self.sun.x, y + step * self.sun.y);
        (density, (0.75 + 1.6 * (here - towards) - 0.35 * density).clamp(0.0, 1.0))
    }
}

/// Relative luminance of a linear sRGB colour (IEC 61966-2-1).
pub fn luminance(c: Rgb) -> f32 {
    0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]
}

/// The upper hemisphere in small, for what the sea mirrors.
pub struct CloudyDome {
    texels: Vec<Vec4>,
}

const DOME_AROUND: usize = 180;
const DOME_UP: usize = 64;

impl CloudyDome {
    /// Of that sky.
    pub fn new(sky: &CloudySky) -> Self {
        // Clouds in cells of 2 by 1.4 degrees: 3 x 3 directions in each.
        let cell = |i: usize| {
            let (up, around) = (i / DOME_AROUND, i % DOME_AROUND);
            let mut sum = Vec4::ZERO;
            for (du, da) in (0..9).map(|s| ((s / 3) as f32 / 3.0 - 0.33, (s % 3) as f32 / 3.0 - 0.33)) {
                let elevation = ((up as f32 + du).max(0.0) / (DOME_UP - 1) as f32).min(1.0) * FRAC_PI_2;
                let azimuth = (around as f32 + da) * TAU / DOME_AROUND as f32;
                let (sin, cos) = elevation.sin_cos();
                let colour = sky.radiance(Vec3::new(azimuth.sin() * cos, azimuth.cos() * cos, sin));
                sum += Vec3::from(colour).extend(0.0) / 9.0;
            }
            sum
        };
        Self { texels: (0..DOME_AROUND * DOME_UP).into_par_iter().map(cell).collect() }
    }

    /// Bilinear radiance; below the horizon as far above it.
    pub fn at(&self, direction: Vec3) -> Vec4 {
        let elevation = direction.z.abs().min(1.0).asin();
        let azimuth = direction.x.atan2(direction.y).rem_euclid(TAU);
        let v = (elevation / FRAC_PI_2 * (DOME_UP - 1) as f32).min((DOME_UP - 1) as f32);
        let u = azimuth / TAU * DOME_AROUND as f32;
        let (iv, iu) = ((v as usize).min(DOME_UP - 2), u as usize % DOME_AROUND);
        let (fv, fu) = (v - iv as f32, u - u.floor());
        let next = (iu + 1) % DOME_AROUND;
        let row = |r: usize, c: usize| self.texels[r * DOME_AROUND + c];
        row(iv, iu).lerp(row(iv, next), fu).lerp(row(iv + 1, iu).lerp(row(iv + 1, next), fu), fv)
    }
}

/// The part of the sky that the camera sees, at its resolution: a cylinder of azimuth against the tangent of elevation.
pub struct Panorama {
    texels: Vec<Vec4>,
    columns: usize,
    rows: usize,
    azimuth_start: f32,
    columns_per_radian: f32,
    tangent_start: f32,
    rows_per_tangent: f32,
}

impl Panorama {
    /// `azimuth` may run over more than a turn's worth of numbers but not more than a turn; `tangent_max` is the highest
    /// tangent of elevation in view; `focal_px` the camera's focal length.
    pub fn new(sky: &CloudySky, azimuth: [f32; 2], tangent_max: f32, focal_px: f32) -> Self {
        let [start, end] = azimuth;
        let columns = (((end - start).min(TAU) * focal_px) as usize + 2).clamp(2, 8192);
        let tangent_start = -0.01;
        let rows = (((tangent_max - tangent_start) * focal_px) as usize + 2).clamp(2, 4096);
        let columns_per_radian = (columns - 1) as f32 / (end - start).clamp(1e-3, TAU);
        let rows_per_tangent = (rows - 1) as f32 / (tangent_max - tangent_start).max(1e-3);
        let texels = (0..rows * columns)
            .into_par_iter()
            .map(|i| {
                let azimuth = start + (i % columns) as f32 / columns_per_radian;
                let tangent = tangent_start + (i / columns) as f32 / rows_per_tangent;
                Vec3::from(sky.radiance(Vec3::new(azimuth.sin(), azimuth.cos(), tangent).normalize()))
                    .extend(0.0)
            })
            .collect();
        Self {
            texels,
            columns,
            rows,
            azimuth_start: start,
            columns_per_radian,
            tangent_start,
            rows_per_tangent,
        }
    }

    /// Bilinear radiance at an azimuth (radians) and a tangent of elevation.
    #[inline(always)]
    pub fn at(&self, azimuth: f32, tangent: f32) -> Vec4 {
        let mut from_start = azimuth - self.azimuth_start;
        if from_start < 0.0 {
            from_start += TAU;
        } else if from_start > TAU {
            from_start -= TAU;
        }
        let limit = |x: f32, count: usize| x.clamp(0.0, (count - 1) as f32 - 1e-2);
        let u = limit(from_start * self.columns_per_radian, self.columns);
        let v = limit((tangent - self.tangent_start) * self.rows_per_tangent, self.rows);
        let ((iu, fu), (iv, fv)) = (split(u), split(v));
        let first = iv.min(self.rows - 2) * self.columns + iu.min(self.columns - 2);
        let lower = &self.texels[first..first + 2];
        let upper = &self.texels[first + self.columns..first + self.columns + 2];
        lower[0].lerp(lower[1], fu).lerp(upper[0].lerp(upper[1], fu), fv)
    }
}

/// Angle whose tangent is `t`, radians, to 2e-6 (odd minimax polynomial after folding at 1).
#[inline(always)]
pub fn arctangent(t: f32) -> f32 {
    let a = t.abs();
    let x = if a > 1.0 { 1.0 / a } else { a };
    let s = x * x;
    let p = x
        * (0.999_977_26
            + s * (-0.332_623_47
                + s * (0.193_543_46 + s * (-0.116_432_87 + s * (0.052_653_32 - s * 0.011_721_2)))));
    let angle = if a > 1.0 { 0.5 * PI - p } else { p };
    if t < 0.0 { -angle } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sky() -> CloudySky {
        let recipe = SkyRecipe { sun_azimuth: 1.2, sun_elevation: 0.6, turbidity: 3.0, cloud_cover: 0.4 };
        CloudySky::new(&recipe, 1).unwrap()
    }

    #[test]
    fn everywhere_finite_and_bright_enough_to_expose() {
        let sky = sky();
        for i in 0..500 {
            let (a, z) = (i as f32 * 0.7, (i as f32 * 0.137).fract());
            let direction = Vec3::new(a.sin(), a.cos(), z * 3.0).normalize();
            for value in sky.radiance(direction) {
                assert!(value.is_finite() && (0.01..20.0).contains(&value), "{direction} {value}");
            }
        }
    }

    #[test]
    fn panorama_and_dome_hold_the_sky() {
        let sky = sky();
        let panorama = Panorama::new(&sky, [-0.4, 0.4], 0.3, 800.0);
        let direction = Vec3::new(0.2f32.sin(), 0.2f32.cos(), 0.15);
        let (got, expected) = (panorama.at(0.2, 0.15), sky.radiance(direction.normalize()));
        assert!((got[1] - expected[1]).abs() < 0.02, "{got:?} {expected:?}");
        let cloudless = CloudySky { threshold: 9.0, ..sky };
        let up = Vec3::new(-0.3, 0.5, 0.6).normalize();
        let (got, expected) = (CloudyDome::new(&cloudless).at(up), cloudless.clear(up));
        assert!((got[2] / expected[2] - 1.0).abs() < 0.02, "{got:?} {expected:?}");
    }

    #[test]
    fn arctangent_is_close() {
        for i in -2000..2000 {
            let t = i as f32 * 0.01;
            assert!((arctangent(t) - t.atan()).abs() < 1e-5, "{t}");
        }
    }
}
