//! The standard atmosphere.

use crate::physics::GRAVITY_M_S2;

/// Specific gas constant of dry air, J/(kg K) (ISO 2533).
const GAS_CONSTANT: f64 = 287.052_87;
/// Ratio of the specific heats of air.
const HEAT_RATIO: f64 = 1.4;
/// Temperature lapse in the troposphere, K/m.
const LAPSE_K_M: f64 = 0.0065;
/// Where the lapse ends, metres.
const TROPOPAUSE_M: f64 = 11_000.0;
/// Heights outside this range are treated as its ends: no round of a deck gun gets there.
const HEIGHT_RANGE_M: (f64, f64) = (-2_000.0, 20_000.0);

/// The air at one height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// Temperature, kelvin.
    pub temperature_k: f64,
    /// Pressure, pascal.
    pub pressure_pa: f64,
    /// Density, kg/m^3.
    pub density_kg_m3: f64,
    /// Speed of sound, m/s.
    pub sound_m_s: f64,
}

/// Dry air with the ICAO lapse (ISO 2533) above a given temperature and pressure at the sea.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Atmosphere {
    sea_level_k: f64,
    sea_level_pa: f64,
}

impl Atmosphere {
    /// The ICAO standard day: 15 C, 1013.25 hPa.
    pub const ICAO: Self = Self { sea_level_k: 288.15, sea_level_pa: 101_325.0 };

    /// A day with another temperature (200 to 340 K) and pressure (80 to 110 kPa) at the sea; `None` outside those.
    pub fn new(sea_level_k: f64, sea_level_pa: f64) -> Option<Self> {
        let fits = (200.0..=340.0).contains(&sea_level_k) && (80e3..=110e3).contains(&sea_level_pa);
        fits.then_some(Self { sea_level_k, sea_level_pa })
    }

    /// The air `height_m` above the sea (geopotential metres). Always finite and of positive density.
    pub fn at(&self, height_m: f64) -> Air {
        // `clamp` keeps NaN; `max` and `min` do not.
        let height = height_m.max(HEIGHT_RANGE_M.0).min(HEIGHT_RANGE_M.1);
        let in_lapse = height.min(TROPOPAUSE_M);
        let temperature_k = self.sea_level_k - LAPSE_K_M * in_lapse;
        let exponent = GRAVITY_M_S2 / (GAS_CONSTANT * LAPSE_K_M);
        let lapse_pa = self.sea_level_pa * (temperature_k / self.sea_level_k).powf(exponent);
        // Isothermal above the tropopause.
        let above = height - in_lapse;
        let pressure_pa = if above > 0.0 {
            lapse_pa * (-GRAVITY_M_S2 * above / (GAS_CONSTANT * temperature_k)).exp()
        } else {
            lapse_pa
        };
        Air {
            temperature_k,
            pressure_pa,
            density_kg_m3: pressure_pa / (GAS_CONSTANT * temperature_k),
            sound_m_s: (HEAT_RATIO * GAS_CONSTANT * temperature_k).sqrt(),
        }
    }
}

impl Default for Atmosphere {
    fn default() -> Self {
        Self::ICAO
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::rows;

    #[test]
    fn agrees_with_the_published_standard_atmosphere() {
        let table = rows(include_str!("../../../data/icao_atmosphere.csv"));
        assert_eq!(table.len(), 12);
        for row in table {
            let air = Atmosphere::ICAO.at(row[0]);
            assert!((air.temperature_k - row[1]).abs() < 0.006, "{row:?} {air:?}");
            assert!((air.pressure_pa - row[2]).abs() < 0.06, "{row:?} {air:?}");
            assert!((air.density_kg_m3 - row[3]).abs() < 6e-7, "{row:?} {air:?}");
            assert!((air.sound_m_s - row[4]).abs() < 6e-5, "{row:?} {air:?}");
        }
    }

    #[test]
    fn the_stratosphere_is_isothermal() {
        // ISO 2533, table 5: 20 km, 5474.87 Pa.
        let air = Atmosphere::ICAO.at(20_000.0);
        assert!((air.temperature_k - 216.65).abs() < 1e-9);
        assert!((air.pressure_pa - 5474.9).abs() < 1.0, "{air:?}");
    }

    #[test]
    fn heights_out_of_range_give_finite_air() {
        for height in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300] {
            let air = Atmosphere::ICAO.at(height);
            assert!(
                air.density_kg_m3.is_finite() && air.density_kg_m3 > 0.0 && air.sound_m_s > 200.0,
                "{height}"
            );
        }
    }

    #[test]
    fn absurd_days_are_refused() {
        assert!(Atmosphere::new(288.15, 101_325.0).is_some());
        for (k, pa) in [(0.0, 101_325.0), (f64::NAN, 101_325.0), (288.0, f64::INFINITY), (288.0, 1013.25)] {
            assert!(Atmosphere::new(k, pa).is_none(), "{k} K, {pa} Pa");
        }
    }
}
