//! Makes recordings from pictures and videos: [`import_pictures`] and [`import_video`].
//!
//! A video's pictures come through the `ffmpeg` program, as JPEG with the times that the container gives them; a GoPro's gyro
//! and accelerometer come from its GPMF track and become the recording's inertial unit. Both are put on one time base: the
//! video's first picture is [`START`]. What lens the camera has, how its gyro is turned and how far its clock is off comes
//! from a calibration file; the gyro's bias can be taken from the video's first seconds, against what the pictures show in
//! the distance, so that the camera need not stand still.
//!
//! A recording appears under its name only when it is whole. Until then it has `.partial` added to its name, and it goes
//! when the import fails.

#![forbid(unsafe_code)]

mod bias;
mod clock_fit;
mod error;
mod ffmpeg;
mod gpmf;
pub mod gyro;
mod mpjpeg;
mod natural;
mod options;
mod output;
mod pictures;
mod sight;
mod telemetry;
pub mod track;
mod video;

pub use bias::{BiasSource, GyroBias};
pub use error::ImportError;
pub use options::{ImportOptions, ImportReport, Level, Progress, TelemetryReport};
pub use output::assumed;
pub use pictures::{import_pictures, picture_names};
pub use telemetry::{Telemetry, read_telemetry};
pub use video::import_video;

use bowwave_core::time::Time;

/// When an imported recording's first picture was taken: late enough that what the gyro said before it has a time as well.
pub const START: Time = Time::from_ns(1_000_000_000);
