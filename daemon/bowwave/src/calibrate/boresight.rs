//! `bowwave calibrate boresight`: where the barrel points, from trigger pulls with the gun aimed at a mark.

use anyhow::{Result, bail};
use bowwave_calibration::{
    boresight::{Pull, Shot, pointing_sigma, solve},
    report::{CalibrationReport, CalibrationVerdict},
    target::{Target, find_tag},
};
use bowwave_core::event::{CameraFrame, Event, TriggerEdge};
use glam::DVec2;

use super::input::{OpenedRecording, open, tell, write};
use crate::{cli::CalibrateBoresight, outcome::Outcome, today::today};

/// A pull of the trigger, with the picture nearest to it.
type PulledPicture = Pull<CameraFrame>;

/// Solves, tells and writes.
pub fn run(arguments: &CalibrateBoresight) -> Result<Outcome> {
    let opened = open(&arguments.recording, arguments.files.calibration.as_deref())?;
    let (pulls, is_cut) = pulls(&opened)?;
    let calibration = &opened.file.calibration;
    let marks = match arguments.target {
        Some(target) => seen(&pulls, &target, arguments.tag),
        None if arguments.mark.len() == pulls.len() => arguments.mark.iter().map(|m| Some(m.0)).collect(),
        None => bail!(
            "the recording has {} trigger pulls: give a --mark for each of them, in their order, or name the board with --target",
            pulls.len()
        ),
    };
    let missed = marks.iter().filter(|m| m.is_none()).count();
    let shots: Vec<Shot> = marks
        .into_iter()
        .flatten()
        .map(|pixel| Shot::aimed(&calibration.lens, pixel, arguments.range))
        .collect();
    let found = solve(&shots, calibration.muzzle_in_camera, pointing_sigma(calibration, &shots));
    let today = today()?;
    let title = format!("Boresight from {}, {today}", arguments.recording.display());
    let mut report = CalibrationReport::of_boresight(&title, &found, calibration);
    if missed > 0 {
        report.notes.push(format!("in {missed} of {} pulls the mark was not seen", pulls.len()));
    }
    opened.warn(&mut report, is_cut, today);
    tell(&report, &arguments.output)?;
    let passed = report.verdict == CalibrationVerdict::Pass;
    if let (Ok(found), true) = (&found, passed) {
        let mut file = opened.file;
        file.set_boresight(found, arguments.range, today);
        write(file, today, &arguments.files)?;
    }
    Ok(if passed { Outcome::Done } else { Outcome::Failed })
}

/// Every pull of the trigger with its picture, and whether the recording was cut short.
fn pulls(opened: &OpenedRecording) -> Result<(Vec<PulledPicture>, bool)> {
    let calibration = &opened.file.calibration;
    let mut pulls: Vec<PulledPicture> = Vec::new();
    opened.play(false, |event| {
        if let Event::Trigger(TriggerEdge { time, pressed: true }) = event {
            pulls.push(Pull::new(time, calibration));
        }
    })?;
    let is_cut = opened.play(true, |event| {
        let Event::Frame(frame) = event else { return };
        for pull in &mut pulls {
            pull.offer(frame.mid_exposure, calibration, || frame.clone());
        }
    })?;
    Ok((pulls, is_cut))
}

/// Where the mark is in each pull's picture.
fn seen(pulls: &[PulledPicture], target: &Target, tag: usize) -> Vec<Option<DVec2>> {
    pulls.iter().map(|pull| find_tag(target, tag, &pull.nearest.as_ref()?.1.picture)).collect()
}
