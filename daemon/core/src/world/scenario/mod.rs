//! The instructor's choice: sea, light, weapon and boats. TOML text in, checked values out.
//!
//! Degrees, knots and minutes stay outside: everything here is in radians, metres and seconds.

mod boat;
mod crew;
mod group;
mod keys;
pub mod read;
mod spec;
mod sun;

pub use spec::{BoatSpec, CAMERA_CLEAR_M, Scenario, Side, WeaponSpec, place};

use crate::text::toml::TomlError;

/// Text of the scenario that is played when none is named: three boats, all within a northward camera's sweep.
pub const DEFAULT: &str = include_str!("../../../scenarios/default.toml");

/// Text that a new scenario begins with: an example of everything, explained.
pub const TEMPLATE: &str = include_str!("../../../templates/scenario.toml");
/// Names and texts of the scenarios that need no file.
pub const BUILT_IN: [(&str, &str); 6] = [
    ("default", DEFAULT),
    ("swarm", include_str!("../../../scenarios/swarm.toml")),
    ("empty", include_str!("../../../scenarios/empty.toml")),
    ("calm-frigate", include_str!("../../../scenarios/calm-frigate.toml")),
    ("karma", include_str!("../../../scenarios/karma.toml")),
    ("three-axes", include_str!("../../../scenarios/three-axes.toml")),
];

impl Scenario {
    /// Checks a scenario's text. `origin` is its name in errors.
    pub fn parse(text: &str, origin: &str) -> Result<Self, TomlError> {
        read::scenario(text, origin)
    }
}

#[cfg(test)]
#[path = "scenario_tests.rs"]
mod tests;
