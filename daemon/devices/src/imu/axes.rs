//! The turns between the axes of units and ours, shared by formats that agree on them.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::{DQuat, DVec3};

/// Half a turn about the horizontal axis between the first two: it swaps x and y and turns z over. East-north-up from
/// north-east-down, and a body's axes right, forward, up from forward, right, down. It is its own inverse.
pub(crate) const SWAP: DQuat = DQuat::from_xyzw(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0, 0.0);

/// Half a turn about x: a body's axes forward, left, up from forward, right, down. It is its own inverse.
pub(crate) const ROLL_OVER: DQuat = DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0);

/// Quarter of a turn about the vertical: east-north-up from north-west-up.
pub(crate) const ENU_FROM_NWU: DQuat = DQuat::from_xyzw(0.0, 0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2);

/// Standard gravity, which units that measure in g mean by it, m/s^2.
pub(crate) use bowwave_core::physics::GRAVITY_M_S2 as G;

/// Three numbers of a wire as a vector.
pub(crate) fn vector([x, y, z]: [f32; 3]) -> DVec3 {
    DVec3::new(f64::from(x), f64::from(y), f64::from(z))
}

/// A rotation from what a wire says, scalar last; all zeros, which the check of the sample drops, where it cannot be one.
pub(crate) fn rotation(xyzw: [f32; 4]) -> DQuat {
    let [x, y, z, w] = xyzw.map(f64::from);
    unit(DQuat::from_xyzw(x, y, z, w))
}

/// A quaternion of length 1, or all zeros where it cannot be a rotation. Left as it is, one at the limit might pass a later
/// check with its length off.
pub(crate) fn unit(q: DQuat) -> DQuat {
    if q.is_finite() && q.length() > 0.5 { q.normalize() } else { DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0) }
}

/// Yaw, then pitch, then roll (about z, y, x, each in the turned axes), radians.
pub(crate) fn from_yaw_pitch_roll([yaw, pitch, roll]: [f64; 3]) -> DQuat {
    DQuat::from_rotation_z(yaw) * DQuat::from_rotation_y(pitch) * DQuat::from_rotation_x(roll)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_rotation_is_nothing() {
        for none in
            [[0.0; 4], [0.0, 0.0, 0.0, 0.5], [f32::NAN, 0.0, 0.0, 1.0], [f32::INFINITY, 0.0, 0.0, 0.0]]
        {
            assert_eq!(rotation(none).length(), 0.0, "{none:?}");
        }
        assert_eq!(rotation([0.0, 0.0, 0.0, 0.6]), DQuat::IDENTITY);
    }

    #[test]
    fn turns_take_axes_where_they_say() {
        let close = |a: DVec3, b: DVec3| assert!(a.abs_diff_eq(b, 1e-15), "{a} {b}");
        close(SWAP * DVec3::X, DVec3::Y);
        close(SWAP * DVec3::Y, DVec3::X);
        close(SWAP * DVec3::Z, DVec3::NEG_Z);
        close(ROLL_OVER * DVec3::X, DVec3::X);
        close(ROLL_OVER * DVec3::Y, DVec3::NEG_Y);
        // North is y, west is minus x.
        close(ENU_FROM_NWU * DVec3::X, DVec3::Y);
        close(ENU_FROM_NWU * DVec3::Y, DVec3::NEG_X);
        close(ENU_FROM_NWU * DVec3::Z, DVec3::Z);
    }
}
