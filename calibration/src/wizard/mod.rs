//! The guided calibration, step by step, as a state machine without I/O, clock or threads.
//!
//! Events of devices, detections in pictures ([`Detector`]), keys and time go in as [`Input`]s; out come a
//! [`Guide`], which terminal and display show alike, and what is to be done outside: [`Ask`]. Results come from the same solvers as those of
//! recordings, and what is missing is what these say is missing.

mod aim;
mod detector;
mod gauges;
mod live;
mod page;
mod views;
mod work;

use std::fmt;

use bowwave_core::{
    calibration::Calibration,
    event::{Event, ImuSample, TriggerEdge},
    fault::{FaultBoard, FaultChange},
    guide::Guide,
    time::Time,
};

use crate::{capture::Capture, report::CalibrationVerdict, target::Target};
use aim::AimWatch;
use live::Live;
use views::WizardViews;

pub use detector::{Detection, Detector, DetectorMode};
pub use work::{Solved, WizardSolution, Work};

/// Part of the calibration; each needs the ones before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Task {
    /// The camera's lens.
    Lens,
    /// Camera and inertial unit.
    Alignment,
    /// Where the barrel points.
    Boresight,
    /// When a round leaves.
    Trigger,
}

impl Task {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Lens, Self::Alignment, Self::Boresight, Self::Trigger];

    /// The command that does it with a recording: `bowwave calibrate` and this.
    pub const fn command(self) -> &'static str {
        match self {
            Self::Lens => "intrinsics",
            Self::Alignment => "extrinsics",
            Self::Boresight => "boresight",
            Self::Trigger => "trigger",
        }
    }

    /// Whether pulls of the trigger are what it is made from.
    pub const fn wants_pulls(self) -> bool {
        matches!(self, Self::Boresight | Self::Trigger)
    }
}

impl fmt::Display for Task {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Lens => "camera lens",
            Self::Alignment => "inertial unit to camera",
            Self::Boresight => "boresight",
            Self::Trigger => "trigger latency",
        })
    }
}

/// Key of the wizard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Key {
    /// Go on, accept. A pull of the trigger does the same where no pull is measured.
    Next,
    /// Back.
    Back,
    /// End.
    Quit,
    /// That one of the tasks.
    Pick(Task),
}

/// Input of the wizard.
#[derive(Clone, Debug)]
pub enum Input {
    /// A measurement of the inertial unit.
    Sample(ImuSample),
    /// The trigger's line changed.
    Edge(TriggerEdge),
    /// Detection in a picture, with the picture's time of arrival.
    Seen(Time, Detection),
    /// A fault came or went.
    Fault(FaultChange),
    /// A key was pressed.
    Key(Key),
    /// It is that late.
    Time(Time),
    /// Work that was asked for is done.
    Solved(Box<Solved>),
    /// The result was written: the calibration as it is now, or why it could not be.
    Saved(Result<Box<Calibration>, String>),
    /// No more will come: a recording has ended.
    Ended,
}

/// Request to whoever runs the wizard.
#[derive(Clone, Debug)]
pub enum Ask {
    /// Run it, beside the pictures, and hand back its result.
    Solve(Box<Work>),
    /// Write it into the calibration.
    Save(Box<WizardSolution>),
    /// End.
    End,
}

/// Where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WizardStep {
    /// A task is chosen.
    Choose,
    /// Material is gathered; meanwhile it is solved again and again.
    Gather,
    /// Enough was gathered; the last solution is awaited.
    Solve,
    /// There is a result.
    Result,
    /// It is being written.
    Saving,
    /// It was.
    Saved,
    /// It has ended.
    Over,
}

/// Settings of the wizard.
#[derive(Clone, Debug)]
pub struct WizardSetup {
    /// The calibration that is begun with.
    pub calibration: Calibration,
    /// Height of the camera above the sea, metres.
    pub eye_height_m: f64,
    /// The board, where there is one.
    pub target: Option<Target>,
    /// From the camera to the mark on the board, metres; no boresight without it.
    pub range_m: Option<f64>,
    /// Whether a file stands where results are written, which is then kept.
    pub replaces: bool,
}

