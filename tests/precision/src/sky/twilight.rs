//! The sky of a sun near or below the horizon, integrated outright: three orders of scattering, the first by quadrature, the others by chance
//! directions. Air, haze and ozone are not the product's: other heights, another haze, other wavelengths, flat steps.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use crate::parts::even;

/// Radii of sea level and of the end of the air, kilometres.
const GROUND_KM: f64 = 6371.0;
const TOP_KM: f64 = 6471.0;
/// Vertical optical depths of molecules (Bodhaine 1999) and of 300 Dobson units of ozone at 630, 532 and 467 nm.
const MOLECULES: DVec3 = DVec3::new(0.0540, 0.1113, 0.1893);
const OZONE: DVec3 = DVec3::new(0.033, 0.020, 0.003);
/// Wavelengths over 532 nm to the power -1.3.
const HAZE_COLOUR: DVec3 = DVec3::new(0.803, 1.0, 1.185);
const HAZE_ALBEDO: f64 = 0.93;
const HAZE_G: f64 = 0.7;

const UP: usize = 12;
const AROUND: usize = 9;

/// Radiance by elevation and azimuth from the sun.
pub struct Twilight {
    sun: DVec3,
    nodes: Vec<DVec3>,
}

struct Air {
    /// Optical depth of haze over its height, 1/km.
    haze: DVec3,
    sun: DVec3,
}

impl Twilight {
    /// For that sun and turbidity.
    pub fn new(sun: DVec3, turbidity: f64) -> Self {
        const SAMPLES: u64 = 8;
        let air = Air { haze: (turbidity - 1.0) * MOLECULES.y / HAZE_KM * HAZE_COLOUR, sun };
        let eye = DVec3::Z * (GROUND_KM + 0.01);
        let node = |i: usize| {
            let elevation = ((i / AROUND) as f64 / (UP - 1) as f64).powf(1.5) * PI / 2.0;
            let azimuth = (i % AROUND) as f64 / (AROUND - 1) as f64 * PI + sun.y.atan2(sun.x);
            let d = super::direction(azimuth, elevation.max(0.004));
            let look = |s: u64| air.looked(eye, d, 1, i as u64 * SAMPLES + s);
            (0..SAMPLES).map(look).sum::<DVec3>() / SAMPLES as f64
        };
        Self { sun, nodes: (0..UP * AROUND).map(node).collect() }
    }

    /// Relative to the sun's irradiance above the air.
    pub fn radiance(&self, direction: DVec3) -> Vec3 {
        let elevation = direction.z.clamp(0.0, 1.0).asin();
        let up = (elevation / (PI / 2.0)).powf(1.0 / 1.5) * (UP - 1) as f64;
        let level = |v: DVec3| v.truncate().normalize_or(glam::DVec2::X);
        let apart = level(direction).dot(level(self.sun)).clamp(-1.0, 1.0).acos();
        let over = apart / PI * (AROUND - 1) as f64;
        let (i, j) = ((up as usize).min(UP - 2), (over as usize).min(AROUND - 2));
        let (u, v) = (up - i as f64, over - j as f64);
        let at = |i: usize, j: usize| self.nodes[i * AROUND + j];
        at(i, j).lerp(at(i, j + 1), v).lerp(at(i + 1, j).lerp(at(i + 1, j + 1), v), u).as_vec3()
    }
}

const MOLECULES_KM: f64 = 8.4;
const HAZE_KM: f64 = 2.0;

impl Air {
    /// Scattering by molecules and by haze, and all that is lost, 1/km.
    fn at(&self, place: DVec3) -> (DVec3, DVec3, DVec3) {
        let height = (place.length() - GROUND_KM).max(0.0);
        let molecules = MOLECULES / MOLECULES_KM * (-height / MOLECULES_KM).exp();
        let haze = self.haze * (-height / HAZE_KM).exp();
        let deviations = (height - 22.0) / 5.0;
        let ozone = OZONE / (5.0 * TAU.sqrt()) * (-0.5 * deviations * deviations).exp();
        (molecules, haze * HAZE_ALBEDO, molecules + haze + ozone)
    }

    /// Way to the top along a line; `None` where the sea is before it.
    fn way(place: DVec3, d: DVec3) -> Option<f64> {
        let along = place.dot(d);
        let inside = |radius: f64| along * along + radius * radius - place.length_squared();
        (along >= 0.0 || inside(GROUND_KM) < 0.0).then(|| inside(TOP_KM).max(0.0).sqrt() - along)
    }

    fn sunlit(&self, place: DVec3) -> DVec3 {
        const STEPS: u32 = 20;
        let Some(way) = Self::way(place, self.sun) else { return DVec3::ZERO };
        let depth: DVec3 = (0..STEPS)
            .map(|i| {
                let (from, to) = (f64::from(i) / f64::from(STEPS), f64::from(i + 1) / f64::from(STEPS));
                let middle = 0.5 * (from * from + to * to) * way;
                self.at(place + self.sun * middle).2 * ((to * to - from * from) * way)
            })
            .sum();
        (-depth).exp()
    }

    fn looked(&self, from: DVec3, d: DVec3, order: u32, seed: u64) -> DVec3 {
        let steps = [36_u32, 10, 5][order as usize - 1];
        let sea = |place: DVec3, d: DVec3| {
            let along = place.dot(d);
            -along - (along * along + GROUND_KM * GROUND_KM - place.length_squared()).max(0.0).sqrt()
        };
        let way = Self::way(from, d).unwrap_or_else(|| sea(from, d));
        let (mut sum, mut left) = (DVec3::ZERO, DVec3::ONE);
        for i in 0..steps {
            let (a, b) = (f64::from(i) / f64::from(steps), f64::from(i + 1) / f64::from(steps));
            let (length, place) = ((b * b - a * a) * way, from + d * (0.5 * (a * a + b * b) * way));
            let (molecules, haze, lost) = self.at(place);
            let turned = |cosine: f64| molecules * rayleigh(cosine) + haze * henyey(cosine);
            let mut gained = turned(d.dot(self.sun)) * self.sunlit(place);
            if order < 3 {
                let salt = seed.wrapping_mul(64) + u64::from(i);
                let (z, azimuth) = (2.0 * even(salt * 2) - 1.0, TAU * even(salt * 2 + 1));
                let side = (1.0 - z * z).sqrt();
                let other = DVec3::new(side * azimuth.cos(), side * azimuth.sin(), z);
                gained += turned(d.dot(other)) * (4.0 * PI) * self.looked(place, other, order + 1, salt);
            }
            let passed = (-lost * length).exp();
            sum += left * gained * (DVec3::ONE - passed) / lost.max(DVec3::splat(1e-12));
            left *= passed;
        }
        sum
    }
}

fn rayleigh(cosine: f64) -> f64 {
    3.0 / (16.0 * PI) * (1.0 + cosine * cosine)
}

fn henyey(cosine: f64) -> f64 {
    let g2 = HAZE_G * HAZE_G;
    (1.0 - g2) / (4.0 * PI * (1.0 + g2 - 2.0 * HAZE_G * cosine).powf(1.5))
}
