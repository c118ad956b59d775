//! `bowwave calibrate extrinsics`: rotation and time offset between camera and inertial unit, and the gyro's bias.

use anyhow::Result;
use bowwave_calibration::report::{CalibrationReport, CalibrationVerdict};

use super::input::{look, tell, write};
use crate::{cli::CalibrateExtrinsics, outcome::Outcome, today::today};

/// Solves, tells and writes.
pub fn run(arguments: &CalibrateExtrinsics) -> Result<Outcome> {
    let (opened, capture, is_cut) =
        look(&arguments.recording, arguments.files.calibration.as_deref(), &arguments.input)?;
    let found = capture.solve();
    let today = today()?;
    let title = format!("Camera and inertial unit from {}, {today}", arguments.recording.display());
    let mut report = CalibrationReport::of_alignment(&title, &capture, &found);
    opened.warn(&mut report, is_cut, today);
    tell(&report, &arguments.input.output)?;
    let passed = report.verdict == CalibrationVerdict::Pass;
    match &found {
        Ok(found) if passed || arguments.accept_poor => {
            let mut file = opened.file;
            file.set_alignment(found, today, &capture.how(found));
            write(file, today, &arguments.files)?;
        }
        Ok(_) => eprintln!("nothing is written; --accept-poor writes it all the same"),
        Err(_) => {}
    }
    Ok(if passed { Outcome::Done } else { Outcome::Failed })
}
