//! Recorded and simulated units, for tests. The simulated ones are what those of each format would send of one and the same motion. Their encoders are in the formats'
//! own files, written from the manuals' tables by matrices and axes, so that they share no turn with the decoders.

use std::{fs, path::Path};

use bowwave_core::{event::ImuSample, time::Time};
use glam::{DMat3, DQuat, DVec3};

use super::ImuFormat;

/// The bytes of a real unit in `../shared/data/imu_bytes`; says so where they are not there.
pub(crate) fn recording(name: &str) -> Option<Vec<u8>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/imu_bytes").join(name);
    let bytes = fs::read(&path).ok();
    if bytes.is_none() {
        eprintln!("skipped: {} is not there", path.display());
    }
    bytes
}

/// Standard gravity, m/s^2.
pub(crate) const G: f64 = 9.806_65;

/// How far the samples read may be from those sent: the rounding of a format's numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FormatTolerance {
    /// Angular rate, rad/s.
    pub(crate) rate: f64,
    /// Specific force, m/s^2.
    pub(crate) accel: f64,
    /// Attitude, rad.
    pub(crate) attitude: f64,
    /// Time of a unit without a clock, ns.
    pub(crate) time_ns: i64,
}

/// A format whose unit can be simulated: one with a clock, that sends 200 packets a second in f32, where nothing else is said.
pub(crate) trait SimulatedUnit {
    /// Nanoseconds from one packet (or group of packets) to the next.
    const PERIOD_NS: i64 = 5_000_000;
    /// Packets of one sample.
    const PACKETS: u64 = 1;
    /// Rounding of its numbers.
    const TOLERANCE: FormatTolerance =
        FormatTolerance { rate: 1e-6, accel: 2e-6, attitude: 1e-6, time_ns: 0 };

    /// The bytes that it sends for sample `n` of any motion. `by_angles`: one that chooses between quaternion and Euler angles tells
    /// the angles.
    fn send(sample: &ImuSample, n: i64, by_angles: bool) -> Vec<u8>;
}

/// The body's axes in the world: forward, right, down as columns of east, north, up.
pub(crate) fn world_of(sample: &ImuSample) -> DMat3 {
    DMat3::from_quat(sample.world_from_imu.unwrap_or(DQuat::IDENTITY))
}

fn attitude(t_s: f64) -> DQuat {
    DQuat::from_rotation_z(1.0 - 0.7 * (0.9 * t_s).sin())
        * DQuat::from_rotation_y(0.2 * (0.6 * t_s + 1.0).sin())
        * DQuat::from_rotation_x(std::f64::consts::PI + 0.3 * (0.8 * t_s).sin())
}

/// The true sample `n`: a gun on a ship, forces of gravity alone.
pub(crate) fn truth(format: ImuFormat, n: i64) -> ImuSample {
    let ns = n * format.simulated_period_ns();
    let (t_s, h) = (ns as f64 * 1e-9, 1e-4);
    let turn = attitude(t_s - h).inverse() * attitude(t_s + h);
    let turn = if turn.w < 0.0 { -turn } else { turn };
    ImuSample {
        arrival: Time::from_ns(1_000_000_000 + ns),
        device_time_ns: ns,
        rate: turn.to_scaled_axis() / (2.0 * h),
        accel: attitude(t_s).inverse() * (DVec3::Z * G),
        world_from_imu: Some(attitude(t_s)),
    }
}

/// Bytes of a unit of that format for [`truth`]'s sample `n`.
pub(crate) fn encode(format: ImuFormat, n: i64) -> Vec<u8> {
    format.send(&truth(format, n), n, false)
}

/// Rows of north, east, down from rows of east, north, up.
pub(crate) fn ned(world: DMat3) -> DMat3 {
    let rows = world.transpose();
    DMat3::from_cols(rows.y_axis, rows.x_axis, -rows.z_axis).transpose()
}

/// Nearer to the pole than this the cosine of the elevation is all rounding, and yaw has what both turn by.
pub(crate) const POLE: f64 = 1e-9;

/// Yaw, pitch and roll of a matrix by the textbook's formulas for z, y, x.
pub(crate) fn yaw_pitch_roll(m: DMat3) -> [f64; 3] {
    let at = |row: usize, column: usize| m.col(column)[row];
    if at(2, 1).hypot(at(2, 2)) < POLE {
        return [(-at(0, 1)).atan2(at(1, 1)), (-at(2, 0)).clamp(-1.0, 1.0).asin(), 0.0];
    }
    [at(1, 0).atan2(at(0, 0)), (-at(2, 0)).clamp(-1.0, 1.0).asin(), at(2, 1).atan2(at(2, 2))]
}

pub(crate) fn be(values: impl IntoIterator<Item = f64>) -> Vec<u8> {
    values.into_iter().flat_map(|v| (v as f32).to_be_bytes()).collect()
}

pub(crate) fn wxyz(q: DQuat) -> [f64; 4] {
    [q.w, q.x, q.y, q.z]
}

pub(crate) fn le(values: impl IntoIterator<Item = f64>) -> Vec<u8> {
    values.into_iter().flat_map(|v| (v as f32).to_le_bytes()).collect()
}

pub(crate) fn i16s(values: [f64; 3]) -> Vec<u8> {
    values.iter().flat_map(|v| (v.round() as i16).to_le_bytes()).collect()
}

/// Right, forward, up.
pub(crate) fn rfu(world: DMat3) -> DMat3 {
    DMat3::from_cols(world.y_axis, world.x_axis, -world.z_axis)
}
