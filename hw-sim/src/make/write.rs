//! A recording out of a recipe.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use bowwave_calibration::{CalibrationFile, Date, SIMULATED, to_toml};
use bowwave_core::{
    calibration::Calibration,
    event::{Mark, TriggerEdge},
    time::{Time, secs_to_ns},
};
use bowwave_devices::nmea::line_of;
use bowwave_record::{CameraInfo, Entry, FrameEntry, PoseEntry, Properties, RecordingWriter, ShipEntry};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{
    MakeError, REVISED_ON, Recipe,
    imu::{self, draw_latency},
    ship,
    studio::{Studio, StudioShot},
};
use crate::ocean::random::stream;

/// When made recordings begin on the host's clock. Later than zero, so that nothing before the start is negative.
pub const START: Time = Time::from_ns(100_000_000_000);

/// Key in [`Properties::extra`] of how far the unit's own clock advances in one loop, nanoseconds.
pub const DEVICE_LOOP_KEY: &str = "device_loop_ns";

/// Frames drawn at once before they are written.
const BATCH: u32 = 48;

/// Summary of a made recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MadeRecording {
    /// Frames.
    pub frames: u64,
    /// Samples of the inertial unit.
    pub imu_samples: u64,
    /// Trigger edges.
    pub trigger_edges: u64,
    /// Length of the file, bytes.
    pub bytes: u64,
    /// Length of the loop, nanoseconds.
    pub loop_ns: i64,
}

