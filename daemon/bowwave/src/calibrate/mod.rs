//! `bowwave calibrate`: what lens, mounting and timing are, for maintainers.

mod board;
mod camera;
mod check;
mod imu;
mod material;
mod pictures;
mod restore;

use anyhow::Result;

use crate::{cli::CalibrateTask, outcome::Outcome};

/// Does one of the tasks.
pub fn run(task: &CalibrateTask) -> Result<Outcome> {
    match task {
        CalibrateTask::Board(arguments) => board::run(arguments),
        CalibrateTask::Camera(arguments) => camera::run(arguments),
        CalibrateTask::Imu(arguments) => imu::run(arguments),
        CalibrateTask::Check(arguments) => check::run(arguments),
        CalibrateTask::Restore(arguments) => restore::run(arguments),
    }
}
