//! A wide picture of the sea that moves: what a simulated camera that somebody turns is cut from.
//!
//! A panorama is an upright cylinder about the eye: columns by azimuth, rows by the tangent of the elevation. The sea below the horizon has
//! a picture for each frame of a loop without a seam, in tiles of some columns, so that only what is seen is decoded. The sky stands still
//! and has one. Heave is in the panorama, since it changes what hides what; roll, pitch and heading are not, since they only turn the camera.
//! [`make()`] writes one for a [`PanoramaRecipe`], which fits a scenario; [`Panorama`] reads it.

mod file;
mod make;
mod recipe;

pub use file::{Panorama, PanoramaError, PanoramaView};
pub use make::make;
pub(crate) use recipe::ELEVATION;
pub use recipe::{LOOP_S, PanoramaRecipe, TRAVERSE_MAX};

/// Raised whenever the same recipe makes another panorama than before, so that kept ones are made again.
pub const REVISION: u32 = 1;
