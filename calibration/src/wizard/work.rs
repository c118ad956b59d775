//! Solving what was gathered: a pure function of it, to be run beside the pictures.

use bowwave_core::{calibration::Calibration, guide::Gauge};
use glam::DVec2;

use super::{Task, Wizard, gauges};
use crate::{
    CalibrationFile, Date,
    alignment::{Alignment, AlignmentError, Movement},
    boresight::{self, Boresight, Shot},
    capture::Capture,
    lens::{self, BoardView, LensCalibration},
    report::{CalibrationReport, Wanting},
    target::varied,
    trigger::{self, Latency},
};

/// Most pictures that the lens is solved from: more take longer and tell nothing new.
pub const PICTURES_MOST: usize = 40;

/// Solution that can be written into the calibration file.
#[derive(Clone, Debug, PartialEq)]
pub enum WizardSolution {
    /// A lens.
    Lens(Box<LensCalibration>),
    /// Camera and inertial unit, and from what.
    Alignment(Box<Alignment>, String),
    /// A boresight, by a mark so many metres away.
    Boresight(Boresight, f64),
    /// The trigger's latency.
    Trigger(Latency),
}

impl WizardSolution {
    /// Takes it over into a calibration file.
    pub fn write_into(&self, file: &mut CalibrationFile, day: Date) {
        match self {
            Self::Lens(camera) => file.set_lens(camera, day),
            Self::Alignment(found, how) => file.set_alignment(found, day, how),
            Self::Boresight(found, range_m) => file.set_boresight(found, *range_m, day),
            Self::Trigger(latency) => file.set_trigger(latency, day),
        }
    }
}

/// Result of one solver run.
#[derive(Clone, Debug, PartialEq)]
pub struct Solved {
    /// Of which [`Work`].
    pub number: u32,
    /// The result; without a verdict of PASS it is not to be written.
    pub report: CalibrationReport,
    /// Solution that can be written, if any.
    pub found: Option<WizardSolution>,
    /// How far each quantity has come.
    pub(super) gauges: Vec<Gauge>,
    /// Advice for the maintainer.
    pub(super) says: String,
    /// The movement without which nothing can be solved.
    pub(super) missing: Option<Movement>,
}

/// Something to be solved.
#[derive(Clone, Debug)]
pub struct Work {
    number: u32,
    what: WizardMaterial,
}

#[derive(Clone, Debug)]
enum WizardMaterial {
    Lens { views: Vec<BoardView>, size: (u32, u32) },
    Alignment(Capture),
    Boresight { marks: Vec<DVec2>, calibration: Calibration, range_m: f64 },
    Trigger(Capture),
}

/// How much there must be before a task is solved for the first time, and how much more each further time: seconds, pictures or pulls.
pub(super) const fn pace(task: Task) -> (f64, f64) {
    match task {
        Task::Lens => (6.0, 3.0),
        Task::Alignment => (8.0, 4.0),
        Task::Boresight => (3.0, 1.0),
        Task::Trigger => (4.0, 1.0),
    }
}

impl Work {
    pub(super) fn of(wizard: &Wizard, number: u32) -> Self {
        let what = match wizard.task {
            Task::Lens => {
                WizardMaterial::Lens { views: wizard.views.kept().to_vec(), size: wizard.views.size() }
            }
            Task::Alignment => WizardMaterial::Alignment(wizard.capture.clone()),
            Task::Boresight => WizardMaterial::Boresight {
                marks: wizard.aim.aimed(wizard.now),
                calibration: wizard.setup.calibration.clone(),
                range_m: wizard.setup.range_m.unwrap_or_default(),
            },
            Task::Trigger => WizardMaterial::Trigger(wizard.capture.clone()),
        };
        Self { number, what }
    }

    /// Solves it.
    pub fn run(self) -> Solved {
        let number = self.number;
        match self.what {
            WizardMaterial::Lens { views, size } => lens(number, &views, size),
            WizardMaterial::Alignment(capture) => alignment(number, &capture),
            WizardMaterial::Boresight { marks, calibration, range_m } => {
                aimed(number, &marks, &calibration, range_m)
            }
            WizardMaterial::Trigger(capture) => dry_shots(number, &capture),
        }
    }
}

fn lens(number: u32, views: &[BoardView], size: (u32, u32)) -> Solved {
    let used: Vec<BoardView> = varied(views, PICTURES_MOST).into_iter().map(|i| views[i].clone()).collect();
    let found = lens::solve(&used, size);
    let report = CalibrationReport::of_lens("Camera lens", &found);
    let says = match &found {
        Ok(camera) => camera.missing().first().map_or_else(|| gauges::ENOUGH.to_owned(), ToString::to_string),
        Err(why) => why.to_string(),
    };
    let gauges = found.as_ref().map_or_else(|_| Vec::new(), gauges::of_lens);
    let found = found.ok().map(|camera| WizardSolution::Lens(Box::new(camera)));
    Solved { number, report, found, gauges, says, missing: None }
}

fn alignment(number: u32, capture: &Capture) -> Solved {
    let found = capture.solve();
    let report = CalibrationReport::of_alignment("Inertial unit to camera", capture, &found);
    let (says, missing) = match &found {
        Ok(a) => match Wanting::of(a, capture.shared_sigma()) {
            None => (gauges::ENOUGH.to_owned(), None),
            Some(Wanting::Board(_)) => (gauges::HORIZON_ENOUGH.to_owned(), None),
            Some(Wanting::Faster) => ("Move to and fro faster, in any direction".to_owned(), None),
            Some(Wanting::Moving(_, movement)) => (gauges::do_more(movement).to_owned(), None),
        },
        Err(AlignmentError::NotObservable { missing, .. }) => {
            (gauges::do_more(*missing).to_owned(), Some(*missing))
        }
        Err(why) => (why.to_string(), None),
    };
    let gauges = found.as_ref().map_or_else(|_| gauges::of_nothing(), gauges::of_alignment);
    let found = found.ok().map(|a| {
        let how = capture.how(&a);
        WizardSolution::Alignment(Box::new(a), how)
    });
    Solved { number, report, found, gauges, says, missing }
}

fn aimed(number: u32, marks: &[DVec2], calibration: &Calibration, range_m: f64) -> Solved {
    let shots: Vec<Shot> = marks.iter().map(|m| Shot::aimed(&calibration.lens, *m, range_m)).collect();
    let sigma = boresight::pointing_sigma(calibration, &shots);
    let found = boresight::solve(&shots, calibration.muzzle_in_camera, sigma);
    let report = CalibrationReport::of_boresight("Boresight", &found, calibration);
    let gauges = found.as_ref().map_or_else(|_| Vec::new(), gauges::of_boresight);
    let found = found.ok().map(|b| WizardSolution::Boresight(b, range_m));
    Solved { number, report, found, gauges, says: gauges::AIM.to_owned(), missing: None }
}

fn dry_shots(number: u32, capture: &Capture) -> Solved {
    let found = trigger::solve(capture.readings(), capture.edges());
    let report = CalibrationReport::of_trigger("Trigger latency", &found);
    let gauges = found.as_ref().map_or_else(|_| Vec::new(), gauges::of_trigger);
    let found = found.ok().map(WizardSolution::Trigger);
    Solved { number, report, found, gauges, says: gauges::DRY.to_owned(), missing: None }
}
