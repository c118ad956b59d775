//! Lamps: virtual points of light bright enough to light what is around them. Fires of boats, illuminating flares, the flash at the muzzle.

use std::f64::consts::FRAC_1_PI;

use glam::{DVec3, Vec3};

use crate::physics::illuminance;

/// Most lamps of a scene; of more, the first fires and the newest flares.
pub const LAMPS_MAX: usize = 8;

/// A lamp in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LampView {
    /// Its place, world.
    pub at: DVec3,
    /// Luminous intensity over the luminance that the camera shows as white, by colour, m^2.
    pub strength: Vec3,
    /// Share of light that air takes in a metre.
    pub extinction_per_m: f64,
    /// It stands high over the sea: waves mirror it far and wide. Low ones light the water about them alone; boats' mirror images hold them.
    pub is_high: bool,
}

impl LampView {
    /// Radiance of a white matt surface at `place` (world) that faces it, white in the picture being 1.
    pub fn matt_at(&self, place: DVec3) -> Vec3 {
        let lux = illuminance(1.0, self.at.distance(place), self.extinction_per_m);
        self.strength * (FRAC_1_PI * lux) as f32
    }

    /// The same of one that lies flat.
    pub fn flat_at(&self, place: DVec3) -> Vec3 {
        let sine = (self.at - place).normalize_or_zero().z.max(0.0);
        self.matt_at(place) * sine as f32
    }
}

/// Radiance of a small white body at `place` (world), as `lamps` light it: a sphere shows a quarter of what it would facing the lamp.
pub fn body_at<'a>(lamps: impl IntoIterator<Item = &'a LampView>, place: DVec3) -> Vec3 {
    lamps.into_iter().map(|lamp| lamp.matt_at(place) * 0.25).sum()
}

/// Radiance of white foam at `place` (world).
pub fn foam_at(lamps: &[LampView], place: DVec3) -> Vec3 {
    lamps.iter().map(|lamp| lamp.flat_at(place)).sum()
}

/// The flash of a round before the muzzle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlashView {
    /// Radiance that it gives a white matt surface of the gun, on average, white in the picture being 1.
    pub on_gun: Vec3,
}
