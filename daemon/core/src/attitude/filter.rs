//! A small error-state filter about an orientation that is integrated from rates: what is still wrong with it, with the gyro's bias, with
//! the inclination it is held against, and with the camera's place on the unit; and how far each of these is known.
//!
//! The error is a small turn of the world: `true = exp(error) estimate` (Sola, "Quaternion kinematics for the error-state Kalman filter",
//! 2017, section 7, global error). A turn of the world hardly changes from one sample to the next, so that a measurement made some
//! frames ago corrects the present.

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};
use nalgebra::{SMatrix, SVector};

use crate::gunnery::GRAVITY_M_S2;

/// Turn of the world (3), gyro's bias in the unit's axes (3), error of the inclination it is held against (2), turn of the camera against
/// the unit in the camera's axes (3), bias of the specific force over gravity in the unit's axes (3).
const STATES: usize = 14;
const BIAS: usize = 3;
const REFERENCE: usize = 6;
const MOUNTING: usize = 8;
const FORCE: usize = 11;

type Covariance = SMatrix<f64, STATES, STATES>;

/// What the filter is told of a unit's errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// White noise of the rate, rad/s/sqrt(Hz).
    pub gyro: f64,
    /// Standard deviation of the bias beyond the calibrated one at the start, rad/s.
    pub bias: DVec3,
    /// Random walk of the bias, rad/s in a square root of a second.
    pub bias_walk: f64,
    /// Standard deviation of the rate's scale.
    pub scale: f64,
    /// Standard deviation of the specific force's bias, m/s^2.
    pub force: f64,
    /// Standard deviation of the camera's calibrated place on the unit, rad, about the camera's axes.
    pub mounting: DVec3,
}

impl Noise {
    /// A unit of the VN-100's class that nothing is known of but its data sheet: bias within 0.1 deg/s, mounted within a milliradian.
    pub const USUAL: Self = Self {
        gyro: 6.1e-5,
        bias: DVec3::splat(1.7e-3),
        bias_walk: 5e-6,
        scale: 5e-4,
        force: 0.04,
        mounting: DVec3::splat(1e-3),
    };
}

/// By what a measurement differs from what was expected, and whether it was believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Square of the difference over its expected variance: chi squared with as many degrees of freedom as the measurement has.
    pub surprise: f64,
    /// Whether it was taken in.
    pub taken: bool,
}

/// What a measurement changes: the world is to be turned by this.
type Correction = DQuat;

/// The filter.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    noise: Noise,
    covariance: Covariance,
    /// Estimates of what is not put into the orientation at once.
    bias: DVec3,
    reference: DVec2,
    mounting: DVec3,
    force: DVec3,
    /// Since the last prediction: integral of the unit's axes in the world, how far it turned, how long.
    axes: DMat3,
    turned: f64,
    dt_s: f64,
    /// Mean square of what the inclination it is held against errs by on an axis, rad^2, and for how long it was watched, s.
    reference_variance: f64,
    watched_s: f64,
    /// For how long the inclination still settles, s; nothing where up was seen otherwise.
    settling_s: f64,
}

/// The inclination's error forgets itself in this time, seconds: about a quarter of a long wave's period.
const REFERENCE_TAU_S: f64 = 3.0;
/// It is never better than this, rad.
const REFERENCE_LEAST: f64 = 2e-3;
/// How wrong it is at the start, rad: what the first seconds of a sea show of gravity.
const REFERENCE_START: f64 = 0.05;
/// How long its size is averaged over, seconds.
const REFERENCE_MEAN_S: f64 = 60.0;
/// What it errs by beside that from one time to the next, rad.
const REFERENCE_NOISE: f64 = 5e-4;
/// Inclination after levelling, rad.
const START_TILT: f64 = 0.06;