/// Makes the recording of `recipe` in a new file at `path`; `progress` hears of (frames done, frames in all). An existing
/// file is not overwritten; a failure leaves the file cut short.
pub fn make(
    recipe: &Recipe,
    path: &Path,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<MadeRecording, MakeError> {
    let studio = Studio::new(recipe)?;
    let mut writer = RecordingWriter::create(path, &properties(recipe, &calibration(recipe)))?;
    let mut others = measurements(recipe).into_iter().peekable();
    let mut latency = stream(recipe.seed, 0xca3);
    let frames = studio.frames();
    progress(0, u64::from(frames));
    for first in (0..frames).step_by(BATCH as usize) {
        let batch = first..frames.min(first + BATCH);
        let shots: Vec<Result<StudioShot, MakeError>> =
            batch.clone().into_par_iter().with_max_len(1).map(|frame| studio.shoot(frame)).collect();
        for (frame, shot) in batch.clone().zip(shots) {
            let shot = shot?;
            let stamp = START.plus_ns(recipe.frame_stamp_ns(frame));
            let arrival = stamp.plus_ns(draw_latency(&mut latency, recipe.camera.latency_ns));
            let truth = Entry::Truth(PoseEntry { time: stamp, pose: shot.truth });
            let picture = Entry::Frame(FrameEntry {
                arrival,
                mid_exposure: stamp,
                sequence: frame,
                jpeg: Arc::from(shot.jpeg),
                is_recoded: false,
            });
            for entry in [truth, picture] {
                while let Some(other) = others.next_if(|o| o.time() <= entry.time()) {
                    writer.write(&other)?;
                }
                writer.write(&entry)?;
            }
        }
        progress(u64::from(batch.end), u64::from(frames));
    }
    for other in others {
        writer.write(&other)?;
    }
    let written = writer.finish()?;
    Ok(MadeRecording {
        frames: written.counts.frames,
        imu_samples: written.counts.imu,
        trigger_edges: written.counts.triggers,
        bytes: written.bytes,
        loop_ns: recipe.duration_ns(),
    })
}

/// Samples, trigger edges, the ship's lines and the operator's presses in the order in which the host meets them.
fn measurements(recipe: &Recipe) -> Vec<Entry> {
    let mut entries: Vec<Entry> = imu::samples(recipe, START).into_iter().map(Entry::Imu).collect();
    for burst in &recipe.trigger {
        let edge = |time_s: f64, pressed| {
            Entry::Trigger(TriggerEdge { time: START.plus_ns(secs_to_ns(time_s)), pressed })
        };
        entries.extend([edge(burst.start_s, true), edge(burst.start_s + burst.length_s, false)]);
    }
    entries.extend(
        ship::samples(recipe, START)
            .into_iter()
            .map(|sample| Entry::Ship(ShipEntry { arrival: sample.arrival, sentence: line_of(&sample) })),
    );
    entries.extend(
        recipe
            .marks
            .iter()
            .map(|&(time_s, kind)| Entry::Mark(Mark { time: START.plus_ns(secs_to_ns(time_s)), kind })),
    );
    entries.sort_by_key(Entry::time);
    entries
}

/// What a recording of a recipe says about itself.
pub(crate) fn properties(recipe: &Recipe, calibration: &CalibrationFile) -> Properties {
    let device_loop = imu::device_ns(recipe.duration_s, recipe.imu.clock_drift_ppm);
    Properties {
        calibration_toml: to_toml(calibration),
        scenario_toml: recipe.scenario_toml.clone(),
        loop_ns: Some(recipe.duration_ns()),
        start: START,
        source: format!("made by hw-sim, Beaufort {}, seed {}", recipe.beaufort.get(), recipe.seed),
        picture: (recipe.width, recipe.height),
        camera_info: Some(CameraInfo::from_lens(&recipe.lens())),
        extra: BTreeMap::from([
            (DEVICE_LOOP_KEY.to_owned(), device_loop.to_string()),
            ("eye_height_m".to_owned(), recipe.eye_height_m.to_string()),
            ("beaufort".to_owned(), recipe.beaufort.get().to_string()),
            ("sun_azimuth_deg".to_owned(), recipe.sky.sun_azimuth.to_degrees().to_string()),
            ("sun_elevation_deg".to_owned(), recipe.sky.sun_elevation.to_degrees().to_string()),
            ("wind_from_deg".to_owned(), recipe.wind_from.to_degrees().to_string()),
            ("significant_height_m".to_owned(), format!("{:.3}", recipe.significant_height_m())),
            ("visibility_m".to_owned(), recipe.visibility_m.to_string()),
        ]),
    }
}

/// A perfect calibration of the recipe's hardware, with the uncertainties of a good one.
pub fn calibration(recipe: &Recipe) -> CalibrationFile {
    let numbers = Calibration {
        lens: recipe.lens(),
        focal_sigma_px: 0.5,
        camera_from_imu: recipe.camera_from_imu(),
        camera_from_imu_sigma: DVec3::splat(0.75e-3),
        time_offset_ns: recipe.camera.time_offset_ns,
        time_offset_sigma_ns: 150_000,
        readout_ns: recipe.camera.readout_ns,
        readout_sigma_ns: if recipe.camera.readout_ns == 0 { 0 } else { 100_000 },
        boresight: DVec2::ZERO,
        boresight_sigma: 0.5e-3,
        muzzle_in_camera: DVec3::new(0.0, 0.12, 0.6),
        trigger: None,
        gyro_bias: recipe.imu.gyro_bias,
        gyro_bias_sigma: DVec3::splat(recipe.imu.gyro_bias_walk.max(1e-6)),
    };
    let mut file =
        CalibrationFile::new(made_on(), SIMULATED, "exact, from the recipe of a made recording", numbers);
    file.camera_name = "simulated camera".to_owned();
    file.imu_name = "simulated unit, VectorNav axes".to_owned();
    file
}

/// Made recordings are of the day of their maker's revision, which keeps equal recipes' files equal.
#[expect(clippy::expect_used, reason = "it is a day of the calendar")]
fn made_on() -> Date {
    let (year, month, day) = REVISED_ON;
    Date::new(year, month, day).expect("a day")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_made_calibration_is_of_the_day_of_its_maker() {
        let made = calibration(&Recipe::default()).made.to_string();
        assert!(made.as_str() >= "2026-11-26", "{made}");
    }
}
