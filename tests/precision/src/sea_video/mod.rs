//! Sea state from simulated video whose truth is known: a small renderer of its own, clips, and the errors on them.

pub mod clips;
pub mod gauges;
pub mod light;
pub mod score;
pub mod video;
