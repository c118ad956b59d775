//! Reflection of a boat in the sea. [`ReflectionTable`] says, for a sea and a line of sight, how much of what stands how high at
//! which distance a pixel of water throws towards the eye, and how much of the sky's light the boat takes from it; [`Lobes`] is that for one
//! boat; [`compose`] draws with it, as the GPU's shaders do. [`hidden_m`] says how much of a hull stands behind waves.
//!
//! The tables were made by following rays over patches of sea (`examples/bake-reflection`).

mod compose;
pub mod grid;
mod hiding;
mod lobes;
mod table;

pub use compose::{Billboard, HALF_WIDTH_MIN_PX, HullFoot, compose};
pub use hiding::{Sighted, encode_hiding, hidden_m};
pub use lobes::{BANDS, Lobes, LuminanceWeight, ReflectionTransfer, ReflectionView, STEPS, water_light};
pub use table::{ReflectionTable, SeaLobes, encode};

use glam::{DVec2, DVec3};

use crate::geometry::RigidPose;

/// Angle from the direction in which a boat is seen to that in which the wind blows (both east, north), radians clockwise. Without wind it
/// is no number, which the tables take for 0.
pub fn wind_to_view(wind: DVec2, away: DVec2) -> f64 {
    wind.angle_to(away)
}

/// How steeply the water under a boat rises in the direction `away` (east, north), tangent: the boat lies on it as it is tilted.
pub fn tilt_away(pose: &RigidPose, away: DVec2) -> f64 {
    let up = pose.world_from_body * DVec3::Z;
    -up.truncate().dot(away.normalize_or_zero()) / up.z.max(0.2)
}
