//! The numerical parts.

mod attitude;
mod board;
mod calibration;
mod camera;
mod clock;
mod colour;
mod depth;
mod drawn;
mod flight;
mod fresnel;
mod fusion;
mod haze;
mod heading;
mod horizon;
mod lens;
mod motion;
mod mount;
mod orientation;
mod own;
mod pacing;
mod reflection;
mod sea;
mod shutter;
mod skyline;
mod target;
mod warp;
mod wavefield;

use anyhow::Result;

use crate::bench::Bench;

/// What is said of a part above its rows.
#[derive(Clone, Copy, Debug)]
pub struct About {
    /// The part's name, as in the rows.
    pub part: &'static str,
    /// What it does in the product.
    pub what: &'static str,
    /// What the truth is and why it shares nothing with what is tested.
    pub truth: &'static str,
    /// What it is held against.
    pub rivals: &'static str,
    /// Why the default was chosen.
    pub why: &'static str,
}

/// One numerical part.
pub struct Part {
    /// What is said of it.
    pub about: About,
    /// Measures its scenes and extreme cases.
    pub measure: fn(&mut Bench) -> Result<()>,
}

/// All of them, in the order of the report.
pub const PARTS: &[Part] = &[
    Part { about: clock::ABOUT, measure: clock::measure },
    Part { about: attitude::ABOUT, measure: attitude::measure },
    Part { about: orientation::ABOUT, measure: orientation::measure },
    Part { about: fusion::ABOUT, measure: fusion::measure },
    Part { about: own::ABOUT, measure: own::measure },
    Part { about: heading::ABOUT, measure: heading::measure },
    Part { about: horizon::ABOUT, measure: horizon::measure },
    Part { about: haze::ABOUT, measure: haze::measure },
    Part { about: skyline::ABOUT, measure: skyline::measure },
    Part { about: lens::ABOUT, measure: lens::measure },
    Part { about: drawn::ABOUT, measure: drawn::measure },
    Part { about: shutter::ABOUT, measure: shutter::measure },
    Part { about: calibration::ABOUT, measure: calibration::measure },
    Part { about: target::ABOUT, measure: target::measure },
    Part { about: camera::ABOUT, measure: camera::measure },
    Part { about: board::ABOUT, measure: board::measure },
    Part { about: mount::ABOUT, measure: mount::measure },
    Part { about: pacing::ABOUT, measure: pacing::measure },
    Part { about: flight::ABOUT, measure: flight::measure },
    Part { about: sea::ABOUT, measure: sea::measure },
    Part { about: wavefield::ABOUT, measure: wavefield::measure },
    Part { about: motion::ABOUT, measure: motion::measure },
    Part { about: reflection::ABOUT, measure: reflection::measure },
    Part { about: fresnel::ABOUT, measure: fresnel::measure },
    Part { about: colour::ABOUT, measure: colour::measure },
    Part { about: depth::ABOUT, measure: depth::measure },
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
fn even(i: u64) -> f64 {
    let mut z = i.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
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
