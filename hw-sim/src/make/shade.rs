//! The light that comes from a patch of water: the sky mirrored in facets too small to see one by one, the sun's glitter,
//! the sea's own colour, foam.

use std::f32::consts::TAU;

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use crate::ocean::{
    cloudy::{CloudyDome, CloudySky, Rgb},
    fresnel::reflectance,
    looped::split,
};

/// Azimuths in the table; it closes around the compass.
const AZIMUTHS: usize = 72;
/// Stored azimuths; the last is the first again.
const STRIDE: usize = AZIMUTHS + 1;
/// Slopes along the line of sight in the table.
const SLOPES: usize = 72;
const SLOPE_MIN: f32 = -0.55;
const SLOPE_MAX: f32 = 0.75;

/// How fine the sea is at one range: what a pixel there cannot resolve.
#[derive(Clone, Copy, Debug)]
pub(super) struct Roughness {
    /// Sine of the angle at which the mean sea is seen.
    pub grazing: f32,
    /// Variances of the slopes not resolved: east, north, and their covariance.
    pub residual: [f32; 3],
}

impl Roughness {
    /// Deviations of the unresolved slopes along and across a line of sight towards (`east`, `north`).
    fn along_and_across(&self, east: f32, north: f32) -> (f32, f32) {
        let [ee, nn, en] = self.residual;
        let along = ee * east * east + nn * north * north + 2.0 * en * east * north;
        let across = ee * north * north + nn * east * east - 2.0 * en * east * north;
        (along.max(1e-5).sqrt(), across.max(1e-5).sqrt())
    }
}

/// Radiance of the water without the sun's glitter, by range, slope along the line of sight, and azimuth. The fourth
/// number is the mean projected area of the facets, per area of the mean sea.
pub(super) struct WaterTable {
    texels: Vec<Vec4>,
    ranges: usize,
}

/// One range of the table, between two of its rows.
#[derive(Clone, Copy)]
pub(super) struct Slice<'a> {
    near: &'a [Vec4],
    far: &'a [Vec4],
    fraction: f32,
}

impl WaterTable {
    /// Sums over visible facets for each of `rows`.
    pub fn new(rows: &[Roughness], dome: &CloudyDome, upwelling: Rgb) -> Self {
        let facets = facets();
        let texels = (0..rows.len() * SLOPES * STRIDE)
            .into_par_iter()
            .map(|i| {
                let (azimuth, slope, range) = (i % STRIDE, i / STRIDE % SLOPES, i / (STRIDE * SLOPES));
                let angle = azimuth as f32 * TAU / AZIMUTHS as f32;
                let slope = SLOPE_MIN + slope as f32 * (SLOPE_MAX - SLOPE_MIN) / (SLOPES - 1) as f32;
                water(&rows[range], angle, slope, &facets, dome, upwelling)
            })
            .collect();
        Self { texels, ranges: rows.len() }
    }

    /// The table at a range between rows `row` and the next.
    pub fn slice(&self, row: f32) -> Slice<'_> {
        let row = row.clamp(0.0, (self.ranges - 1) as f32);
        let first = (row as usize).min(self.ranges.saturating_sub(2));
        let size = SLOPES * STRIDE;
        let take = |r: usize| &self.texels[r * size..(r + 1) * size];
        Slice { near: take(first), far: take((first + 1).min(self.ranges - 1)), fraction: row - first as f32 }
    }
}

impl Slice<'_> {
    /// Trilinear value for a slope along the line of sight and an azimuth in table columns (0 north, growing eastwards).
    #[inline(always)]
    pub fn at(&self, slope: f32, column: f32) -> Vec4 {
        const PER_SLOPE: f32 = (SLOPES - 1) as f32 / (SLOPE_MAX - SLOPE_MIN);
        let s = ((slope - SLOPE_MIN) * PER_SLOPE).clamp(0.0, (SLOPES - 1) as f32 - 1e-3);
        let column = if column < 0.0 { column + AZIMUTHS as f32 } else { column };
        let ((is, fs), (ia, fa)) = (split(s), split(column));
        // The stored row is one longer than the circle, so that its end meets its start.
        let a0 = if ia >= AZIMUTHS { ia - AZIMUTHS } else { ia };
        let low = is.min(SLOPES - 2) * STRIDE + a0.min(AZIMUTHS - 1);
        let bilinear = |t: &[Vec4]| -> Vec4 {
            let (lower, upper) = (&t[low..low + 2], &t[low + STRIDE..low + STRIDE + 2]);
            lower[0].lerp(lower[1], fa).lerp(upper[0].lerp(upper[1], fa), fs)
        };
        bilinear(self.near).lerp(bilinear(self.far), self.fraction)
    }
}

