//! `bowwave calibrate imu`: rotation and time offset between camera and inertial unit, and the gyro's bias.

use anyhow::Result;
use bowwave_calibration::sheet::{Sheet, Verdict};

use super::material::{look, tell, warn};
use crate::{cli::CalibrateImu, import::today, outcome::Outcome};

/// Solves, tells and writes.
pub fn run(arguments: &CalibrateImu) -> Result<Outcome> {
    let looked = look(&arguments.recording, &arguments.material)?;
    let found = looked.capture.solve();
    let today = today()?;
    let title = format!("Camera and inertial unit from {}, {today}", arguments.recording.display());
    let mut sheet = Sheet::of_alignment(&title, &looked.capture, &found);
    warn(&mut sheet, &looked, today);
    tell(&sheet, &arguments.material)?;
    let passed = sheet.verdict == Verdict::Pass;
    let out = arguments.out.as_ref().or(arguments.material.calibration.as_ref());
    match (&found, out) {
        (Ok(found), Some(out)) if passed || arguments.accept_poor => {
            let mut file = looked.file;
            let how = if looked.capture.is_by_horizon() { "horizon" } else { "board" };
            let seconds = looked.capture.seconds();
            file.set_alignment(found, today, &format!("{seconds:.0} s of movement, {how}, {}", found.grade));
            file.write(out)?;
            eprintln!(
                "{} written; what stood there before is kept (bowwave calibrate restore)",
                out.display()
            );
        }
        (Ok(_), Some(out)) => eprintln!("{} is left as it is; --accept-poor writes it", out.display()),
        (Ok(_), None) => eprintln!("nothing is written; name a file with --out or --calibration"),
        (Err(_), _) => {}
    }
    Ok(if passed { Outcome::Done } else { Outcome::Failed })
}
