//! The trigger switch, the inert interlock and the power supply's warning, over the GPIO character device.
//!
//! Edges carry the kernel's `CLOCK_MONOTONIC` time, taken in the interrupt. `switch` and `guard` decide what they mean, as functions
//! of edges and of time; [`gpio`](crate::gpio) asks the kernel; a thread joins them. Nothing here drives a line.

mod guard;
mod port;
mod switch;
mod wiring;

use std::{io, time::Duration};

use bowwave_core::{act::Act, event::MarkKind};

pub use self::{
    port::TriggerPort,
    switch::{TriggerCounters, TriggerLife},
    wiring::{InterlockProbe, InterlockWiring, WiringError},
};
use crate::gpio::GpioError;
pub use crate::gpio::{InputLine, LineBias as Bias};

/// Reasons why the trigger cannot be watched.
#[derive(Debug, thiserror::Error)]
pub enum TriggerError {
    /// Its line cannot be used.
    #[error(transparent)]
    Gpio(#[from] GpioError),
    /// The interlock could arm a gun that is not inert.
    #[error(transparent)]
    Wiring(#[from] WiringError),
    /// The window is too short for contacts, or too long for a finger.
    #[error("a debounce of {ms} ms is out of range: give 10 to 20")]
    Debounce {
        /// The value asked for.
        ms: u128,
    },
    /// The time is no time that a belt takes.
    #[error("a trigger that is stuck after {s} s is out of range: give 1 to 3600")]
    StuckAfter {
        /// The value asked for.
        s: f64,
    },
    /// One line for two things.
    #[error("{name} and {other} are both line {line} of {chip}: give each its own")]
    SameLine {
        /// The one.
        name: &'static str,
        /// The other.
        other: &'static str,
        /// The chip.
        chip: String,
        /// The line.
        line: String,
    },
    /// The thread could not be started.
    #[error("cannot start the thread that watches the trigger: {0}; are too many processes running?")]
    Thread(#[source] io::Error),
    /// The thread panicked: a defect of this program.
    #[error("the thread that watches the trigger broke down: report it with the log")]
    BrokeDown,
    /// A kernel call of the thread does not return.
    #[error(
        "a kernel call on the trigger's chip does not return: its thread is left behind; look at the kernel's log (dmesg)"
    )]
    Blocked,
}

crate::worker::tells_of_threads!(TriggerError);

/// A button of the operator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Press {
    /// Its line: active is pressed.
    pub line: InputLine,
    /// What it says.
    pub kind: PressKind,
}

/// What a button says by being pressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PressKind {
    /// The gun stands at a place of known bearing.
    Mark(MarkKind),
    /// The trainee does something, or an instructor marks a call.
    Act(Act),
}

impl Press {
    /// Its name.
    pub const fn name(&self) -> &'static str {
        match self.kind {
            PressKind::Mark(MarkKind::Stow) => "re-zero",
            PressKind::Mark(MarkKind::Landmark) => "landmark",
            PressKind::Act(act) => act.name(),
        }
    }
}

/// The lines that are inputs, with what they are.
pub fn named_inputs<'a>(
    trigger: Option<&'a InputLine>,
    interlock: Option<&'a InterlockWiring>,
    power_fail: Option<&'a InputLine>,
    presses: &'a [Press],
) -> impl Iterator<Item = (&'static str, &'a InputLine)> {
    let lines = [
        ("trigger", trigger),
        ("interlock", interlock.map(|interlock| &interlock.contact)),
        ("second interlock", interlock.and_then(|interlock| interlock.second.as_ref())),
        ("power-fail", power_fail),
    ];
    let lines = lines.into_iter().filter_map(|(name, line)| Some((name, line?)));
    lines.chain(presses.iter().map(|press| (press.name(), &press.line)))
}

/// Wiring of the trigger and the inputs beside it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TriggerSettings {
    /// The trigger switch: active is pressed.
    pub trigger: InputLine,
    /// How long contacts chatter: 10 to 20 ms.
    pub debounce: Duration,
    /// How long a trigger may be held: longer than the longest belt lasts.
    pub stuck_after: Duration,
    /// The inert interlock. Where there is none the caller decides what that means.
    pub interlock: Option<InterlockWiring>,
    /// The power supply's warning: active means that power is about to fail.
    pub power_fail: Option<InputLine>,
    /// Buttons by which the operator tells where the gun stands, and those of the trainee's acts.
    pub presses: Vec<Press>,
}

impl TriggerSettings {
    /// With everything but the trigger's line at its default: 15 ms, stuck after 10 s, nothing else wired.
    pub const fn new(trigger: InputLine) -> Self {
        Self {
            trigger,
            debounce: Duration::from_millis(15),
            stuck_after: Duration::from_secs(10),
            interlock: None,
            power_fail: None,
            presses: Vec::new(),
        }
    }

    /// Every line that is an input, with what it is.
    pub fn inputs(&self) -> impl Iterator<Item = (&'static str, &InputLine)> {
        let Self { trigger, interlock, power_fail, presses, .. } = self;
        named_inputs(Some(trigger), interlock.as_ref(), power_fail.as_ref(), presses)
    }

    fn check(&self) -> Result<(), TriggerError> {
        let ms = self.debounce.as_millis();
        if !(10..=20).contains(&ms) {
            return Err(TriggerError::Debounce { ms });
        }
        if !(Duration::from_secs(1)..=Duration::from_secs(3600)).contains(&self.stuck_after) {
            return Err(TriggerError::StuckAfter { s: self.stuck_after.as_secs_f64() });
        }
        self.interlock.as_ref().map_or(Ok(()), InterlockWiring::check)?;
        let lines: Vec<_> = self.inputs().collect();
        for (i, (name, line)) in lines.iter().enumerate() {
            if let Some((other, _)) =
                lines.iter().take(i).find(|(_, l)| (&l.chip, &l.line) == (&line.chip, &line.line))
            {
                return Err(TriggerError::SameLine {
                    name,
                    other,
                    chip: line.chip.clone(),
                    line: line.line.clone(),
                });
            }
        }
        Ok(())
    }
}

/// Level of a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LineState {
    /// It is not open.
    #[default]
    Absent,
    /// Not active.
    Inactive,
    /// Active: pressed, inert, or power failing.
    Active,
}

/// Status of the trigger and the inputs beside it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TriggerStatus {
    /// The trigger's life.
    pub life: TriggerLife,
    /// The trigger's line, contacts as they are.
    pub trigger: LineState,
    /// The interlock's line; `None` where none is wired.
    pub interlock: Option<LineState>,
    /// Its second line; `None` where none is wired.
    pub second_interlock: Option<LineState>,
    /// The power supply's line; `None` where none is wired.
    pub power_fail: Option<LineState>,
    /// The interlock is closed: presses count. `None` where none is wired: they count always.
    pub armed: Option<bool>,
    /// Counts so far.
    pub counters: TriggerCounters,
}
