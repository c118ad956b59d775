//! A small error-state filter about an orientation that is integrated from rates: what is still wrong with it, with the gyro's bias, with
//! the inclination it is held against, and with the camera's place on the unit; and how far each of these is known.
//!
//! The error is a small turn of the world: `true = exp(error) estimate` (Sola, "Quaternion kinematics for the error-state Kalman filter",
//! 2017, section 7, global error). A turn of the world hardly changes from one sample to the next, so that a measurement made some
//! frames ago corrects the present.

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};
use nalgebra::{SMatrix, SVector};

use super::{inclination::Settings, lag::Lag, swell::Swell};
use crate::gunnery::GRAVITY_M_S2;

/// Turn of the world (3), gyro's bias in the unit's axes (3), error of the inclination it is held against (2), turn of the camera against
/// the unit in the camera's axes (3), bias of the specific force over gravity in the unit's axes (3), how much higher the horizon stands
/// than geometry has it, turn about the vertical of the anchor and its rate, what a turn about the unit's upright axis is measured too large
/// by about each of its axes, what the inclination's error is the slope of (2), turn of the gun on its mount.
const STATES: usize = 23;
const HEADING: usize = 2;
const BIAS: usize = 3;
const REFERENCE: usize = 6;
const MOUNTING: usize = 8;
const FORCE: usize = 11;
const DIP: usize = 14;
const ANCHOR: usize = 15;
const ANCHOR_RATE: usize = 16;
const SCREW: usize = 17;
const SWAY: usize = 20;
const MOUNT: usize = 22;

type Covariance = SMatrix<f64, STATES, STATES>;
/// How a measured number changes with the states.
type Row = SVector<f64, STATES>;

/// What the filter is told of a unit's errors.
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
    sway: DVec2,
    mounting: DVec3,
    force: DVec3,
    dip: f64,
    anchor: f64,
    anchor_rate: f64,
    mount: f64,
    screw: DVec3,
    /// The unit's axis that pointed up when it was looked at last.
    upright: DVec3,
    lag: Lag,
    swell: Swell,
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
    inclination: Settings,
}

