//! What a sea does to the light of one boat: the table for its place and height.

use glam::Vec3;

use super::{
    grid::{RISE_NODES, TONES, rise_sine},
    table::{Column, SeaLobes, SkyLight},
};
use crate::light::LUMINANCE;

/// Bands of height that a boat is held in.
pub const BANDS: usize = 10;
/// Distances from the hull at which lobes are held.
pub const STEPS: usize = 64;

/// A boat's bands are finer at its foot, which is seen in the sea from farther off.
const BAND_POWER: f64 = 1.4;
/// What throws back less than this, everywhere, is not drawn.
const SHARE_MIN: f32 = 0.006;

/// What a pixel of water throws back of one band of a boat.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lobe {
    /// Share of the band's light, by brightness of the pixel.
    pub thrown: [f32; TONES],
    /// Luminance of the sky that the band hides from the pixel, by brightness of the pixel.
    pub taken: [f32; TONES],
    /// How far right of the pixel's own direction the band is seen, metres at the hull.
    pub aside_m: f32,
    /// Half width of the stretch of hull that is seen, metres.
    pub half_width_m: f32,
}

/// Lobes of one boat.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lobes {
    /// Distance from the hull beyond which there is no reflection, metres.
    pub reach_m: f64,
    /// Colour of the sky that is taken away, over its luminance.
    pub hue: Vec3,
    /// By distance from the hull, at [`Lobes::step_m`], and by band from the water up.
    pub steps: Vec<[Lobe; BANDS]>,
}

impl Lobes {
    /// Distance from the hull of a step, metres: they grow with the square.
    pub fn step_m(&self, step: usize) -> f64 {
        self.reach_m * (step as f64 / (STEPS - 1) as f64).powi(2)
    }

    /// Place of a distance among the steps; beyond the last it is more than `STEPS - 1`.
    pub fn place(&self, distance_m: f64) -> f64 {
        (distance_m.max(0.0) / self.reach_m.max(1e-6)).sqrt() * (STEPS - 1) as f64
    }

    /// The lobes at a place among the steps, interpolated.
    pub fn at(&self, place: f64) -> [Lobe; BANDS] {
        let first = (place as usize).min(STEPS - 2);
        let part = (place - first as f64).clamp(0.0, 1.0) as f32;
        let none = [Lobe::default(); BANDS];
        let (a, b) = (self.steps.get(first).unwrap_or(&none), self.steps.get(first + 1).unwrap_or(&none));
        std::array::from_fn(|i| a[i].mix(&b[i], part))
    }
}

impl Lobe {
    fn mix(&self, other: &Self, part: f32) -> Self {
        let mix = |a: f32, b: f32| a + (b - a) * part;
        Self {
            thrown: std::array::from_fn(|t| mix(self.thrown[t], other.thrown[t])),
            taken: std::array::from_fn(|t| mix(self.taken[t], other.taken[t])),
            aside_m: mix(self.aside_m, other.aside_m),
            half_width_m: mix(self.half_width_m, other.half_width_m),
        }
    }
}

/// Height of the lower edge of a band of a boat `height_m` high, metres; of `BANDS`, the boat's.
pub fn band_edge_m(height_m: f64, band: usize) -> f64 {
    height_m * (band as f64 / BANDS as f64).powf(BAND_POWER)
}

/// How a boat is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Angle from the wind's direction to the line of sight, radians clockwise; a sea looks the same half a turn on.
    pub wind_to_view: f64,
    /// The sky behind the boat.
    pub sky: SkyLight,
    /// Height of the eye over the water, metres.
    pub eye_m: f64,
    /// Distance to the boat along the sea, metres.
    pub range_m: f64,
    /// Height of the boat over the water, metres.
    pub height_m: f64,
}

impl Lobes {
    /// The lobes of a boat.
    pub fn of(sea: &SeaLobes, seen: &Seen) -> Self {
        let mut lobes = Self::default();
        lobes.set(sea, seen);
        lobes
    }

    /// The same into what is there. Empty where the sea throws back nothing that is seen.
    pub fn set(&mut self, sea: &SeaLobes, seen: &Seen) {
        self.steps.clear();
        self.reach_m = 0.0;
        let strength = |distance: f64| {
            let strongest = |l: &Lobe| l.thrown.iter().copied().fold(0.0, f32::max);
            bands(sea, seen, distance).iter().map(strongest).sum::<f32>()
        };
        // Nearer the eye than a twentieth of the range there is no water to be seen.
        let farthest = 0.95 * seen.range_m;
        if !(farthest > 0.0 && farthest.is_finite() && seen.eye_m > 0.0 && seen.height_m > 0.0) {
            return;
        }
        let tries = 24;
        let reach = (1..=tries).rev().map(|i| farthest * (f64::from(i) / f64::from(tries)).powi(2));
        let Some(reach_m) = reach.into_iter().find(|d| strength(*d) >= SHARE_MIN) else { return };
        self.reach_m = reach_m;
        // Seen from a quarter of the reach a third of the boat's height hides this sky.
        let tangent = 0.35 * seen.height_m / (0.25 * reach_m);
        self.hue = seen.sky.hue(tangent / (1.0 + tangent * tangent).sqrt());
        for i in 0..STEPS {
            let step = bands(sea, seen, self.step_m(i));
            // It ends at nothing.
            let end = |l: Lobe| Lobe { thrown: [0.0; TONES], taken: [0.0; TONES], ..l };
            self.steps.push(if i == STEPS - 1 { step.map(end) } else { step });
        }
    }
}

