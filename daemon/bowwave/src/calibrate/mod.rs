//! `bowwave calibrate`: what lens, mounting and timing are, for maintainers.

mod board;
mod boresight;
mod camera;
mod check;
mod imu;
mod material;
mod pictures;
mod restore;
mod trigger;

use anyhow::Result;

use crate::{cli::CalibrateTask, outcome::Outcome};

/// Does one of the tasks.
pub fn run(task: &CalibrateTask) -> Result<Outcome> {
    match task {
        CalibrateTask::Board(arguments) => board::run(arguments),
        CalibrateTask::Camera(arguments) => camera::run(arguments),
        CalibrateTask::Imu(arguments) => imu::run(arguments),
        CalibrateTask::Boresight(arguments) => boresight::run(arguments),
        CalibrateTask::Trigger(arguments) => trigger::run(arguments),
        CalibrateTask::Check(arguments) => check::run(arguments),
        CalibrateTask::Restore(arguments) => restore::run(arguments),
    }
}
