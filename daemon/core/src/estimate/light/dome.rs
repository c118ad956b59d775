//! The whole sky from the part of it that a picture shows.
//!
//! A family of skies for the scenario's sun, from clear to overcast and from pure to hazy air, is held against the pixels: each of them with
//! the camera's own exposure and white balance. Every one counts by how well it fits (a mean over models and no choice of one), and their
//! mean supplies what the picture does not show.

use glam::{DVec3, Vec3};

use crate::sky::{ClearSky, SkyLobes, SkyModel, overcast, overcast_zenith};

/// Shares of the sky under clouds that are tried.
const COVERS: [f32; 7] = [0.0, 0.2, 0.4, 0.6, 0.8, 0.93, 1.0];
/// Error of a right model's brightness at a pixel, natural logarithm: clouds' edges, haze in layers.
const MISFIT: f32 = 0.08;
/// Pixels next to each other err alike: so many count.
const COUNTED: f32 = 19.0;
/// A sky half under clouds is so much rarer than a clear or a closed one, natural logarithm: weather stations' okta have that shape.
const RARER: f32 = 1.0;
/// No pixel counts as farther off, natural logarithm: a sail or a shore in the sky.
const FAR: f32 = 0.5;
/// Fewer pixels of sky tell no sky from another.
const PIXELS_FEWEST: usize = 12;

/// One pixel of sky.
#[derive(Clone, Copy, Debug)]
pub struct SkyPixel {
    /// Unit vector towards it, world.
    pub direction: DVec3,
    /// Linear radiance, the video's white being 1.
    pub radiance: Vec3,
}

/// The skies of a sun: clear ones of several turbidities by one model, each under any share of clouds.
#[derive(Clone, Debug)]
pub struct SkyFamily<S = ClearSky> {
    skies: Vec<Member<S>>,
    overcast: SkyLobes,
}

#[derive(Clone, Debug)]
struct Member<S> {
    clear: S,
    /// Without the aureole, ...
    lobes: SkyLobes,
    /// ...which falls on faces as the sun does: its irradiance on one that faces it.
    aureole: Vec3,
    /// Zenith's radiance where it is overcast.
    overcast: Vec3,
}

/// A sky with its sun, at the camera's exposure and white balance.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedSky {
    /// Of each turbidity's clear sky, so much.
    clear: Vec<Vec3>,
    /// Zenith's radiance of the overcast part.
    overcast: Vec3,
    /// The camera's exposure and white balance: its light for a radiance of 1, relative to the sun's irradiance above the air.
    pub gain: Vec3,
    /// The light of the whole dome without the sun's aureole.
    pub lobes: SkyLobes,
    /// Irradiance of the sun on a surface that faces it, ...
    pub sun: Vec3,
    /// ...and of its aureole.
    pub aureole: Vec3,
}

impl SkyFamily {
    /// For a sun towards `sun`, unit vector, wherever it stands.
    pub fn new(sun: DVec3) -> Self {
        Self::of((0..ClearSky::TURBIDITIES.len()).map(|number| ClearSky::new(number, sun)), sun)
    }

    /// Skies in it, one a turbidity.
    pub const fn count(&self) -> usize {
        self.skies.len()
    }

    /// Replaces the sky of that number by the one of a sun towards `sun`.
    pub fn renew(&mut self, number: usize, sun: DVec3) {
        if let Some(sky) = self.skies.get_mut(number) {
            *sky = Member::of(ClearSky::new(number, sun), sun);
        }
    }
}

impl<S: SkyModel> Member<S> {
    fn of(clear: S, sun: DVec3) -> Self {
        let lobes = SkyLobes::of(|d| without_aureole(&clear, sun, d));
        let aureole = aureole(&clear, sun);
        let level = lobes.on_level() + (clear.sunlight() + aureole) * sun.z.max(0.0) as f32;
        Self { clear, lobes, aureole, overcast: overcast_zenith(level) }
    }
}

impl<S: SkyModel> SkyFamily<S> {
    /// Of these clear skies, all under a sun towards `sun`.
    pub fn of(skies: impl IntoIterator<Item = S>, sun: DVec3) -> Self {
        Self {
            skies: skies.into_iter().map(|clear| Member::of(clear, sun)).collect(),
            overcast: SkyLobes::of(|d| Vec3::splat(overcast(d))),
        }
    }

