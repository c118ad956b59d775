//! Stage three: what one frame shows, and why the rest is left out.

mod boats;
mod composer;
pub mod fires;
pub mod lamplight;
pub mod lamps;
mod lights;
pub mod plan;
pub mod reflection;
mod rounds;
pub mod scene;
pub mod searchlight;
pub mod view;
pub mod wake;

pub use composer::{Composer, ComposerSettings, FrameMoment, WaterDrawn};
pub use lights::LIGHTS_A_BOAT;
pub use rounds::ROUNDS_SEEN_MAX;
