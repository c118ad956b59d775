//! A sky with its sun or moon over the sea, as paths meet it and as the product is given it.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use anyhow::{Context as _, Result};
use bowwave_core::{
    estimate::light::{FittedSky, Light, SkyFamily, SkyPixel},
    sky::{ClearSky, SkyModel as _, overcast},
};
use glam::{DVec3, Vec3};
use hw_sim::ocean::fresnel::reflectance;

use crate::sky::{direction, irradiance};

/// What the sky is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Clear, with sun or moon.
    Clear,
    /// Closed clouds, the sun unseen.
    Overcast,
}

/// Which of the clear skies is looked at: a turbidity of 1.6.
const TURBIDITY: usize = 2;
/// Light that comes out of the sea over the light that falls on it (Mobley 1994).
const WATER_ALBEDO: f32 = 0.015;
/// Nodes of elevation, closer together near the horizon, and of azimuth.
const UP: usize = 192;
const AROUND: usize = 768;

/// The light of a scene.
pub struct TracedLight {
    /// Unit vector towards sun or moon.
    pub sun_direction: DVec3,
    /// Irradiance of its disc on a surface that faces it.
    pub sun: Vec3,
    /// Radiance of the sea from above.
    pub sea: Vec3,
    nodes: Vec<Vec3>,
    fitted: FittedSky,
}

impl TracedLight {
    /// A sky of that kind under a sun towards `sun_direction`, seen by a camera to which a matt white surface is as bright as `white` that faces the sun, or
    /// that lies level under clouds. The product's own fit to a window of it decides what the sky is, both for paths and for the product.
    pub fn new(kind: Kind, sun_direction: DVec3, white: f32) -> Result<Self> {
        let clear = ClearSky::new(TURBIDITY, sun_direction);
        let places: Vec<DVec3> = (0..216)
            .map(|i| {
                let (over, up) = (f64::from(i % 24) / 23.0 - 0.5, (f64::from(i / 24) + 0.5) / 9.0);
                direction(FRAC_PI_2 + over * 0.7, (up * 0.436).max(0.01))
            })
            .collect();
        let radiance = |d: &DVec3| match kind {
            Kind::Clear => clear.radiance(*d),
            Kind::Overcast => Vec3::splat(overcast(*d)),
        };
        let sunlight = if kind == Kind::Clear { clear.sunlight() } else { Vec3::ZERO };
        let facing = (irradiance(DVec3::Z, |d| radiance(&d)) + sunlight) / PI as f32;
        let gain = white / facing.max_element();
        let seen: Vec<SkyPixel> =
            places.iter().map(|d| SkyPixel { direction: *d, radiance: radiance(d) * gain }).collect();
        let family = SkyFamily::new(sun_direction);
        let fitted = family.fit(&seen).context("a sky that is too dark to be fitted")?;
        let node = |i: usize| {
            let share = (i / AROUND) as f64 / (UP - 1) as f64;
            let azimuth = (i % AROUND) as f64 / AROUND as f64 * TAU;
            family.radiance(&fitted, direction(azimuth, share * share * FRAC_PI_2))
        };
        let nodes = (0..UP * AROUND).map(node).collect();
        let sun = if sun_direction.z > 0.0 { fitted.sun } else { Vec3::ZERO };
        let mut light = Self { sun_direction, sun, sea: Vec3::ZERO, nodes, fitted };
        light.sea = light.sea_seen();
        Ok(light)
    }

    /// Radiance of the sky from unit `d`, without the disc of the sun; below the horizon that of the horizon.
    pub fn sky(&self, d: DVec3) -> Vec3 {
        let row = (d.z.clamp(0.0, 1.0).asin() / FRAC_PI_2).sqrt() * (UP - 1) as f64;
        let column = d.y.atan2(d.x).rem_euclid(TAU) / TAU * AROUND as f64;
        let (j, i) = ((row as usize).min(UP - 2), column as usize % AROUND);
        let (v, u) = ((row - j as f64) as f32, (column - column.floor()) as f32);
        let at = |j: usize, i: usize| self.nodes[j * AROUND + i % AROUND];
        at(j, i).lerp(at(j, i + 1), u).lerp(at(j + 1, i).lerp(at(j + 1, i + 1), u), v)
    }

    /// Radiance that a surface that stands upright gets from the sea below on the average over all azimuths: the sky in a level mirror, and what
    /// comes out of the water.
    fn sea_seen(&self) -> Vec3 {
        let out = irradiance(DVec3::Z, |d| self.sky(d)) / PI as f32;
        let water = (out + self.sun * (self.sun_direction.z.max(0.0) as f32 / PI as f32)) * WATER_ALBEDO;
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for i in 0..24 {
            let up = (f64::from(i) + 0.5) / 24.0 * FRAC_PI_2;
            let share = reflectance(up.sin() as f32);
            // An upright surface gets light from that far down by the cosine's square.
            let weight = (up.cos() * up.cos()) as f32;
            for j in 0..24 {
                let sky = self.sky(direction(f64::from(j) / 24.0 * TAU, up));
                sum += (sky * share + water * (1.0 - share)) * weight;
                weights += weight;
            }
        }
        sum / weights
    }

    /// The same light as the product has it from its own fit.
    pub fn product(&self) -> Light {
        let lobes = self.fitted.lobes;
        let over_pi = 1.0 / PI as f32;
        Light {
            sun_direction: self.sun_direction,
            sun: (self.fitted.sun + self.fitted.aureole) * over_pi,
            sky: lobes.on_level().max(Vec3::ZERO) * over_pi,
            dome: lobes,
            horizon: self.sky(direction(FRAC_PI_2, 0.05)),
            sea: self.sea,
        }
    }

    /// Radiance of a matt white surface that lies level under the sky alone.
    pub fn level(&self) -> Vec3 {
        irradiance(DVec3::Z, |d| self.sky(d)) / PI as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_product_gets_the_light_that_paths_meet() {
        let sun = direction(0.4, 0.6);
        for kind in [Kind::Clear, Kind::Overcast] {
            let light = TracedLight::new(kind, sun, 0.7).unwrap();
            let on_level = light.level() + light.sun * (sun.z as f32 / PI as f32);
            let product = light.product().on_level();
            assert!(((product - on_level) / on_level).abs().max_element() < 0.1, "{product}, not {on_level}");
            assert!(light.sea.min_element() > 0.0 && light.sea.max_element() < light.level().max_element());
        }
    }
}
