//! A dialogue that runs in the trainer's loop instead of a training.

use anyhow::Result;
use bowwave_core::{
    event::{Event, Tick},
    guide::Guide,
};

/// A dialogue with the user over the live picture: the guided calibration. The loop hands it all events and shows its pages; the session
/// sees the pictures only.
pub trait Companion {
    /// Whether it waits for the user: a recording stands still meanwhile.
    fn waits(&self) -> bool;

    /// Takes in the events since the last frame and gives the page to show; `None` ends the run.
    ///
    /// # Errors
    /// Ends the run.
    fn frame(&mut self, events: &[Event], tick: Tick) -> Result<Option<Guide>>;

    /// No more events will come.
    fn source_ended(&mut self);

    /// The user wants to end, by signal or by closing the window.
    fn quit(&mut self);
}
