//! Plays a recording in a thread of its own, at its own pace or as fast as it is taken.

use std::{
    path::PathBuf,
    thread::{self, JoinHandle},
};

use anyhow::{Context, Result, anyhow};
use bowwave_core::{event::Event, time::Time};
use bowwave_devices::clock::{now, sleep_until};
use crossbeam_channel::{Receiver, bounded};

use crate::calibrate::input::open;

/// Events played ahead: more than a unit of 1000 Hz sends between two looks, with few pictures among them.
const AHEAD: usize = 64;

/// A recording that is being played. Nobody takes its events while the wizard waits for a key: it stands still meanwhile.
pub struct RecordingPlayer {
    /// Events of the devices; closed at the end.
    pub events: Receiver<Event>,
    thread: JoinHandle<Result<bool>>,
}

impl RecordingPlayer {
    /// Plays the recording, whose pictures have the size of the named calibration's lens.
    pub fn start(recording: PathBuf, calibration: Option<PathBuf>, paced: bool) -> Result<Self> {
        let (sender, events) = bounded(AHEAD);
        let thread = thread::Builder::new()
            .name("player".to_owned())
            .spawn(move || {
                let opened = open(&recording, calibration.as_deref())?;
                let (mut due, mut last) = (now(), None::<Time>);
                opened.play(true, |event| {
                    if paced {
                        let step = last.map_or(0, |last| event.arrival().ns_since(last).max(0));
                        last = Some(event.arrival());
                        // Time for which it stood still is not caught up with.
                        due = due.plus_ns(step).max(now());
                        sleep_until(due);
                    }
                    // Nobody listens any more: the rest is skipped.
                    let _ = sender.send(event);
                })
            })
            .context("cannot start the player's thread; are too many processes running?")?;
        Ok(Self { events, thread })
    }

    /// Why it could not play on; whether the recording was cut short. What was not played to its end is not waited for.
    pub fn finish(self) -> Result<bool> {
        if !self.thread.is_finished() {
            return Ok(false);
        }
        self.thread.join().map_err(|_| anyhow!("the player broke down; report it with the log"))?
    }
}
