//! A fire on a boat: its heat and its light.
//!
//! A fire on fuel grows with the square of time (the ultra-fast curve of NFPA 92) and stops growing at a megawatt.

/// Heat of an outboard and its fuel as it catches fire, and as it burns fully, kW.
const HEAT_LEAST_KW: f64 = 150.0;
const HEAT_MOST_KW: f64 = 1000.0;
/// Growth of the heat, kW/s^2.
const GROWTH_KW_S2: f64 = 0.1876;
/// Luminous intensity of a fire for each kW, cd: that of 160 lm to all sides, as a candle gives 12 lm of 80 W.
pub const FIRE_CANDELA_KW: f64 = 12.7;

/// Heat of a fire `since_s` seconds after it was lit, kW; 0 before that.
pub fn fire_heat_kw(since_s: f64) -> f64 {
    if since_s < 0.0 { 0.0 } else { (HEAT_LEAST_KW + GROWTH_KW_S2 * since_s * since_s).min(HEAT_MOST_KW) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fire_grows_for_a_minute_to_a_megawatt() {
        assert_eq!([-1.0, 0.0, 1e6].map(fire_heat_kw), [0.0, 150.0, 1000.0]);
        assert!(fire_heat_kw(60.0) < 1000.0 && fire_heat_kw(70.0) == 1000.0);
    }
}
