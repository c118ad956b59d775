//! The numerical parts.

pub mod ambient;
mod attitude;
mod beam;
mod board;
mod calibration;
mod camera;
mod clock;
mod colour;
mod cut;
mod depth;
mod drawn;
mod drawn_boat;
mod driving;
mod fires;
mod flight;
mod fresnel;
mod fusion;
mod haze;
mod heading;
mod hits;
mod horizon;
mod hull;
mod lamps;
mod lens;
mod misses;
mod moon;
mod motion;
mod mount;
mod noise;
mod orientation;
mod own;
mod pacing;
mod phantom;
mod reflection;
pub mod relight;
mod sea;
mod seeing;
pub mod shadow;
mod shutter;
mod skylight;
mod skyline;
mod sun;
mod target;
mod warp;
mod wavefield;

use anyhow::Result;
use hw_sim::ocean::random;

use crate::bench::PartBench;

/// Description of a part above its rows.
#[derive(Clone, Copy, Debug)]
pub struct About {
    /// The part's name, as in the rows.
    pub part: &'static str,
    /// Its task in the product.
    pub what: &'static str,
    /// The truth, and why it shares nothing with the code under test.
    pub truth: &'static str,
    /// The rivals that it is held against.
    pub rivals: &'static str,
    /// Why the default was chosen.
    pub why: &'static str,
}

/// One numerical part.
pub struct NumericalPart {
    /// Its description.
    pub about: About,
    /// Measures its scenes and extreme cases.
    pub measure: fn(&mut PartBench) -> Result<()>,
}

/// All of them, in the order of the report.
pub const PARTS: &[NumericalPart] = &[
    NumericalPart { about: clock::ABOUT, measure: clock::measure },
    NumericalPart { about: attitude::ABOUT, measure: attitude::measure },
    NumericalPart { about: orientation::ABOUT, measure: orientation::measure },
    NumericalPart { about: fusion::ABOUT, measure: fusion::measure },
    NumericalPart { about: own::ABOUT, measure: own::measure },
    NumericalPart { about: heading::ABOUT, measure: heading::measure },
    NumericalPart { about: horizon::ABOUT, measure: horizon::measure },
    NumericalPart { about: haze::ABOUT, measure: haze::measure },
    NumericalPart { about: skyline::ABOUT, measure: skyline::measure },
    NumericalPart { about: sun::ABOUT, measure: sun::measure },
    NumericalPart { about: moon::ABOUT, measure: moon::measure },
    NumericalPart { about: skylight::ABOUT, measure: skylight::measure },
    NumericalPart { about: ambient::ABOUT, measure: ambient::measure },
    NumericalPart { about: shadow::ABOUT, measure: shadow::measure },
    NumericalPart { about: hull::ABOUT, measure: hull::measure },
    NumericalPart { about: phantom::ABOUT, measure: phantom::measure },
    NumericalPart { about: beam::ABOUT, measure: beam::measure },
    NumericalPart { about: lamps::ABOUT, measure: lamps::measure },
    NumericalPart { about: relight::ABOUT, measure: relight::measure },
    NumericalPart { about: fires::ABOUT, measure: fires::measure },
    NumericalPart { about: noise::ABOUT, measure: noise::measure },
    NumericalPart { about: seeing::ABOUT, measure: seeing::measure },
    NumericalPart { about: lens::ABOUT, measure: lens::measure },
    NumericalPart { about: drawn::ABOUT, measure: drawn::measure },
    NumericalPart { about: shutter::ABOUT, measure: shutter::measure },
    NumericalPart { about: calibration::ABOUT, measure: calibration::measure },
    NumericalPart { about: target::ABOUT, measure: target::measure },
    NumericalPart { about: camera::ABOUT, measure: camera::measure },
    NumericalPart { about: board::ABOUT, measure: board::measure },
    NumericalPart { about: mount::ABOUT, measure: mount::measure },
    NumericalPart { about: pacing::ABOUT, measure: pacing::measure },
    NumericalPart { about: flight::ABOUT, measure: flight::measure },
    NumericalPart { about: hits::ABOUT, measure: hits::measure },
    NumericalPart { about: misses::ABOUT, measure: misses::measure },
    NumericalPart { about: cut::ABOUT, measure: cut::measure },
    NumericalPart { about: sea::ABOUT, measure: sea::measure },
    NumericalPart { about: wavefield::ABOUT, measure: wavefield::measure },
    NumericalPart { about: motion::ABOUT, measure: motion::measure },
    NumericalPart { about: driving::ABOUT, measure: driving::measure },
    NumericalPart { about: reflection::ABOUT, measure: reflection::measure },
    NumericalPart { about: fresnel::ABOUT, measure: fresnel::measure },
    NumericalPart { about: colour::ABOUT, measure: colour::measure },
    NumericalPart { about: depth::ABOUT, measure: depth::measure },
];

/// The numeric rows of a CSV text: comments and the heading aside; cells that are no numbers become NaN.
fn table(csv: &str) -> Vec<Vec<f64>> {
    csv.lines()
        .filter(|line| !line.starts_with('#'))
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.trim().parse().unwrap_or(f64::NAN)).collect())
        .collect()
}

/// Uniform numbers 0 to 1 from splitmix64 of `i`: the product draws from another generator.
pub(crate) fn even(i: u64) -> f64 {
    random::unit(random::mix(i.wrapping_mul(random::GOLDEN)))
}

/// The largest; NaN where one of them is none, so that no broken value hides.
fn worst(errors: impl IntoIterator<Item = f64>) -> f64 {
    errors.into_iter().fold(0.0, |a: f64, e| if a.is_nan() || e.is_nan() { f64::NAN } else { a.max(e) })
}

/// Root mean square; NaN where one of them is none.
pub fn rms(errors: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = errors.into_iter().fold((0.0, 0.0), |(s, n), e| (s + e * e, n + 1.0));
    (sum / count).sqrt()
}
