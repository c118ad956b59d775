//! The sky as light: radiance from every direction, from a sun overhead down to one far below the horizon.
//!
//! [`ClearSky`] is an atmosphere of molecules, haze and ozone round the Earth, single scattering along the line of sight and higher orders as
//! Hillaire has them ("A Scalable and Production Ready Sky and Atmosphere Rendering Technique", 2020). [`overcast`] is the CIE's. Both are
//! relative: the sun above the air has an irradiance of 1 in each channel.

mod air;
mod clear;
mod lobes;
mod model;
mod scatter;

pub use air::sunlight;
pub use clear::ClearSky;
pub use lobes::{LOBES, SkyLobes};
pub use model::{NIGHT, SUN_LUX, SkyModel, overcast, overcast_zenith};