impl WizardSetup {
    /// Nothing gathered yet. A read-out that is known is taken as it is, else boards tell it.
    fn capture(&self) -> Capture {
        let Calibration { lens, readout_ns, .. } = &self.calibration;
        let capture = Capture::new(*lens, self.eye_height_m);
        if *readout_ns == 0 { capture } else { capture.with_readout(*readout_ns as f64 * 1e-9) }
    }
}

/// A pull that comes so soon after a step began belonged to the one before, seconds.
const PULL_AFTER_S: f64 = 0.7;
/// The same after pulls were measured: one more than enough must not save the result.
const MEASURED_AFTER_S: f64 = 3.0;

/// The guided calibration.
#[derive(Debug)]
pub struct Wizard {
    setup: WizardSetup,
    step: WizardStep,
    /// When the step began.
    since: Time,
    now: Time,
    task: Task,
    done: [bool; Task::ALL.len()],
    capture: Capture,
    views: WizardViews,
    aim: AimWatch,
    live: Live,
    faults: FaultBoard,
    /// The newest solution of what is being gathered.
    solved: Option<Box<Solved>>,
    /// Counts work; the number of that which is under way.
    works: u32,
    awaited: Option<u32>,
    /// How much there was when it was last solved.
    solved_at: f64,
    asks: Vec<Ask>,
    /// Reason why a request could not be met.
    refused: Option<String>,
    has_ended: bool,
}

impl Wizard {
    /// Begins with the choice of a task, or with one.
    pub fn new(setup: WizardSetup, task: Option<Task>) -> Self {
        let first = if setup.target.is_some() { Task::Lens } else { Task::Alignment };
        let mut wizard = Self {
            step: WizardStep::Choose,
            since: Time::MIN,
            now: Time::MIN,
            task: task.unwrap_or(first),
            done: [false; Task::ALL.len()],
            capture: setup.capture(),
            views: WizardViews::default(),
            aim: AimWatch::default(),
            live: Live::new(setup.calibration.camera_from_imu),
            faults: FaultBoard::new(),
            solved: None,
            works: 0,
            awaited: None,
            solved_at: 0.0,
            asks: Vec::new(),
            refused: None,
            has_ended: false,
            setup,
        };
        if task.is_some() {
            wizard.gather_anew();
        }
        wizard
    }

    /// Where it is.
    pub const fn step(&self) -> WizardStep {
        self.step
    }

    /// The task that is chosen, or under way.
    pub const fn task(&self) -> Task {
        self.task
    }

    /// The calibration as it is now.
    pub const fn calibration(&self) -> &Calibration {
        &self.setup.calibration
    }

    /// Whether it goes on only by a key.
    pub const fn waits(&self) -> bool {
        matches!(self.step, WizardStep::Choose | WizardStep::Result | WizardStep::Saved)
    }

    /// Kind of detection that the present step needs.
    pub fn look(&self) -> DetectorMode {
        match (self.step, self.task) {
            (WizardStep::Gather, Task::Lens) => DetectorMode::Corners,
            (WizardStep::Gather, Task::Alignment) => DetectorMode::Orientation,
            (WizardStep::Gather, Task::Boresight) => DetectorMode::Mark,
            _ => DetectorMode::Nothing,
        }
    }

    /// The next thing to be done outside.
    pub fn ask(&mut self) -> Option<Ask> {
        (!self.asks.is_empty()).then(|| self.asks.remove(0))
    }

    /// Page for the maintainer.
    pub fn guide(&self) -> Guide {
        page::page(self)
    }

