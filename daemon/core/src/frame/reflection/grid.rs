//! The places at which the baked table is known.

/// Wind forces (Beaufort) that have tables.
pub const FORCES: usize = 5;
/// Angles between wind and line of sight: 0, 45 and 90 degrees. A sea looks the same from before and behind, and mirrored from the
/// other side.
pub const WINDS: usize = 3;
/// Elevations of the line of sight.
pub const ELEVATIONS: usize = 15;
/// Distances from the water to the hull.
pub const DISTANCES: usize = 10;
/// Heights on the hull over the distance to it.
pub const RISES: usize = 13;
/// Brightnesses of a pixel: dark, middling, bright.
pub const TONES: usize = 3;
/// States of the water at the hull: the mean one, low, high, tilted away from the eye, tilted towards it.
pub const STATES: usize = 5;
/// Numbers at one elevation, distance, rise and state: what is thrown back and what share of a sky that is bright all over is taken away
/// for each brightness, then how far aside light goes, mean and spread, and the sine of the sky's elevation that it comes from.
pub const RECORD: usize = 2 * TONES + 3;
/// The same for all states, as they are stored: where light comes from is one for all.
pub const STORED: usize = STATES * 2 * TONES + 3;

/// Least elevation, and the ratio of each to the one before, radians below the horizontal.
const ELEVATION_MIN: f64 = 0.006;
const ELEVATION_RATIO: f64 = 1.36;
/// Least distance, metres, and the ratio of each to the one before.
pub const DISTANCE_MIN_M: f64 = 0.5;
const DISTANCE_RATIO: f64 = 1.85;

/// The states are so many standard deviations of the level and of the tilt of a small boat off the mean.
pub const STATE_OUTER: f64 = 1.5;
/// Beyond so many times that they are held.
const STATE_MAX: f64 = 1.4;

/// Tangents of the directions that bound the cells in height over the hull's water line; what lies below the first comes from under it, and
/// the last has also what lies above.
pub const RISE_NODES: [f64; RISES] =
    [0.0, 0.02, 0.05, 0.09, 0.14, 0.2, 0.28, 0.38, 0.52, 0.75, 1.2, 3.0, 10.0];

/// The outer brightnesses are so many standard deviations from the sea's mean at that elevation: where an eighth of a normal distribution is
/// beyond.
pub const TONE_OUTER: f64 = 1.15;
/// What pixels throw back changes with their brightness up to so many times the outer ones.
const TONE_MOST: f32 = 3.0;
/// And so many times as much as the mean over all pixels of a brightness does, which is evener than any of them: against the truth this costs
/// nothing (mean FLIP of 72 cells .0503 at 1, .0500 at 1.3, .0503 at 1.6, .0514 at 2), and it gives waves back some of their contrast.
pub const TONE_GAIN: f32 = 1.5;

/// How much each of the states counts for a level and a tilt in standard deviations; what is tilted towards the eye is positive. The first
/// counts for what the others leave.
pub fn state_weights(level: f64, tilt: f64) -> [f64; STATES] {
    let held = |v: f64| if v.is_finite() { (v / STATE_OUTER).clamp(-STATE_MAX, STATE_MAX) } else { 0.0 };
    let (level, tilt) = (held(level), held(tilt));
    [1.0 - level.abs() - tilt.abs(), (-level).max(0.0), level.max(0.0), (-tilt).max(0.0), tilt.max(0.0)]
}

/// How much each of the brightnesses counts for a tone in standard deviations.
pub fn tone_weights(tone: f64) -> [f64; TONES] {
    let at = (tone / TONE_OUTER).clamp(-1.0, 1.0);
    [(-at).max(0.0), 1.0 - at.abs(), at.max(0.0)]
}

/// By how much more than the mean is drawn at a tone in standard deviations, in steps to the outer brightnesses.
pub fn outer_tones(tone: f32) -> f32 {
    (tone / TONE_OUTER as f32).clamp(-TONE_MOST, TONE_MOST) * TONE_GAIN
}

/// Elevation of node `i`, radians.
pub fn elevation(i: usize) -> f64 {
    ELEVATION_MIN * ELEVATION_RATIO.powi(i32::try_from(i).unwrap_or(0))
}

/// Place of an elevation among the nodes, held within them.
pub fn elevation_place(radians: f64) -> f64 {
    place(radians, ELEVATION_MIN, ELEVATION_RATIO, ELEVATIONS)
}

/// Distance of node `i`, metres.
pub fn distance_m(i: usize) -> f64 {
    DISTANCE_MIN_M * DISTANCE_RATIO.powi(i32::try_from(i).unwrap_or(0))
}

/// Place of a distance among the nodes, held within them.
pub fn distance_place(metres: f64) -> f64 {
    place(metres, DISTANCE_MIN_M, DISTANCE_RATIO, DISTANCES)
}

fn place(value: f64, least: f64, ratio: f64, count: usize) -> f64 {
    let place = (value.max(least) / least).ln() / ratio.ln();
    if place.is_finite() { place.clamp(0.0, count as f64 - 1.0) } else { 0.0 }
}

/// Sky radiance by elevation, relative, that the table was baked under: a clear day's.
pub fn sky_shape(sine: f64) -> f64 {
    0.3 + 0.7 * (-sine.max(0.0) / 0.25).exp()
}