/// VQF's inclination has settled after so many of its time constants: until then what it lags by is not that of the filter alone.
const SETTLE_TAUS: f64 = 4.0;
/// How wrong it is at the start, rad: what the first seconds of a sea show of gravity.
const REFERENCE_START: f64 = 0.05;
/// How long its size is averaged over, seconds.
const REFERENCE_MEAN_S: f64 = 60.0;
/// What it errs by beside that from one time to the next, rad.
const REFERENCE_NOISE: f64 = 5e-4;
/// Refraction moves the true horizon by as much from day to day and hour to hour (design figures: 0.08 to 0.12 deg in daytime), radians.
pub const DIP_SIGMA: f64 = 0.1f64.to_radians();
/// It forgets itself in this time, seconds.
const DIP_TAU_S: f64 = 3600.0;
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
    pub(super) fn new(noise: Noise, inclination: Settings) -> Self {
        let tau_s = inclination.tau_accel_s;
        let mut covariance = Covariance::zeros();
        let mut set = |at: usize, deviation: f64| covariance[(at, at)] = deviation * deviation;
        for axis in 0..3 {
            set(axis, if axis < 2 { START_TILT } else { 0.0 });
            set(BIAS + axis, noise.bias[axis]);
            set(MOUNTING + axis, noise.mounting[axis]);
            set(FORCE + axis, noise.force / GRAVITY_M_S2);
            set(SCREW + axis, noise.scale);
        }
        set(DIP, DIP_SIGMA);
        let mut filter = Self {
            noise,
            covariance,
            bias: DVec3::ZERO,
            reference: DVec2::ZERO,
            sway: DVec2::ZERO,
            mounting: DVec3::ZERO,
            force: DVec3::ZERO,
            dip: 0.0,
            anchor: 0.0,
            anchor_rate: 0.0,
            mount: 0.0,
            screw: DVec3::ZERO,
            upright: DVec3::ZERO,
            lag: Lag::new(tau_s),
            swell: Swell::new(tau_s),
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
        self.bias
    }

    /// A turn (scaled axis, radians, the unit's axes) that was measured over `dt_s` seconds, without what is known to be wrong with it.
    pub(super) fn corrected(&self, turn: DVec3, dt_s: f64) -> DVec3 {
        turn - self.bias * dt_s - self.screw * turn.dot(self.upright)
    }

    /// Turn of the camera against its calibrated place on the unit, radians, about the camera's axes.
    pub(super) fn mounting(&self) -> DVec3 {
        self.mounting
    }

    /// By how much the horizon stands higher than geometry has it, radians.
    pub(super) fn dip(&self) -> f64 {
        self.dip
    }

    /// Covariance of the turn of the world, rad^2.
    pub(super) fn turn_covariance(&self) -> DMat3 {
        let p = &self.covariance;
        DMat3::from_cols_array_2d(&[0, 1, 2].map(|c| [0, 1, 2].map(|r| p[(r, c)])))
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
        self.screw = DVec3::ZERO;
        self.screws = DMat3::ZERO;
        self.lag.forget_screw();
        for axis in 0..3 {
            self.forget(SCREW + axis, self.noise.scale);
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
        let kept = (-dt / DIP_TAU_S).exp();
        self.dip *= kept;
        self.fade(DIP, kept, DIP_SIGMA * DIP_SIGMA);
        self.anchor += self.anchor_rate * dt;
        self.add_row(ANCHOR, ANCHOR_RATE, dt);
        let missed = std::mem::take(&mut self.missed);
        // The inclination it is held against has missed the same turn.
        if missed > MISSED_MUCH {
            self.settling_s = SETTLE_TAUS * self.inclination.tau_accel_s;
            self.seen = false;
        }
        for axis in 0..3 {
            self.covariance[(axis, axis)] += self.noise.gyro.powi(2) * dt + missed * missed;
            self.covariance[(BIAS + axis, BIAS + axis)] += self.noise.bias_walk.powi(2) * dt;
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
            self.covariance[(axis, axis)] += self.noise.scale.powi(2) * farther;
        }
    }

    /// What an error of the rate at these three states turned the world by since the last prediction, `axes` being the integral of what
    /// it turns by where it is one about each of the unit's axes: states that nothing happens to are left out, which makes this ten times as
    /// fast as the product of matrices.
    fn turn_by(&mut self, state: usize, axes: &DMat3) {
        for row in 0..3 {
            for column in 0..3 {
                self.add_row(row, state + column, -axes.col(column)[row]);
            }
        }
    }

    /// The inclination's error goes on to and fro.
    fn sway_on(&mut self, dt: f64) {
        let (change, added) = self.swell.step(dt);
        let [place, slope] = [0, 1].map(|row| change.row(row));
        for axis in 0..2 {
            let at = [SWAY + axis, REFERENCE + axis];
            let now = change * DVec2::new(self.sway[axis], self.reference[axis]);
            (self.sway[axis], self.reference[axis]) = (now.x, now.y);
            let p = &mut self.covariance;
            for other in 0..STATES {
                let both = DVec2::new(p[(at[0], other)], p[(at[1], other)]);
                (p[(at[0], other)], p[(at[1], other)]) = (place.dot(both), slope.dot(both));
            }
            for other in 0..STATES {
                let both = DVec2::new(p[(other, at[0])], p[(other, at[1])]);
                (p[(other, at[0])], p[(other, at[1])]) = (place.dot(both), slope.dot(both));
            }
            for (row, of_row) in at.into_iter().enumerate() {
                for (column, of_column) in at.into_iter().enumerate() {
                    p[(of_row, of_column)] += self.reference_variance * added.col(column)[row];
                }
            }
        }
    }

    /// The state `to` grows by `share` of the state `from`.
    fn add_row(&mut self, to: usize, from: usize, share: f64) {
        let p = &mut self.covariance;
        for other in 0..STATES {
            p[(to, other)] += share * p[(from, other)];
        }
        for other in 0..STATES {
            p[(other, to)] += share * p[(other, from)];
        }
    }

    /// The state keeps that share of itself, and chance makes up what its variance loses.
    fn fade(&mut self, state: usize, kept: f64, variance: f64) {
        for other in 0..STATES {
            self.covariance[(state, other)] *= kept;
            self.covariance[(other, state)] *= kept;
        }
        self.covariance[(state, state)] += variance * (1.0 - kept * kept);
    }

    /// Holds `world_from_imu` against an inclination that errs by itself: where up is in the unit's axes, `since_s` after the last one.
    pub(super) fn incline(&mut self, world_from_imu: DQuat, up_imu: DVec3, since_s: f64) -> Correction {
        let swung = self.lag.behind() * self.bias + self.lag.screwed() * self.screw;
        let up = (world_from_imu * up_imu - self.lag.axes() * self.force + swung.cross(DVec3::Z)).truncate();
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
        self.update(&self.inclined_rows(), up - self.reference, noise, f64::INFINITY).0
    }

    /// How the horizontal parts of that inclination change with the states.
    fn inclined_rows(&self) -> [Row; 2] {
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
        (self.reference, self.sway) = (DVec2::ZERO, DVec2::ZERO);
        let place = REFERENCE_START * self.swell.place_variance().sqrt();
        for axis in 0..2 {
            self.forget(axis, START_TILT);
            self.forget(REFERENCE + axis, REFERENCE_START);
            self.forget(SWAY + axis, place);
        }
    }

    /// The state is no longer known but to that deviation.
    fn forget(&mut self, state: usize, deviation: f64) {
        self.covariance.row_mut(state).fill(0.0);
        self.covariance.column_mut(state).fill(0.0);
        self.covariance[(state, state)] = deviation * deviation;
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
        // A horizon that stands higher tilts up away from where the camera looks.
        let ahead = axes.z_axis.truncate().normalize_or_zero();
        for column in 0..3 {
            let turned = axes.col(column);
            rows[0][MOUNTING + column] = turned.y;
            rows[1][MOUNTING + column] = -turned.x;
        }
        rows[0][DIP] = -ahead.x;
        rows[1][DIP] = -ahead.y;
        let differ = up.truncate() + ahead * self.dip;
        let (turn, outcome) = self.update(&rows, differ, covariance, limit);
        if outcome.taken {
            self.seen = true;
        }
        (turn, outcome)
    }

    /// Takes in that the world is to be turned by `off` about the vertical, rad, known to that variance.
    pub(super) fn see_heading(&mut self, off: f64, variance: f64, limit: f64) -> (Correction, Outcome) {
        let mut row = Row::zeros();
        row[HEADING] = 1.0;
        self.update_one(&row, off, variance, limit)
    }

    /// The heading is set from outside and known to that deviation: what was known of it before holds no longer.
    pub(super) fn set_heading(&mut self, deviation: f64) {
        self.forget(HEADING, deviation);
        self.forget(ANCHOR, std::f64::consts::PI);
        self.forget(MOUNT, std::f64::consts::PI);
    }

    /// By how much the bias turns the world about the vertical, standard deviation, rad/s, with the unit as in `world_from_imu`.
    pub(super) fn drift_sigma(&self, world_from_imu: DQuat) -> f64 {
        let vertical = world_from_imu.inverse() * DVec3::Z;
        let bias = DMat3::from_cols_array_2d(
            &[0, 1, 2].map(|c| [0, 1, 2].map(|r| self.covariance[(BIAS + r, BIAS + c)])),
        );
        vertical.dot(bias * vertical).max(0.0).sqrt()
    }

    /// The gun's bearing on its mount is what heading and the ship's heading now make it, which errs by `variance` beyond the heading.
    pub(super) fn anchor_mount(&mut self, variance: f64) {
        self.copy_heading(MOUNT);
        self.covariance[(MOUNT, MOUNT)] += variance;
        self.mount = 0.0;
    }

    /// The bearing, or what the ship says of its own heading, may have changed by `variance`.
    pub(super) fn walk_mount(&mut self, variance: f64) {
        self.covariance[(MOUNT, MOUNT)] += variance;
    }

    /// Takes in that by the ship's heading and the gun's bearing on its mount the world is to be turned by `off` about the vertical, rad.
    pub(super) fn see_mount(&mut self, off: f64, variance: f64, limit: f64) -> (Correction, Outcome) {
        let mut row = Row::zeros();
        row[HEADING] = 1.0;
        row[MOUNT] = -1.0;
        self.update_one(&row, off + self.mount, variance, limit)
    }

    /// The state is from now on what the heading is.
    fn copy_heading(&mut self, state: usize) {
        let mut heading = self.covariance.row(HEADING).into_owned();
        heading[state] = heading[HEADING];
        self.covariance.set_row(state, &heading);
        self.covariance.set_column(state, &heading.transpose());
    }

    /// From now on what is seen of the anchor tells of changes since now; what is anchored in turns by `drift` rad/s itself.
    pub(super) fn anchor(&mut self, drift: f64) {
        self.copy_heading(ANCHOR);
        self.anchor = 0.0;
        if self.covariance[(ANCHOR_RATE, ANCHOR_RATE)] <= 0.0 {
            self.forget(ANCHOR_RATE, drift);
        }
    }

    /// Takes in that by what is anchored the world is to be turned by `off` about the vertical, rad.
    pub(super) fn see_anchor(&mut self, off: f64, variance: f64, limit: f64) -> (Correction, Outcome) {
        let mut row = Row::zeros();
        row[HEADING] = 1.0;
        row[ANCHOR] = -1.0;
        self.update_one(&row, off + self.anchor, variance, limit)
    }

    fn update_one(&mut self, row: &Row, differ: f64, variance: f64, limit: f64) -> (Correction, Outcome) {
        let gain = self.covariance * row;
        let expected = row.dot(&gain) + variance;
        let surprise = differ * differ / expected;
        if surprise.is_nan() || surprise > limit {
            return (DQuat::IDENTITY, Outcome { surprise, taken: false });
        }
        self.covariance -= gain * gain.transpose() / expected;
        self.hold_symmetric();
        (self.put_in(&(gain * (differ / expected))), Outcome { surprise, taken: true })
    }

    fn update(&mut self, rows: &[Row; 2], differ: DVec2, noise: DMat2, limit: f64) -> (Correction, Outcome) {
        let rows = SMatrix::<f64, STATES, 2>::from_columns(rows);
        let differ = SVector::<f64, 2>::new(differ.x, differ.y);
        let noise = SMatrix::<f64, 2, 2>::from_fn(|r, c| noise.col(c)[r]);
        let across = self.covariance * rows;
        let expected = rows.transpose() * across + noise;
        let Some(inverse) = expected.try_inverse() else {
            return (DQuat::IDENTITY, Outcome { surprise: f64::NAN, taken: false });
        };
        let surprise = (differ.transpose() * inverse * differ)[(0, 0)];
        if surprise.is_nan() || surprise > limit {
            return (DQuat::IDENTITY, Outcome { surprise, taken: false });
        }
        let gain = across * inverse;
        // Joseph's form, (I - K H) P (I - K H)' + K R K', from the left: what rounding left of the second factor is taken off by it.
        self.covariance -= gain * across.transpose();
        let rest = self.covariance * rows - gain * noise;
        self.covariance -= rest * gain.transpose();
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
        self.sway += DVec2::new(error[SWAY], error[SWAY + 1]);
        self.screw += three(SCREW);
        self.mounting += three(MOUNTING);
        self.force += three(FORCE);
        self.dip += error[DIP];
        self.anchor += error[ANCHOR];
        self.anchor_rate += error[ANCHOR_RATE];
        self.mount += error[MOUNT];
        DQuat::from_scaled_axis(three(0))
    }
}

/// How the horizontal parts of where up is found change with the turn of the world: `up + up x turn`.
fn up_rows() -> [Row; 2] {
    let mut rows = [Row::zeros(); 2];
    rows[0][1] = -1.0;
    rows[1][0] = 1.0;
    rows
}
