//! One function for each thing that is read from outside: it takes any bytes and panics where a promise is broken.
//!
//! Used twice: by the fuzzers, and by the test that runs every file in `corpus` and `findings` once.

#![allow(clippy::expect_used, clippy::panic, reason = "a broken promise must end the run")]

pub mod calibration;
pub mod config;
pub mod imu;
pub mod imu_formats;
pub mod instructor_command;
pub mod jpeg;
pub mod link;
mod memory;
pub mod model;
mod place;
pub mod recording;
pub mod scenario;
mod steps;

/// The name of a target's binary and folders, and its function.
pub type FuzzTarget = (&'static str, fn(&[u8]));

/// All targets.
pub const ALL: &[FuzzTarget] = &[
    ("imu", imu::run),
    ("imu_formats", imu_formats::run),
    ("calibration", calibration::run),
    ("jpeg", jpeg::run),
    ("config", config::run),
    ("recording", recording::run),
    ("scenario", scenario::run),
    ("model", model::run),
    ("link", link::run),
    ("instructor_command", instructor_command::run),
];
