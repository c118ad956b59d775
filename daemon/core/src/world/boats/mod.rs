//! Boats: where they go, as pure functions of time, and how waves move them.

mod course;
mod float;
mod hull;
mod motion;
mod path;
mod ride;

pub use course::{Arrival, Course, CourseError, CourseState, Damage};
pub use float::{Floating, facing, float, ride};
pub use hull::{Hull, HullForm};
pub use motion::Motion;
pub use ride::Ride;

use glam::DVec2;

/// Unit vector (x east, y north) of a heading, radians clockwise from north.
pub fn ahead(heading: f64) -> DVec2 {
    DVec2::new(heading.sin(), heading.cos())
}

/// Unit vector to starboard of a heading.
fn starboard(heading: f64) -> DVec2 {
    DVec2::new(heading.cos(), -heading.sin())
}

/// Heading of a vector, radians clockwise from north, -pi to pi.
fn heading_of(v: DVec2) -> f64 {
    v.x.atan2(v.y)
}
