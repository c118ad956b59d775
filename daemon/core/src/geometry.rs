//! Spaces and the lens.
//!
//! World: x east, y north, z up, z = 0 mean sea level under the mount, metres. Camera: x right, y down, z forward. Boat:
//! x forward, y to port, z up, z = 0 at the waterline. Quaternions are Hamilton, named `to_from_from`.

mod distortion;
mod heading;
mod lens;
mod linearise;

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec2, DVec3};

pub use distortion::{Distortion, Fisheye, RadialTangential};
pub use heading::{ahead, bearing_and_elevation_deg, heading_of, starboard, towards};
pub use lens::{Bend, Lens, Optics};
pub use linearise::{INTRINSICS, LinearisedPixel};

/// Mean Earth radius in metres (IUGG R1).
pub const EARTH_RADIUS_M: f64 = 6_371_008.8;

/// Ratio of the Earth's radius to the radius of a light ray's curve near the sea (standard refraction, Bomford 1980).
pub const REFRACTION: f64 = 0.13;

/// Dip of the visible sea horizon below the horizontal, radians, for an eye `height_m` above the sea.
pub fn horizon_dip(height_m: f64) -> f64 {
    (2.0 * height_m.max(0.0) * (1.0 - REFRACTION) / EARTH_RADIUS_M).sqrt()
}

/// Distance along the sea to its visible horizon, metres, for an eye `height_m` above it.
pub fn horizon_distance(height_m: f64) -> f64 {
    horizon_dip(height_m) * EARTH_RADIUS_M / (1.0 - REFRACTION)
}

/// How far the sea surface has dropped below the tangent plane at `distance_m`, refraction included, metres.
pub fn curvature_drop(distance_m: f64) -> f64 {
    distance_m * distance_m * (1.0 - REFRACTION) / (2.0 * EARTH_RADIUS_M)
}

/// Whether `place` lies in a polygon, of one that crosses itself by the even-odd rule: a ray to the right crosses its edges an odd number of times (Shimrat 1962).
pub fn is_inside(polygon: &[DVec2], place: DVec2) -> bool {
    let ends = polygon.iter().zip(polygon.iter().cycle().skip(1));
    let crossed = |(a, b): &(&DVec2, &DVec2)| {
        (a.y > place.y) != (b.y > place.y) && place.x < a.x + (place.y - a.y) / (b.y - a.y) * (b.x - a.x)
    };
    ends.filter(crossed).count() % 2 == 1
}

/// Squared distance from a place to the nearest point of a segment.
pub fn distance_squared_to_segment(place: DVec2, from: DVec2, to: DVec2) -> f64 {
    let along = to - from;
    let share = ((place - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    place.distance_squared(from + along * share)
}

/// By what a small turn of the world turns it about the vertical, counter-clockwise from above, radians (the twist about z of Dobrowolski
/// 2015, swing-twist).
pub fn turn_about_vertical(turn: DQuat) -> f64 {
    2.0 * turn.z.atan2(turn.w)
}

/// An angle by at most half a turn either way, radians.
pub fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

/// Rotation vector of the shorter way, radians; exact near nothing, where glam's own goes through an arc cosine.
pub fn rotation_vector(q: DQuat) -> DVec3 {
    let (v, sign) = (DVec3::new(q.x, q.y, q.z), if q.w < 0.0 { -1.0 } else { 1.0 });
    let sin = v.length();
    if sin < 1e-12 { 2.0 * sign * v } else { v * (2.0 * sign * sin.atan2(q.w.abs()) / sin) }
}

/// `world_from_camera` of a camera that looks along `azimuth` (clockwise from north), `elevation` above the horizontal and
/// is rolled clockwise by `roll` (the horizon then tilts counter-clockwise in its picture), all in radians.
pub fn look(azimuth: f64, elevation: f64, roll: f64) -> DQuat {
    // Level camera that looks north: x east, y down, z north.
    let level = DQuat::from_mat3(&DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y));
    DQuat::from_rotation_z(-azimuth)
        * level
        * DQuat::from_rotation_x(elevation)
        * DQuat::from_rotation_z(roll)
}

/// Where the camera stands and looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraPose {
    /// Rotation from the camera's axes to the world's.
    pub world_from_camera: DQuat,
    /// The camera's place in the world, metres.
    pub position: DVec3,
}

impl CameraPose {
    /// Tangent of the angle below the horizontal under which a pixel of `lens` looks; negative above it.
    pub fn tangent_below(&self, lens: &Lens, pixel: DVec2) -> f64 {
        let up = (self.world_from_camera * lens.unproject(pixel)).z;
        -up / (1.0 - up * up).max(1e-12).sqrt()
    }

    /// A world point in the camera's space.
    pub fn to_camera(&self, world: DVec3) -> DVec3 {
        self.world_from_camera.inverse() * (world - self.position)
    }
}

/// Place and attitude of a rigid body in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidPose {
    /// Rotation from the body's axes to the world's.
    pub world_from_body: DQuat,
    /// The body's origin in the world, metres.
    pub position: DVec3,
}

impl RigidPose {
    /// A body point in the world.
    pub fn to_world(&self, body: DVec3) -> DVec3 {
        self.world_from_body * body + self.position
    }

    /// A world point in the body's space.
    pub fn to_body(&self, world: DVec3) -> DVec3 {
        self.world_from_body.inverse() * (world - self.position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_horizon_of_a_ten_metre_eye() {
        // Bowditch: dip 1.76' * sqrt(h), distance 2.08 nautical miles * sqrt(h), h in metres; its refraction is 0.16.
        let (dip, distance) = (horizon_dip(10.0), horizon_distance(10.0));
        assert!((dip.to_degrees() * 60.0 - 1.76 * 10f64.sqrt()).abs() < 0.15, "{dip}");
        assert!((distance / 1852.0 - 2.08 * 10f64.sqrt()).abs() < 0.1, "{distance}");
        // Seen from the eye, the sea at that distance lies just at the dip.
        let angle = (10.0 + curvature_drop(distance)) / distance;
        assert!((angle - dip).abs() < 1e-5);
    }

    #[test]
    fn looking_east_and_up() {
        let q = look(90f64.to_radians(), 0.1, 0.0);
        let forward = q * DVec3::Z;
        assert!((forward - DVec3::new(0.1f64.cos(), 0.0, 0.1f64.sin())).length() < 1e-12);
        // Rolled clockwise, the camera's right side points down.
        assert!((look(0.0, 0.0, 0.2) * DVec3::X).z < 0.0);
    }
}
