//! A clear sky's radiance over the whole dome, for one place of the sun.

use glam::{DVec2, DVec3, Vec3};

use super::{
    air::{
        GROUND_M, HAZE_ALBEDO, HAZE_G, RAYLEIGH, along, cell, densities, depth, haze, sunlight, through,
        way_to_top,
    },
    model::{NIGHT, SkyModel},
    scatter::{TABLED, multiple, scattering},
};

/// Nodes of elevation and of azimuth from the sun.
const UP: usize = 24;
const AROUND: usize = 9;
/// Steps along a line of sight.
const STEPS: u32 = 28;
/// Height of the eye, metres.
const EYE_M: f64 = 10.0;

/// Light from a direction: light that molecules and haze scattered once, without how much of it they turn by that angle, and all other.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    molecules: Vec3,
    haze: Vec3,
    even: Vec3,
}

impl Seen {
    fn lerp(self, other: Self, share: f32) -> Self {
        Self {
            molecules: self.molecules.lerp(other.molecules, share),
            haze: self.haze.lerp(other.haze, share),
            even: self.even.lerp(other.even, share),
        }
    }
}

/// A clear sky, without the sun's disc.
#[derive(Clone, Debug)]
pub struct ClearSky {
    /// Unit vector towards the sun.
    sun: DVec3,
    nodes: Vec<Seen>,
    /// Sunlight on a surface at sea level that faces the sun.
    sunlight: Vec3,
}

impl ClearSky {
    /// Turbidities that a sky can be made for.
    pub const TURBIDITIES: [f64; TABLED.len()] = TABLED;

    /// The sky of the turbidity of that number in [`Self::TURBIDITIES`] under a sun towards `sun` (unit vector), wherever it stands.
    pub fn new(number: usize, sun: DVec3) -> Self {
        let number = number.min(TABLED.len() - 1);
        let node = |i: usize| {
            let share = (i / AROUND) as f64 / (UP - 1) as f64;
            let sine = sine_of_share(share);
            let azimuth = (i % AROUND) as f64 / (AROUND - 1) as f64 * std::f64::consts::PI;
            looked(number, sine, azimuth.cos(), sun.z)
        };
        Self { sun, nodes: (0..UP * AROUND).map(node).collect(), sunlight: sunlight(sun.z, TABLED[number]) }
    }
}

impl SkyModel for ClearSky {
    fn radiance(&self, direction: DVec3) -> Vec3 {
        let sine = direction.z.clamp(0.0, 1.0);
        let level = |v: DVec3| v.truncate().normalize_or(DVec2::X);
        let apart = level(direction).dot(level(self.sun)).clamp(-1.0, 1.0).acos();
        let (row, up) = cell(sine.powf(1.0 / SINE_POWER), UP);
        let (column, over) = cell(apart / std::f64::consts::PI, AROUND);
        let at = |row: usize, column: usize| self.nodes[row * AROUND + column];
        let low = at(row, column).lerp(at(row, column + 1), over as f32);
        let seen = low.lerp(at(row + 1, column).lerp(at(row + 1, column + 1), over as f32), up as f32);
        let cosine = direction.dot(self.sun).clamp(-1.0, 1.0);
        let light = seen.molecules * rayleigh_phase(cosine) + seen.haze * haze_phase(cosine) + seen.even;
        light + Vec3::splat(NIGHT)
    }

    fn sunlight(&self) -> Vec3 {
        self.sunlight
    }
}

/// Rows are closer together near the horizon.
const SINE_POWER: f64 = 2.0;

fn sine_of_share(share: f64) -> f64 {
    share.powf(SINE_POWER)
}

/// Light by molecules that is turned by an angle of that cosine, 1/sr.
fn rayleigh_phase(cosine: f64) -> f32 {
    (3.0 / (16.0 * std::f64::consts::PI) * (1.0 + cosine * cosine)) as f32
}

/// The same by haze: Cornette and Shanks 1992.
fn haze_phase(cosine: f64) -> f32 {
    let g2 = HAZE_G * HAZE_G;
    let scale = 3.0 / (8.0 * std::f64::consts::PI) * (1.0 - g2) / (2.0 + g2);
    (scale * (1.0 + cosine * cosine) / (1.0 + g2 - 2.0 * HAZE_G * cosine).powf(1.5)) as f32
}

