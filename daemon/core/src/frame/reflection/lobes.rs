//! Reflection of one boat in a sea: the table for its place and height.

use glam::Vec3;

use super::{
    grid::{DISTANCE_MIN_M, RISE_NODES, RISES, TONES},
    table::{SeaLobes, SightLine},
};
use crate::{
    colour::LUMINANCE,
    estimate::light::{Light, SkyLight},
};

/// Bands of height that a boat is held in, at most.
pub const BANDS: usize = 10;
/// Distances from the hull at which lobes are held, at most.
pub const STEPS: usize = 20;
/// And at least.
const BANDS_MIN: usize = 3;
const STEPS_MIN: usize = 8;
/// No band is finer than so many pixels of the boat, and no step beside the hull than so many of the water.
const BAND_PX: f64 = 0.8;
const STEP_PX: f64 = 0.4;

/// A boat's bands are finer at its foot, which is seen in the sea from farther off.
const BAND_POWER: f64 = 1.8;
/// Water that throws back less than this share of a boat's light is not drawn: where the boat is black against a bright sky it changes one
/// or two codes of 256.
const SHARE_MIN: f32 = 0.02;
/// Beside the boat it is drawn down to this one, of which nothing is seen to end.
const SHARE_ASIDE: f32 = 0.005;

/// Diffuse reflectance of the water below its surface, as seen from above without the surface: clear coastal water (Mobley 1994, section 3.8).
const WATER: Vec3 = Vec3::new(0.006, 0.022, 0.030);
/// Close to the hull the boat keeps so much of the light from the water below, since it comes in under it and beside it; and the distance, in
/// heights of the boat, over which that falls to a third.
const WATER_SHADED: f64 = 0.6;
const WATER_SHADED_HEIGHTS: f64 = 1.4;
/// Distances among which that is looked for beyond which there is no reflection; and the nearest of them, among which it need not grow weaker.
const TRIES: usize = 24;
const NEAREST: usize = 3;
/// No wave mirrors more than so many times the sky that a bright one does; the sky may be held too dark by some.
const SKY_MOST: f32 = 1.5;

/// A share that changes with a pixel's brightness.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LuminanceWeight {
    /// Its mean over the pixels of a sea.
    pub mean: f32,
    /// By how much more a bright pixel has it (one that is [`TONE_OUTER`](super::grid::TONE_OUTER) beyond the mean), and a dark one less.
    pub slope: f32,
}

/// How many of a sea's pixels are dark, middling and bright, where brightness is distributed normally.
const TONE_SHARES: [f32; TONES] = [0.293, 0.414, 0.293];

impl LuminanceWeight {
    /// Of a dark, a middling and a bright pixel.
    fn of(tones: [f32; TONES]) -> Self {
        let mean = tones.iter().zip(TONE_SHARES).map(|(v, share)| v * share).sum();
        Self { mean, slope: 0.5 * (tones[TONES - 1] - tones[0]) }
    }

    /// The most that dark or bright pixels have.
    pub fn most(&self) -> f32 {
        self.mean + self.slope.abs()
    }

    fn mix(&self, other: &Self, part: f32) -> Self {
        let mix = |a: f32, b: f32| a + (b - a) * part;
        Self { mean: mix(self.mean, other.mean), slope: mix(self.slope, other.slope) }
    }
}

/// Transfer from one band of a boat to a pixel of water.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReflectionTransfer {
    /// Share of the band's light.
    pub thrown: LuminanceWeight,
    /// Share of the pixel's own luminance that the band hides from it.
    pub taken: LuminanceWeight,
    /// Colour of what is hidden over the pixel's own: its luminance is 1.
    pub hue: Vec3,
    /// Luminance above which a pixel's light is not the sky's: the sun's glitter, of which a boat hides little. The same for all bands.
    pub sky_most: f32,
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
    /// How many bands of height there are: as many as the boat is large in the picture.
    pub bands: usize,
    /// By distance from the hull, at [`Lobes::step_m`], and by band from the water up; bands that there are not throw back nothing.
    pub steps: Vec<[ReflectionTransfer; BANDS]>,
    /// How far to either side of the hull it is seen at each step, metres at the hull.
    pub aside_m: Vec<f64>,
}

