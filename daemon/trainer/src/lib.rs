//! The trainer: thirty times a second from what a source says to a frame that is shown, stored and supervised.
//!
//! ```text
//! source (devices | recording) -> session -> presenter (renderer, output thread)
//!                              \-> storage (journal, recording)
//! ```
//!
//! `bowwave run`, `bowwave simulate` and the guided calibration are settings of [`Trainer`]. The loop runs on one thread; the source's
//! devices, the output thread, the recorder and the journal have threads of their own, joined to it by bounded queues.

#![forbid(unsafe_code)]

pub mod clock;
mod companion;
pub mod divergence;
pub mod instructor;
mod options;
pub mod presenter;
pub mod replay;
pub mod source;
pub mod storage;
pub mod summary;
pub mod supervisor;
mod trainer;

pub use clock::TickClock;
pub use companion::Companion;
pub use options::{Ended, Finished, ReloadCause, Signals, TrainerOptions};
pub use trainer::Trainer;