/// Table columns per radian of azimuth.
pub(super) const COLUMNS_PER_RADIAN: f32 = AZIMUTHS as f32 / TAU;

/// Points and weights that stand for a normal distribution in two dimensions, in deviations.
fn facets() -> Vec<(f32, f32, f32)> {
    let mut all = Vec::new();
    for a in -5..=5 {
        for c in -2..=2 {
            let (x, y) = (a as f32 * 0.5, c as f32 * 0.9);
            all.push((x, y, (-0.5 * (x * x + y * y)).exp()));
        }
    }
    let total: f32 = all.iter().map(|f| f.2).sum();
    all.iter_mut().for_each(|f| f.2 /= total);
    all
}

fn water(
    row: &Roughness,
    azimuth: f32,
    slope: f32,
    facets: &[(f32, f32, f32)],
    dome: &CloudyDome,
    upwelling: Rgb,
) -> Vec4 {
    let (east, north) = azimuth.sin_cos();
    let sin = row.grazing;
    let cos = (1.0 - sin * sin).max(0.0).sqrt();
    let to_eye = Vec3::new(-cos * east, -cos * north, sin);
    let (sigma_along, sigma_across) = row.along_and_across(east, north);
    let (mut sum, mut seen) = (Vec4::ZERO, 0.0f32);
    let upwelling = Vec4::new(upwelling[0], upwelling[1], upwelling[2], 0.0);
    for &(x, y, weight) in facets {
        let (along, across) = (slope + x * sigma_along, y * sigma_across);
        // Slope vector in the world: `along` rises away from the eye, `across` rises to its right.
        let (se, sn) = (along * east + across * north, along * north - across * east);
        let facet = Vec3::new(-se, -sn, 1.0);
        // Projected area of the facet per area of the mean sea. The small remainder keeps slopes that face away defined.
        let area = facet.dot(to_eye).max(1e-4);
        let normal = facet.normalize();
        let cos_i = normal.dot(to_eye).max(1e-4);
        let mirrored = 2.0 * cos_i * normal - to_eye;
        let f = reflectance(cos_i);
        let sky = dome.at(mirrored);
        // Light that is thrown down meets the sea again: it shows the sky once more dimmed.
        let again = if mirrored.z < 0.0 { reflectance(-mirrored.z).max(0.25) } else { 1.0 };
        sum += weight * area * (f * again * sky + (1.0 - f) * upwelling);
        seen += weight * area;
    }
    (sum / seen).with_w(seen)
}

/// The sun's glitter at one range and azimuth (Cox and Munk 1954, eq. 4, with the projected area of the facets that are
/// seen in place of the mean sea's).
#[derive(Clone, Copy)]
pub(super) struct Glitter {
    /// Slopes along and across the line of sight that throw the sun into the eye.
    along: f32,
    across: f32,
    inverse_along: f32,
    inverse_across: f32,
    /// Reflected sunlight times the distribution's peak.
    strength: f32,
}

impl Glitter {
    pub fn new(row: &Roughness, east: f32, north: f32, sky: &CloudySky) -> Self {
        let sin = row.grazing;
        let cos = (1.0 - sin * sin).max(0.0).sqrt();
        let half = sky.sun + Vec3::new(-cos * east, -cos * north, sin);
        let half_z = half.z.max(1e-3);
        let (se, sn) = (-half.x / half_z, -half.y / half_z);
        let length = half.length();
        let (sigma_along, sigma_across) = row.along_and_across(east, north);
        // 1 / cos^4 of the facet's tilt.
        let tilt = 1.0 + se * se + sn * sn;
        let f = reflectance(0.5 * length);
        Self {
            along: se * east + sn * north,
            across: se * north - sn * east,
            inverse_along: 1.0 / sigma_along,
            inverse_across: 1.0 / sigma_across,
            strength: f * tilt * tilt / (4.0 * TAU * sigma_along * sigma_across),
        }
    }

