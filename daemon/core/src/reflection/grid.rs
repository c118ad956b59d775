//! The places at which the baked table is known.

/// Wind forces (Beaufort) that have tables.
pub const FORCES: usize = 5;
/// Angles between wind and line of sight: 0, 45 and 90 degrees. A sea looks the same from before and behind, and mirrored from the
/// other side.
pub const WINDS: usize = 3;
/// Elevations of the line of sight.
pub const ELEVATIONS: usize = 14;
/// Distances from the water to the hull.
pub const DISTANCES: usize = 12;
/// Heights on the hull over the distance to it.
pub const RISES: usize = 12;
/// Brightnesses of a pixel.
pub const TONES: usize = 4;
/// Numbers at one elevation, distance and rise: what is thrown back and what is taken away for each brightness, then how far aside light
/// goes, mean and spread.
pub const RECORD: usize = 2 * TONES + 2;

/// Least elevation, and the ratio of each to the one before, radians below the horizontal.
const ELEVATION_MIN: f64 = 0.004;
const ELEVATION_RATIO: f64 = 1.45;
/// Least distance, metres, and the ratio of each to the one before.
const DISTANCE_MIN_M: f64 = 0.4;
const DISTANCE_RATIO: f64 = 1.8;

/// Tangents of the directions that bound the cells in height; what lies below the first comes from under the mean water.
pub const RISE_NODES: [f64; RISES] = [0.0, 0.02, 0.05, 0.09, 0.14, 0.2, 0.28, 0.38, 0.52, 0.75, 1.2, 3.0];

/// The brightnesses, in standard deviations from the sea's mean at that elevation: the eighths of a normal distribution, evenly spaced.
pub const TONE_STEP: f64 = 0.767;
/// The first of them.
pub const TONE_FIRST: f64 = -1.5 * TONE_STEP;

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

/// Sine of the direction that stands for the cell whose upper bound is rise node `r`.
pub fn rise_sine(r: usize) -> f64 {
    let upper = RISE_NODES.get(r).copied().unwrap_or(3.0);
    let lower = r.checked_sub(1).and_then(|l| RISE_NODES.get(l)).copied().unwrap_or(0.0);
    let tangent = 0.5 * (lower + upper).max(0.02);
    tangent / (1.0 + tangent * tangent).sqrt()
}

/// Drawn are the darkest and the brightest tone of the table and the middle between the inner two: standard deviations from the mean.
pub const DRAWN_TONE: f64 = -TONE_FIRST;

/// The drawn tones, dark to bright, of the table's.
pub fn drawn_tones(tones: &[f32; TONES]) -> [f32; 3] {
    let [dark, darker, brighter, bright] = *tones;
    [dark, 0.5 * (darker + brighter), bright]
}
