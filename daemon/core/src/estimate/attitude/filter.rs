//! A small error-state filter about an orientation that is integrated from rates: what is still wrong with it, with the gyro's bias, with
//! the inclination it is held against, and with the camera's place on the unit; and how far each of these is known.

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};

use super::{
    error_state::{COMMON, Correction, ErrorState, MeasurementRow, TURN, up_rows},
    heave::HeaveAcceleration,
    inclination::InclinationSettings,
    lag::Lag,
};
use crate::physics::GRAVITY_M_S2;

/// Beside what all have: gyro's bias in the unit's axes (3), error of the inclination it is held against (2), bias of the specific force over
/// gravity in the unit's axes (3), what a turn about the unit's upright axis is measured too large by about each of its axes, what the
/// inclination's error is the slope of (2).
const BIAS: usize = COMMON;
const REFERENCE: usize = BIAS + 3;
const FORCE: usize = REFERENCE + 2;
const SCREW: usize = FORCE + 3;
const SWAY: usize = SCREW + 3;
const STATES: usize = SWAY + 2;

/// Noise model of a unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// White noise of the rate, rad/s/sqrt(Hz).
    pub gyro: f64,
    /// Standard deviation of the bias beyond the calibrated one at the start, rad/s.
    pub bias: DVec3,
    /// Random walk of the bias, rad/s in a square root of a second.
    pub bias_walk: f64,
    /// Standard deviation of the rate's scale, and of an axis's share in what another measures.
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

/// The filter.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    /// States and how far they are known.
    pub(super) error_state: ErrorState<STATES>,
    noise: Noise,
    /// The unit's axis that pointed up when it was looked at last.
    upright: DVec3,
    lag: Lag,
    heave: HeaveAcceleration,
    /// Since the last prediction: integral of the unit's axes in the world, of them times the rate about the upright axis, the turn about
    /// others, how long.
    axes: DMat3,
    screws: DMat3,
    turned: DVec3,
    dt_s: f64,
    /// How far it has turned in the last seconds, in the unit's axes.
    swing: DVec3,
    /// What it may have turned since the last prediction without the gyro's telling, radians.
    missed: f64,
    /// Mean square of what the inclination it is held against errs by on an axis, rad^2, and for how long it was watched, s.
    reference_variance: f64,
    watched_s: f64,
    /// For how long the inclination still settles, s, and whether up was seen otherwise since that began.
    settling_s: f64,
    seen: bool,
    inclination: InclinationSettings,
}

/// VQF's inclination has settled after so many of its time constants: until then what it lags by is not that of the filter alone.
const SETTLE_TAUS: f64 = 4.0;
/// How wrong it is at the start, rad: what the first seconds of a sea show of gravity.
const REFERENCE_START: f64 = 0.05;
/// How long its size is averaged over, seconds.
const REFERENCE_MEAN_S: f64 = 60.0;
/// What it errs by beside that from one time to the next, rad.
const REFERENCE_NOISE: f64 = 5e-4;
/// Cosine of how far the upright axis may lean: beyond, a turn about the vertical errs by something else.
const UPRIGHT_LEAST: f64 = 0.7;
/// A turn about others is remembered for so long, seconds: longer than a wave, shorter than what corrects its error takes.
const SWING_TAU_S: f64 = 10.0;
/// A turn that the gyro did not tell and that is larger than this is more than the inclination's own error, radians.
const MISSED_MUCH: f64 = 5e-3;
/// Inclination after levelling, rad.
const START_TILT: f64 = 0.06;

impl Filter {
    /// Nothing learnt yet about an orientation that is held against an inclination so set.
    pub(super) fn new(noise: Noise, inclination: InclinationSettings) -> Self {
        let tau_s = inclination.tau_accel_s;
        let mut error_state = ErrorState::new(noise.mounting);
        for axis in 0..3 {
            error_state.forget(BIAS + axis, noise.bias[axis]);
            error_state.forget(FORCE + axis, noise.force / GRAVITY_M_S2);
            error_state.forget(SCREW + axis, noise.scale);
        }
        let mut filter = Self {
            error_state,
            noise,
            upright: DVec3::ZERO,
            lag: Lag::new(tau_s),
            heave: HeaveAcceleration::new(tau_s),
            axes: DMat3::ZERO,
            screws: DMat3::ZERO,
            turned: DVec3::ZERO,
            dt_s: 0.0,
            swing: DVec3::ZERO,
            missed: 0.0,
            reference_variance: REFERENCE_START * REFERENCE_START,
            watched_s: 0.0,
            settling_s: SETTLE_TAUS * tau_s,
            seen: false,
            inclination,
        };
        filter.forget_tilt();
        filter
    }

