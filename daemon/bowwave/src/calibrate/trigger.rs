//! `bowwave calibrate trigger`: how long after the line's edge a round leaves, from dry shots.

use anyhow::Result;
use bowwave_calibration::{
    capture::Capture,
    report::{CalibrationReport, CalibrationVerdict},
    trigger,
};

use super::input::{open, tell, write};
use crate::{cli::CalibrateTrigger, outcome::Outcome, today::today};

/// Solves, tells and writes.
pub fn run(arguments: &CalibrateTrigger) -> Result<Outcome> {
    let opened = open(&arguments.recording, arguments.files.calibration.as_deref())?;
    let mut capture = Capture::new(opened.file.calibration.lens, 0.0);
    let is_cut = opened.play(false, |event| capture.take(&event))?;
    let found = trigger::solve(capture.readings(), capture.edges());
    let today = today()?;
    let title = format!("Trigger from {}, {today}", arguments.recording.display());
    let mut report = CalibrationReport::of_trigger(&title, &found);
    opened.warn(&mut report, is_cut, today);
    tell(&report, &arguments.output)?;
    if let Ok(found) = &found {
        let mut file = opened.file;
        file.set_trigger(found, today);
        write(file, today, &arguments.files)?;
    }
    Ok(if report.verdict == CalibrationVerdict::Pass { Outcome::Done } else { Outcome::Failed })
}
