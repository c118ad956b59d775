//! The instructor's choice: sea, light, weapon and boats. TOML text in, checked values out.
//!
//! Degrees, knots and minutes stay outside: everything here is in radians, metres and seconds.

mod boat;
mod crew;
mod exercise;
mod group;
mod keys;
pub mod read;
mod spec;
mod sun;
mod weapon;

pub use spec::{BoatSpec, CAMERA_CLEAR_M, Scenario, WeaponSpec, place};
pub use weapon::built_in as built_in_weapons;

pub use crate::side::Side;

use crate::text::toml::TomlError;

/// Text of the scenario that is played when none is named: three boats, all within a northward camera's sweep.
pub const DEFAULT: &str = include_str!("../../../scenarios/default.toml");

/// Text that a new scenario begins with: an example of everything, explained.
pub const TEMPLATE: &str = include_str!("../../../templates/scenario.toml");
/// Names and texts of the scenarios that need no file: the first ones, and twelve exercises from a first target to a swarm, each with
/// briefing, goals and par scores.
pub const BUILT_IN: [(&str, &str); 18] = [
    ("default", DEFAULT),
    ("swarm", include_str!("../../../scenarios/swarm.toml")),
    ("empty", include_str!("../../../scenarios/empty.toml")),
    ("calm-frigate", include_str!("../../../scenarios/calm-frigate.toml")),
    ("karma", include_str!("../../../scenarios/karma.toml")),
    ("three-axes", include_str!("../../../scenarios/three-axes.toml")),
    ("first-target", include_str!("../../../scenarios/first-target.toml")),
    ("slow-crosser", include_str!("../../../scenarios/slow-crosser.toml")),
    ("fast-crosser", include_str!("../../../scenarios/fast-crosser.toml")),
    ("closing-skiff", include_str!("../../../scenarios/closing-skiff.toml")),
    ("friend-or-foe", include_str!("../../../scenarios/friend-or-foe.toml")),
    ("fishing-fleet", include_str!("../../../scenarios/fishing-fleet.toml")),
    ("feint", include_str!("../../../scenarios/feint.toml")),
    ("dusk-patrol", include_str!("../../../scenarios/dusk-patrol.toml")),
    ("night-intruder", include_str!("../../../scenarios/night-intruder.toml")),
    ("stoppage-drill", include_str!("../../../scenarios/stoppage-drill.toml")),
    ("rough-water", include_str!("../../../scenarios/rough-water.toml")),
    ("swarm-of-nine", include_str!("../../../scenarios/swarm-of-nine.toml")),
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
