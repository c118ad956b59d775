//! The light that a scene is set up with, before anything was seen in a picture.

use glam::DVec3;

use crate::ephemeris::Moment;

/// Illuminance of a level surface under a clear sky with the sun at that sine of elevation, lux (Seidelmann 1992, table of illuminances).
pub fn illuminance_of_sun(sine: f64) -> f64 {
    const TABLE: [(f64, f64); 8] = [
        (-18.0, 6.5e-4),
        (-12.0, 8.3e-3),
        (-6.0, 3.4),
        (0.0, 759.0),
        (5.0, 4760.0),
        (10.0, 10_900.0),
        (30.0, 49_000.0),
        (90.0, 103_000.0),
    ];
    let elevation = sine.clamp(-1.0, 1.0).asin().to_degrees();
    let above = TABLE.iter().position(|(node, _)| *node >= elevation).unwrap_or(TABLE.len() - 1);
    let [low, high] = [above.saturating_sub(1), above].map(|i| TABLE[i]);
    let share = ((elevation - low.0) / (high.0 - low.0).max(1e-9)).clamp(0.0, 1.0);
    (low.1.ln() + share * (high.1 / low.1).ln()).exp()
}

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

    /// Tests whether no sun and no moon ever shine: the sun is down and stays where it is.
    pub fn stays_down(&self) -> bool {
        self.sun_direction.z < -0.02 && self.moment.is_none() && !self.from_ship
    }

    /// A clear sky whose sun stays towards unit `sun_direction`, world.
    pub const fn fixed(sun_direction: DVec3, visibility_m: f64) -> Self {
        Self { sun_direction, moment: None, from_ship: false, sun_strength: 1.0, visibility_m }
    }
}
