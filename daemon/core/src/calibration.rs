//! A calibration as checked numbers. The file format is the `calibration` crate's.

use glam::{DQuat, DVec2, DVec3};

use crate::geometry::{Lens, Optics};

/// Everything that maintainers measure about one camera and one inertial unit on one mount.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// The camera's lens.
    pub lens: Lens,
    /// Standard deviation of the focal length, pixels.
    pub focal_sigma_px: f64,
    /// Rotation from the inertial unit's axes to the camera's.
    pub camera_from_imu: DQuat,
    /// Standard deviation of that rotation, radians, about the camera's x, y and z.
    pub camera_from_imu_sigma: DVec3,
    /// Add this to a frame's mid-exposure stamp to get the time on the inertial unit's (host-mapped) clock, nanoseconds.
    pub time_offset_ns: i64,
    /// Standard deviation of the time offset, nanoseconds.
    pub time_offset_sigma_ns: i64,
    /// From reading the picture's first row to reading its last, nanoseconds; negative where the last comes first, zero where all are
    /// exposed at once.
    pub readout_ns: i64,
    /// Standard deviation of that, nanoseconds; zero where all are exposed at once.
    pub readout_sigma_ns: i64,
    /// Where the barrel points in the camera's picture: angles right of and below the optical axis, radians.
    pub boresight: DVec2,
    /// Standard deviation of the boresight, radians.
    pub boresight_sigma: f64,
    /// The muzzle in the camera's space, metres (parallax of camera and barrel).
    pub muzzle_in_camera: DVec3,
    /// How long after the trigger's edge a round leaves, where that was measured.
    pub trigger: Option<TriggerLatency>,
    /// The gyro's bias, rad/s in the unit's axes, to be subtracted.
    pub gyro_bias: DVec3,
    /// Standard deviation of the gyro's bias, rad/s.
    pub gyro_bias_sigma: DVec3,
}

/// From the edge of the trigger's line to the round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TriggerLatency {
    /// Nanoseconds; negative where the line is the later one.
    pub latency_ns: i64,
    /// Standard deviation, nanoseconds.
    pub sigma_ns: i64,
}

impl Calibration {
    /// A camera whose axes, clock and muzzle are the unit's own, known to a milliradian and a nanosecond: what nothing was measured of.
    pub fn nominal(lens: Lens) -> Self {
        Self {
            lens,
            focal_sigma_px: 1.0,
            camera_from_imu: DQuat::IDENTITY,
            camera_from_imu_sigma: DVec3::splat(1e-3),
            time_offset_ns: 0,
            time_offset_sigma_ns: 1,
            readout_ns: 0,
            readout_sigma_ns: 0,
            boresight: DVec2::ZERO,
            boresight_sigma: 1e-3,
            muzzle_in_camera: DVec3::ZERO,
            trigger: None,
            gyro_bias: DVec3::ZERO,
            gyro_bias_sigma: DVec3::ONE,
        }
    }

    /// What drawing through its lens and shutter has to follow.
    pub fn optics(&self) -> Optics {
        Optics { rolling: self.readout_ns != 0, ..self.lens.optics() }
    }

    /// The barrel's direction in the camera's space, a unit vector.
    pub fn bore_in_camera(&self) -> DVec3 {
        DVec3::new(self.boresight.x.tan(), self.boresight.y.tan(), 1.0).normalize()
    }
}
