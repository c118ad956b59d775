//! Properties of every sky, and the overcast one.

use glam::{DVec3, Vec3};

/// Illuminance of a surface that faces the sun above the air, lux (Seidelmann 1992): what relative radiances are to be multiplied with for cd/m^2.
pub const SUN_LUX: f64 = 128_000.0;

/// Radiance of starlight and airglow, relative to the sun's irradiance above the air: 2e-4 of 128 000 cd/m^2 (Leinert 1998, table 1). No
/// sky is darker, whatever the sun does.
pub const NIGHT: f32 = 1.6e-9;

/// A model of a clear sky under one sun, relative to the sun's irradiance above the air.
pub trait SkyModel {
    /// Radiance from unit `direction`, without the sun's disc; below the horizon that of the horizon.
    fn radiance(&self, direction: DVec3) -> Vec3;
    /// Irradiance of the sun at sea level on a surface that faces it.
    fn sunlight(&self) -> Vec3;
}

/// Radiance of the CIE's overcast sky (Moon and Spencer 1942) from unit `direction`, relative to that of its zenith; below the horizon that
/// of the horizon.
pub fn overcast(direction: DVec3) -> f32 {
    (1.0 + 2.0 * direction.z.clamp(0.0, 1.0) as f32) / 3.0
}

/// Zenith's radiance of an overcast sky where a level surface would have the irradiance `level_clear` under a clear one.
///
/// Clouds let through a quarter of what falls on them (Kasten and Czeplak 1980), which is what falls on a level surface under a clear sky, and
/// a level surface gets 7 pi / 9 of the zenith's radiance from a sky of that shape.
pub fn overcast_zenith(level_clear: Vec3) -> Vec3 {
    const THROUGH: f32 = 0.25;
    level_clear * (THROUGH * 9.0 / (7.0 * std::f32::consts::PI))
}
