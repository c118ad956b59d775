//! Skies that the trainer's own models do not make, with what a camera sees of them and the light that they send onto faces.

pub mod models;
mod twilight;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use bowwave_core::{
    colour::{linear_to_srgb, srgb_to_linear},
    estimate::light::SkyPixel,
    sky::SkyModel,
};
use glam::{DVec2, DVec3, Vec3};
use models::{Cie, Hosek};
use twilight::Twilight;

use crate::parts::even;

/// What made a sky.
enum Dome {
    /// Hosek and Wilkie 2012 in linear sRGB: a fit to a brute-force path tracer.
    Clear(Hosek),
    /// The same with clouds in patches: seed, and share of the sky.
    Clouded(Hosek, u64, f64),
    /// One of the CIE's 15 standard skies (ISO 15469), grey as far as it is clouded.
    Standard(Cie, Hosek),
    /// An own integration of the light of a sun that is down.
    Twilight(Twilight),
}

/// A sky to be guessed.
pub struct TrueSky {
    dome: Dome,
    /// Unit vector towards the sun.
    pub sun: DVec3,
    /// For a table.
    pub name: String,
    /// Of which kind it is.
    pub kind: &'static str,
}

/// Unit vector by azimuth from x and elevation, radians.
pub fn direction(azimuth: f64, elevation: f64) -> DVec3 {
    (DVec2::from_angle(azimuth) * elevation.cos()).extend(elevation.sin())
}

impl TrueSky {
    /// Fifty of them: sun from -6 to 80 degrees, clear to overcast; others for each set.
    pub fn fifty(set: u64) -> Vec<Self> {
        let pick = |i: u64, salt: u64| even((set * 1000 + i) * 31 + salt);
        let make = |i: u64| {
            let low = i % 5 == 4;
            let elevation_deg = if low { -6.0 + 6.0 * pick(i, 1) } else { 1.0 + 79.0 * pick(i, 1).powf(1.3) };
            let sun = direction(0.0, elevation_deg.to_radians());
            let turbidity = 2.0 + 5.0 * pick(i, 2);
            let clear = || Hosek::new(sun, turbidity as f32);
            let (dome, kind, what) = match (low, i % 5) {
                (true, _) => (
                    Dome::Twilight(Twilight::new(sun, turbidity)),
                    "twilight",
                    format!("turbidity {turbidity:.1}"),
                ),
                (_, 0 | 1) => (Dome::Clear(clear()), "clear", format!("turbidity {turbidity:.1}")),
                (_, 2) => {
                    let cover = 0.15 + 0.7 * pick(i, 3);
                    (
                        Dome::Clouded(clear(), set * 1000 + i, cover),
                        "clouds",
                        format!("{:.0} % clouds", 100.0 * cover),
                    )
                }
                _ => {
                    let number = 1 + (10.0 * pick(i, 4)) as usize;
                    (Dome::Standard(Cie::new(number, sun), clear()), "CIE", format!("CIE {number}"))
                }
            };
            Self { dome, sun, name: format!("sun {elevation_deg:.0} deg, {what}"), kind }
        };
        (0..50).map(make).collect()
    }

    /// Radiance from a direction; any unit.
    pub fn radiance(&self, direction: DVec3) -> Vec3 {
        match &self.dome {
            Dome::Clear(clear) => clear.radiance(direction),
            Dome::Clouded(clear, seed, cover) => clouded(clear, *seed, *cover, direction),
            Dome::Standard(cie, clear) => {
                // The colder the clearer: kinds 1 to 6 are clouds, 10 is half of each.
                let grey = Vec3::splat(cie.radiance(direction));
                let blue = clear.radiance(direction);
                let tint = blue / (blue.element_sum() / 3.0).max(1e-9);
                grey * Vec3::ONE.lerp(tint, cie.clearness())
            }
            Dome::Twilight(twilight) => twilight.radiance(direction),
        }
    }

    /// Irradiance on a face of unit `normal` from the sky alone.
    pub fn on_face(&self, normal: DVec3) -> Vec3 {
        irradiance(normal, |d| self.radiance(d))
    }