impl Lobes {
    /// Distance from the hull of a step, metres: they grow with the square.
    pub fn step_m(&self, step: usize) -> f64 {
        step_m(self.reach_m, step, self.last())
    }

    /// Place of a distance among the steps; beyond the last it is more than the last's.
    pub fn place(&self, distance_m: f64) -> f64 {
        (distance_m.max(0.0) / self.reach_m.max(1e-6)).sqrt() * self.last()
    }

    /// Place of the last step.
    fn last(&self) -> f64 {
        self.steps.len().saturating_sub(1).max(1) as f64
    }

    /// The lobes at a place among the steps, interpolated.
    pub fn at(&self, place: f64) -> [ReflectionTransfer; BANDS] {
        let first = (place as usize).min(self.steps.len().saturating_sub(2));
        let part = (place - first as f64).clamp(0.0, 1.0) as f32;
        let none = [ReflectionTransfer::default(); BANDS];
        let (a, b) = (self.steps.get(first).unwrap_or(&none), self.steps.get(first + 1).unwrap_or(&none));
        std::array::from_fn(|i| a[i].mix(&b[i], part))
    }
}

impl ReflectionTransfer {
    /// Share of the band's light that water throws back which lies so far beyond an end of a hull.
    fn seen_beyond(&self, beyond_m: f32, width_m: f32) -> f32 {
        let half = self.half_width_m.max(1e-6);
        let part = (half + self.aside_m.abs() - beyond_m).min(width_m) / (2.0 * half);
        self.thrown.mean * part.clamp(0.0, 1.0)
    }

    fn mix(&self, other: &Self, part: f32) -> Self {
        let mix = |a: f32, b: f32| a + (b - a) * part;
        Self {
            thrown: self.thrown.mix(&other.thrown, part),
            taken: self.taken.mix(&other.taken, part),
            hue: self.hue.lerp(other.hue, part),
            sky_most: mix(self.sky_most, other.sky_most),
            aside_m: mix(self.aside_m, other.aside_m),
            half_width_m: mix(self.half_width_m, other.half_width_m),
        }
    }
}

/// Distance from the hull of a step, of which `last` is the last's place, metres.
fn step_m(reach_m: f64, step: usize, last: f64) -> f64 {
    reach_m * (step as f64 / last).powi(2)
}

/// Height of the lower edge of a band, of so many, of a boat `height_m` high, metres; of band `bands`, the boat's.
fn band_edge_m(height_m: f64, band: usize, bands: usize) -> f64 {
    height_m * (band as f64 / bands as f64).powf(BAND_POWER)
}

/// So many as the lowest, or nearest, of them is `least_px` of `whole_px` wide, where they grow with a power.
fn divisions(whole_px: f64, least_px: f64, power: f64, (fewest, most): (usize, usize)) -> usize {
    let count = (whole_px / least_px).max(1.0).powf(1.0 / power).ceil();
    if count.is_finite() { (count as usize).clamp(fewest, most) } else { most }
}

/// How a boat is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReflectionView {
    /// Angle from the line of sight to the direction in which the wind blows, radians clockwise; a sea looks the same half a turn on.
    pub wind_to_view: f64,
    /// The sky behind the boat.
    pub sky: SkyLight,
    /// Light that comes out of the water, linear: see [`water_light`].
    pub water: Vec3,
    /// Level of the water at the boat over the mean one, metres.
    pub level_m: f64,
    /// How steeply that water rises away from the eye, tangent.
    pub tilt: f64,
    /// Height of the eye over the water, metres.
    pub eye_m: f64,
    /// Distance to the boat along the sea, metres.
    pub range_m: f64,
    /// Height of the boat over the water, metres.
    pub height_m: f64,
    /// Width of the boat across the line of sight, metres.
    pub width_m: f64,
    /// Tangent that one pixel spans downwards.
    pub pixel: f64,
}

