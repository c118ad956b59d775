//! The light that a scene is set up with, before anything was seen in a picture.

use glam::DVec3;

/// Sun and visibility.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Daylight {
    /// Unit vector towards the sun, world.
    pub sun_direction: DVec3,
    /// Share of a clear sky's sunlight that clouds let through, 0 to 1.
    pub sun_strength: f64,
    /// Meteorological visibility, metres.
    pub visibility_m: f64,
}
