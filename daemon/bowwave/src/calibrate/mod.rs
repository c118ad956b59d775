//! `bowwave calibrate`: what lens, mounting and timing are, for maintainers.

mod board;
mod camera;
mod pictures;

use anyhow::Result;

use crate::{cli::CalibrateTask, outcome::Outcome};

/// Does one of the tasks.
pub fn run(task: &CalibrateTask) -> Result<Outcome> {
    match task {
        CalibrateTask::Board(arguments) => board::run(arguments),
        CalibrateTask::Camera(arguments) => camera::run(arguments),
    }
}
