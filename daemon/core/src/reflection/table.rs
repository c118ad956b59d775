//! The baked table and what it says for one sea.

use glam::Vec3;

use super::grid::{
    DISTANCES, ELEVATIONS, FORCES, RECORD, RISES, TONES, WINDS, distance_place, elevation_place,
};
use crate::{light::LUMINANCE, sea::BeaufortForce};

/// Numbers of one force and wind.
const PLANE: usize = ELEVATIONS * DISTANCES * RISES * RECORD;
/// Numbers of all.
const TOTAL: usize = FORCES * WINDS * PLANE;
/// Shares are held from 0 to this.
const SHARE_MAX: f32 = 2.0;
/// How far aside, over the distance, is held from minus this to this.
const ASIDE_MAX: f32 = 4.0;

/// The baked table.
const BAKED: &[u8] = include_bytes!("../../data/reflection.bin");

/// Sixteen bits a number; shares by their root, which keeps small ones.
pub fn encode(values: &[f32]) -> Vec<u8> {
    let code = |(i, v): (usize, &f32)| {
        let unit = if i % RECORD < 2 * TONES {
            (v / SHARE_MAX).clamp(0.0, 1.0).sqrt()
        } else {
            (0.5 + 0.5 * v / ASIDE_MAX).clamp(0.0, 1.0)
        };
        (unit * 65_535.0).round() as u16
    };
    values.iter().enumerate().map(code).flat_map(u16::to_le_bytes).collect()
}

fn decode(bytes: &[u8]) -> Vec<f32> {
    let value = |(i, pair): (usize, &[u8])| {
        let unit = pair.iter().rev().fold(0.0, |sum, b| sum * 256.0 + f32::from(*b)) / 65_535.0;
        if i % RECORD < 2 * TONES { unit * unit * SHARE_MAX } else { (2.0 * unit - 1.0) * ASIDE_MAX }
    };
    bytes.chunks_exact(2).enumerate().map(value).collect()
}

/// Sky radiance by elevation, linear, behind a boat; linear between the nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyLight {
    /// At the elevations of [`SKY_SINES`].
    pub nodes: [Vec3; SKY_SINES.len()],
}

/// Sines of 1, 4, 9, 18, 35 and 70 degrees.
pub const SKY_SINES: [f64; 6] = [0.017_5, 0.069_8, 0.156_4, 0.309, 0.573_6, 0.939_7];

impl SkyLight {
    /// The sky whose mean radiance is `horizon` from 0.5 to 6 degrees and `sky` from there to some 20, as [`LightMeter`] has it. What lies
    /// higher than a camera sees is guessed: a sky that darkens upwards does so as a clear one, one that brightens as an overcast one.
    ///
    /// [`LightMeter`]: crate::light::LightMeter
    pub fn of_bands(horizon: Vec3, sky: Vec3) -> Self {
        // Sines of 3 and 12 degrees stand for the bands.
        let (low, high) = (0.052_3, 0.207_9);
        let node = |sine: f64, h: f32, s: f32| {
            // Clear: an exponential towards the zenith's; overcast (Moon and Spencer 1942): even in the sine.
            let shape = |x: f64| if h > s { (-x / 0.25).exp() } else { -x };
            let share = (shape(sine) - shape(high)) / (shape(low) - shape(high));
            (s + (h - s) * share as f32).clamp(0.25 * s, 3.0 * s.max(h))
        };
        let colour = |sine| Vec3::from_array(std::array::from_fn(|c| node(sine, horizon[c], sky[c])));
        Self { nodes: SKY_SINES.map(colour) }
    }

    /// Radiance at an elevation of that sine; at the ends that of the nodes there.
    pub fn at(&self, sine: f64) -> Vec3 {
        let [first, .., last] = self.nodes;
        let Some(i) = SKY_SINES.iter().position(|s| sine < *s) else { return last };
        let Some(before) = i.checked_sub(1) else { return first };
        let share = (sine - SKY_SINES[before]) / (SKY_SINES[i] - SKY_SINES[before]);
        self.nodes[before].lerp(self.nodes[i], share as f32)
    }

    /// Its colour at an elevation of that sine, over its luminance there.
    pub fn hue(&self, sine: f64) -> Vec3 {
        let low = self.at(sine);
        low / low.dot(LUMINANCE).max(1e-6)
    }
}

/// How waves of all forces and winds mirror.
#[derive(Clone, Debug)]
pub struct Table {
    values: Vec<f32>,
}

/// The table for one strength of the wind.
#[derive(Clone, Debug, PartialEq)]
pub struct SeaLobes {
    values: Vec<f32>,
}

/// The records of all rises at one elevation and distance.
pub(super) type Column = [[f32; RECORD]; RISES];

impl Table {
    /// The table that comes with the program.
    pub fn baked() -> Self {
        let mut values = decode(BAKED);
        values.resize(TOTAL, 0.0);
        Self { values }
    }

