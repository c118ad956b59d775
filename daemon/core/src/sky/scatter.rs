//! Light that was scattered more than once, as if evenly to all sides: Hillaire 2020, section 5.5.

use std::{
    f64::consts::{PI, TAU},
    sync::OnceLock,
};

use glam::DVec3;

use super::air::{
    GROUND_M, HAZE_ALBEDO, RAYLEIGH, TOP_M, along, densities, depth, haze, mixed, share_of_radius, through,
    way_to_sea, way_to_top,
};

/// Reflectance of the sea below, on the average.
const SEA_ALBEDO: f64 = 0.06;

const HEIGHTS: usize = 10;
const SUNS: usize = 32;
/// Sine of the sun's elevation at which the table begins; no light is left below.
const LOWEST: f64 = -0.35;
/// Within so much of the horizon nodes lie about evenly, farther off ever farther apart.
const NEAR: f64 = 0.04;

/// Sine of the sun's elevation at a share of the table, and back.
fn sun_of_share(share: f64) -> f64 {
    let (low, high) = ((LOWEST / NEAR).asinh(), (1.0 / NEAR).asinh());
    NEAR * (low + (high - low) * share).sinh()
}

fn share_of_sun(sine: f64) -> f64 {
    let (low, high) = ((LOWEST / NEAR).asinh(), (1.0 / NEAR).asinh());
    ((sine / NEAR).asinh() - low) / (high - low)
}

/// Light scattered more than once, for the sun's irradiance above the air of 1.
pub(super) struct Multiple(Vec<DVec3>);

/// Turbidities that are tabled. Their logarithms are about evenly apart.
pub(super) const TABLED: [f64; 6] = [1.0, 1.25, 1.6, 2.1, 2.8, 4.0];

/// The table for the turbidity of that number in [`TABLED`].
pub(super) fn multiple(number: usize) -> &'static Multiple {
    static TABLES: [OnceLock<Multiple>; TABLED.len()] = [const { OnceLock::new() }; TABLED.len()];
    let number = number.min(TABLED.len() - 1);
    TABLES[number].get_or_init(|| Multiple::new(TABLED[number]))
}

/// Coefficients of scattering of all kinds where the densities are `of`, 1/m.
pub(super) fn scattering(of: DVec3, turbidity: f64) -> DVec3 {
    RAYLEIGH * of.x + haze(turbidity) * (HAZE_ALBEDO * of.y)
}

impl Multiple {
    fn new(turbidity: f64) -> Self {
        let cell = |i: usize| {
            let share = (i / SUNS) as f64 / (HEIGHTS - 1) as f64;
            let radius = GROUND_M + 20.0 + (TOP_M - GROUND_M - 40.0) * share.powi(3);
            let sun = sun_of_share((i % SUNS) as f64 / (SUNS - 1) as f64);
            at(radius, sun, turbidity)
        };
        Self((0..HEIGHTS * SUNS).map(cell).collect())
    }

    /// Radiance that scatters again at a height (radius from the Earth's middle, metres) where the sun's sine of elevation is `sun`.
    pub(super) fn at(&self, radius: f64, sun: f64) -> DVec3 {
        mixed(&self.0, (share_of_radius(radius), HEIGHTS), (share_of_sun(sun), SUNS))
    }
}

/// Second order from all sides and what each order passes on to the next: their geometric series.
fn at(radius: f64, sun: f64, turbidity: f64) -> DVec3 {
    const UP: u32 = 6;
    const AROUND: u32 = 4;
    const STEPS: u32 = 14;
    let sun_side = (1.0 - sun * sun).max(0.0).sqrt();
    let (mut second, mut passed) = (DVec3::ZERO, DVec3::ZERO);
    for i in 0..UP * AROUND {
        let sine = (2.0 * f64::from(i / AROUND) + 1.0) / f64::from(UP) - 1.0;
        // The sun's side and the other are alike to right and left.
        let azimuth = (f64::from(i % AROUND) + 0.5) / f64::from(AROUND) * PI;
        let level = (1.0 - sine * sine).sqrt() * azimuth.cos();
        let sea = way_to_sea(radius, sine);
        let way = sea.unwrap_or_else(|| way_to_top(radius, sine));
        let mut left = DVec3::ONE;
        let mut last = 0.0;
        for step in 0..STEPS {
            let share = f64::from(step + 1) / f64::from(STEPS);
            let next = way * share * share;
            let (there, _) = along(radius, sine, 0.5 * (last + next));
            let of = densities(there - GROUND_M);
            // The sun's elevation there: the Earth is round.
            let towards = sun * radius + 0.5 * (last + next) * (sine * sun + level * sun_side);
            let lost = (-depth(of, turbidity) * (next - last)).exp();
            let scattered = scattering(of, turbidity) * (DVec3::ONE - lost)
                / depth(of, turbidity).max(DVec3::splat(1e-12));
            second += left * scattered * through(there, towards / there, turbidity) / (2.0 * TAU);
            passed += left * scattered;
            left *= lost;
            last = next;
        }
        if sea.is_some() {
            let (there, _) = along(radius, sine, way);
            let towards = (sun * radius + way * (sine * sun + level * sun_side)) / there;
            second += left * through(there, towards, turbidity) * (SEA_ALBEDO * towards.max(0.0) / PI);
        }
    }
    let count = f64::from(UP * AROUND);
    (second / count) / (DVec3::ONE - (passed / count).min(DVec3::splat(0.98)))
}
