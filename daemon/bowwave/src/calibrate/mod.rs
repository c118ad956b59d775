//! `bowwave calibrate`: what lens, mounting and timing are, for maintainers.

mod board;
mod boresight;
mod check;
mod extrinsics;
mod input;
mod intrinsics;
mod phantom;
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
    if let Some((former, name)) = former_name(std::env::args()) {
        log::warn!("`calibrate {former}` is now called {name}; the old name goes with the next version");
    }
    let Some(task) = task else { return wizard::run(&CalibrateWizard::unasked()?) };
    match task {
        CalibrateTask::Wizard(arguments) => wizard::run(arguments),
        CalibrateTask::Board(arguments) => board::run(arguments),
        CalibrateTask::Intrinsics(arguments) => intrinsics::run(arguments),
        CalibrateTask::Extrinsics(arguments) => extrinsics::run(arguments),
        CalibrateTask::Boresight(arguments) => boresight::run(arguments),
        CalibrateTask::Trigger(arguments) => trigger::run(arguments),
        CalibrateTask::Phantom(arguments) => phantom::run(arguments),
        CalibrateTask::Check(arguments) => check::run(arguments),
        CalibrateTask::Restore(arguments) => restore::run(arguments),
    }
}

/// Names of tasks that were renamed, and what they are called now.
const RENAMED: [(&str, &str); 2] = [("camera", "intrinsics"), ("imu", "extrinsics")];

/// The former name of a task among the program's arguments, behind `calibrate` or `calibrate wizard`, and the present one.
fn former_name(arguments: impl Iterator<Item = String>) -> Option<(&'static str, &'static str)> {
    let task = arguments.skip(1).skip_while(|a| a != "calibrate").skip(1).find(|a| a != "wizard")?;
    RENAMED.into_iter().find(|(former, _)| *former == task)
}

#[cfg(test)]
mod tests {
    use super::former_name;

    #[test]
    fn former_names_are_told_from_present_ones_and_from_files() {
        let named = |line: &str| former_name(line.split(' ').map(str::to_owned));
        assert_eq!(named("bowwave calibrate imu a.mcap"), Some(("imu", "extrinsics")));
        assert_eq!(named("bowwave -v calibrate wizard camera"), Some(("camera", "intrinsics")));
        for line in [
            "bowwave calibrate",
            "bowwave calibrate extrinsics imu",
            "bowwave run camera",
            "calibrate camera",
        ] {
            assert_eq!(named(line), None, "{line}");
        }
    }
}
