//! How much of a hull the waves before it hide: at a grazing angle they stand before its foot.

use super::{
    grid::{ELEVATIONS, FORCES, STATES, WINDS, elevation_place, state_weights},
    table::{force_place, neighbours, wind_place},
};

/// The baked table: millimetres by force, wind, elevation and state, then for each force the spreads of level and tilt of a small boat.
const BAKED: &[u8] = include_bytes!("../../../data/hiding.bin");
/// Numbers of all.
const TOTAL: usize = FORCES * WINDS * ELEVATIONS * STATES;
/// Heights are held in steps of this, metres.
const HEIGHT_STEP_M: f64 = 1e-3;
/// Spreads are held in steps of this: metres for the level, and for the tilt its tangent.
const SPREAD_STEP: f64 = 1e-4;

/// How a boat is seen over the waves before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighted {
    /// Wind 10 m above the sea, m/s; beyond Beaufort 4 it counts as that.
    pub wind_m_s: f64,
    /// Angle from the line of sight to the direction in which it blows, radians clockwise.
    pub wind_to_view: f64,
    /// Angle below the horizontal under which the boat's foot is seen, radians.
    pub elevation: f64,
    /// Level of the water at the boat over the mean one, metres.
    pub level_m: f64,
    /// How steeply that water rises away from the eye, tangent.
    pub tilt: f64,
}

/// Height over a boat's own water up to which waves before it hide it, in the mean, metres.
pub fn hidden_m(sighted: &Sighted) -> f64 {
    let (wind, _) = wind_place(sighted.wind_to_view);
    let mut sum = 0.0;
    for (force, weight) in neighbours(force_place(sighted.wind_m_s), FORCES) {
        let [level, tilt] = [0, 1].map(|i| (SPREAD_STEP * number(TOTAL + 2 * force + i)).max(1e-3));
        let states = state_weights(sighted.level_m / level, sighted.tilt / tilt);
        for (w, ww) in neighbours(wind, WINDS) {
            for (e, ew) in neighbours(elevation_place(sighted.elevation), ELEVATIONS) {
                let first = ((force * WINDS + w) * ELEVATIONS + e) * STATES;
                let here = states.iter().enumerate().map(|(s, share)| share * number(first + s));
                sum += weight * ww * ew * HEIGHT_STEP_M * here.sum::<f64>();
            }
        }
    }
    sum.max(0.0)
}

/// A number of the table.
fn number(i: usize) -> f64 {
    match BAKED.get(2 * i..2 * i + 2) {
        Some(&[low, high]) => f64::from(i16::from_le_bytes([low, high])),
        _ => 0.0,
    }
}

/// The table as it is stored: metres, and each force's spreads of level (metres) and tilt (tangent).
pub fn encode_hiding(metres: &[f64], spreads: &[[f64; 2]]) -> Vec<u8> {
    let spreads = spreads.as_flattened().iter().map(|s| s / SPREAD_STEP);
    let all = metres.iter().map(|m| m / HEIGHT_STEP_M).chain(spreads);
    all.flat_map(|v| (v.round() as i16).to_le_bytes()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hidden(wind_m_s: f64, elevation: f64, level_m: f64) -> f64 {
        hidden_m(&Sighted { wind_m_s, wind_to_view: 0.7, elevation, level_m, tilt: 0.0 })
    }

    #[test]
    fn rough_seas_hide_more_the_more_they_are_seen_from_the_side_and_most_in_a_trough() {
        assert_eq!(BAKED.len(), 2 * (TOTAL + 2 * FORCES));
        for elevation in [0.01, 0.02, 0.05] {
            let by_wind = [0.0, 0.84, 2.4, 4.3, 6.7].map(|wind| hidden(wind, elevation, 0.0));
            assert!(by_wind[0] == 0.0 && by_wind.is_sorted(), "{elevation}: {by_wind:?}");
        }
        let by_elevation = [0.1, 0.05, 0.02, 0.01].map(|elevation| hidden(6.7, elevation, 0.0));
        assert!(by_elevation.is_sorted(), "{by_elevation:?}");
        // Force 4 raises waves of 1 m; seen from 8 m at 400 m some of that stands before a boat at the mean level.
        let mean = by_elevation[2];
        assert!((0.04..0.3).contains(&mean), "{by_elevation:?}");
        let (low, high) = (hidden(6.7, 0.02, -0.2), hidden(6.7, 0.02, 0.3));
        assert!(low > mean + 0.1 && high < 0.7 * mean, "{low} {high}");
    }

    #[test]
    fn what_is_no_number_hides_nothing_that_is_none() {
        for bad in [f64::NAN, f64::INFINITY, -1e9] {
            for sighted in [
                Sighted { wind_m_s: bad, wind_to_view: 0.0, elevation: 0.02, level_m: 0.0, tilt: 0.0 },
                Sighted { wind_m_s: 5.0, wind_to_view: bad, elevation: 0.02, level_m: 0.0, tilt: 0.0 },
                Sighted { wind_m_s: 5.0, wind_to_view: 0.0, elevation: bad, level_m: 0.0, tilt: 0.0 },
                Sighted { wind_m_s: 5.0, wind_to_view: 0.0, elevation: 0.02, level_m: bad, tilt: 0.0 },
                Sighted { wind_m_s: 5.0, wind_to_view: 0.0, elevation: 0.02, level_m: 0.0, tilt: bad },
            ] {
                assert!((0.0..3.0).contains(&hidden_m(&sighted)), "{sighted:?}: {}", hidden_m(&sighted));
            }
        }
    }
}