impl Filter {
    pub(super) fn new(noise: Noise, settling_s: f64) -> Self {
        let mut covariance = Covariance::zeros();
        let mut set = |at: usize, deviation: f64| covariance[(at, at)] = deviation * deviation;
        for axis in 0..3 {
            set(axis, if axis < 2 { START_TILT } else { 0.0 });
            set(BIAS + axis, noise.bias[axis]);
            set(MOUNTING + axis, noise.mounting[axis]);
            set(FORCE + axis, noise.force / GRAVITY_M_S2);
        }
        set(REFERENCE, REFERENCE_START);
        set(REFERENCE + 1, REFERENCE_START);
        Self {
            noise,
            covariance,
            bias: DVec3::ZERO,
            reference: DVec2::ZERO,
            mounting: DVec3::ZERO,
            force: DVec3::ZERO,
            axes: DMat3::ZERO,
            turned: 0.0,
            dt_s: 0.0,
            reference_variance: REFERENCE_START * REFERENCE_START,
            watched_s: 0.0,
            settling_s,
        }
    }

    /// The bias beyond the calibrated one, rad/s, the unit's axes.
    pub(super) fn bias(&self) -> DVec3 {
        self.bias
    }

    /// Turn of the camera against its calibrated place on the unit, radians, about the camera's axes.
    pub(super) fn mounting(&self) -> DVec3 {
        self.mounting
    }

    /// Covariance of the turn of the world, rad^2.
    pub(super) fn turn_covariance(&self) -> DMat3 {
        let p = &self.covariance;
        DMat3::from_cols_array_2d(&[0, 1, 2].map(|c| [0, 1, 2].map(|r| p[(r, c)])))
    }

    /// A step by `turn` (radians) over `dt_s` seconds, with the unit's axes in the world.
    pub(super) fn step(&mut self, world_from_imu: DQuat, turn: f64, dt_s: f64) {
        self.axes += DMat3::from_quat(world_from_imu) * dt_s;
        self.turned += turn;
        self.dt_s += dt_s;
    }

    /// Brings the covariance to the present.
    pub(super) fn predict(&mut self) {
        let dt = std::mem::take(&mut self.dt_s);
        if dt <= 0.0 {
            return;
        }
        let axes = std::mem::replace(&mut self.axes, DMat3::ZERO);
        let turned = std::mem::take(&mut self.turned);
        let mut step = Covariance::identity();
        for row in 0..3 {
            for column in 0..3 {
                step[(row, BIAS + column)] = -axes.col(column)[row];
            }
        }
        let kept = (-dt / REFERENCE_TAU_S).exp();
        step[(REFERENCE, REFERENCE)] = kept;
        step[(REFERENCE + 1, REFERENCE + 1)] = kept;
        self.reference *= kept;
        self.covariance = step * self.covariance * step.transpose();
        // A wrong scale adds up over a turn of a radian and is as likely to be undone by the next one.
        let turning = self.noise.gyro.powi(2) * dt + self.noise.scale.powi(2) * turned;
        let mut add = |at: usize, variance: f64| self.covariance[(at, at)] += variance;
        for axis in 0..3 {
            add(axis, turning);
            add(BIAS + axis, self.noise.bias_walk.powi(2) * dt);
        }
        add(REFERENCE, self.reference_variance * (1.0 - kept * kept));
        add(REFERENCE + 1, self.reference_variance * (1.0 - kept * kept));
    }

    /// Holds `world_from_imu` against an inclination that errs by itself: where up is in the unit's axes, `since_s` after the last one.
    pub(super) fn incline(&mut self, world_from_imu: DQuat, up_imu: DVec3, since_s: f64) -> Correction {
        let up = world_from_imu * (up_imu - self.force);
        if self.settling_s > 0.0 {
            self.settling_s -= since_s;
            self.forget_tilt();
        } else {
            self.watch(up, since_s);
        }
        let mut rows = up_rows();
        rows[0][REFERENCE] = 1.0;
        rows[1][REFERENCE + 1] = 1.0;
        let axes = DMat3::from_quat(world_from_imu);
        for column in 0..3 {
            rows[0][FORCE + column] = axes.col(column).x;
            rows[1][FORCE + column] = axes.col(column).y;
        }
        let differ = DVec2::new(up.x, up.y) - self.reference;
        let noise = DMat2::from_diagonal(DVec2::splat(REFERENCE_NOISE * REFERENCE_NOISE));
        self.update(rows, differ, noise, f64::INFINITY).0
    }

