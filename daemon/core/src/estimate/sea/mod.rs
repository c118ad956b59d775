//! The sea's state and the sky's light from the live picture.
//!
//! Patches of water are followed on the plane z = 0 for a minute or two, Fourier transformed in time, and searched in space for
//! waves that keep the dispersion relation (`shell`). Sky, roughness and Fresnel's law, fitted to the mean picture, turn brightness
//! into slope (`radiance`); slope and wavelength give height, and the eye's height fixes all lengths.
//!
//! Limits: deep water; an eye that stands still over the ground; no current; waves lower than about half of the eye's height; no
//! sun glitter in view (refused); vignetting and tone mapping that differs from sRGB enter the height by as much as they change
//! the fall of brightness from the horizon to the picture's lower edge.

mod analysis;
mod estimate;
mod follow;
mod grid;
mod linear;
mod meter;
mod profile;
mod radiance;
mod record;
mod shell;
mod sky;
mod summary;

pub use self::{
    estimate::{LEAST_S, MeasuredValue, Restart, SeaEstimate, SeaFrame, Unknown},
    follow::{SeaConditions, SeaFollower, SeaInUse, SeaOrder, SeaSource},
    meter::SeaMeter,
    sky::{SkyEstimate, SkyFrame, SkyMeter},
};

#[cfg(test)]
#[path = "estimate_tests.rs"]
mod tests;