    /// Takes something in.
    pub fn take(&mut self, input: Input) {
        if self.step == WizardStep::Over {
            return;
        }
        match input {
            Input::Sample(sample) => self.sample(&sample),
            Input::Edge(edge) => self.edge(edge),
            Input::Seen(arrival, finding) => self.seen(arrival, finding),
            Input::Fault(change) => {
                self.pass(change.time);
                // The log is the affair of whoever noticed it.
                let _ = self.faults.take(&change);
            }
            Input::Key(key) => self.key(key),
            Input::Time(time) => self.pass(time),
            Input::Solved(solved) => self.take_solved(solved),
            Input::Saved(saved) => self.saved(saved),
            Input::Ended => {
                self.has_ended = true;
                // Nothing more will come for the last pull.
                self.pass(self.now.plus_secs(2.0 * aim::SETTLE_S));
                if self.step == WizardStep::Gather {
                    self.finish();
                }
            }
        }
        if self.step == WizardStep::Gather {
            self.solve_meanwhile();
        }
    }

    /// Time does not go back.
    fn pass(&mut self, time: Time) {
        if self.now == Time::MIN {
            self.since = time;
        }
        self.now = self.now.max(time);
    }

    fn enter(&mut self, step: WizardStep) {
        self.step = step;
        self.since = self.now;
        self.refused = None;
    }

    fn gather_anew(&mut self) {
        self.capture = self.setup.capture();
        self.views = WizardViews::default();
        self.aim = AimWatch::default();
        self.live = Live::new(self.setup.calibration.camera_from_imu);
        self.solved = None;
        // What is still under way belongs to what was gathered before.
        self.awaited = None;
        self.solved_at = 0.0;
        self.enter(WizardStep::Gather);
        if let Some(lacks) = self.lacks(self.task) {
            self.enter(WizardStep::Choose);
            self.refused = Some(lacks.to_owned());
        }
    }