    /// Until the inclination has settled, nothing that it said before is worth more than what it says now.
    fn forget_tilt(&mut self) {
        self.reference = DVec2::ZERO;
        for (state, deviation) in
            [(0, START_TILT), (1, START_TILT), (REFERENCE, REFERENCE_START), (REFERENCE + 1, REFERENCE_START)]
        {
            for other in 0..STATES {
                self.covariance[(state, other)] = 0.0;
                self.covariance[(other, state)] = 0.0;
            }
            self.covariance[(state, state)] = deviation * deviation;
        }
    }

    /// Learns how far that inclination swings about.
    fn watch(&mut self, up: DVec3, since_s: f64) {
        self.watched_s = (self.watched_s + since_s).min(REFERENCE_MEAN_S);
        let share = (since_s / self.watched_s.max(since_s)).min(1.0);
        let seen = 0.5 * (up.x * up.x + up.y * up.y);
        let now = self.reference_variance + share * (seen - self.reference_variance);
        self.reference_variance =
            now.clamp(REFERENCE_LEAST * REFERENCE_LEAST, REFERENCE_START * REFERENCE_START);
    }

    /// Takes in the direction of up that the camera saw, in the camera's axes, with the covariance of its part across up, rad^2, in the
    /// world's horizontal axes; `limit` is the surprise beyond which it is not believed.
    pub(super) fn see_up(
        &mut self,
        world_from_camera: DQuat,
        up_camera: DVec3,
        covariance: DMat2,
        limit: f64,
    ) -> (Correction, Outcome) {
        let up = world_from_camera * up_camera;
        let mut rows = up_rows();
        let axes = DMat3::from_quat(world_from_camera);
        for column in 0..3 {
            let turned = axes.col(column);
            rows[0][MOUNTING + column] = turned.y;
            rows[1][MOUNTING + column] = -turned.x;
        }
        let (turn, outcome) = self.update(rows, DVec2::new(up.x, up.y), covariance, limit);
        if outcome.taken {
            self.settling_s = 0.0;
        }
        (turn, outcome)
    }

    fn update(
        &mut self,
        rows: [[f64; STATES]; 2],
        differ: DVec2,
        noise: DMat2,
        limit: f64,
    ) -> (Correction, Outcome) {
        let rows = SMatrix::<f64, 2, STATES>::from_fn(|r, c| rows[r][c]);
        let differ = SVector::<f64, 2>::new(differ.x, differ.y);
        let noise = SMatrix::<f64, 2, 2>::from_fn(|r, c| noise.col(c)[r]);
        let gain = self.covariance * rows.transpose();
        let expected = rows * gain + noise;
        let Some(inverse) = expected.try_inverse() else {
            return (DQuat::IDENTITY, Outcome { surprise: f64::NAN, taken: false });
        };
        let surprise = (differ.transpose() * inverse * differ)[(0, 0)];
        if surprise.is_nan() || surprise > limit {
            return (DQuat::IDENTITY, Outcome { surprise, taken: false });
        }
        let gain = gain * inverse;
        // Joseph's form: stays positive however small the noise.
        let left = Covariance::identity() - gain * rows;
        self.covariance = left * self.covariance * left.transpose() + gain * noise * gain.transpose();
        self.hold_symmetric();
        (self.put_in(&(gain * differ)), Outcome { surprise, taken: true })
    }

    fn hold_symmetric(&mut self) {
        self.covariance = (self.covariance + self.covariance.transpose()) * 0.5;
    }

    /// Puts the estimated error into what is held; what is left is the turn of the world.
    fn put_in(&mut self, error: &SVector<f64, STATES>) -> Correction {
        let three = |at: usize| DVec3::new(error[at], error[at + 1], error[at + 2]);
        self.bias += three(BIAS);
        self.reference += DVec2::new(error[REFERENCE], error[REFERENCE + 1]);
        self.mounting += three(MOUNTING);
        self.force += three(FORCE);
        DQuat::from_scaled_axis(three(0))
    }
}

/// How the horizontal parts of where up is found change with the turn of the world: `up + up x turn`.
fn up_rows() -> [[f64; STATES]; 2] {
    let mut rows = [[0.0; STATES]; 2];
    rows[0][1] = -1.0;
    rows[1][0] = 1.0;
    rows
}
