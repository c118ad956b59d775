//! Headings and bearings, radians clockwise from north, as vectors on the sea (x east, y north).

use glam::DVec2;

/// Unit vector of a heading.
pub fn ahead(heading: f64) -> DVec2 {
    DVec2::new(heading.sin(), heading.cos())
}

/// Unit vector to starboard of a heading.
pub fn starboard(heading: f64) -> DVec2 {
    DVec2::new(heading.cos(), -heading.sin())
}

/// Heading of a vector, -pi to pi.
pub fn heading_of(v: DVec2) -> f64 {
    v.x.atan2(v.y)
}