impl ReflectionView {
    /// How high the boat stands in the picture, pixels.
    fn height_px(&self) -> f64 {
        self.height_m / (self.range_m * self.pixel)
    }

    /// How far below the hull the water at a distance from it lies in the picture, pixels.
    fn below_px(&self, distance_m: f64) -> f64 {
        (self.eye_m / (self.range_m - distance_m) - self.eye_m / self.range_m) / self.pixel
    }
}

/// Light that comes out of clear coastal water lit by sun and sky, before the surface keeps some of it.
pub fn water_light(light: &Light) -> Vec3 {
    WATER * light.on_level()
}

impl Lobes {
    /// The lobes of a boat.
    pub fn of(sea: &SeaLobes, seen: &ReflectionView) -> Self {
        let mut lobes = Self::default();
        lobes.set(sea, seen);
        lobes
    }

    /// The same into what is there. Empty where the sea throws back nothing that is seen.
    pub fn set(&mut self, sea: &SeaLobes, seen: &ReflectionView) {
        self.steps.clear();
        self.aside_m.clear();
        self.reach_m = 0.0;
        self.bands = divisions(seen.height_px(), BAND_PX, BAND_POWER, (BANDS_MIN, BANDS));
        let width = seen.width_m as f32;
        let strength =
            |distance: f64| seen_beyond(&bands(sea, seen, distance, self.bands), -0.5 * width, width);
        // Nearer the eye than a twentieth of the range there is no water to be seen.
        let farthest = 0.95 * seen.range_m;
        if !(farthest > 0.0 && farthest.is_finite() && seen.eye_m > 0.0 && seen.height_m > 0.0 && width > 0.0)
        {
            return;
        }
        let reach = |i: usize| farthest * (i as f64 / TRIES as f64).powi(2);
        let Some(reach_m) = last_seen(|i| strength(reach(i)) >= SHARE_MIN).map(reach) else { return };
        self.reach_m = reach_m;
        let last = divisions(seen.below_px(reach_m), STEP_PX, 2.0, (STEPS_MIN, STEPS)) - 1;
        for i in 0..=last {
            let distance_m = step_m(reach_m, i, last as f64);
            let step = pixel_bands(sea, seen, distance_m, self.bands);
            self.aside_m.push(f64::from(aside(&step, width)));
            // It ends at nothing.
            let end = |l: ReflectionTransfer| ReflectionTransfer {
                thrown: LuminanceWeight::default(),
                taken: LuminanceWeight::default(),
                ..l
            };
            self.steps.push(if i == last { step.map(end) } else { step });
        }
    }
}

/// The farthest of [`TRIES`] distances at which a reflection is seen, which grows weaker from [`NEAREST`] on.
fn last_seen(is_seen: impl Fn(usize) -> bool) -> Option<usize> {
    let (mut seen, mut unseen) = (NEAREST, TRIES + 1);
    while unseen - seen > 1 {
        let middle = usize::midpoint(seen, unseen);
        *(if is_seen(middle) { &mut seen } else { &mut unseen }) = middle;
    }
    if seen > NEAREST { Some(seen) } else { (1..=NEAREST).rev().find(|i| is_seen(*i)) }
}

/// Share of the boat's light that water throws back which lies so far beyond an end of the hull.
fn seen_beyond(bands: &[ReflectionTransfer; BANDS], beyond_m: f32, width_m: f32) -> f32 {
    bands.iter().map(|l| l.seen_beyond(beyond_m, width_m)).sum()
}

/// How far beyond an end of the hull more than [`SHARE_ASIDE`] is seen, metres.
fn aside(bands: &[ReflectionTransfer; BANDS], width_m: f32) -> f32 {
    let widest = bands.iter().map(|l| l.half_width_m + l.aside_m.abs()).fold(0.0, f32::max);
    let (mut seen, mut unseen) = (0.0, widest);
    for _ in 0..8 {
        let middle = 0.5 * (seen + unseen);
        let there = seen_beyond(bands, middle, width_m) > SHARE_ASIDE;
        *(if there { &mut seen } else { &mut unseen }) = middle;
    }
    unseen
}

