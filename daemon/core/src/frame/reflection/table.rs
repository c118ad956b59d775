//! The baked table and what it says for one sea.

use super::grid::{
    DISTANCES, ELEVATIONS, FORCES, RECORD, RISES, STATES, STORED, TONES, WINDS, distance_place,
    elevation_place, state_weights,
};
use crate::sea::BeaufortForce;

/// Numbers of one force and wind.
const PLANE: usize = ELEVATIONS * DISTANCES * RISES * STORED;
/// Numbers of all.
const TOTAL: usize = FORCES * WINDS * PLANE;
/// How far aside, over the distance, is held from minus this to this.
const ASIDE_MAX: f32 = 2.0;
/// Spreads are held in steps of this: metres for the level, and for the tilt its tangent.
const SPREAD_STEP: f64 = 1e-4;

/// The baked table.
const BAKED: &[u8] = include_bytes!("../../../data/reflection.bin");

/// Whether number `i` says how far aside light goes, or its spread.
fn is_aside(i: usize) -> bool {
    (STATES * 2 * TONES..STORED - 1).contains(&(i % STORED))
}

/// Eight bits a number, by its root, which keeps small ones; then for each force the spreads of level (metres) and
/// tilt (tangent) of a small boat, sixteen bits.
pub fn encode(values: &[f32], spreads: &[[f64; 2]]) -> Vec<u8> {
    let code = |(i, v): (usize, &f32)| {
        if !is_aside(i) {
            (v.clamp(0.0, 1.0).sqrt() * 255.0).round() as u8
        } else {
            let unit = (v / ASIDE_MAX).clamp(-1.0, 1.0);
            (128.0 + 127.0 * unit.abs().sqrt().copysign(unit)).round() as u8
        }
    };
    let spread = |s: &f64| ((s / SPREAD_STEP).round() as u16).to_le_bytes();
    values.iter().enumerate().map(code).chain(spreads.as_flattened().iter().flat_map(spread)).collect()
}

fn decode(bytes: &[u8]) -> Vec<f32> {
    let value = |(i, byte): (usize, &u8)| {
        if !is_aside(i) {
            (f32::from(*byte) / 255.0).powi(2)
        } else {
            let unit = (f32::from(*byte) - 128.0) / 127.0;
            unit * unit.abs() * ASIDE_MAX
        }
    };
    bytes.iter().enumerate().map(value).collect()
}

/// How waves of all forces and winds mirror.
#[derive(Clone, Debug)]
pub struct ReflectionTable {
    values: Vec<f32>,
    spreads: [[f64; 2]; FORCES],
}

/// The table for one strength of the wind.
#[derive(Clone, Debug, PartialEq)]
pub struct SeaLobes {
    values: Vec<f32>,
    /// Standard deviation of a small boat's level, metres, and of the tangent of its tilt.
    spread: [f64; 2],
}

/// From where to where a line of sight goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct SightLine {
    /// Angle from it to the direction in which the wind blows, radians clockwise.
    pub(super) wind_to_view: f64,
    /// Level of the water at the hull over the mean one, metres.
    pub(super) level_m: f64,
    /// How steeply that water rises away from the eye, tangent.
    pub(super) tilt: f64,
    /// Radians below the horizontal.
    pub(super) elevation: f64,
    /// From where it meets the water to the hull, metres.
    pub(super) distance_m: f64,
}

/// The records of all rises for one line of sight.
pub(super) type TableColumn = [[f32; RECORD]; RISES];

impl ReflectionTable {
    /// The table that comes with the program.
    pub fn baked() -> Self {
        let (values, spreads) = BAKED.split_at(TOTAL.min(BAKED.len()));
        let mut values = decode(values);
        values.resize(TOTAL, 0.0);
        let mut all = [[0.0; 2]; FORCES];
        for (spread, pair) in all.as_flattened_mut().iter_mut().zip(spreads.chunks_exact(2)) {
            *spread = SPREAD_STEP * pair.iter().rev().fold(0.0, |sum, b| sum * 256.0 + f64::from(*b));
        }
        Self { values, spreads: all }
    }

    /// The table for a wind 10 m above the sea, m/s; between the forces' own winds it is interpolated. Beyond Beaufort 4 it is that.
    pub fn sea(&self, wind_m_s: f64) -> SeaLobes {
        let mut sea = SeaLobes { values: vec![0.0; WINDS * PLANE], spread: [0.0; 2] };
        self.set_sea(&mut sea, wind_m_s);
        sea
    }

    /// The same into what is there.
    pub fn set_sea(&self, sea: &mut SeaLobes, wind_m_s: f64) {
        sea.values.fill(0.0);
        sea.spread = [0.0; 2];
        for (f, weight) in neighbours(force_place(wind_m_s), FORCES) {
            let values = self.values.iter().skip(f * WINDS * PLANE);
            for (sum, v) in sea.values.iter_mut().zip(values) {
                *sum += weight as f32 * v;
            }
            for (sum, spread) in sea.spread.iter_mut().zip(self.spreads.get(f).unwrap_or(&[0.0; 2])) {
                *sum += weight * spread;
            }
        }
    }
}