    /// Whether any water that is likely to be met glitters: slopes that the tiles resolve stay below 0.45.
    pub fn within_reach(&self) -> bool {
        let spread = 4.0 / self.inverse_along.min(self.inverse_across);
        self.along.hypot(self.across) < 0.45 + spread
    }

    /// Share of the sun's irradiance that comes as radiance from water whose resolved slopes are these and whose facets'
    /// projected area is `area`.
    #[inline(always)]
    pub fn at(&self, along: f32, across: f32, area: f32) -> f32 {
        let x = (self.along - along) * self.inverse_along;
        let y = (self.across - across) * self.inverse_across;
        let exponent = 0.5 * (x * x + y * y);
        if exponent > 9.0 {
            return 0.0;
        }
        self.strength * (-exponent).exp() / area.max(0.02)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ocean::cloudy::SkyRecipe;

    fn sky() -> CloudySky {
        let recipe = SkyRecipe { sun_azimuth: 1.5, sun_elevation: 0.7, turbidity: 3.0, cloud_cover: 0.0 };
        CloudySky::new(&recipe, 1).unwrap()
    }

    fn row(grazing: f32, variance: f32) -> Roughness {
        Roughness { grazing, residual: [variance, variance, 0.0] }
    }

    #[test]
    fn flat_water_mirrors_the_sky_by_fresnel() {
        let (sky, upwelling) = (sky(), [0.01, 0.02, 0.03]);
        let dome = CloudyDome::new(&sky);
        let row = row(0.3, 0.0);
        let got = water(&row, 0.4, 0.0, &facets(), &dome, upwelling);
        let cos = (1.0f32 - 0.09).sqrt();
        let up = Vec3::new(cos * 0.4f32.sin(), cos * 0.4f32.cos(), 0.3);
        let f = reflectance(0.3);
        for c in 0..3 {
            let expected = f * sky.clear(up)[c] + (1.0 - f) * upwelling[c];
            assert!((got[c] / expected - 1.0).abs() < 0.03, "{got:?} {expected}");
        }
        assert!((got[3] - 0.3).abs() < 0.01, "{}", got[3]);
    }

    #[test]
    fn faces_turned_to_the_eye_are_darker() {
        let sky = sky();
        let dome = CloudyDome::new(&sky);
        let table = WaterTable::new(&[row(0.05, 0.004), row(0.02, 0.006)], &dome, [0.01, 0.02, 0.03]);
        let (back, face) = (table.slice(0.5).at(-0.02, 3.0), table.slice(0.5).at(0.3, 3.0));
        assert!(face[1] < 0.8 * back[1], "{face:?} {back:?}");
        assert!(face[3] > back[3]);
    }

    #[test]
    fn glitter_sums_to_the_mirrored_sun() {
        // Over all slopes, radiance times projected area is Fresnel times irradiance / (4 cos^4), weighted by the slopes.
        let sky = sky();
        let row = row(0.5, 0.01);
        let glitter = Glitter::new(&row, 0.2f32.sin(), 0.2f32.cos(), &sky);
        let mut sum = 0.0;
        let step = 0.01;
        for i in -200..200 {
            for j in -200..200 {
                let (a, c) = (i as f32 * step, j as f32 * step);
                sum += glitter.at(a, c, 1.0) * step * step;
            }
        }
        let tilt = 1.0 + glitter.along * glitter.along + glitter.across * glitter.across;
        let half = sky.sun + Vec3::new(-0.75f32.sqrt() * 0.2f32.sin(), -0.75f32.sqrt() * 0.2f32.cos(), 0.5);
        let expected = reflectance(0.5 * half.length()) * tilt * tilt / 4.0;
        assert!((sum / expected - 1.0).abs() < 0.01, "{sum} {expected}");
    }
}
