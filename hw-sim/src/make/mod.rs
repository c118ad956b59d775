//! Makes recordings with known truth: a sea, a camera on a ship, an inertial unit, a trigger, and the ship's own heading.
//!
//! [`make`] writes what a [`Recipe`] says. Everything in a recording repeats after its length, so that it can be replayed in a
//! loop without a seam: every wave's frequency, the ship, the gun and the slow errors have a whole number of cycles in it.
//!
//! Times. All motion is a function of the host's clock. A frame with stamp s was exposed at
//! s + [`Recipe::exposure_delay_s`]; the calibration's `time_offset` is that delay plus the least latency of the inertial
//! unit's link, since that is how late the unit's clock seems to the host that maps it. The truth of a frame is the exact pose
//! at its exposure, filed under its stamp. Exposures are instantaneous: motion does not blur. With a rolling shutter each row is exposed
//! at a time of its own, the middle one at the frame's: the camera turns from row to row, waves and heave wait.
//!
//! The picture. Three tiles of waves (FFT of a directional spectrum) give heights and slopes; each column of a level camera
//! walks outwards over them and paints what is not hidden; a patch of water mirrors the sky in all the facets too small to be
//! seen one by one, weighted by how much of each is seen (Ross, Dion and Potvin 2005), by exact Fresnel, out of a table; the
//! sun's glitter is Cox and Munk's. The level picture is then turned into the camera's. Left out: second reflections between
//! waves (only their dimming), shadows of clouds, spray, the ship's own wake. Believable up to about Beaufort 7.

pub(crate) mod camera;
mod foam;
pub(crate) mod imu;
pub(crate) mod march;
pub(crate) mod motion;
mod patches;
mod recipe;
mod shade;
mod ship;
pub(crate) mod studio;
mod write;

pub use imu::samples as imu_samples;
pub use motion::{GRAVITY, GunMotion, Harmonic, Motion, MotionState, Periodic, ShipMotion};
pub use recipe::{Burst, CameraRecipe, ImuRecipe, Jolt, Recipe, ShipFeedRecipe};
pub use ship::samples as ship_samples;
pub use studio::{Studio, StudioShot};
pub(crate) use write::properties;
pub use write::{DEVICE_LOOP_KEY, MadeRecording, START, calibration, make};

pub use crate::ocean::{cloudy::SkyRecipe, spectrum::Swell};

/// Raised whenever the same recipe makes another recording than before, so that kept ones are made anew.
pub const REVISION: u32 = 2;
/// The day of that revision: year, month, day.
const REVISED_ON: (u16, u8, u8) = (2026, 11, 26);

/// Why no recording was made.
#[derive(Debug, thiserror::Error)]
pub enum MakeError {
    /// A number of the recipe.
    #[error("the recipe's {what} is {value}; it must be {range}")]
    Recipe {
        /// Field of the recipe.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Range of values that it may have.
        range: &'static str,
    },
    /// A picture could not be encoded.
    #[error("frame {frame} could not be encoded as JPEG ({source}); try another camera.jpeg_quality")]
    Encode {
        /// Frame number from 0.
        frame: u32,
        /// Cause.
        source: image::ImageError,
    },
    /// The recording could not be written.
    #[error(transparent)]
    Record(#[from] bowwave_record::RecordError),
}