    /// The bias beyond the calibrated one, rad/s, the unit's axes.
    pub(super) fn bias(&self) -> DVec3 {
        self.error_state.three(BIAS)
    }

    /// A turn (scaled axis, radians, the unit's axes) that was measured over `dt_s` seconds, without what is known to be wrong with it.
    pub(super) fn corrected(&self, turn: DVec3, dt_s: f64) -> DVec3 {
        turn - self.bias() * dt_s - self.error_state.three(SCREW) * turn.dot(self.upright)
    }

    /// A step by `turn` (scaled axis, radians) over `dt_s` seconds, with the unit's axes in the world.
    pub(super) fn step(&mut self, world_from_imu: DQuat, turn: DVec3, dt_s: f64) {
        let axes = DMat3::from_quat(world_from_imu);
        let up = axes.transpose().z_axis;
        if up.dot(self.upright) < UPRIGHT_LEAST {
            self.set_upright(up);
        }
        let about = turn.dot(self.upright);
        self.axes += axes * dt_s;
        self.screws += axes * about;
        self.turned += turn - self.upright * about;
        self.dt_s += dt_s;
    }

    /// Another axis points up: what is wrong with turns about it is another thing.
    fn set_upright(&mut self, up: DVec3) {
        self.upright = up;
        self.screws = DMat3::ZERO;
        self.lag.forget_screw();
        for axis in 0..3 {
            self.error_state.forget(SCREW + axis, self.noise.scale);
        }
    }

    /// It may have turned by another `turn` radians that the gyro did not tell.
    pub(super) fn miss(&mut self, turn: f64) {
        self.missed += turn;
    }

    /// Brings the covariance to the present.
    pub(super) fn predict(&mut self) {
        let dt = std::mem::take(&mut self.dt_s);
        if dt <= 0.0 {
            return;
        }
        let axes = std::mem::replace(&mut self.axes, DMat3::ZERO);
        let turned = std::mem::take(&mut self.turned);
        let screws = std::mem::replace(&mut self.screws, DMat3::ZERO);
        self.turn_by(BIAS, &axes);
        self.turn_by(SCREW, &screws);
        self.lag.step(axes, screws, dt);
        self.sway_on(dt);
        self.error_state.pass_time(dt);
        let missed = std::mem::take(&mut self.missed);
        // The inclination it is held against has missed the same turn.
        if missed > MISSED_MUCH {
            self.settling_s = SETTLE_TAUS * self.inclination.tau_accel_s;
            self.seen = false;
        }
        for axis in 0..3 {
            self.error_state.walk(TURN + axis, self.noise.gyro.powi(2) * dt + missed * missed);
            self.error_state.walk(BIAS + axis, self.noise.bias_walk.powi(2) * dt);
        }
        let before = self.swing * (-dt / SWING_TAU_S).exp();
        self.swing = before + turned;
        self.turn_by_axes((self.swing.length_squared() - before.length_squared()).max(0.0));
    }

    /// What wrong scales and axes of the gyro that are not square add up to where it does not turn about the upright axis, `farther` being by
    /// how much the square of the turn from where it was before has grown: turning back undoes that error, so turns there and back do not
    /// add up.
    fn turn_by_axes(&mut self, farther: f64) {
        for axis in 0..3 {
            self.error_state.walk(TURN + axis, self.noise.scale.powi(2) * farther);
        }
    }

    /// What an error of the rate at these three states turned the world by since the last prediction, `axes` being the integral of what
    /// it turns by where it is one about each of the unit's axes.
    fn turn_by(&mut self, state: usize, axes: &DMat3) {
        for row in 0..3 {
            for column in 0..3 {
                self.error_state.add(TURN + row, state + column, -axes.col(column)[row]);
            }
        }
    }