    /// The sky of which `pixels` are a part; `None` for too few of them, or for black ones.
    pub fn fit(&self, pixels: &[SkyPixel]) -> Option<FittedSky> {
        let seen: Vec<(&SkyPixel, Vec3)> = pixels
            .iter()
            // What is white is at least that bright, and black is noise.
            .filter(|p| p.radiance.max_element() < 0.98 && p.radiance.min_element() > 1e-4)
            .map(|p| (p, p.radiance.map(f32::ln)))
            .collect();
        if seen.len() < PIXELS_FEWEST {
            return None;
        }
        let mut tried = Vec::with_capacity(self.skies.len() * COVERS.len());
        for (number, sky) in self.skies.iter().enumerate() {
            let clear: Vec<Vec3> = seen.iter().map(|(p, _)| sky.clear.radiance(p.direction)).collect();
            for cover in COVERS {
                let (gain, off) = held_against(&seen, &clear, sky.overcast, cover);
                tried.push((number, cover, gain, off));
            }
        }
        let best = tried.iter().map(|t| t.3).fold(f32::INFINITY, f32::min);
        let weight = |cover: f32, off: f32| {
            let rarer = RARER * 4.0 * cover * (1.0 - cover);
            (-COUNTED * (off - best) / (2.0 * MISFIT * MISFIT) - rarer).exp()
        };
        let total: f32 = tried.iter().map(|t| weight(t.1, t.3)).sum();
        let mut fitted = FittedSky {
            clear: vec![Vec3::ZERO; self.skies.len()],
            overcast: Vec3::ZERO,
            gain: Vec3::ZERO,
            lobes: SkyLobes::default(),
            sun: Vec3::ZERO,
            aureole: Vec3::ZERO,
        };
        for (number, cover, gain, off) in tried {
            let (share, sky) = (weight(cover, off) / total, self.skies.get(number)?);
            let clear = gain * (share * (1.0 - cover));
            if let Some(of) = fitted.clear.get_mut(number) {
                *of += clear;
            }
            fitted.overcast += gain * sky.overcast * (share * cover);
            fitted.gain += gain * share;
            fitted.lobes.add(&sky.lobes, clear);
            fitted.sun += clear * sky.clear.sunlight();
            fitted.aureole += clear * sky.aureole;
        }
        fitted.lobes.add(&self.overcast, fitted.overcast);
        Some(fitted)
    }

    /// Radiance of a fitted sky from unit `direction`.
    pub fn radiance(&self, fitted: &FittedSky, direction: DVec3) -> Vec3 {
        let clear = self.skies.iter().zip(&fitted.clear).filter(|(_, gain)| **gain != Vec3::ZERO);
        let clear: Vec3 = clear.map(|(sky, gain)| sky.clear.radiance(direction) * *gain).sum();
        clear + fitted.overcast * overcast(direction)
    }
}

/// Radius of the aureole about the sun, radians: it falls on a face as the sun does, and nine polynomials cannot follow it without
/// going below nothing elsewhere.
const AUREOLE: f64 = 20.0 * std::f64::consts::PI / 180.0;

/// Radiance of a sky from unit `d`, within the aureole that at its edge.
fn without_aureole(sky: &impl SkyModel, sun: DVec3, d: DVec3) -> Vec3 {
    let whole = sky.radiance(d);
    let side = (d - sun * d.dot(sun)).normalize_or_zero();
    if d.dot(sun) < AUREOLE.cos() || side == DVec3::ZERO {
        return whole;
    }
    let (sin, cos) = AUREOLE.sin_cos();
    whole.min(sky.radiance(sun * cos + side * sin))
}

/// Irradiance of the aureole above the horizon on a face that faces the sun.
fn aureole(sky: &impl SkyModel, sun: DVec3) -> Vec3 {
    const RINGS: u32 = 16;
    const AROUND: u32 = 16;
    let (u, v) = sun.any_orthonormal_pair();
    let mut sum = Vec3::ZERO;
    for i in 0..RINGS * AROUND {
        // Rings are closer together near the sun; each stands for its own solid angle.
        let edge = |ring: u32| AUREOLE * (f64::from(ring) / f64::from(RINGS)).powi(2);
        let (inner, outer) = (edge(i / AROUND), edge(i / AROUND + 1));
        let (sin, cos) = (0.5 * (inner + outer)).sin_cos();
        let (y, x) = ((f64::from(i % AROUND) + 0.5) / f64::from(AROUND) * std::f64::consts::TAU).sin_cos();
        let d = sun * cos + (u * x + v * y) * sin;
        if d.z > 0.0 {
            let solid = std::f64::consts::TAU * (inner.cos() - outer.cos()) / f64::from(AROUND);
            sum += (sky.radiance(d) - without_aureole(sky, sun, d)) * (solid * cos) as f32;
        }
    }
    sum
}

