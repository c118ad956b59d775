//! Result of a calibration or of a check, in units that maintainers know: one value, [`CalibrationReport`], made by a function for each
//! solver and shown by three renderers: as text (its `Display`), as an HTML page ([`html()`]), and as a page of the head-up display.

mod alignment;
mod check;
mod html;
pub(crate) mod hud;
mod lens;
mod mount;
mod text;

use std::fmt;

use glam::{DMat3, DVec2, DVec3};

use crate::{
    alignment::{Deviation, Residual},
    capture::Capture,
};

pub(crate) use alignment::Wanting;
pub use html::html;

/// Range at which errors are said in metres.
pub const RANGE_M: f64 = 500.0;
/// Names of turns about the camera's axes, as who turns a gun calls them.
pub(crate) const AXES: [&str; 3] = ["elevation", "traverse", "roll"];

/// Verdict of a calibration or of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CalibrationVerdict {
    /// A new calibration is good enough to train with.
    Pass,
    /// It is not, or there is none.
    Fail,
    /// An old calibration still holds.
    Good,
    /// It does not any more.
    Stale,
    /// The recording does not tell.
    CannotTell,
}

impl CalibrationVerdict {
    /// Whether nothing need be done.
    pub const fn is_well(self) -> bool {
        matches!(self, Self::Pass | Self::Good)
    }
}

impl fmt::Display for CalibrationVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pass => "PASS",
            Self::Fail => "FAIL",
            Self::Good => "GOOD",
            Self::Stale => "STALE",
            Self::CannotTell => "CANNOT TELL",
        })
    }
}

/// A residual with its place in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedResidual {
    /// Seconds after the first.
    pub seconds: f64,
    /// Residual rotation with its weight.
    pub residual: Residual,
    /// Where it was seen, pixels.
    pub pixel: DVec2,
}

/// The result of one calibration or check.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationReport {
    /// Task, recording and day.
    pub title: String,
    /// Whether the result can be used.
    pub verdict: CalibrationVerdict,
    /// The verdict in a sentence.
    pub says: String,
    /// Quantities and their values.
    pub rows: Vec<(String, String)>,
    /// Advice: causes to look into and things to do.
    pub notes: Vec<String>,
    /// Covariance of the rotation, camera's axes, rad^2.
    pub covariance: Option<DMat3>,
    /// Residual of each observation, in order of time.
    pub residuals: Vec<PlacedResidual>,
    /// Of a check: each number of the calibration, those that are wrong before the others.
    pub deviations: Vec<Deviation>,
    /// Size and focal length of the picture, pixels.
    pub picture: (DVec2, DVec2),
}

/// An angle in milliradians and what it is in metres at [`RANGE_M`].
pub fn at_range(radians: f64) -> String {
    format!("{:.2} mrad ({:.2} m at {RANGE_M:.0} m)", radians * 1e3, radians * RANGE_M)
}

fn ms(seconds: f64, sigma: f64) -> String {
    format!("{:.2} +- {:.2} ms", seconds * 1e3, sigma * 1e3)
}

fn deg_per_s(rate: DVec3) -> String {
    let [x, y, z] = rate.to_array().map(f64::to_degrees);
    format!("{x:.4}, {y:.4}, {z:.4} deg/s")
}

impl CalibrationReport {
    fn bare(title: &str, verdict: CalibrationVerdict, says: String) -> Self {
        Self {
            title: title.to_owned(),
            verdict,
            says,
            rows: Vec::new(),
            notes: Vec::new(),
            covariance: None,
            residuals: Vec::new(),
            deviations: Vec::new(),
            picture: (DVec2::ONE, DVec2::ONE),
        }
    }

    fn new(title: &str, verdict: CalibrationVerdict, says: String, capture: &Capture) -> Self {
        let lens = capture.lens();
        let picture = (DVec2::new(lens.width.into(), lens.height.into()), lens.focal);
        Self { rows: alignment::seen(capture), picture, ..Self::bare(title, verdict, says) }
    }

    fn row(&mut self, name: &str, value: String) {
        self.rows.push((name.to_owned(), value));
    }
}

#[cfg(test)]
mod tests;