impl SeaLobes {
    /// The records of a line of sight.
    pub(super) fn column(&self, sight: &SightLine) -> TableColumn {
        let mut out = [[0.0; RECORD]; RISES];
        let (wind, mirrored) = wind_place(sight.wind_to_view);
        let [level, tilt] = self.spread.map(|s| s.max(1e-3));
        let states = state_weights(sight.level_m / level, sight.tilt / tilt);
        for (w, ww) in neighbours(wind, WINDS) {
            for (e, ew) in neighbours(elevation_place(sight.elevation), ELEVATIONS) {
                for (d, dw) in neighbours(distance_place(sight.distance_m), DISTANCES) {
                    let weight = (ww * ew * dw) as f32;
                    if weight == 0.0 {
                        continue;
                    }
                    let start = ((w * ELEVATIONS + e) * DISTANCES + d) * RISES * STORED;
                    let values = self.values.get(start..start + RISES * STORED).unwrap_or(&[]);
                    for (sums, stored) in out.iter_mut().zip(values.chunks_exact(STORED)) {
                        let (shares, aside) = stored.split_at(STATES * 2 * TONES);
                        for (share, state) in shares.chunks_exact(2 * TONES).zip(states) {
                            if state == 0.0 {
                                continue;
                            }
                            let weight = weight * state as f32;
                            for (sum, v) in sums.iter_mut().zip(share) {
                                *sum += weight * v;
                            }
                        }
                        for (sum, v) in sums.iter_mut().skip(2 * TONES).zip(aside) {
                            *sum += weight * v;
                        }
                    }
                }
            }
        }
        // The first state may count for less than nothing.
        for record in &mut out {
            record.iter_mut().take(2 * TONES).for_each(|v| *v = v.max(0.0));
        }
        if mirrored {
            out.iter_mut().for_each(|record| record[2 * TONES] = -record[2 * TONES]);
        }
        out
    }
}

/// Place of a wind among the forces' own winds.
pub(super) fn force_place(wind_m_s: f64) -> f64 {
    // BeaufortForce::wind_mean_m_s turned round.
    let force =
        (wind_m_s.max(0.0) / BeaufortForce::new(1).map_or(1.0, BeaufortForce::wind_mean_m_s)).powf(2.0 / 3.0);
    if force.is_finite() { force.clamp(0.0, FORCES as f64 - 1.0) } else { FORCES as f64 - 1.0 }
}

/// Place of an angle among the winds, and whether the sea is to be mirrored left and right.
pub(super) fn wind_place(wind_to_view: f64) -> (f64, bool) {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    let angle = if wind_to_view.is_finite() { wind_to_view.rem_euclid(PI) } else { 0.0 };
    if angle > FRAC_PI_2 { ((PI - angle) / FRAC_PI_4, true) } else { (angle / FRAC_PI_4, false) }
}

/// The two nodes around a place and their weights.
pub(super) fn neighbours(place: f64, count: usize) -> [(usize, f64); 2] {
    let first = (place as usize).min(count.saturating_sub(2));
    let part = place - first as f64;
    [(first, 1.0 - part), (first + 1, part)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_from_eight_bits() {
        let values: Vec<f32> = (0..3 * STORED).map(|i| 0.012 * i as f32).collect();
        for (i, (got, want)) in decode(&encode(&values, &[])).iter().zip(&values).enumerate() {
            let most = if !is_aside(i) { 1.0 } else { ASIDE_MAX };
            let want = want.min(most);
            // Half a step of the root.
            assert!((got - want).abs() < 1.1 * (want * most).sqrt() / 127.0 + 1e-4, "{i}: {got} {want}");
        }
    }

    fn sight(wind_to_view: f64, elevation: f64, distance_m: f64) -> SightLine {
        SightLine { wind_to_view, level_m: 0.0, tilt: 0.0, elevation, distance_m }
    }

    #[test]
    fn the_table_is_whole_and_its_shares_are_shares() {
        assert_eq!(BAKED.len(), TOTAL + 4 * FORCES);
        let table = ReflectionTable::baked();
        for (i, column) in table.values.chunks_exact(RISES * STORED).enumerate() {
            for kind in 0..STATES * TONES {
                let thrown: f32 = column.chunks_exact(STORED).map(|r| r[2 * kind]).sum();
                assert!((0.0..=1.03).contains(&thrown), "column {i}, kind {kind}: {thrown}");
            }
        }
        let spreads = table.spreads;
        assert!(spreads[0] == [0.0; 2] && spreads.windows(2).all(|s| s[1] >= s[0]), "{spreads:?}");
    }

    #[test]
    fn places_off_the_grid_take_its_ends_and_a_wind_from_behind_is_one_from_before() {
        let table = ReflectionTable::baked();
        let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
        let alike = |a: f64, b: f64| close(&table.sea(a).values, &table.sea(b).values);
        // Force 4, and calm.
        assert!(alike(1e9, 0.836 * 8.0) && alike(-3.0, 0.0) && !alike(0.0, 3.0));
        let sea = table.sea(3.0);
        let flat = |wind: f64| sea.column(&sight(wind, 0.1, 5.0)).as_flattened().to_vec();
        assert!(close(&flat(0.3), &flat(0.3 + std::f64::consts::PI)));
        assert!(close(&flat(f64::NAN), &flat(0.0)));
        // From the other side light goes to the other side.
        let (left, right) = (sea.column(&sight(-0.6, 0.1, 5.0)), sea.column(&sight(0.6, 0.1, 5.0)));
        assert!((left[5][2 * TONES] + right[5][2 * TONES]).abs() < 1e-5 && right[5][2 * TONES].abs() > 1e-4);
        for elevation in [0.0, 1e-9, 3.0, f64::NAN] {
            for distance_m in [-5.0, 0.0, 1e9, f64::NAN] {
                for level_m in [-1e9, 0.0, 2.0, f64::NAN] {
                    let sight =
                        SightLine { wind_to_view: 0.1, level_m, tilt: -level_m, elevation, distance_m };
                    assert!(sea.column(&sight).as_flattened().iter().all(|v| v.is_finite()));
                }
            }
        }
    }
}
