//! Seeing and being seen: whether an eye that looks at a vessel tells it from what is behind it, by light, haze, glare and size.
//!
//! Pure functions: [`Ambient`] is the light of a scene, [`threshold`] what human eyes need, and [`Seeing`] joins both for one [`Target`].

mod ambient;
mod log;
mod sight;
pub mod threshold;

pub use ambient::Ambient;
pub use log::{SceneLight, SeeingLog};
pub use sight::{Glare, Seeing, Target};
