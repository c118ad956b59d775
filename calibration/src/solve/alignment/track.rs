//! The gyro integrated once over the whole recording, asked at any time.

use glam::{DMat3, DQuat, DVec3};

use super::input::GyroTrace;
use crate::solve::so3::exp;

/// Orientation at every reading, and how it depends on the gyro's errors.
#[derive(Clone, Debug)]
pub(super) struct GyroTrack<'a> {
    gyro: &'a GyroTrace,
    bias: DVec3,
    /// True rates by those that were read.
    scale: DVec3,
    nodes: Vec<TrackNode>,
}

#[derive(Clone, Copy, Debug)]
struct TrackNode {
    start_from_imu: DQuat,
    by_bias: DMat3,
    by_scale: DMat3,
    segment: usize,
}

/// The inertial unit at one instant. Its frame at the first reading is "start".
#[derive(Clone, Copy, Debug)]
pub(super) struct TrackState {
    /// Seconds since the first reading.
    pub time: f64,
    pub start_from_imu: DQuat,
    /// Rate less bias, unit's axes, rad/s.
    pub rate: DVec3,
    /// Integral of the rotation matrix: minus this by the bias's error turns the start's frame.
    pub by_bias: DMat3,
    /// Integral of the rotation matrix times the diagonal matrix of rates: turns the start's frame by the scale's error.
    pub by_scale: DMat3,
    /// Counts the breaks before.
    pub segment: usize,
}

/// Turn over `h` seconds between rates that a line joins, with the first commutator (Iserles & Norsett 1999, eq. 1.2).
fn magnus(from: DVec3, to: DVec3, h: f64) -> DVec3 {
    (from + to) * (h / 2.0) + from.cross(to) * (h * h / 12.0)
}

impl GyroTrace {
    /// Integral that the cubic through four readings adds to the line's integral from reading `i` to the next; nothing beside breaks and
    /// between uneven steps, where the line has to do.
    fn bend(&self, i: usize) -> DVec3 {
        let Some(before) = i.checked_sub(1) else { return DVec3::ZERO };
        let (Some(t), Some(w)) = (self.time.get(before..before + 4), self.rate.get(before..before + 4))
        else {
            return DVec3::ZERO;
        };
        let h = t[2] - t[1];
        let even = [t[1] - t[0], t[3] - t[2]].iter().all(|other| (other - h).abs() < 0.2 * h);
        if !even || self.broken[before] || self.broken[i] || self.broken[i + 1] {
            return DVec3::ZERO;
        }
        (w[1] + w[2] - w[0] - w[3]) * (h / 24.0)
    }
}

/// The rotation matrix's own and rate-weighted integrals over `h` seconds, by the trapezoid.
fn integrals(from: (DQuat, DVec3), to: (DQuat, DVec3), h: f64) -> (DMat3, DMat3) {
    let (a, b) = (DMat3::from_quat(from.0), DMat3::from_quat(to.0));
    let weighted = a * DMat3::from_diagonal(from.1) + b * DMat3::from_diagonal(to.1);
    ((a + b) * (h / 2.0), weighted * (h / 2.0))
}

impl<'a> GyroTrack<'a> {
    /// Integrates the rates less their bias, which are off by the shares `scale` of what was read.
    pub(super) fn new(gyro: &'a GyroTrace, bias: DVec3, scale: DVec3) -> Self {
        let scale = DVec3::ONE + scale;
        let mut nodes = Vec::with_capacity(gyro.time.len());
        let mut node = TrackNode {
            start_from_imu: DQuat::IDENTITY,
            by_bias: DMat3::ZERO,
            by_scale: DMat3::ZERO,
            segment: 0,
        };
        for i in 0..gyro.time.len() {
            if i > 0 {
                let h = gyro.time[i] - gyro.time[i - 1];
                let (w0, w1) = (gyro.rate[i - 1] * scale - bias, gyro.rate[i] * scale - bias);
                node = node.after(w0, w1, h, gyro.bend(i - 1) * scale);
                node.segment += usize::from(gyro.broken[i - 1]);
            }
            nodes.push(node);
        }
        Self { gyro, bias, scale, nodes }
    }