    /// What a camera sees of it: a window of `size_deg` (across, up from the horizon) about an azimuth, radians, at an exposure and white
    /// balance of its own, eight bits a channel.
    pub fn window(&self, azimuth: f64, size_deg: DVec2, seed: u64) -> Window {
        const ACROSS: usize = 24;
        const UP: usize = 9;
        let places: Vec<DVec3> = (0..ACROSS * UP)
            .map(|i| {
                let over = ((i % ACROSS) as f64 + 0.5) / ACROSS as f64 - 0.5;
                let up = ((i / ACROSS) as f64 + 0.5) / UP as f64;
                direction(azimuth + over * size_deg.x.to_radians(), (up * size_deg.y).max(0.6).to_radians())
            })
            .collect();
        let light: Vec<Vec3> = places.iter().map(|d| self.radiance(*d)).collect();
        let mut bright: Vec<f32> = light.iter().map(|l| l.max_element()).collect();
        bright.sort_by(f32::total_cmp);
        let exposure = 0.75 / bright[bright.len() * 9 / 10].max(1e-12);
        let balance = |c: u64| (1.0 + 0.2 * (even(seed * 7 + c) - 0.5)) as f32;
        let gain = Vec3::new(balance(1), 1.0, balance(2)) * exposure;
        let code =
            |value: f32| srgb_to_linear((linear_to_srgb(value.clamp(0.0, 1.0)) * 255.0).round() / 255.0);
        let pixels = places.into_iter().zip(light);
        let pixels = pixels.map(|(direction, l)| SkyPixel { direction, radiance: (l * gain).map(code) });
        Window { pixels: pixels.collect(), gain }
    }
}

/// Part of a sky as a camera has it.
pub struct Window {
    /// Its pixels.
    pub pixels: Vec<SkyPixel>,
    /// What the camera multiplied the sky with.
    pub gain: Vec3,
}

/// Irradiance from the upper half of the directions on a face of that normal.
pub fn irradiance(normal: DVec3, radiance: impl Fn(DVec3) -> Vec3) -> Vec3 {
    let (up, around) = (36, 72);
    let mut sum = Vec3::ZERO;
    for i in 0..up {
        let sine = (f64::from(i) + 0.5) / f64::from(up);
        for j in 0..around {
            let d = direction((f64::from(j) + 0.5) / f64::from(around) * TAU, sine.asin());
            let cosine = d.dot(normal);
            if cosine > 0.0 {
                sum += radiance(d) * cosine as f32;
            }
        }
    }
    sum * (TAU / f64::from(up * around)) as f32
}

/// Faces of a boat: one level, eight that stand, eight that lean back by 45 degrees.
pub fn faces() -> Vec<DVec3> {
    let around = |elevation: f64| (0..8).map(move |i| direction(f64::from(i) * PI / 4.0, elevation));
    std::iter::once(DVec3::Z).chain(around(0.0)).chain(around(FRAC_PI_2 / 2.0)).collect()
}

/// Clear sky with clouds in patches on a level layer, lit by what falls on the ground.
fn clouded(clear: &Hosek, seed: u64, cover: f64, direction: DVec3) -> Vec3 {
    let sine = direction.z.max(0.03);
    let (x, y) = (direction.x / sine * 1.5, direction.y / sine * 1.5);
    let (i, j) = (x.floor(), y.floor());
    let node = |i: f64, j: f64| {
        let number = (i as i64).rem_euclid(4096) as u64 * 8191 + (j as i64).rem_euclid(4096) as u64;
        even(number ^ (seed << 32))
    };
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (u, v) = (smooth(x - i), smooth(y - j));
    let low = node(i, j) * (1.0 - u) + node(i + 1.0, j) * u;
    let high = node(i, j + 1.0) * (1.0 - u) + node(i + 1.0, j + 1.0) * u;
    let noise = low * (1.0 - v) + high * v;
    let share = ((noise - (1.0 - cover) + 0.1) / 0.2).clamp(0.0, 1.0) as f32;
    let blue = clear.radiance(direction);
    let ground = clear.ground() / std::f32::consts::PI;
    blue.lerp(ground * (0.35 + 0.4 * noise as f32), share)
}
