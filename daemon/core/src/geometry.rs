//! Spaces and the lens.
//!
//! World: x east, y north, z up, z = 0 mean sea level under the mount, metres. Camera: x right, y down, z forward. Boat:
//! x forward, y to port, z up, z = 0 at the waterline. Quaternions are Hamilton, named `to_from_from`.

use glam::{DMat3, DQuat, DVec2, DVec3};

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

/// Pinhole with radial and tangential distortion (Brown-Conrady, as OpenCV's first five coefficients without k3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Picture width in pixels.
    pub width: u32,
    /// Picture height in pixels.
    pub height: u32,
    /// Focal lengths in pixels.
    pub focal: DVec2,
    /// Principal point in pixels; the centre of the first pixel is (0.5, 0.5).
    pub centre: DVec2,
    /// Radial coefficients k1, k2.
    pub radial: DVec2,
    /// Tangential coefficients p1, p2.
    pub tangential: DVec2,
}

impl Lens {
    /// An undistorted lens with square pixels, centred, that covers `hfov` radians across.
    pub fn pinhole(width: u32, height: u32, hfov: f64) -> Self {
        let focal = f64::from(width) / 2.0 / (hfov / 2.0).tan();
        Self {
            width,
            height,
            focal: DVec2::splat(focal),
            centre: DVec2::new(f64::from(width), f64::from(height)) / 2.0,
            radial: DVec2::ZERO,
            tangential: DVec2::ZERO,
        }
    }

    /// Where a point of the camera's space falls, in pixels; `None` behind the camera or where the distortion folds back.
    pub fn project(&self, camera: DVec3) -> Option<DVec2> {
        if camera.z <= 1e-6 || !camera.is_finite() {
            return None;
        }
        let n = camera.truncate() / camera.z;
        let r2 = n.length_squared();
        // Radius must still grow with the angle, or the model wraps far-off points into the picture.
        if 1.0 + 3.0 * self.radial.x * r2 + 5.0 * self.radial.y * r2 * r2 <= 0.0 {
            return None;
        }
        Some(self.distort(n) * self.focal + self.centre)
    }

    /// Undistorted normalised coordinates (x/z, y/z) to distorted ones.
    pub fn distort(&self, n: DVec2) -> DVec2 {
        let r2 = n.length_squared();
        let radial = 1.0 + r2 * (self.radial.x + r2 * self.radial.y);
        let (p1, p2) = (self.tangential.x, self.tangential.y);
        let tangential = DVec2::new(
            2.0 * p1 * n.x * n.y + p2 * (r2 + 2.0 * n.x * n.x),
            p1 * (r2 + 2.0 * n.y * n.y) + 2.0 * p2 * n.x * n.y,
        );
        n * radial + tangential
    }

    /// Unit vector in the camera's space of what falls on `pixel`. Fixed-point iteration; error below 1e-9 for the lenses
    /// that [`Lens::project`] accepts inside the picture.
    pub fn unproject(&self, pixel: DVec2) -> DVec3 {
        let distorted = (pixel - self.centre) / self.focal;
        let mut n = distorted;
        for _ in 0..60 {
            let step = distorted - self.distort(n);
            n += step;
            if step.length_squared() < 1e-24 {
                break;
            }
        }
        DVec3::new(n.x, n.y, 1.0).normalize()
    }

    /// The lens of the same camera when its picture is scaled to cover a `width` x `height` screen and centred (what falls
    /// outside is cut off).
    #[must_use]
    pub fn covering(&self, width: u32, height: u32) -> Self {
        let from = DVec2::new(f64::from(self.width), f64::from(self.height));
        let to = DVec2::new(f64::from(width), f64::from(height));
        let scale = (to / from).max_element();
        Self {
            width,
            height,
            focal: self.focal * scale,
            centre: (self.centre - from / 2.0) * scale + to / 2.0,
            ..*self
        }
    }

    /// Half the diagonal field of view, radians: no visible direction is farther from the axis.
    pub fn half_diagonal(&self) -> f64 {
        let (w, h) = (f64::from(self.width), f64::from(self.height));
        [DVec2::ZERO, DVec2::new(w, 0.0), DVec2::new(0.0, h), DVec2::new(w, h)]
            .into_iter()
            .map(|corner| self.unproject(corner).z.clamp(-1.0, 1.0).acos())
            .fold(0.0, f64::max)
    }
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
    use proptest::prelude::*;

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

    proptest! {
        #[test]
        fn unproject_inverts_project(
            x in 0.0..1280.0f64, y in 0.0..720.0f64, k1 in -0.2..0.2f64, k2 in -0.02..0.02f64,
            p1 in -0.005..0.005f64, p2 in -0.005..0.005f64,
        ) {
            let mut lens = Lens::pinhole(1280, 720, 1.0);
            lens.radial = DVec2::new(k1, k2);
            lens.tangential = DVec2::new(p1, p2);
            let pixel = DVec2::new(x, y);
            let back = lens.project(lens.unproject(pixel) * 37.0).unwrap();
            prop_assert!(back.distance(pixel) < 1e-6, "{back} {pixel}");
        }

        #[test]
        fn covering_scales_about_the_centre(w in 16u32..4000, h in 16u32..4000) {
            let lens = Lens::pinhole(1280, 720, 1.0);
            let screen = lens.covering(w, h);
            let axis = screen.project(DVec3::Z).unwrap();
            prop_assert!(axis.distance(DVec2::new(f64::from(w), f64::from(h)) / 2.0) < 1e-9);
            // Both sides of the picture reach at least the screen's edge.
            let scale = screen.focal.x / lens.focal.x;
            prop_assert!(1280.0 * scale >= f64::from(w) - 1e-6 && 720.0 * scale >= f64::from(h) - 1e-6);
        }
    }
}
