//! How a command ended, as an exit code.

use std::process::ExitCode;

/// How a command that did not fail ended. (Failures are errors: exit code 1; bad arguments end in clap: 2.)
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All is well.
    Done,
    /// It ran, and found something that is not as it must be.
    Failed,
    /// Something was lost or cut short; the rest is there.
    Partly,
}

impl From<Outcome> for ExitCode {
    fn from(outcome: Outcome) -> Self {
        match outcome {
            Outcome::Done => Self::SUCCESS,
            Outcome::Failed => Self::FAILURE,
            Outcome::Partly => Self::from(3),
        }
    }
}