/// Gain of each channel with which a sky fits best, and the mean square that the logarithms are off by.
fn held_against(seen: &[(&SkyPixel, Vec3)], clear: &[Vec3], zenith: Vec3, cover: f32) -> (Vec3, f32) {
    let off = |(p, light): &(&SkyPixel, Vec3), clear: &Vec3| {
        let model = *clear * (1.0 - cover) + zenith * (cover * overcast(p.direction));
        *light - model.map(f32::ln)
    };
    let count = seen.len() as f32;
    let mean = seen.iter().zip(clear).map(|(p, c)| off(p, c)).sum::<Vec3>() / count;
    let square = |off: Vec3| off.clamp(Vec3::splat(-FAR), Vec3::splat(FAR)).length_squared();
    let squares: f32 = seen.iter().zip(clear).map(|(p, c)| square(off(p, c) - mean)).sum();
    (mean.map(f32::exp), squares / (3.0 * count))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sun(elevation_deg: f64) -> DVec3 {
        let (sin, cos) = elevation_deg.to_radians().sin_cos();
        DVec3::new(cos, 0.0, sin)
    }

    fn directions() -> impl Iterator<Item = DVec3> {
        (0..400).map(|i| {
            let (z, azimuth) = ((f64::from(i) + 0.5) / 400.0, f64::from(i) * 2.4);
            DVec3::new((1.0 - z * z).sqrt() * azimuth.cos(), (1.0 - z * z).sqrt() * azimuth.sin(), z)
        })
    }

    #[test]
    fn no_light_of_a_sky_is_negative_to_speak_of() {
        for elevation_deg in [-90.0, -18.0, -6.0, 0.0, 5.0, 20.0, 45.0, 80.0, 90.0] {
            let family = SkyFamily::new(sun(elevation_deg));
            for (number, sky) in family.skies.iter().enumerate() {
                let most = directions().map(|d| sky.lobes.at(d).max_element()).fold(0.0, f32::max);
                let least = directions().map(|d| sky.lobes.at(d).min_element()).fold(f32::INFINITY, f32::min);
                assert!(least > -0.12 * most && most > 0.0, "{elevation_deg} {number}: {least} of {most}");
                assert!(sky.aureole.is_finite() && sky.aureole.min_element() >= 0.0);
            }
        }
    }

    #[test]
    fn a_sky_of_the_family_is_found_from_a_window() {
        for (elevation_deg, number, cover) in
            [(50.0, 1, 0.0), (20.0, 3, 0.0), (30.0, 2, 1.0), (5.0, 1, 0.4), (-5.0, 2, 0.0)]
        {
            let family = SkyFamily::new(sun(elevation_deg));
            let sky = &family.skies[number];
            let light =
                |d: DVec3| sky.clear.radiance(d) * (1.0 - cover) + sky.overcast * (cover * overcast(d));
            let pixels: Vec<SkyPixel> = (0..200)
                .map(|i| {
                    let (azimuth, up) = (1.0 + 0.035 * f64::from(i % 20), 0.02 + 0.04 * f64::from(i / 20));
                    DVec3::new(up.cos() * azimuth.cos(), up.cos() * azimuth.sin(), up.sin())
                })
                .map(|direction| SkyPixel { direction, radiance: light(direction) })
                .collect();
            let gain = 0.7 / pixels.iter().map(|p| p.radiance.max_element()).fold(0.0, f32::max);
            let scaled: Vec<SkyPixel> =
                pixels.iter().map(|p| SkyPixel { radiance: p.radiance * gain, ..*p }).collect();
            let fitted = family.fit(&scaled).expect("enough");
            let truth = SkyLobes::of(light);
            let (found, expected) = (fitted.lobes.on_level(), truth.on_level() * gain);
            let off = (found - expected).length() / expected.length();
            assert!(off < 0.15, "{elevation_deg} {number} {cover}: {found}, not {expected}");
            // What is seen is what it was made from.
            for p in scaled.iter().step_by(17) {
                let there = family.radiance(&fitted, p.direction);
                assert!(
                    ((there - p.radiance) / p.radiance).abs().max_element() < 0.2,
                    "{there} {}",
                    p.radiance
                );
            }
        }
        let family = SkyFamily::new(sun(30.0));
        assert_eq!(family.fit(&[]), None);
        let black = SkyPixel { direction: DVec3::X, radiance: Vec3::ZERO };
        assert_eq!(family.fit(&[black; 100]), None);
    }
}
