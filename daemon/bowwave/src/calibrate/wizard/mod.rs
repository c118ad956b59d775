//! `bowwave calibrate wizard`: guided step by step, on the devices or on a recording.
//!
//! What to do is decided by [`bowwave_calibration::wizard`]; here are devices, keys, pictures and files.

mod live;
mod player;
mod replay;
mod terminal;

use std::path::PathBuf;

use anyhow::Result;
use bowwave_calibration::{
    CalibrationFile, Date,
    report::{CalibrationReport, html},
    wizard::{Detector, Input, Task, Wizard, WizardSetup, WizardSolution, WizardStep},
};
use bowwave_core::event::Event;

use crate::{
    cli::{CalibrateWizard, WizardTask},
    outcome::Outcome,
};

/// Runs until the maintainer ends it.
pub fn run(arguments: &CalibrateWizard) -> Result<Outcome> {
    match &arguments.replay {
        Some(recording) => replay::run(recording, arguments),
        None => live::run(arguments),
    }
}

/// The wizard, with what it looks through and where its results go.
struct Guided {
    wizard: Wizard,
    file: CalibrationFile,
    out: Option<PathBuf>,
    report: Option<PathBuf>,
    today: Date,
    eye_height_m: f64,
    tag: usize,
    /// Whether pulls of the trigger are meant for the wizard.
    pulls_are_keys: bool,
    saved: usize,
}

impl Guided {
    fn new(
        arguments: &CalibrateWizard,
        file: CalibrationFile,
        out: Option<PathBuf>,
        eye_height_m: f64,
    ) -> Result<Self> {
        let setup = WizardSetup {
            calibration: file.calibration.clone(),
            eye_height_m,
            target: arguments.target,
            range_m: arguments.range,
            replaces: out.as_ref().is_some_and(|out| out.exists()),
        };
        let task = arguments.task.map(|task| match task {
            WizardTask::Intrinsics => Task::Lens,
            WizardTask::Extrinsics => Task::Alignment,
            WizardTask::Boresight => Task::Boresight,
            WizardTask::Trigger => Task::Trigger,
        });
        Ok(Self {
            wizard: Wizard::new(setup, task),
            file,
            out,
            report: arguments.report.clone(),
            today: crate::today::today()?,
            eye_height_m,
            tag: arguments.tag,
            pulls_are_keys: arguments.replay.is_none(),
            saved: 0,
        })
    }

    fn eyes(&self, arguments: &CalibrateWizard) -> Detector {
        Detector::new(self.wizard.calibration(), self.eye_height_m, arguments.target, self.tag)
            .with_mask(self.file.own_ship().mask)
    }

    /// Hands over what a device reported; pictures are looked at elsewhere.
    fn event(&mut self, event: Event) {
        match event {
            Event::Imu(sample) => self.wizard.take(Input::Sample(sample)),
            // Pulls of a recording were meant for something else.
            Event::Trigger(edge) if self.pulls_are_keys || self.wizard.task().wants_pulls() => {
                self.wizard.take(Input::Edge(edge));
            }
            Event::Fault(change) => self.wizard.take(Input::Fault(change)),
            Event::Trigger(_)
            | Event::Frame(_)
            | Event::Ship(_)
            | Event::ShipFix(_)
            | Event::Mark(_)
            | Event::Act(_)
            | Event::Order(_) => {}
        }
    }

    /// Writes what was found, and tells the wizard.
    fn save(&mut self, found: &WizardSolution) {
        let mut file = self.file.clone();
        found.write_into(&mut file, self.today);
        let written = match &self.out {
            Some(out) => file.write(out).map_err(|e| e.to_string()),
            None => {
                Err("nothing is written: start again and name a file with --out or --calibration".to_owned())
            }
        };
        let saved = written.map(|()| {
            self.file = file;
            self.saved += 1;
            Box::new(self.file.calibration.clone())
        });
        self.wizard.take(Input::Saved(saved));
    }

    /// Shows a result as a page, where that is wanted.
    fn report(&self, report: &CalibrationReport) {
        let Some(path) = self.report.as_ref().filter(|_| self.wizard.step() == WizardStep::Result) else {
            return;
        };
        if let Err(e) = std::fs::write(path, html(report)) {
            log::error!("cannot write {}: {e}; check the folder and its permissions", path.display());
        }
    }

    fn outcome(&self) -> Outcome {
        if self.saved > 0 { Outcome::Done } else { Outcome::Failed }
    }
}
