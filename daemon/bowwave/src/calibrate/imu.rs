//! `bowwave calibrate imu`: rotation and time offset between camera and inertial unit, and the gyro's bias.

use anyhow::Result;
use bowwave_calibration::sheet::{Sheet, Verdict};

use super::material::{look, tell, write};
use crate::{cli::CalibrateImu, outcome::Outcome, today::today};

/// Solves, tells and writes.
pub fn run(arguments: &CalibrateImu) -> Result<Outcome> {
    let (opened, capture, is_cut) =
        look(&arguments.recording, arguments.files.calibration.as_deref(), &arguments.material)?;
    let found = capture.solve();
    let today = today()?;
    let title = format!("Camera and inertial unit from {}, {today}", arguments.recording.display());
    let mut sheet = Sheet::of_alignment(&title, &capture, &found);
    opened.warn(&mut sheet, is_cut, today);
    tell(&sheet, &arguments.material.told)?;
    let passed = sheet.verdict == Verdict::Pass;
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
