//! `bowwave calibrate trigger`: how long after the line's edge a round leaves, from dry shots.

use anyhow::Result;
use bowwave_calibration::{
    Provenance,
    capture::Capture,
    sheet::{Sheet, Verdict},
    trigger,
};
use bowwave_core::{calibration::TriggerLatency, time::secs_to_ns};

use super::material::{open, tell, write};
use crate::{cli::CalibrateTrigger, import::today, outcome::Outcome};

/// Solves, tells and writes.
pub fn run(arguments: &CalibrateTrigger) -> Result<Outcome> {
    let opened = open(&arguments.recording, arguments.files.calibration.as_deref())?;
    // Nothing is looked for in pictures: the height of the eye does not matter.
    let mut capture = Capture::new(opened.file.calibration.lens, 1.0);
    let is_cut = opened.play(false, |event| capture.take(&event))?;
    let found = trigger::solve(capture.readings(), capture.edges());
    let today = today()?;
    let title = format!("Trigger from {}, {today}", arguments.recording.display());
    let mut sheet = Sheet::of_trigger(&title, &found);
    opened.warn(&mut sheet, is_cut, today);
    tell(&sheet, &arguments.told)?;
    if let Ok(found) = &found {
        let how =
            format!("{} dry shots, {:.1} ms apart from each other", found.jolts.len(), found.spread_s * 1e3);
        let mut file = opened.file;
        file.calibration.trigger = Some(TriggerLatency {
            latency_ns: secs_to_ns(found.latency_s),
            sigma_ns: secs_to_ns(found.sigma_s).max(1),
        });
        file.trigger = Some(Provenance::new(today, how));
        write(file, today, &arguments.files)?;
    }
    Ok(if sheet.verdict == Verdict::Pass { Outcome::Done } else { Outcome::Failed })
}
