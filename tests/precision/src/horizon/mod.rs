//! The horizon found in real and drawn pictures, and what else could find it.

pub mod cases;
pub mod frames;
pub mod overlay;
pub mod report;
pub mod rivals;
pub mod score;
pub mod stills;
pub mod synth;
pub mod video;
pub mod ways;
