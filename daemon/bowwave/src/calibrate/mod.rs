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
mod wizard;

use anyhow::Result;

use crate::{
    cli::{CalibrateTask, CalibrateWizard},
    outcome::Outcome,
};

/// Does one of the tasks; without one, the wizard asks.
pub fn run(task: Option<&CalibrateTask>) -> Result<Outcome> {
    let Some(task) = task else { return wizard::run(&CalibrateWizard::unasked()?) };
    match task {
        CalibrateTask::Wizard(arguments) => wizard::run(arguments),
        CalibrateTask::Board(arguments) => board::run(arguments),
        CalibrateTask::Camera(arguments) => camera::run(arguments),
        CalibrateTask::Imu(arguments) => imu::run(arguments),
        CalibrateTask::Boresight(arguments) => boresight::run(arguments),
        CalibrateTask::Trigger(arguments) => trigger::run(arguments),
        CalibrateTask::Check(arguments) => check::run(arguments),
        CalibrateTask::Restore(arguments) => restore::run(arguments),
    }
}
