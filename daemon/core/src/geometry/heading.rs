//! Headings and bearings, radians clockwise from north, as vectors on the sea (x east, y north).

use glam::{DVec2, DVec3};

/// Unit vector of a heading.
pub fn ahead(heading: f64) -> DVec2 {
    DVec2::new(heading.sin(), heading.cos())
}

/// Unit vector to starboard of a heading.
pub fn starboard(heading: f64) -> DVec2 {
    DVec2::new(heading.cos(), -heading.sin())
}

/// Unit vector towards a bearing and an elevation, radians (z up).
pub fn towards(bearing: f64, elevation: f64) -> DVec3 {
    (ahead(bearing) * elevation.cos()).extend(elevation.sin())
}

/// Bearing, 0 to 360, and elevation of a unit vector, degrees.
pub fn bearing_and_elevation_deg(direction: DVec3) -> [f64; 2] {
    let bearing = heading_of(direction.truncate()).to_degrees().rem_euclid(360.0);
    [bearing, direction.z.clamp(-1.0, 1.0).asin().to_degrees()]
}

/// Heading of a vector, -pi to pi.
pub fn heading_of(v: DVec2) -> f64 {
    v.x.atan2(v.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_has_the_bearing_and_elevation_that_it_was_made_of() {
        for bearing in [0, 45, 90, 180, 270, 359] {
            for elevation in [-89, -10, 0, 35, 89] {
                let [b, e] = [bearing, elevation].map(f64::from);
                let [found_b, found_e] = bearing_and_elevation_deg(towards(b.to_radians(), e.to_radians()));
                assert!((found_b - b).abs().min(360.0 - (found_b - b).abs()) < 1e-9, "{b}: {found_b}");
                assert!((found_e - e).abs() < 1e-9, "{e}: {found_e}");
            }
        }
        assert!(
            (towards(1.5 * std::f64::consts::PI, 0.0) + DVec3::X).length() < 1e-12,
            "270 degrees is west"
        );
    }
}