    /// `None` before the first reading, after the last and where readings are missing.
    pub(super) fn at(&self, t: f64) -> Option<TrackState> {
        let after = self.gyro.time.partition_point(|x| *x <= t);
        if after == 0 || after >= self.gyro.time.len() || self.gyro.broken[after - 1] {
            return None;
        }
        let i = after - 1;
        let (h, tau) = (self.gyro.time[after] - self.gyro.time[i], t - self.gyro.time[i]);
        let rate = |i: usize| self.gyro.rate[i] * self.scale - self.bias;
        let (w0, w1) = (rate(i), rate(after));
        let rate = w0 + (w1 - w0) * (tau / h);
        let TrackNode { start_from_imu, by_bias, by_scale, segment } =
            self.nodes[i].after(w0, rate, tau, DVec3::ZERO);
        Some(TrackState { time: t, start_from_imu, rate, by_bias, by_scale, segment })
    }
}

impl TrackNode {
    fn after(self, w0: DVec3, w1: DVec3, h: f64, bend: DVec3) -> Self {
        let q = (self.start_from_imu * exp(magnus(w0, w1, h) + bend)).normalize();
        let (bias, scale) = integrals((self.start_from_imu, w0), (q, w1), h);
        Self {
            start_from_imu: q,
            by_bias: self.by_bias + bias,
            by_scale: self.by_scale + scale,
            segment: self.segment,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::so3::log;

    fn coning(hz: f64) -> GyroTrace {
        let at = |t: f64| {
            let inner = DQuat::from_rotation_x(0.3) * DQuat::from_rotation_z(2.0 * t);
            inner.inverse() * DVec3::Z * 0.5 + DVec3::Z * 2.0
        };
        let time: Vec<f64> = (0..(10.0 * hz) as usize).map(|i| i as f64 / hz).collect();
        let n = time.len();
        GyroTrace {
            epoch: bowwave_core::time::Time::from_ns(0),
            rate: time.iter().map(|t| at(*t)).collect(),
            time,
            force: vec![None; n],
            broken: vec![false; n],
        }
    }

    #[test]
    fn a_coning_motion_is_followed_between_readings() {
        let truth = |t: f64| {
            DQuat::from_rotation_z(0.5 * t) * DQuat::from_rotation_x(0.3) * DQuat::from_rotation_z(2.0 * t)
        };
        let gyro = coning(200.0);
        let track = GyroTrack::new(&gyro, DVec3::ZERO, DVec3::ZERO);
        for t in [0.0, 0.0013, 3.3333, 9.99] {
            let expected = truth(0.0).inverse() * truth(t);
            let off = log(track.at(t).unwrap().start_from_imu * expected.inverse()).length();
            assert!(off < 2e-6, "{off} at {t}");
        }
        assert!(track.at(-0.1).is_none() && track.at(11.0).is_none() && track.at(f64::NAN).is_none());
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let gyro = coning(200.0);
        let (plain, b) =
            (GyroTrack::new(&gyro, DVec3::ZERO, DVec3::ZERO).at(7.0).unwrap(), DVec3::new(1e-6, -2e-6, 3e-6));
        let biased = GyroTrack::new(&gyro, b, DVec3::ZERO).at(7.0).unwrap();
        let turn = log(biased.start_from_imu * plain.start_from_imu.inverse());
        assert!((turn + plain.by_bias * b).length() < 1e-3 * turn.length());
        let mut scaled = gyro.clone();
        scaled.rate.iter_mut().for_each(|w| *w *= DVec3::ONE + b);
        let turn = log(GyroTrack::new(&scaled, DVec3::ZERO, DVec3::ZERO).at(7.0).unwrap().start_from_imu
            * plain.start_from_imu.inverse());
        assert!((turn - plain.by_scale * b).length() < 1e-3 * turn.length(), "{turn}");
    }
}
