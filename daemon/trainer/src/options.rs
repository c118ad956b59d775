//! Settings of a trainer, and what it leaves.

use std::sync::atomic::AtomicBool;

use bowwave_core::{fault::FaultChange, session::Setup};

use crate::{
    instructor::AskedScenario,
    presenter::PresenterOptions,
    summary::{Summary, SummaryOptions},
};

/// Requests from outside to the loop.
#[derive(Debug, Default)]
pub struct Signals {
    /// End.
    pub stop: AtomicBool,
    /// Read the settings again.
    pub reload: AtomicBool,
    /// The gun stands at its stow.
    pub rezero: AtomicBool,
}

/// Why the loop ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ended {
    /// It was asked to, or has drawn all frames.
    Stopped,
    /// The settings are to be read again, the LCD has another size now, or the instructor asked for another scenario.
    Reload {
        /// Size of the LCD at that time: one that is slow to start is not waited for again.
        lcd: Option<(u32, u32)>,
        /// Why.
        cause: ReloadCause,
    },
}

/// Why everything is to be opened again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ReloadCause {
    /// The settings are to be read again.
    Settings,
    /// The LCD has another size.
    Screen,
    /// The instructor asked for that scenario.
    Asked(AskedScenario),
}

/// Settings of a trainer. Source, clock and storage are opened by the caller, since what may be wrong with them differs.
#[derive(Debug)]
pub struct TrainerOptions {
    /// What the session is made from.
    pub setup: Setup,
    /// How frames are drawn and where they go; `None` draws nothing.
    pub presenter: Option<PresenterOptions>,
    /// End after so many frames.
    pub frames: Option<u64>,
    /// The run is to reach the end of its recording, so that how that ends is looked at.
    pub plays_to_the_end: bool,
    /// A size of the LCD other than the session's asks for new settings.
    pub follow_lcd: bool,
    /// This boot, for the log.
    pub boot_id: Option<String>,
    /// What the summary says besides what was measured.
    pub summary: SummaryOptions,
    /// Faults that were found before the trainer was made.
    pub faults: Vec<FaultChange>,
    /// The exercise stands still until the instructor lets it go.
    pub waits: bool,
}

/// A trainer that has ended.
#[derive(Debug)]
pub struct Finished {
    /// Why.
    pub ended: Ended,
    /// What it reports about itself.
    pub summary: Summary,
    /// What went wrong on the way without ending the run.
    pub wrong: Vec<String>,
    /// Messages of Vulkan's validation layer.
    pub validation: Vec<String>,
}
