//! Options and reports of the importers.

use std::path::PathBuf;

use bowwave_calibration::{CalibrationFile, Date};

use crate::GyroBias;

/// Options of an import.
#[derive(Clone, Debug)]
pub struct ImportOptions {
    /// The camera's calibration. Without it an undistorted lens of [`ImportOptions::assumed_hfov_deg`] is assumed.
    pub calibration: Option<CalibrationFile>,
    /// Horizontal field of view to assume where there is no calibration, degrees.
    pub assumed_hfov_deg: f64,
    /// Take the gyro's bias from so many seconds at the start of the video, in place of the calibration's.
    pub bias_from_s: Option<f64>,
    /// How the camera was held at the first picture. The gyro then carries on from there, and the recording's inertial unit
    /// has an attitude; without it the player levels the unit by its accelerometer, which a moving camera misleads.
    pub level: Option<Level>,
    /// Text of the scenario to keep in the recording.
    pub scenario_toml: Option<String>,
    /// Leave the video's gyro out.
    pub without_gyro: bool,
    /// Replace a recording of that name.
    pub replace: bool,
    /// Today, for what is measured during the import.
    pub today: Date,
    /// The `ffmpeg` program; `ffprobe` is looked for beside it.
    pub ffmpeg: PathBuf,
}

impl ImportOptions {
    /// No calibration, 60 degrees assumed, the gyro as it comes, no scenario, nothing replaced, `ffmpeg` from the search path.
    pub fn new(today: Date) -> Self {
        Self {
            calibration: None,
            assumed_hfov_deg: 60.0,
            bias_from_s: None,
            level: None,
            scenario_toml: None,
            without_gyro: false,
            replace: false,
            today,
            ffmpeg: PathBuf::from("ffmpeg"),
        }
    }
}

/// How a camera is held, as its picture of the horizon tells. It looks north: a gyro knows no heading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Above the horizontal, radians.
    pub elevation: f64,
    /// Clockwise, radians; the horizon then tilts the other way.
    pub roll: f64,
}

/// How far an import is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Pictures written.
    pub frames: u64,
    /// Pictures expected, where that is known.
    pub frames_total: Option<u64>,
}

/// Use of the video's gyro.
#[derive(Clone, Debug, PartialEq)]
pub enum TelemetryReport {
    /// Pictures have none.
    None,
    /// The video has no gyro track that can be read.
    Absent,
    /// There may be one, but it was not wanted.
    LeftOut,
    /// It is in the recording.
    Used {
        /// The camera's own name; may be empty.
        camera: String,
        /// Gyro samples a second by the camera's clock.
        rate_hz: f64,
        /// The bias that was taken from the start of the video, where that was wanted.
        bias: Option<GyroBias>,
    },
}

/// Report of an import.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportReport {
    /// The recording.
    pub path: PathBuf,
    /// Pictures in it.
    pub frames: u64,
    /// Samples of the inertial unit in it.
    pub imu_samples: u64,
    /// From the first entry to the last, nanoseconds.
    pub duration_ns: i64,
    /// Size of the file in bytes.
    pub bytes: u64,
    /// Width and height of the pictures.
    pub picture: (u32, u32),
    /// Use of the video's gyro.
    pub telemetry: TelemetryReport,
    /// Complaints of the video's reader that did not stop it.
    pub warnings: Vec<String>,
}
