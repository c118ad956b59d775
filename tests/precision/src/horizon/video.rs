//! Frames of the public clip from a drone, by the product's own import of videos.

use std::ops::ControlFlow;

use anyhow::{Context as _, Result};
use bowwave_calibration::{CalibrationFile, Date};
use bowwave_import::{ImportError, ImportOptions, import_video};
use bowwave_record::{Entry, RecordingReader};

use super::frames::{Frame, decoded};
use crate::recorded;

/// Height of the drone over the sea, metres: guessed from the houses on the cliff.
const DRONE_M: f64 = 40.0;

/// All frames, with the lens of the calibration that goes with the clip. None, with a word of it, where clip or ffmpeg is
/// absent.
pub fn karma() -> Result<Vec<Frame>> {
    let Some(video) = recorded::find("camera_imu/gopro_karma/karma.mp4") else { return Ok(Vec::new()) };
    let calibration = concat!(env!("CARGO_MANIFEST_DIR"), "/../../calibration/examples/gopro_karma.toml");
    let calibration = CalibrationFile::read(calibration.as_ref())?;
    let folder = tempfile::tempdir().context("no folder for the recording")?;
    let recording = folder.path().join("karma.mcap");
    let options = ImportOptions {
        calibration: Some(calibration.clone()),
        without_gyro: true,
        ..ImportOptions::new(Date::new(2026, 11, 21).context("a date")?)
    };
    match import_video(&video, &recording, &options, &mut |_| ControlFlow::Continue(())) {
        Ok(_) => {}
        Err(e @ ImportError::ProgramMissing { .. }) => {
            println!("skipped: {e}");
            return Ok(Vec::new());
        }
        Err(e) => return Err(e.into()),
    }
    let mut frames = Vec::new();
    for entry in RecordingReader::open(&recording)?.entries()? {
        if let Entry::Frame(frame) = entry? {
            let mut frame = decoded(&format!("karma_{:03}", frames.len()), &frame.jpeg)?;
            frame.lens = calibration.calibration.lens;
            frame.eye_m = DRONE_M;
            frames.push(frame);
        }
    }
    Ok(frames)
}