/// The lobes of a pixel whose middle is at a distance from the hull: far off it sees a long stretch of water, over which they change.
fn pixel_bands(
    sea: &SeaLobes,
    seen: &ReflectionView,
    distance_m: f64,
    count: usize,
) -> [ReflectionTransfer; BANDS] {
    let to_water = (seen.range_m - distance_m).max(0.05 * seen.range_m);
    let length_m = seen.pixel * to_water * to_water / seen.eye_m;
    // Two points of Gauss's formula.
    let [near, far] = [-1.0, 1.0].map(|side| distance_m + side * length_m / 12.0_f64.sqrt());
    if !(length_m > 0.1 * distance_m.max(0.5) && far < 0.95 * seen.range_m) {
        return bands(sea, seen, distance_m, count);
    }
    let (near, far) = (bands(sea, seen, near.max(0.0), count), bands(sea, seen, far, count));
    std::array::from_fn(|b| near[b].mix(&far[b], 0.5))
}

/// Share of one of the table's cells.
#[derive(Clone, Copy, Default)]
struct TableCell {
    thrown: [f32; TONES],
    /// Light of the sky that is mirrored from there.
    sky: [Vec3; TONES],
    aside: f32,
    spread: f32,
}

/// The lobes at one distance from the hull, of so many bands.
fn bands(
    sea: &SeaLobes,
    seen: &ReflectionView,
    distance_m: f64,
    count: usize,
) -> [ReflectionTransfer; BANDS] {
    // Nearer than the table reaches, waves between hull and water no longer change what is seen.
    let distance_m = distance_m.max(DISTANCE_MIN_M);
    let to_water = (seen.range_m - distance_m).max(0.05 * seen.range_m);
    let elevation = (seen.eye_m / to_water).atan();
    let ReflectionView { wind_to_view, level_m, tilt, .. } = *seen;
    let column = sea.column(&SightLine { wind_to_view, level_m, tilt, elevation, distance_m });
    let mut cells = [TableCell::default(); RISES];
    let (mut sky, mut mirrored) = ([Vec3::ZERO; TONES], [0.0; TONES]);
    for (cell, record) in cells.iter_mut().zip(&column) {
        let light = seen.sky.at(f64::from(record[2 * TONES + 2]));
        cell.thrown = std::array::from_fn(|t| record[2 * t]);
        cell.sky = std::array::from_fn(|t| light * record[2 * t + 1]);
        [cell.aside, cell.spread] = [record[2 * TONES], record[2 * TONES + 1]];
        for t in 0..TONES {
            sky[t] += cell.sky[t];
            mirrored[t] += cell.thrown[t];
        }
    }
    // All that a pixel sees: only shares of it count, so that the sky may be held too bright or too dark.
    let shaded = WATER_SHADED * (-distance_m / (WATER_SHADED_HEIGHTS * seen.height_m)).exp();
    let whole: [Vec3; TONES] = std::array::from_fn(|t| {
        let water = seen.water * ((1.0 - mirrored[t]).max(0.0) * (1.0 - shaded as f32));
        (sky[t] + water).max(Vec3::splat(1e-6))
    });
    std::array::from_fn(|b| {
        if b >= count {
            return ReflectionTransfer::default();
        }
        let edge = |b| band_edge_m(seen.height_m, b, count) / distance_m;
        let lower = if b == 0 { f64::NEG_INFINITY } else { edge(b) };
        band(&cells, &whole, [lower, edge(b + 1)], distance_m)
    })
}

