//! Frames of the public clip from a drone, by the product's own import of videos.

use std::ops::ControlFlow;

use anyhow::{Context as _, Result};
use bowwave_calibration::{CalibrationFile, Date};
use bowwave_core::time::Time;
use bowwave_import::{ImportError, ImportOptions, import_video};
use bowwave_record::{Entry, RecordingReader};

use super::frames::{SeaFrame, decoded};
use crate::recorded;

/// Height of the drone over the sea, metres: guessed from the houses on the cliff.
const DRONE_M: f64 = 40.0;

/// The clip's place among the public recordings.
pub const KARMA: &str = "camera_imu/gopro_karma/karma.mp4";

/// When a picture was taken, and its bytes.
pub type TimedFrame = (Time, Vec<u8>);

/// Time on the container's clock and JPEG of all pictures. None, with a word of it, where clip or ffmpeg is absent.
pub fn karma_pictures() -> Result<Option<Vec<TimedFrame>>> {
    let Some(video) = recorded::find(KARMA) else { return Ok(None) };
    let folder = tempfile::tempdir().context("no folder for the recording")?;
    let recording = folder.path().join("karma.mcap");
    let today = Date::new(2026, 11, 21).context("a date")?;
    let options = ImportOptions { without_gyro: true, ..ImportOptions::new(today) };
    match import_video(&video, &recording, &options, &mut |_| ControlFlow::Continue(())) {
        Ok(_) => {}
        Err(e @ ImportError::ProgramMissing { .. }) => {
            println!("skipped: {e}");
            return Ok(None);
        }
        Err(e) => return Err(e.into()),
    }
    let mut pictures = Vec::new();
    for entry in RecordingReader::open(&recording)?.entries()? {
        if let Entry::Frame(frame) = entry? {
            pictures.push((frame.mid_exposure, frame.jpeg.to_vec()));
        }
    }
    Ok(Some(pictures))
}

/// All frames, with the lens of the calibration that goes with the clip. None, with a word of it, where clip or ffmpeg is
/// absent.
pub fn karma() -> Result<Vec<SeaFrame>> {
    let calibration = concat!(env!("CARGO_MANIFEST_DIR"), "/../../calibration/examples/gopro_karma.toml");
    let calibration = CalibrationFile::read(calibration.as_ref())?;
    let mut frames = Vec::new();
    for (i, (_, jpeg)) in karma_pictures()?.into_iter().flatten().enumerate() {
        let mut frame = decoded(&format!("karma_{i:03}"), &jpeg)?;
        frame.lens = calibration.calibration.lens;
        frame.eye_m = DRONE_M;
        frames.push(frame);
    }
    Ok(frames)
}
