//! Waves: their spectrum, and the height of the water at any place and time.

mod field;
mod spectrum;

pub use field::{CHANGE_S, WaterLevel, WaterPlane, Wave, WaveField};
pub use spectrum::{Spectrum, WaveSpec};
