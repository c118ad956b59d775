//! Stage two: the virtual world. Boats on the sea, the weapon, rounds in flight and what they strike.
//!
//! This stage knows nothing of what is drawn.

pub mod boats;
pub mod burst;
pub mod clock;
mod contact;
pub mod exercise;
pub mod flare;
pub mod fleet;
pub mod gunnery;
mod note_clock;
pub mod rounds;
pub mod scenario;
pub mod score;
mod sea_change;
pub mod searchlight;
pub mod seeing;
mod stage;
pub mod track;
pub mod waves;
pub mod weapon;

pub use stage::{BoreAim, LastResult, RESULT_S, RunningWorld, Score, World};
