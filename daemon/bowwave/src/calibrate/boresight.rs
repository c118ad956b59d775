//! `bowwave calibrate boresight`: where the barrel points, from trigger pulls with the gun aimed at a mark.

use anyhow::{Result, bail};
use bowwave_calibration::{
    Provenance,
    boresight::{Shot, solve},
    sheet::{Sheet, Verdict},
    target::{Target, find_tag},
};
use bowwave_core::{
    calibration::Calibration,
    event::{CameraFrame, Event, TriggerEdge},
    time::Time,
};
use glam::{DVec2, DVec3};

use super::material::{Opened, open, tell, write};
use crate::{cli::CalibrateBoresight, import::today, outcome::Outcome};

/// A picture farther from a pull than this shows another aim, seconds.
const APART_MOST_S: f64 = 0.05;
/// How well the mark is found in a picture, pixels.
const MARK_PX: f64 = 0.5;

/// A pull of the trigger, with the picture nearest to it.
struct Pull {
    fired: Time,
    nearest: Option<(f64, CameraFrame)>,
}

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
        .map(|pixel| Shot {
            hit_in_camera: calibration.lens.unproject(pixel),
            range_m: arguments.range,
            // The bore is aimed at the mark: nothing flies.
            drop_in_camera_m: DVec3::ZERO,
        })
        .collect();
    let found = solve(&shots, calibration.muzzle_in_camera, pointing_sigma(calibration, &shots));
    let today = today()?;
    let title = format!("Boresight from {}, {today}", arguments.recording.display());
    let mut sheet = Sheet::of_boresight(&title, &found, calibration);
    if missed > 0 {
        sheet.notes.push(format!("in {missed} of {} pulls the mark was not seen", pulls.len()));
    }
    opened.warn(&mut sheet, is_cut, today);
    tell(&sheet, &arguments.told)?;
    let passed = sheet.verdict == Verdict::Pass;
    if let (Ok(found), true) = (&found, passed) {
        let how = format!("{} pulls at a mark {} m away", found.residuals.len(), arguments.range);
        let mut file = opened.file;
        file.calibration.boresight = found.angles;
        file.calibration.boresight_sigma = found.sigma().max(1e-9);
        file.boresight = Provenance::new(today, how);
        write(file, today, &arguments.files)?;
    }
    Ok(if passed { Outcome::Done } else { Outcome::Failed })
}

/// How well all directions are known alike: by the lens's focal length, and by the mark's place in a picture.
fn pointing_sigma(calibration: &Calibration, shots: &[Shot]) -> f64 {
    let focal = calibration.lens.focal.y;
    let slope = |s: &Shot| s.hit_in_camera.truncate().length() / s.hit_in_camera.z.max(1e-3);
    let off_axis = shots.iter().map(slope).fold(0.0, f64::max);
    (MARK_PX / focal).hypot(off_axis * calibration.focal_sigma_px / focal)
}

/// Every pull of the trigger with its picture, and whether the recording was cut short.
fn pulls(opened: &Opened) -> Result<(Vec<Pull>, bool)> {
    let calibration = &opened.file.calibration;
    let latency_ns = calibration.trigger.map_or(0, |t| t.latency_ns);
    let mut pulls: Vec<Pull> = Vec::new();
    opened.play(false, |event| {
        if let Event::Trigger(TriggerEdge { time, pressed: true }) = event {
            pulls.push(Pull { fired: time.plus_ns(latency_ns), nearest: None });
        }
    })?;
    let is_cut = opened.play(true, |event| {
        let Event::Frame(frame) = event else { return };
        let exposed = frame.mid_exposure.plus_ns(calibration.time_offset_ns);
        for pull in &mut pulls {
            let apart = exposed.secs_since(pull.fired).abs();
            if apart < pull.nearest.as_ref().map_or(APART_MOST_S, |n| n.0) {
                pull.nearest = Some((apart, frame.clone()));
            }
        }
    })?;
    Ok((pulls, is_cut))
}

/// Where the mark is in each pull's picture.
fn seen(pulls: &[Pull], target: &Target, tag: usize) -> Vec<Option<DVec2>> {
    pulls.iter().map(|pull| find_tag(target, tag, &pull.nearest.as_ref()?.1.picture)).collect()
}
