//! The light of a scene as an eye at sea has it: sky and sea at the horizon, and the body that shines.

use std::f64::consts::PI;

use glam::DVec3;

use crate::{
    colour::LUMINANCE,
    daylight::illuminance_of_sun,
    ephemeris::Moon,
    sea::{fresnel, rms_slope},
    sky::{SUN_LUX, sunlight},
};

/// Haze of clear air at sea, for the share of light that comes straight from the sun (Linke's turbidity).
const TURBIDITY: f64 = 2.1;
/// Share of the sky's light that comes back out of the water, of what falls in.
const UPWELLING: f64 = 0.02;
/// Least slope of facets that face an eye: no sea is a mirror, radians.
const LEAST_SLOPE: f64 = 0.05;

/// Light of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ambient {
    /// Luminance of the sky at the horizon, cd/m^2.
    pub sky_cd_m2: f64,
    /// Luminance of the sea before the horizon, cd/m^2, without what air adds.
    pub sea_cd_m2: f64,
    /// Illuminance of a level surface by the sky alone, lux.
    pub sky_lux: f64,
    /// Unit vector towards the body that shines, world.
    pub towards: DVec3,
    /// Illuminance by it alone of a surface that faces it, lux.
    pub direct_lux: f64,
}

impl Ambient {
    /// Light of the sun towards `sun` (unit vector, world), of which clouds let `sun_strength` through, and of the moon, on a sea under a
    /// wind of `wind_m_s`. The sky is even.
    pub fn new(sun: DVec3, sun_strength: f64, moon: Option<&Moon>, wind_m_s: f64) -> Self {
        let by_sun = Luminary::of(sun, 1.0, sun_strength);
        let by_moon = moon
            .filter(|moon| moon.direction.z > 0.0)
            .map_or(Luminary::DARK, |moon| Luminary::of(moon.direction, moon.irradiance, sun_strength));
        let sky_lux = by_sun.sky_lux + by_moon.sky_lux;
        let brighter = if by_moon.direct_lux > by_sun.direct_lux { by_moon } else { by_sun };
        let sky_cd_m2 = sky_lux / PI;
        // Seen flatly, the facets that face the eye are what is seen of the sea.
        let slope = rms_slope(wind_m_s).max(LEAST_SLOPE).atan();
        let sea_cd_m2 = sky_cd_m2 * (fresnel(slope.sin()) + UPWELLING).min(1.0);
        let Luminary { towards, direct_lux, .. } = brighter;
        Self { sky_cd_m2, sea_cd_m2, sky_lux, towards, direct_lux }
    }
}

/// Light of sun or moon.
#[derive(Clone, Copy, Debug)]
struct Luminary {
    towards: DVec3,
    direct_lux: f64,
    sky_lux: f64,
}

impl Luminary {
    const DARK: Self = Self { towards: DVec3::Z, direct_lux: 0.0, sky_lux: 0.0 };

    /// Light of a body as bright as `times` the sun, of whose own light `strength` comes through.
    fn of(towards: DVec3, times: f64, strength: f64) -> Self {
        let sine = towards.z.clamp(-1.0, 1.0);
        let level_lux = illuminance_of_sun(sine) * times;
        if sine <= 0.0 {
            return Self { towards, direct_lux: 0.0, sky_lux: level_lux };
        }
        // How it is shared out between body and sky: extinction against the sky's light of a clear day (Gillette, Pierpoint & Treado 1984).
        let direct = SUN_LUX * f64::from(sunlight(sine, TURBIDITY).dot(LUMINANCE)) * sine;
        let share = direct / (direct + 800.0 + 15_500.0 * sine.sqrt());
        let direct_lux = (share * level_lux / sine).min(SUN_LUX * times) * strength.clamp(0.0, 1.0);
        Self { towards, direct_lux, sky_lux: (1.0 - share) * level_lux }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(elevation_deg: f64) -> Ambient {
        let (sine, cosine) = elevation_deg.to_radians().sin_cos();
        Ambient::new(DVec3::new(0.0, cosine, sine), 1.0, None, 5.0)
    }

    #[test]
    fn sky_and_sun_share_the_light_of_the_tables() {
        let noon = at(60.0);
        let level = noon.sky_lux + noon.direct_lux * 60f64.to_radians().sin();
        assert!((level / illuminance_of_sun(60f64.to_radians().sin()) - 1.0).abs() < 1e-9);
        assert!((0.1..0.25).contains(&(noon.sky_lux / level)), "{noon:?}");
        assert_eq!(at(-3.0).direct_lux, 0.0);
        // Starlight and airglow: 2e-4 cd/m^2 (Leinert 1998).
        assert!((at(-40.0).sky_cd_m2 / 2e-4 - 1.0).abs() < 0.1, "{:?}", at(-40.0));
    }

    #[test]
    fn the_sea_is_darker_than_the_sky_and_more_so_in_wind() {
        let sea = |wind_m_s: f64| Ambient::new(DVec3::Z, 1.0, None, wind_m_s).sea_cd_m2;
        let sky = at(90.0).sky_cd_m2;
        assert!(sea(10.0) < sea(3.0) && sea(0.0) < sky && sea(25.0) > 0.1 * sky);
    }

    #[test]
    fn a_moon_lights_the_night() {
        let moon = Moon { direction: DVec3::Z, lit: 1.0, irradiance: 2.5e-6 };
        let night = at(-40.0);
        let lit = Ambient::new(DVec3::NEG_Z, 1.0, Some(&moon), 5.0);
        assert!(lit.sky_cd_m2 > 10.0 * night.sky_cd_m2 && lit.direct_lux > 0.1, "{lit:?}");
        let set = Moon { direction: DVec3::NEG_Z, ..moon };
        assert_eq!(Ambient::new(DVec3::NEG_Z, 1.0, Some(&set), 5.0).sky_cd_m2, night.sky_cd_m2);
    }

    #[test]
    fn every_elevation_of_the_sun_has_light() {
        let all: Vec<Ambient> = (-90..=90).map(|deg| at(f64::from(deg))).collect();
        for pair in all.windows(2) {
            let [low, high] = [pair[0], pair[1]];
            assert!(low.sky_cd_m2 > 0.0 && low.sky_cd_m2.is_finite() && low.direct_lux.is_finite());
            assert!(low.sea_cd_m2 > 0.0 && low.sea_cd_m2 < low.sky_cd_m2);
            let level_lux = |at: &Ambient| at.sky_lux + at.direct_lux * at.towards.z.max(0.0);
            assert!(level_lux(&high) >= level_lux(&low), "{high:?}");
        }
    }
}
