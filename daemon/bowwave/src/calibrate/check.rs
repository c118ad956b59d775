//! `bowwave calibrate check`: whether a calibration still holds, on any recording.

use anyhow::Result;
use bowwave_calibration::report::{CalibrationReport, CalibrationVerdict};

use super::input::{look, tell};
use crate::{cli::CalibrateCheck, outcome::Outcome, today::today};

/// Checks and tells: done where it holds, failed where it does not, partly where the recording does not tell.
pub fn run(arguments: &CalibrateCheck) -> Result<Outcome> {
    let named = arguments.calibration.as_deref();
    let (opened, capture, is_cut) = look(&arguments.recording, named, &arguments.input)?;
    let calibration = &opened.file.calibration;
    let found = capture.compare(calibration);
    let of = named.map_or_else(|| "Its own calibration".to_owned(), |path| path.display().to_string());
    let title = format!("{of} checked on {}", arguments.recording.display());
    let mut report = CalibrationReport::of_check(&title, &capture, calibration, &found);
    opened.warn(&mut report, is_cut, today()?);
    tell(&report, &arguments.input.output)?;
    Ok(match report.verdict {
        CalibrationVerdict::Pass | CalibrationVerdict::Good => Outcome::Done,
        CalibrationVerdict::Fail | CalibrationVerdict::Stale => Outcome::Failed,
        CalibrationVerdict::CannotTell => Outcome::Partly,
    })
}
