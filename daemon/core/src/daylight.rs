//! The light that a scene is set up with, before anything was seen in a picture.

use glam::DVec3;

use crate::ephemeris::Moment;

/// Sun and visibility.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Daylight {
    /// Unit vector towards the sun as the run begins, world.
    pub sun_direction: DVec3,
    /// Place and time as the run begins, where the sun follows from them.
    pub moment: Option<Moment>,
    /// Place and time come from the ship's instruments once these tell them.
    pub from_ship: bool,
    /// Share of a clear sky's sunlight that clouds let through, 0 to 1.
    pub sun_strength: f64,
    /// Meteorological visibility, metres.
    pub visibility_m: f64,
}

impl Daylight {
    /// Tests whether the sun is up and stays where it is.
    pub fn stays_up(&self) -> bool {
        self.sun_direction.z > 0.0 && self.moment.is_none() && !self.from_ship
    }

    /// A clear sky whose sun stays towards unit `sun_direction`, world.
    pub const fn fixed(sun_direction: DVec3, visibility_m: f64) -> Self {
        Self { sun_direction, moment: None, from_ship: false, sun_strength: 1.0, visibility_m }
    }
}