    /// What it says for a wind 10 m above the sea, m/s; between the forces' own winds it is interpolated. Beyond Beaufort 4 it is that.
    pub fn sea(&self, wind_m_s: f64) -> SeaLobes {
        let mut sea = SeaLobes { values: vec![0.0; WINDS * PLANE] };
        self.set_sea(&mut sea, wind_m_s);
        sea
    }

    /// The same into what is there.
    pub fn set_sea(&self, sea: &mut SeaLobes, wind_m_s: f64) {
        sea.values.fill(0.0);
        for (f, weight) in neighbours(force_place(wind_m_s), FORCES) {
            let values = self.values.iter().skip(f * WINDS * PLANE);
            for (sum, v) in sea.values.iter_mut().zip(values) {
                *sum += weight as f32 * v;
            }
        }
    }
}

impl SeaLobes {
    /// The records at an angle between wind and line of sight (radians clockwise), an elevation (radians below the horizontal) and a
    /// distance to the hull (metres).
    pub(super) fn column(&self, wind_to_view: f64, elevation: f64, distance_m: f64) -> Column {
        let mut out = [[0.0; RECORD]; RISES];
        let (wind, mirrored) = wind_place(wind_to_view);
        for (w, ww) in neighbours(wind, WINDS) {
            for (e, ew) in neighbours(elevation_place(elevation), ELEVATIONS) {
                for (d, dw) in neighbours(distance_place(distance_m), DISTANCES) {
                    let weight = (ww * ew * dw) as f32;
                    let start = ((w * ELEVATIONS + e) * DISTANCES + d) * RISES * RECORD;
                    let values = self.values.get(start..start + RISES * RECORD).unwrap_or(&[]);
                    for (sum, v) in out.as_flattened_mut().iter_mut().zip(values) {
                        *sum += weight * v;
                    }
                }
            }
        }
        if mirrored {
            out.iter_mut().for_each(|record| record[2 * TONES] = -record[2 * TONES]);
        }
        out
    }
}

/// Place of a wind among the forces' own winds.
fn force_place(wind_m_s: f64) -> f64 {
    // BeaufortForce::wind_mean_m_s turned round.
    let force =
        (wind_m_s.max(0.0) / BeaufortForce::new(1).map_or(1.0, BeaufortForce::wind_mean_m_s)).powf(2.0 / 3.0);
    if force.is_finite() { force.clamp(0.0, FORCES as f64 - 1.0) } else { FORCES as f64 - 1.0 }
}

/// Place of an angle among the winds, and whether the sea is to be mirrored left and right.
fn wind_place(wind_to_view: f64) -> (f64, bool) {
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
    fn numbers_come_back_from_sixteen_bits() {
        let values: Vec<f32> = (0..3 * RECORD).map(|i| 0.003 * i as f32).collect();
        for (got, want) in decode(&encode(&values)).iter().zip(&values) {
            assert!((got - want).abs() < 1e-4, "{got} {want}");
        }
    }

    #[test]
    fn the_table_is_whole_and_its_shares_are_shares() {
        assert_eq!(BAKED.len(), 2 * TOTAL);
        let table = Table::baked();
        for (i, column) in table.values.chunks_exact(RISES * RECORD).enumerate() {
            for tone in 0..TONES {
                let thrown: f32 = column.chunks_exact(RECORD).map(|r| r[2 * tone]).sum();
                assert!((0.0..=1.01).contains(&thrown), "column {i}, tone {tone}: {thrown}");
            }
        }
    }

    #[test]
    fn places_off_the_grid_take_its_ends_and_a_wind_from_behind_is_one_from_before() {
        let table = Table::baked();
        let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
        let alike = |a: f64, b: f64| close(&table.sea(a).values, &table.sea(b).values);
        // Force 4, and calm.
        assert!(alike(1e9, 0.836 * 8.0) && alike(-3.0, 0.0) && !alike(0.0, 3.0));
        let sea = table.sea(3.0);
        let flat = |wind: f64| sea.column(wind, 0.1, 5.0).as_flattened().to_vec();
        assert!(close(&flat(0.3), &flat(0.3 + std::f64::consts::PI)));
        assert!(close(&flat(f64::NAN), &flat(0.0)));
        // From the other side light goes to the other side.
        let (left, right) = (sea.column(-0.6, 0.1, 5.0), sea.column(0.6, 0.1, 5.0));
        assert!((left[5][2 * TONES] + right[5][2 * TONES]).abs() < 1e-5 && right[5][2 * TONES].abs() > 1e-4);
        for elevation in [0.0, 1e-9, 3.0, f64::NAN] {
            for distance in [-5.0, 0.0, 1e9, f64::NAN] {
                assert!(sea.column(0.1, elevation, distance).as_flattened().iter().all(|v| v.is_finite()));
            }
        }
    }
}
