//! From the inertial unit's samples to its orientation.

use glam::{DQuat, DVec3};

use crate::{event::ImuSample, pose::OrientationSample, time::Time};

/// A unit without an orientation of its own is levelled by the mean specific force over this long.
const LEVEL_NS: i64 = 250_000_000;

/// A gap longer than this is not bridged by integrating: the unit is levelled anew.
const GAP_NS: i64 = 1_000_000_000;

/// Orientation by the unit's own estimate where it gives one, else by integrating its rate from a levelled start.
///
/// Integration is only as good as the bias that the calibration gives; its heading starts at the camera's "north".
#[derive(Clone, Debug)]
pub struct Attitude {
    gyro_bias: DVec3,
    camera_from_imu: DQuat,
    state: State,
}

#[derive(Clone, Debug)]
enum State {
    /// Gathering specific force: since when, the sum and how many.
    Levelling { since: Option<Time>, sum: DVec3, count: u32 },
    /// Integrating from the last orientation and rate, and the rate before with its distance in time.
    Integrating { last: OrientationSample, before: Option<(DVec3, i64)> },
}

impl State {
    const START: Self = Self::Levelling { since: None, sum: DVec3::ZERO, count: 0 };
}

impl Attitude {
    /// An estimator for a unit with that bias (rad/s, its own axes) and that place on the camera.
    pub fn new(gyro_bias: DVec3, camera_from_imu: DQuat) -> Self {
        Self { gyro_bias, camera_from_imu, state: State::START }
    }

    /// Takes in a finite sample whose measurement was made at `time`; `None` while levelling.
    pub fn observe(&mut self, time: Time, sample: &ImuSample) -> Option<OrientationSample> {
        let rate = sample.rate - self.gyro_bias;
        if let Some(q) = sample.world_from_imu {
            return Some(OrientationSample { time, world_from_imu: q.normalize(), rate });
        }
        match &mut self.state {
            State::Integrating { last, before } => {
                let dt_ns = time.ns_since(last.time);
                if !(0..=GAP_NS).contains(&dt_ns) {
                    self.state = State::START;
                    return None;
                }
                // Times from a shifting clock map differ by microseconds; only about equal steps have a parabola.
                let even = before.filter(|(_, step_ns)| (step_ns - dt_ns).abs() * 5 < dt_ns).map(|(w, _)| w);
                let turn = DQuat::from_scaled_axis(magnus(even, last.rate, rate, dt_ns as f64 * 1e-9));
                *before = Some((last.rate, dt_ns));
                *last = OrientationSample {
                    time,
                    world_from_imu: (last.world_from_imu * turn).normalize(),
                    rate,
                };
                Some(*last)
            }
            State::Levelling { since, sum, count } => {
                *sum += sample.accel;
                *count += 1;
                let since = *since.get_or_insert(time);
                if time.ns_since(since) < LEVEL_NS {
                    return None;
                }
                let world_from_imu = level(*sum / f64::from(*count), self.camera_from_imu);
                let start = OrientationSample { time, world_from_imu, rate };
                self.state = State::Integrating { last: start, before: None };
                Some(start)
            }
        }
    }
}

/// Turn over the `h` seconds from rate `from` to rate `to`, a scaled axis in the body's frame: the integral of the rate and the
/// first commutator of the Magnus expansion (Iserles & Norsett 1999, eq. 1.2), which is what coning adds. With the rate `h`
/// seconds `before` the integral is that of the parabola through all three, else of the line.
fn magnus(before: Option<DVec3>, from: DVec3, to: DVec3, h: f64) -> DVec3 {
    let integral = match before {
        Some(before) => (to * 5.0 + from * 8.0 - before) * (h / 12.0),
        None => (from + to) * (h / 2.0),
    };
    integral + from.cross(to) * (h * h / 12.0)
}

/// The orientation in which `up_imu` (the direction of the specific force at rest) points up and the camera looks north.
/// A camera that looks straight up or down keeps the heading of its picture's top.
pub fn level(up_imu: DVec3, camera_from_imu: DQuat) -> DQuat {
    let up = up_imu.try_normalize().unwrap_or(DVec3::NEG_Z);
    let tilted = DQuat::from_rotation_arc(up, DVec3::Z);
    let axis = |camera: DVec3| tilted * (camera_from_imu.inverse() * camera);
    let forward = axis(DVec3::Z);
    let north = if forward.truncate().length() > 1e-3 { forward } else { axis(DVec3::NEG_Y) };
    let azimuth = north.x.atan2(north.y);
    (DQuat::from_rotation_z(azimuth) * tilted).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::look;
    use proptest::prelude::*;

    fn sample(rate: DVec3, accel: DVec3) -> ImuSample {
        ImuSample { arrival: Time::from_ns(0), device_time_ns: 0, rate, accel, world_from_imu: None }
    }

    proptest! {
        #[test]
        fn levelling_finds_elevation_and_roll(el in -1.4..1.4f64, roll in -3.0..3.0f64) {
            // Camera axes serve as the unit's axes.
            let truth = look(0.0, el, roll);
            let q = level(truth.inverse() * DVec3::Z * 9.81, DQuat::IDENTITY);
            prop_assert!(q.angle_between(truth) < 1e-6, "{}", q.angle_between(truth));
        }
    }

    #[test]
    fn integrates_a_coning_motion() {
        // Orientation about a fixed tilt that precesses: the worst case for integrating rates axis by axis.
        let at = |t: f64| {
            DQuat::from_rotation_z(0.5 * t) * DQuat::from_rotation_x(0.3) * DQuat::from_rotation_z(2.0 * t)
        };
        let rate = |t: f64| {
            let h = 1e-6;
            (at(t - h).inverse() * at(t + h)).to_scaled_axis() / (2.0 * h)
        };
        let mut attitude = Attitude::new(DVec3::ZERO, DQuat::IDENTITY);
        let up = |t: f64| at(t).inverse() * DVec3::Z * 9.81;
        let mut first: Option<(f64, DQuat)> = None;
        for i in 0..200 * 60 {
            let t = f64::from(i) * 0.005;
            let got = attitude.observe(Time::from_ns(0).plus_secs(t), &sample(rate(t), up(t)));
            if let Some(o) = got {
                let (t0, q0) = *first.get_or_insert((t, o.world_from_imu));
                let expected = q0 * at(t0).inverse() * at(t);
                assert!(o.world_from_imu.angle_between(expected) < 2e-3, "at {t}");
            }
        }
        assert!(first.is_some());
    }

    #[test]
    fn the_units_own_orientation_is_taken_as_it_is() {
        let q = look(1.0, 0.2, 0.1);
        let mut s = sample(DVec3::X, DVec3::Z);
        s.world_from_imu = Some(q);
        let o = Attitude::new(DVec3::X, DQuat::IDENTITY).observe(Time::from_ns(5), &s).unwrap();
        assert!(o.world_from_imu.angle_between(q) < 1e-9);
        assert_eq!(o.rate, DVec3::ZERO);
    }
}
