//! The gun's frame, in which models of the gun are made, and the camera in it.
//!
//! The gun's frame has glTF's axes, metres: x to the left, y up, z forward along the bore. Its origin is the model's own. A calibration knows
//! where the bore points in the camera's picture; how the camera is rolled about the bore, and where it stands in the model, is said beside it.

use bowwave_core::calibration::Calibration;
use glam::{DMat3, DQuat, DVec3};

/// Place and turn of the camera in the gun's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GunFrame {
    camera_from_gun: DMat3,
    camera_at: DVec3,
}

impl GunFrame {
    /// That of a calibrated camera which stands `camera_at` in the gun's frame, metres, and is rolled about the bore by `roll` radians, clockwise
    /// as seen from behind it. Without a place the frame's origin is the muzzle, as the boresight measured it.
    pub fn new(calibration: &Calibration, camera_at: Option<DVec3>, roll: f64) -> Self {
        let bore = calibration.bore_in_camera();
        // The bore is never more than 80 degrees from the axis, so that the camera's up has a part across it.
        let up = (DVec3::NEG_Y).reject_from_normalized(bore).normalize();
        let up = DQuat::from_axis_angle(bore, -roll) * up;
        let camera_from_gun = DMat3::from_cols(up.cross(bore), up, bore);
        let at_muzzle = || -(camera_from_gun.transpose() * calibration.muzzle_in_camera);
        Self { camera_from_gun, camera_at: camera_at.unwrap_or_else(at_muzzle) }
    }

    /// A place of the gun in the camera's space, metres.
    pub fn to_camera(&self, gun: DVec3) -> DVec3 {
        self.camera_from_gun * (gun - self.camera_at)
    }

    /// A place of the camera's space in the gun's frame, metres.
    pub fn to_gun(&self, camera: DVec3) -> DVec3 {
        self.camera_from_gun.transpose() * camera + self.camera_at
    }

    /// The camera's place, metres.
    pub fn camera_at(&self) -> DVec3 {
        self.camera_at
    }
}

#[cfg(test)]
mod tests {
    use bowwave_core::geometry::Lens;
    use glam::DVec2;
    use proptest::prelude::*;

    use super::*;

    fn calibration(boresight: DVec2) -> Calibration {
        let muzzle_in_camera = DVec3::new(0.05, 0.12, 0.9);
        Calibration { boresight, muzzle_in_camera, ..Calibration::nominal(Lens::pinhole(1280, 720, 1.0)) }
    }

    #[test]
    fn the_guns_axes_are_left_up_and_along_the_bore() {
        let frame = GunFrame::new(&calibration(DVec2::ZERO), Some(DVec3::new(0.0, 0.2, -1.0)), 0.0);
        assert_eq!(frame.to_camera(DVec3::new(0.3, 0.2, 1.0)), DVec3::new(-0.3, 0.0, 2.0));
        assert_eq!(frame.to_camera(DVec3::ZERO), DVec3::new(0.0, 0.2, 1.0));
    }

    #[test]
    fn a_camera_that_is_rolled_clockwise_sees_the_gun_turned_the_other_way() {
        let frame = GunFrame::new(&calibration(DVec2::ZERO), Some(DVec3::ZERO), 0.1);
        let up = frame.to_camera(DVec3::Y);
        assert!(up.x < 0.0 && up.y < 0.0, "{up}");
    }

    proptest! {
        #[test]
        fn the_bore_and_the_muzzle_are_where_the_calibration_says(
            right in -1.0..1.0f64, down in -1.0..1.0f64, roll in -3.0..3.0f64, place in [-1.0..1.0f64, -1.0..1.0, -1.0..1.0],
        ) {
            let calibration = calibration(DVec2::new(right, down));
            let frame = GunFrame::new(&calibration, None, roll);
            prop_assert!(frame.to_camera(DVec3::ZERO).distance(calibration.muzzle_in_camera) < 1e-12);
            let ahead = frame.to_camera(DVec3::Z) - frame.to_camera(DVec3::ZERO);
            prop_assert!(ahead.distance(calibration.bore_in_camera()) < 1e-12);
            let place = DVec3::from(place);
            prop_assert!(frame.to_gun(frame.to_camera(place)).distance(place) < 1e-12);
        }
    }
}