/// Light along a line of sight of that sine of elevation, `level` being the cosine of its azimuth from the sun, whose sine of elevation is
/// `sun`.
fn looked(number: usize, sine: f64, level: f64, sun: f64) -> Seen {
    let (turbidity, radius) = (TABLED[number], GROUND_M + EYE_M);
    let more = multiple(number);
    let way = way_to_top(radius, sine);
    let between = sine * sun + level * ((1.0 - sine * sine).max(0.0) * (1.0 - sun * sun).max(0.0)).sqrt();
    let (mut left, mut last) = (DVec3::ONE, 0.0);
    let (mut molecules, mut by_haze, mut even) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for step in 0..STEPS {
        let share = f64::from(step + 1) / f64::from(STEPS);
        let next = way * share * share;
        let middle = 0.5 * (last + next);
        let (there, _) = along(radius, sine, middle);
        let of = densities(there - GROUND_M);
        let towards = ((sun * radius + middle * between) / there).clamp(-1.0, 1.0);
        let lost = depth(of, turbidity);
        let passed = (-lost * (next - last)).exp();
        // The step's own light is dimmed within it.
        let gained = left * (DVec3::ONE - passed) / lost.max(DVec3::splat(1e-12));
        let lit = through(there, towards, turbidity);
        molecules += gained * lit * RAYLEIGH * of.x;
        by_haze += gained * lit * haze(turbidity) * (HAZE_ALBEDO * of.y);
        even += gained * more.at(there, towards) * scattering(of, turbidity);
        (left, last) = (left * passed, next);
    }
    Seen { molecules: molecules.as_vec3(), haze: by_haze.as_vec3(), even: even.as_vec3() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sun(elevation_deg: f64) -> DVec3 {
        let (sin, cos) = elevation_deg.to_radians().sin_cos();
        DVec3::new(cos, 0.0, sin)
    }

    fn level_irradiance(sky: &ClearSky) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for i in 0..40 {
            let sine = ((f64::from(i) + 0.5) / 40.0).sqrt();
            for j in 0..40 {
                let flat = DVec2::from_angle((f64::from(j) + 0.5) / 40.0 * std::f64::consts::TAU);
                sum += sky.radiance((flat * (1.0 - sine * sine).sqrt()).extend(sine));
            }
        }
        sum * (std::f32::consts::PI / 1600.0)
    }

    #[test]
    fn every_sun_makes_a_finite_sky_that_darkens_smoothly() {
        let mut before = f32::INFINITY;
        for half_degrees in (-180..=60).rev() {
            let sky = ClearSky::new(2, sun(f64::from(half_degrees) * 0.5));
            let level = level_irradiance(&sky);
            assert!(level.is_finite() && level.min_element() > 0.0, "{half_degrees}");
            // Twilight falls to a third in a degree; a few nodes of a table make single steps steeper.
            assert!(
                level.y <= before && level.y > 0.25 * before || before.is_infinite(),
                "{half_degrees}: {level} {before}"
            );
            before = level.y;
        }
    }

    /// Illuminances of the CIE's and of Seidelmann's (1992) tables: level surface, clear sky with the sun, lux.
    #[test]
    fn days_and_twilights_are_as_bright_as_measured() {
        for (elevation_deg, lux) in
            [(60.0, 98_000.0), (30.0, 49_000.0), (10.0, 10_900.0), (0.0, 759.0), (-6.0, 3.4)]
        {
            let towards = sun(elevation_deg);
            let sky = ClearSky::new(3, towards);
            let level = level_irradiance(&sky) + sky.sunlight() * towards.z.max(0.0) as f32;
            let found = f64::from(level.dot(crate::colour::LUMINANCE)) * 128_000.0;
            let times = found / lux;
            let allowed = if elevation_deg < 5.0 { 2.0 } else { 1.25 };
            assert!(times < allowed && times > 1.0 / allowed, "{elevation_deg}: {found} lux, not {lux}");
        }
    }

    #[test]
    fn a_clear_zenith_is_blue_and_its_horizon_pale() {
        let sky = ClearSky::new(1, sun(40.0));
        let (zenith, horizon) =
            (sky.radiance(DVec3::Z), sky.radiance(DVec3::new(-0.2, 0.98, 0.03).normalize()));
        assert!(zenith.z > 2.5 * zenith.x, "{zenith}");
        assert!(horizon.z < 1.6 * horizon.x && horizon.y > 2.0 * zenith.y, "{horizon} {zenith}");
    }
}
