//! Light: sky, sun and the light that comes back out of the water.
//!
//! Radiances are in W/(m^2 sr) weighted as linear sRGB (683 lm/W turns them into luminance); the camera's gain scales them later.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec2, DVec3};
use hw_skymodel::rgb::{Channel, SkyParams, SkyState};

/// Apparent radius of the sun, radians.
pub const SUN_RADIUS: f64 = 0.004_65;
/// Extraterrestrial solar illuminance, 128 klx, in this module's unit.
const SUN_ABOVE_AIR: f64 = 128_000.0 / 683.0;
/// Vertical optical depths of clear maritime air of turbidity 3 at about 610, 550 and 465 nm: Rayleigh (Bodhaine 1999) and aerosol of
/// 0.12 at 550 nm with Angstrom exponent 1, ozone with it.
const OPTICAL_DEPTH: DVec3 = DVec3::new(0.195, 0.245, 0.345);
/// Horizontal illuminance under a heavy cloud cover with a sun of some 40 degrees, lux.
const OVERCAST_LUX: f64 = 15_000.0;

/// Kind of sky.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SkyWeather {
    /// Hosek and Wilkie 2012 with turbidity 3, and the sun.
    Clear,
    /// CIE overcast sky (Moon and Spencer 1942), no sun.
    Overcast,
}

/// Daylight and sun of a scene.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SkySpec {
    /// Clear or overcast.
    pub weather: SkyWeather,
    /// Elevation of the sun, degrees.
    pub sun_elevation_deg: f64,
    /// Azimuth of the sun, degrees clockwise from north.
    pub sun_azimuth_deg: f64,
}

/// Hosek and Wilkie's clear sky (2012) in linear sRGB.
pub(super) struct ClearSky(Box<SkyState>);

impl ClearSky {
    /// For a sun's elevation (radians), a turbidity from 1 to 10 and the ground's albedo; `None` outside of what the model covers.
    pub(super) fn new(elevation: f32, turbidity: f32, albedo: [f32; 3]) -> Option<Self> {
        SkyState::new(&SkyParams { elevation, turbidity, albedo }).ok().map(|state| Self(Box::new(state)))
    }

    /// Radiance from `theta` off the zenith and `gamma` off the sun, radians.
    pub(super) fn radiance(&self, theta: f32, gamma: f32) -> [f32; 3] {
        [Channel::R, Channel::G, Channel::B].map(|c| self.0.radiance(theta, gamma, c).max(0.0))
    }
}

enum SkyDome {
    Clear(ClearSky),
    Overcast { zenith: DVec3 },
    Uniform(DVec3),
}

/// The light of a scene.
pub struct Daylight {
    dome: SkyDome,
    /// Unit vector towards the sun.
    pub sun_direction: DVec3,
    /// Irradiance of the sun on a plane that faces it; black without a sun.
    pub sun: DVec3,
    /// Irradiance of the sky on a horizontal plane.
    pub sky_irradiance: DVec3,
}

impl Daylight {
    /// The light of `spec`; `None` for a sun outside of what the model covers.
    pub fn new(spec: &SkySpec) -> Option<Self> {
        let elevation = spec.sun_elevation_deg.to_radians();
        let azimuth = spec.sun_azimuth_deg.to_radians();
        let flat = DVec2::new(azimuth.sin(), azimuth.cos()) * elevation.cos();
        let sun_direction = flat.extend(elevation.sin());
        let (dome, sun) = match spec.weather {
            SkyWeather::Clear => {
                let clear = ClearSky::new(elevation.max(0.0) as f32, 3.0, [0.06; 3])?;
                (SkyDome::Clear(clear), sunlight(elevation))
            }
            SkyWeather::Overcast => {
                // Horizontal irradiance of the dome is 7 pi / 9 of its zenith radiance.
                let zenith = OVERCAST_LUX / 683.0 * 9.0 / (7.0 * PI);
                (SkyDome::Overcast { zenith: zenith * DVec3::new(0.97, 1.0, 1.05) }, DVec3::ZERO)
            }
        };
        Some(Self::finish(Self { dome, sun_direction, sun, sky_irradiance: DVec3::ZERO }))
    }

    /// The same radiance from everywhere, and no sun: for tests of energy.
    pub fn uniform(radiance: DVec3) -> Self {
        let sky = Self {
            dome: SkyDome::Uniform(radiance),
            sun_direction: DVec3::Z,
            sun: DVec3::ZERO,
            sky_irradiance: DVec3::ZERO,
        };
        Self::finish(sky)
    }

    fn finish(mut sky: Self) -> Self {
        let (rows, columns) = (90, 180);
        let mut sum = DVec3::ZERO;
        for i in 0..rows {
            // Equal steps of the square of the sine: each stands for the same share of a horizontal plane's irradiance.
            let sin = ((f64::from(i) + 0.5) / f64::from(rows)).sqrt();
            let cos = (1.0 - sin * sin).sqrt();
            for j in 0..columns {
                let angle = (f64::from(j) + 0.5) / f64::from(columns) * 2.0 * PI;
                sum += sky.radiance((DVec2::from_angle(angle) * cos).extend(sin));
            }
        }
        sky.sky_irradiance = sum * PI / f64::from(rows * columns);
        sky
    }

    /// Radiance of the sky, without the sun's disc, from unit `direction`; below the horizon that of the horizon.
    pub fn radiance(&self, direction: DVec3) -> DVec3 {
        let sin = direction.z.clamp(0.0, 1.0);
        match &self.dome {
            SkyDome::Uniform(radiance) => *radiance,
            SkyDome::Overcast { zenith } => *zenith * (1.0 + 2.0 * sin) / 3.0,
            SkyDome::Clear(clear) => {
                let theta = (FRAC_PI_2 - sin.asin()) as f32;
                let level = if direction.z < 0.0 {
                    direction.truncate().normalize_or_zero().extend(0.0)
                } else {
                    direction
                };
                let gamma = level.dot(self.sun_direction).clamp(-1.0, 1.0).acos() as f32;
                DVec3::from_array(clear.radiance(theta, gamma).map(f64::from))
            }
        }
    }

    /// Radiance of the sun's disc where `direction` hits it.
    pub fn sun_disc(&self, direction: DVec3) -> DVec3 {
        if direction.dot(self.sun_direction) > SUN_RADIUS.cos() {
            self.sun / (PI * SUN_RADIUS * SUN_RADIUS)
        } else {
            DVec3::ZERO
        }
    }

    /// Irradiance on a horizontal plane from the sun.
    pub fn sun_horizontal(&self) -> DVec3 {
        self.sun * self.sun_direction.z.max(0.0)
    }
}

/// Irradiance of the sun at `elevation` radians, Beer's law over the air mass of Kasten & Young 1989.
fn sunlight(elevation: f64) -> DVec3 {
    let degrees = elevation.to_degrees();
    if degrees <= 0.0 {
        return DVec3::ZERO;
    }
    let airmass = 1.0 / (elevation.sin() + 0.505_72 * (degrees + 6.079_95).powf(-1.636_4));
    let through = |depth: f64| (-depth * airmass).exp();
    SUN_ABOVE_AIR * DVec3::new(through(OPTICAL_DEPTH.x), through(OPTICAL_DEPTH.y), through(OPTICAL_DEPTH.z))
}