/// Sum of the cells between two rises.
fn band(
    cells: &[TableCell; RISES],
    whole: &[Vec3; TONES],
    [from, to]: [f64; 2],
    distance_m: f64,
) -> ReflectionTransfer {
    let mut lobe = ReflectionTransfer::default();
    let (mut thrown, mut hidden) = ([0.0; TONES], [Vec3::ZERO; TONES]);
    let mut below = f64::NEG_INFINITY;
    for (cell, node) in cells.iter().zip(RISE_NODES) {
        let part = if below.is_finite() {
            ((to.min(node) - from.max(below)) / (node - below)).clamp(0.0, 1.0)
        } else {
            f64::from(from == f64::NEG_INFINITY)
        } as f32;
        below = node;
        if part <= 0.0 {
            continue;
        }
        for t in 0..TONES {
            thrown[t] += part * cell.thrown[t];
            hidden[t] += part * cell.sky[t] / whole[t];
        }
        let all: f32 = cell.thrown.iter().sum();
        lobe.aside_m += part * all * cell.aside;
        lobe.half_width_m += part * all * cell.spread;
    }
    let scale = distance_m as f32 / thrown.iter().sum::<f32>().max(1e-9);
    lobe.aside_m *= scale;
    // A box as wide has the spread's standard deviation.
    lobe.half_width_m *= scale * 3.0_f32.sqrt();
    lobe.thrown = LuminanceWeight::of(thrown);
    lobe.taken = LuminanceWeight::of(hidden.map(|h| h.dot(LUMINANCE)));
    let middling = hidden[TONES / 2];
    lobe.hue = middling / middling.dot(LUMINANCE).max(1e-9);
    lobe.sky_most = SKY_MOST * whole[TONES - 1].dot(LUMINANCE);
    lobe
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::reflection::table::ReflectionTable;

    fn seen(eye_m: f64, range_m: f64, height_m: f64) -> ReflectionView {
        let sky = SkyLight::of_bands(Vec3::new(0.6, 0.66, 0.72), Vec3::new(0.35, 0.42, 0.52));
        let water = Vec3::new(0.004, 0.016, 0.023);
        ReflectionView {
            wind_to_view: 0.4,
            sky,
            water,
            level_m: 0.1,
            tilt: 0.02,
            eye_m,
            range_m,
            height_m,
            width_m: 3.0 * height_m,
            pixel: 7e-4,
        }
    }

    #[test]
    fn lobes_are_finite_wherever_a_boat_is_and_end_at_nothing() {
        let table = ReflectionTable::baked();
        for wind in [0.0, 0.84, 3.3, 6.7, 12.0, f64::NAN] {
            let sea = table.sea(wind);
            for eye in [0.0, 0.01, 4.0, 15.0, -2.0, f64::NAN] {
                for range in [0.0, 0.5, 60.0, 5000.0, 1e9, f64::NAN] {
                    for height in [0.0, 1.5, 60.0] {
                        let lobes = Lobes::of(&sea, &seen(eye, range, height));
                        assert!(lobes.reach_m.is_finite());
                        for lobe in lobes.steps.iter().flatten() {
                            assert!(
                                lobe.aside_m.is_finite() && lobe.half_width_m.is_finite(),
                                "{wind} {eye} {range} {height}: {lobe:?}"
                            );
                            assert!(lobe.hue.is_finite());
                            for share in [lobe.thrown, lobe.taken] {
                                assert!(
                                    (0.0..=1.03).contains(&share.mean) && share.most() < 1.5,
                                    "{share:?}"
                                );
                            }
                        }
                        let last =
                            lobes.steps.last().map_or(0.0, |s| s.iter().map(|l| l.thrown.most()).sum());
                        assert_eq!(last, 0.0);
                    }
                }
            }
        }
    }

    /// What lies between the steps is what is there, however few there are of them.
    #[test]
    fn a_far_boats_few_steps_hold_what_many_would() {
        for wind in [0.84, 3.3, 6.7] {
            let sea = ReflectionTable::baked().sea(wind);
            for range in [30.0, 60.0, 150.0, 400.0] {
                let seen = seen(8.0, range, 3.0);
                let lobes = Lobes::of(&sea, &seen);
                let all = |lobes: &[ReflectionTransfer; BANDS]| {
                    let sum = |of: fn(&ReflectionTransfer) -> f32| lobes.iter().map(of).sum::<f32>();
                    [sum(|l| l.thrown.mean + l.taken.mean), sum(|l| l.thrown.slope + l.taken.slope)]
                };
                let mut worst: f32 = 0.0;
                for i in 0..=200 {
                    // In the last step it fades away.
                    let distance_m = lobes.reach_m * 0.8 * f64::from(i) / 200.0;
                    let (held, there) =
                        (lobes.at(lobes.place(distance_m)), pixel_bands(&sea, &seen, distance_m, BANDS));
                    for (held, there) in all(&held).iter().zip(all(&there)) {
                        worst = worst.max((held - there).abs());
                    }
                }
                // Of as much as two. Farther off, all of it lies within a pixel.
                assert!(worst < 0.06, "wind {wind}, {range} m: {worst}");
                assert!(range < 300.0 || lobes.steps.len() <= STEPS / 2 && lobes.bands <= BANDS / 2);
            }
        }
    }

    #[test]
    fn a_reflection_ends_where_no_farther_water_shows_it() {
        let views = |wind: f64| {
            let sea = ReflectionTable::baked().sea(wind);
            for range in [5.0, 15.0, 30.0, 60.0, 150.0, 400.0, 1000.0, 5000.0] {
                for (eye, height) in [(2.0, 0.3), (3.0, 1.0), (6.0, 2.0), (6.0, 8.0), (20.0, 30.0)] {
                    for (turn, level, tilt) in [(0.0, 0.0, 0.0), (0.7, 0.5, 0.05), (1.5, -0.5, -0.05)] {
                        let seen = ReflectionView {
                            eye_m: eye,
                            height_m: height,
                            wind_to_view: turn,
                            level_m: level,
                            tilt,
                            ..seen(8.0, range, 3.0)
                        };
                        let lobes = Lobes::of(&sea, &seen);
                        let count = divisions(seen.height_px(), BAND_PX, BAND_POWER, (BANDS_MIN, BANDS));
                        let width = seen.width_m as f32;
                        let is_seen = |distance_m: &f64| {
                            let bands = bands(&sea, &seen, *distance_m, count);
                            seen_beyond(&bands, -0.5 * width, width) >= SHARE_MIN
                        };
                        let mut tries =
                            (1..=TRIES).rev().map(|i| 0.95 * range * (i as f64 / TRIES as f64).powi(2));
                        let farthest = tries.find(is_seen);
                        assert_eq!(lobes.reach_m, farthest.unwrap_or(0.0), "{wind} m/s, {seen:?}");
                    }
                }
            }
        };
        [0.0, 0.5, 2.0, 6.7, 20.0].into_iter().for_each(views);
    }

    /// On a calm a boat's whole height is mirrored as far off as geometry has it, and light is what Fresnel's formula leaves of it.
    #[test]
    fn a_calm_mirrors_a_tall_boat_by_fresnels_share() {
        let sea = ReflectionTable::baked().sea(0.0);
        let lobes = Lobes::of(&sea, &seen(8.0, 60.0, 30.0));
        let near = lobes.at(lobes.place(5.0));
        let sum: f32 = near.iter().map(|l| l.thrown.mean).sum();
        // 8 m over 55 m: 8.3 degrees; slopes that face the eye are steeper by some of their 3.1 degrees. Fresnel, n = 1.34, at a grazing
        // angle of 10 degrees: 0.349 (mean of 0.407 and 0.291).
        assert!((0.3..0.62).contains(&sum), "{sum}");
        // Rougher water throws back less, and less far up.
        let rough = Lobes::of(&ReflectionTable::baked().sea(6.7), &seen(8.0, 60.0, 30.0));
        let rough: f32 = rough.at(rough.place(5.0)).iter().map(|l| l.thrown.mean).sum();
        assert!(rough < 0.8 * sum, "{rough} {sum}");
    }
}