    /// Why a task cannot be begun.
    fn lacks(&self, task: Task) -> Option<&'static str> {
        match task {
            Task::Lens if self.setup.target.is_none() => Some("no board: start again with --target"),
            Task::Boresight if self.setup.target.is_none() => {
                Some("no board that marks the aim: start again with --target and --range")
            }
            Task::Boresight if self.setup.range_m.is_none() => {
                Some("the board's distance is not known: start again with --range")
            }
            _ => None,
        }
    }

    fn sample(&mut self, sample: &ImuSample) {
        self.pass(sample.arrival);
        self.live.sample(sample);
        if self.step == WizardStep::Gather && self.task != Task::Lens {
            self.capture.take(&Event::Imu(*sample));
        }
    }

    fn edge(&mut self, edge: TriggerEdge) {
        self.pass(edge.time);
        if matches!(self.step, WizardStep::Gather | WizardStep::Solve) && self.task.wants_pulls() {
            if self.step == WizardStep::Gather {
                self.capture.take(&Event::Trigger(edge));
                if edge.pressed {
                    self.aim.pull(edge.time, &self.setup.calibration);
                }
            }
        } else {
            let after_s = if self.task.wants_pulls() { MEASURED_AFTER_S } else { PULL_AFTER_S };
            if edge.pressed && edge.time.secs_since(self.since) > after_s {
                self.key(Key::Next);
            }
        }
    }

    fn seen(&mut self, arrival: Time, finding: Detection) {
        self.pass(arrival);
        self.live.picture(arrival, &finding);
        if self.step != WizardStep::Gather {
            return;
        }
        // What was looked for when another task was under way is of no use.
        match (self.task, finding) {
            (Task::Alignment, Detection::Orientation(seen)) => self.capture.see(&seen),
            (Task::Lens, Detection::Corners { view, size }) => self.views.take(view, size),
            (Task::Boresight, Detection::Mark { stamp, pixel }) => {
                self.aim.mark(stamp, pixel, &self.setup.calibration);
            }
            _ => {}
        }
    }

    fn key(&mut self, key: Key) {
        match (self.step, key) {
            (_, Key::Quit) => {
                self.enter(WizardStep::Over);
                self.asks.push(Ask::End);
            }
            (WizardStep::Choose, Key::Pick(task)) => {
                self.task = task;
                self.refused = self.lacks(task).map(str::to_owned);
            }
            (WizardStep::Choose, Key::Next) => self.gather_anew(),
            (WizardStep::Gather, Key::Next) => self.finish(),
            (WizardStep::Gather | WizardStep::Solve, Key::Back) => {
                self.awaited = None;
                self.enter(WizardStep::Choose);
            }
            (WizardStep::Result, Key::Next) if self.passed() => {
                if let Some(found) = self.solved.as_ref().and_then(|s| s.found.clone()) {
                    self.enter(WizardStep::Saving);
                    self.asks.push(Ask::Save(Box::new(found)));
                }
            }
            (WizardStep::Result, Key::Next | Key::Back) if !self.has_ended => self.enter(WizardStep::Gather),
            (WizardStep::Result, Key::Next | Key::Back) | (WizardStep::Saved, Key::Next | Key::Back)
                if self.has_ended =>
            {
                self.key(Key::Quit);
            }
            (WizardStep::Saved, Key::Next | Key::Back) => {
                let is_left = |t: &Task| !self.done[*t as usize] && self.lacks(*t).is_none();
                self.task = Task::ALL.into_iter().find(is_left).unwrap_or(self.task);
                self.enter(WizardStep::Choose);
            }
            _ => {}
        }
    }

    fn passed(&self) -> bool {
        self.solved.as_ref().is_some_and(|s| s.report.verdict == CalibrationVerdict::Pass)
    }

    /// Solves all that was gathered, for the result.
    fn finish(&mut self) {
        self.enter(WizardStep::Solve);
        self.order();
    }

    fn order(&mut self) {
        self.works += 1;
        self.awaited = Some(self.works);
        self.solved_at = self.gathered();
        self.asks.push(Ask::Solve(Box::new(work::Work::of(self, self.works))));
    }

    /// Solves again once there is enough more.
    fn solve_meanwhile(&mut self) {
        let (least, step) = work::pace(self.task);
        let there = self.gathered();
        let grown = there - self.solved_at;
        // A long recording takes longer to solve.
        if self.awaited.is_none() && there >= least && grown >= step.max(0.1 * there) {
            self.order();
        }
    }

    /// How much was gathered: seconds, pictures or pulls.
    fn gathered(&self) -> f64 {
        match self.task {
            Task::Lens => self.views.kept().len() as f64,
            Task::Alignment => self.capture.seconds(),
            Task::Boresight => self.aim.aimed(self.now).len() as f64,
            Task::Trigger => self.aim.settled(self.now) as f64,
        }
    }

    fn take_solved(&mut self, solved: Box<Solved>) {
        if self.awaited != Some(solved.number) {
            return;
        }
        self.awaited = None;
        self.solved = Some(solved);
        if self.step == WizardStep::Solve || self.step == WizardStep::Gather && self.has_enough() {
            self.enter(WizardStep::Result);
        }
    }

    /// Whether it is over by itself: pulls are not to be made in vain, and the hands may be far from keys.
    fn has_enough(&self) -> bool {
        self.task.wants_pulls() && self.passed() && self.gathered() >= aim::PULLS as f64
    }

    fn saved(&mut self, saved: Result<Box<Calibration>, String>) {
        if self.step != WizardStep::Saving {
            return;
        }
        match saved {
            Ok(calibration) => {
                self.setup.calibration = *calibration;
                self.setup.replaces = true;
                self.done[self.task as usize] = true;
                self.enter(WizardStep::Saved);
            }
            Err(why) => {
                self.enter(WizardStep::Result);
                self.refused = Some(why);
            }
        }
    }
}

#[cfg(test)]
mod tests;