/// The lobes at one distance from the hull.
fn bands(sea: &SeaLobes, seen: &Seen, distance_m: f64) -> [Lobe; BANDS] {
    let distance = distance_m.max(0.05);
    let to_water = (seen.range_m - distance).max(0.05 * seen.range_m);
    let cells = sea.column(seen.wind_to_view, (seen.eye_m / to_water).atan(), distance);
    std::array::from_fn(|b| {
        let lower = if b == 0 { f64::NEG_INFINITY } else { band_edge_m(seen.height_m, b) / distance };
        band(&cells, &seen.sky, [lower, band_edge_m(seen.height_m, b + 1) / distance], distance)
    })
}

/// Sum of the cells between two rises.
fn band(cells: &Column, sky: &SkyLight, [from, to]: [f64; 2], distance_m: f64) -> Lobe {
    let mut lobe = Lobe::default();
    let mut weight = 0.0;
    let mut below = f64::NEG_INFINITY;
    for (r, (cell, node)) in cells.iter().zip(RISE_NODES).enumerate() {
        let part = if below.is_finite() {
            ((to.min(node) - from.max(below)) / (node - below)).clamp(0.0, 1.0)
        } else {
            f64::from(from == f64::NEG_INFINITY)
        };
        below = node;
        if part <= 0.0 {
            continue;
        }
        let light = sky.at(rise_sine(r)).dot(LUMINANCE);
        let mut thrown = 0.0;
        for t in 0..TONES {
            lobe.thrown[t] += part as f32 * cell[2 * t];
            lobe.taken[t] += part as f32 * cell[2 * t + 1] * light;
            thrown += part as f32 * cell[2 * t];
        }
        weight += thrown;
        lobe.aside_m += thrown * cell[2 * TONES];
        lobe.half_width_m += thrown * cell[2 * TONES + 1];
    }
    let scale = distance_m as f32 / weight.max(1e-9);
    lobe.aside_m *= scale;
    // A box as wide has the spread's standard deviation.
    lobe.half_width_m *= scale * 3.0_f32.sqrt();
    lobe
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reflection::table::Table;

    fn seen(eye_m: f64, range_m: f64, height_m: f64) -> Seen {
        let sky = SkyLight::of_bands(Vec3::new(0.6, 0.66, 0.72), Vec3::new(0.35, 0.42, 0.52));
        Seen { wind_to_view: 0.4, sky, eye_m, range_m, height_m }
    }

    #[test]
    fn lobes_are_finite_wherever_a_boat_is_and_end_at_nothing() {
        let table = Table::baked();
        for wind in [0.0, 0.84, 3.3, 6.7, 12.0, f64::NAN] {
            let sea = table.sea(wind);
            for eye in [0.0, 0.01, 4.0, 15.0, -2.0, f64::NAN] {
                for range in [0.0, 0.5, 60.0, 5000.0, 1e9, f64::NAN] {
                    for height in [0.0, 1.5, 60.0] {
                        let lobes = Lobes::of(&sea, &seen(eye, range, height));
                        assert!(lobes.reach_m.is_finite() && lobes.hue.is_finite());
                        for lobe in lobes.steps.iter().flatten() {
                            let all = lobe
                                .thrown
                                .iter()
                                .chain(&lobe.taken)
                                .chain([&lobe.aside_m, &lobe.half_width_m]);
                            assert!(
                                all.clone().all(|v| v.is_finite()),
                                "{wind} {eye} {range} {height}: {lobe:?}"
                            );
                            assert!(lobe.thrown.iter().all(|t| (0.0..=1.01).contains(t)));
                        }
                        let last = lobes.steps.last().map_or(0.0, |s| s.iter().map(|l| l.thrown[0]).sum());
                        assert_eq!(last, 0.0);
                    }
                }
            }
        }
    }

    /// On a calm a boat's whole height is mirrored as far off as geometry has it, and light is what Fresnel's formula leaves of it.
    #[test]
    fn a_calm_mirrors_a_tall_boat_by_fresnels_share() {
        let sea = Table::baked().sea(0.0);
        let lobes = Lobes::of(&sea, &seen(8.0, 60.0, 30.0));
        let near = lobes.at(lobes.place(5.0));
        let sum: f32 = near.iter().map(|l| 0.5 * (l.thrown[1] + l.thrown[2])).sum();
        // 8 m over 55 m: 8.3 degrees; slopes that face the eye are steeper by some of their 3.1 degrees. Fresnel, n = 1.34, at a grazing
        // angle of 10 degrees: 0.349 (mean of 0.407 and 0.291).
        assert!((0.3..0.62).contains(&sum), "{sum}");
        // Rougher water throws back less, and less far up.
        let rough = Lobes::of(&Table::baked().sea(6.7), &seen(8.0, 60.0, 30.0));
        let rough: f32 = rough.at(rough.place(5.0)).iter().map(|l| 0.5 * (l.thrown[1] + l.thrown[2])).sum();
        assert!(rough < 0.8 * sum, "{rough} {sum}");
    }
}