    /// The inclination's error goes on to and fro.
    fn sway_on(&mut self, dt: f64) {
        let (change, added) = self.heave.step(dt);
        for axis in 0..2 {
            self.error_state.mix([SWAY + axis, REFERENCE + axis], change, added * self.reference_variance);
        }
    }

    /// Holds `world_from_imu` against an inclination that errs by itself: where up is in the unit's axes, `since_s` after the last one.
    pub(super) fn incline(&mut self, world_from_imu: DQuat, up_imu: DVec3, since_s: f64) -> Correction {
        let swung = self.lag.behind() * self.bias() + self.lag.screwed() * self.error_state.three(SCREW);
        let felt = self.lag.axes() * self.error_state.three(FORCE);
        let up = (world_from_imu * up_imu - felt + swung.cross(DVec3::Z)).truncate();
        if self.settling_s > 0.0 {
            self.settling_s -= since_s;
            if self.seen {
                return DQuat::IDENTITY;
            }
            self.forget_tilt();
        } else {
            self.watch(up, since_s);
        }
        let noise = DMat2::from_diagonal(DVec2::splat(REFERENCE_NOISE * REFERENCE_NOISE));
        let differ = up - self.error_state.two(REFERENCE);
        self.error_state.update(&self.inclined_rows(), differ, noise, f64::INFINITY).0
    }

    /// How the horizontal parts of that inclination change with the states.
    fn inclined_rows(&self) -> [MeasurementRow<STATES>; 2] {
        let mut rows = up_rows();
        for column in 0..3 {
            let (felt, behind, screwed) =
                (self.lag.axes().col(column), self.lag.behind().col(column), self.lag.screwed().col(column));
            // A turn of the axes that it works in turns up.
            for (row, by) in rows.iter_mut().zip([DVec2::new(0.0, -1.0), DVec2::new(1.0, 0.0)]) {
                row[BIAS + column] = by.dot(behind.truncate());
                row[SCREW + column] = by.dot(screwed.truncate());
            }
            rows[0][FORCE + column] = felt.x;
            rows[1][FORCE + column] = felt.y;
        }
        rows[0][REFERENCE] = 1.0;
        rows[1][REFERENCE + 1] = 1.0;
        rows
    }

    /// Until the inclination has settled, nothing that it said before is worth more than what it says now.
    fn forget_tilt(&mut self) {
        let place = REFERENCE_START * self.heave.place_variance().sqrt();
        for axis in 0..2 {
            self.error_state.forget(TURN + axis, START_TILT);
            self.error_state.forget(REFERENCE + axis, REFERENCE_START);
            self.error_state.forget(SWAY + axis, place);
        }
    }

    /// Learns how far that inclination swings about.
    fn watch(&mut self, up: DVec2, since_s: f64) {
        self.watched_s = (self.watched_s + since_s).min(REFERENCE_MEAN_S);
        let share = (since_s / self.watched_s.max(since_s)).min(1.0);
        let seen = 0.5 * up.length_squared();
        let now = self.reference_variance + share * (seen - self.reference_variance);
        self.reference_variance =
            now.clamp(self.inclination.error_least.powi(2), REFERENCE_START * REFERENCE_START);
    }

    /// Up was seen otherwise than by specific force.
    pub(super) const fn saw_up(&mut self) {
        self.seen = true;
    }

    /// The heading is set from outside: the world is turned by `off` about the vertical, which is then known to `deviation`.
    pub(super) fn set_heading(&mut self, off: f64, deviation: f64) {
        self.error_state.set_heading(off, deviation, &[REFERENCE, SWAY]);
        self.lag.turn(DMat3::from_rotation_z(off));
    }

    /// By how much the bias turns the world about the vertical, standard deviation, rad/s, with the unit as in `world_from_imu`.
    pub(super) fn drift_sigma(&self, world_from_imu: DQuat) -> f64 {
        let vertical = world_from_imu.inverse() * DVec3::Z;
        vertical.dot(self.error_state.covariance(BIAS) * vertical).max(0.0).sqrt()
    }
}
