//! Sea state from simulated video whose truth is known.

pub mod clips;
pub mod light;
pub mod ocean;
pub mod video;
