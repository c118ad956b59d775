//! A small error-state filter about an orientation that is integrated from rates: what is still wrong with it, with the gyro's bias and gains,
//! with the specific force, with the velocity that is integrated from it, and with the camera's place on the unit; and how far each of these
//! is known.

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};

use super::{
    carriage::Carriage,
    consistency::Consistency,
    error_state::{COMMON, Correction, ErrorState, MeasurementRow, TURN},
    rest::RefusedRests,
};
use crate::physics::GRAVITY_M_S2;

/// Beside what all have: gyro's bias in the unit's axes (3), error of the velocity that is integrated from specific force (2), place and
/// velocity as what carries the unit has them (2 each), bias of the specific force in the unit's axes (3), what a turn about each of the
/// unit's axes is measured too large by about each of them, as a share (9, one column after the other), what share of a shock is as it was felt.
const BIAS: usize = COMMON;
const DRIFT: usize = BIAS + 3;
const PLACE: usize = DRIFT + 2;
const VELOCITY: usize = PLACE + 2;
const FORCE: usize = VELOCITY + 2;
const GAIN: usize = FORCE + 3;
const SHOCK: usize = GAIN + 9;
const STATES: usize = SHOCK + 1;

/// Noise model of a unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// White noise of the rate, rad/s/sqrt(Hz).
    pub gyro: f64,
    /// Standard deviation of the bias beyond the calibrated one at the start, rad/s; the first rest may find any.
    pub bias: DVec3,
    /// Random walk of the bias, rad/s in a square root of a second, up to what it is at the start.
    pub bias_walk: f64,
    /// Standard deviation of the rate's scale...
    pub scale: f64,
    /// ...and of an axis's share in what another measures.
    pub skew: f64,
    /// Standard deviation of the specific force's bias, m/s^2.
    pub force: f64,
    /// Standard deviation of the camera's calibrated place on the unit, rad, about the camera's axes.
    pub mounting: DVec3,
}

impl Noise {
    /// A unit of the VN-100's class that nothing is known of but its data sheet: bias within 0.1 deg/s, mounted within a milliradian. Worse ones
    /// are covered by what their bias walks as they turn (`BIAS_TURN`), and by what a rest says of it.
    pub const USUAL: Self = Self {
        gyro: 6.1e-5,
        bias: DVec3::splat(1.7e-3),
        bias_walk: 7e-6,
        scale: 1.5e-3,
        skew: 5e-4,
        force: 0.02,
        mounting: DVec3::splat(1e-3),
    };
}

/// A sample's motion, with the unit's axes in the world in the middle of its time.
#[derive(Clone, Copy, Debug)]
pub(super) struct SampleMotion {
    /// The unit's axes in the world.
    pub axes: DMat3,
    /// The turn as it was measured, scaled axis, radians, the unit's axes.
    pub turn: DVec3,
    /// Specific force, m/s^2, the unit's axes.
    pub force: DVec3,
    /// Its time, seconds.
    pub dt_s: f64,
}

/// Integrals since the last prediction.
#[derive(Clone, Copy, Debug)]
struct Gathered {
    /// Of the unit's axes in the world, seconds, and of these times the rate about each of its axes, radians.
    axes: DMat3,
    turns: [DMat3; 3],
    /// Of the rate and of the specific force, in the unit's axes and in the world's.
    turned: DVec3,
    pushed: DVec3,
    /// Of what was felt of shocks, m/s, the world's horizontal axes.
    shocked: DVec2,
    /// Covariance of the turn and variance of the velocity that the unit did not tell, rad^2 and (m/s)^2.
    missed: DMat3,
    unfelt: f64,
    dt_s: f64,
}

impl Gathered {
    const NOTHING: Self = Self {
        axes: DMat3::ZERO,
        turns: [DMat3::ZERO; 3],
        turned: DVec3::ZERO,
        pushed: DVec3::ZERO,
        shocked: DVec2::ZERO,
        missed: DMat3::ZERO,
        unfelt: 0.0,
        dt_s: 0.0,
    };
}

/// The filter.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    /// States and how far they are known.
    pub(super) error_state: ErrorState<STATES>,
    noise: Noise,
    carriage: Carriage,
    consistency: Consistency,
    gathered: Gathered,
    /// The velocity that is integrated from specific force, m/s, and its change since the last hold, with the time of that.
    velocity: DVec2,
    change: DVec2,
    since_s: f64,
    /// The bias at the last rest, rad/s, the unit's axes.
    rested: Option<DVec3>,
    refused: RefusedRests,
    /// Seconds since up was seen otherwise than by specific force, and for which it is still plain VQF's.
    unseen_s: f64,
    fallen_s: f64,
    falls: u32,
    /// For how long what a shock moved may still come back, seconds.
    returns_s: f64,
    /// For how long VQF is not worth holding against after a shock, seconds.
    shaken_s: f64,
}

/// Velocity and carriage are held together this often, seconds.
const HOLD_S: f64 = 0.1;
/// ...to within this, m/s: nothing beside what either is known to.
const HOLD_NOISE: f64 = 1e-3;
/// Chi squared at 99.99 % with two degrees of freedom.
const HOLD_GATE: f64 = 18.4;
/// Share of the change of the velocity by which it is measured wrong: the scale of the specific force, and axes that are not square.
const FORCE_SHARE: f64 = 0.02;
/// White noise of the specific force, m/s^2/sqrt(Hz).
const FORCE_NOISE: f64 = 0.01;
/// Of what is felt of a shock some share is so, from nothing to all, as units clip it or miss its peak: its mean and its deviation...
const SHOCK_SHARE: f64 = 0.5;
/// ...and that of each shock alone, one standard deviation.
const SHOCK_NOISE: f64 = 0.3;
/// What a shock moved comes back within this, seconds: until then half of a blow is no velocity...
const RETURN_S: f64 = 0.25;
/// ...but one is held after so long, seconds.
const SHOCKS_MOST_S: f64 = 5.0;
/// Share of a turn in a hold's time by which it is measured wrong beside the gains: they are none of every rate alike.
const TURN_SHARE: f64 = 1e-3;
/// Random walk of the bias for each rad/s that it turns by, rad/s in a square root of a second.
const BIAS_TURN: f64 = 2e-5;
/// What a gyro turns by as it is shaken, rad/s for each (m/s^2)^2 (IEEE Std 952, vibration rectification).
const PUSH_TURN: f64 = 2e-5;
/// What plain VQF's errs by where it is fallen back to, rad, ...
const FALLEN_TILT: f64 = 2f64.to_radians();
/// ...for so long, seconds: four of its time constants.
const FALLEN_S: f64 = 12.0;
/// Up that was seen so long ago is worth more than VQF's, seconds.
const SEEN_S: f64 = 2.0;
/// Standard deviation of the bias as a rest shows it, rad/s (VQF's `bias_sigma_rest`), ...
const REST_NOISE: f64 = 0.03f64.to_radians();
/// ...unless it is further than this from what is known (chi squared at 99.7 % with one degree of freedom): then it is no rest.
const REST_GATE: f64 = 9.0;

impl Filter {
    /// Nothing learnt yet of an inclination that is wrong by `tilt`, radians.
    pub(super) fn new(noise: Noise, tilt: f64) -> Self {
        let mut filter = Self {
            error_state: ErrorState::new(noise.mounting),
            noise,
            carriage: Carriage::new(),
            consistency: Consistency::default(),
            gathered: Gathered::NOTHING,
            velocity: DVec2::ZERO,
            change: DVec2::ZERO,
            since_s: 0.0,
            rested: None,
            refused: RefusedRests::default(),
            unseen_s: f64::INFINITY,
            fallen_s: 0.0,
            falls: 0,
            returns_s: 0.0,
            shaken_s: 0.0,
        };
        filter.begin(tilt);
        filter
    }

    /// Nothing is known but a tilt to that deviation.
    fn begin(&mut self, tilt: f64) {
        for axis in 0..2 {
            self.error_state.forget(TURN + axis, tilt);
        }
        for axis in 0..3 {
            self.error_state.forget(BIAS + axis, self.noise.bias[axis]);
            self.error_state.forget(FORCE + axis, self.noise.force);
        }
        for gain in 0..9 {
            let own = gain % 4 == 0;
            self.error_state.forget(GAIN + gain, if own { self.noise.scale } else { self.noise.skew });
        }
        self.error_state.forget(SHOCK, SHOCK_SHARE);
        self.error_state.set(SHOCK, SHOCK_SHARE);
        self.carriage = Carriage::new();
        self.consistency = Consistency::default();
        self.forget_velocity();
    }

    fn forget_velocity(&mut self) {
        let (place, speed) = (self.carriage.place_variance().sqrt(), self.carriage.speed_variance().sqrt());
        for axis in 0..2 {
            self.error_state.forget(DRIFT + axis, speed);
            self.error_state.forget(PLACE + axis, place);
            self.error_state.forget(VELOCITY + axis, speed);
        }
        self.velocity = DVec2::ZERO;
    }

    /// The bias beyond the calibrated one, rad/s, the unit's axes.
    pub(super) fn bias(&self) -> DVec3 {
        self.error_state.three(BIAS)
    }

    /// How often it has fallen back to plain VQF.
    pub(super) const fn falls(&self) -> u32 {
        self.falls
    }

    /// A turn (scaled axis, radians, the unit's axes) that was measured over `dt_s` seconds, without what is known to be wrong with it.
    pub(super) fn corrected(&self, turn: DVec3, dt_s: f64) -> DVec3 {
        let gain = |axis: usize| self.error_state.three(GAIN + 3 * axis) * turn[axis];
        turn - self.bias() * dt_s - gain(0) - gain(1) - gain(2)
    }

    /// Goes on by a sample.
    pub(super) fn step(&mut self, sample: &SampleMotion) {
        let &SampleMotion { axes, turn, force, dt_s } = sample;
        let g = &mut self.gathered;
        let push = axes * (force - self.error_state.three(FORCE)) * dt_s;
        g.axes += axes * dt_s;
        for (axis, turns) in g.turns.iter_mut().enumerate() {
            *turns += axes * turn[axis];
        }
        g.turned += turn;
        g.pushed += push;
        g.dt_s += dt_s;
        self.velocity += push.truncate();
        self.change += push.truncate();
        self.since_s += dt_s;
        self.returns_s -= dt_s;
    }

    /// It may have turned otherwise by a turn of that covariance (rad^2, the world's axes), and its velocity changed by another of that variance on an
    /// axis, (m/s)^2, that the unit did not tell.
    pub(super) fn miss(&mut self, turn: DMat3, push: f64) {
        self.gathered.missed += turn;
        self.gathered.unfelt += push;
    }

    /// A shock was felt to push it by that, m/s, the world's axes.
    pub(super) fn shake(&mut self, push: DVec3) {
        let taken = push * self.error_state.at(SHOCK);
        let g = &mut self.gathered;
        g.shocked += push.truncate();
        g.unfelt += (SHOCK_NOISE * push.length()).powi(2);
        g.pushed += taken;
        self.velocity += taken.truncate();
        self.change += taken.truncate();
        self.returns_s = RETURN_S;
        self.shaken_s = FALLEN_S;
    }

    /// Brings the covariance to the present.
    pub(super) fn predict(&mut self) {
        let g = std::mem::replace(&mut self.gathered, Gathered::NOTHING);
        if g.dt_s <= 0.0 {
            return;
        }
        let pushed = g.pushed - DVec3::Z * (GRAVITY_M_S2 * g.dt_s);
        // A turn of the world turns what is felt, gravity first of all. That the heading turns it, too, is left out: what carries the unit is alike
        // in all directions and tells nothing of it, and a filter that is linear would believe that it does.
        let [x, y, z] = [g.axes.row(0), g.axes.row(1), g.axes.row(2)];
        let tilts = [(TURN + 1, -g.pushed.z), (TURN, g.pushed.z)];
        for (axis, (tilt, row)) in tilts.into_iter().zip([x, y]).enumerate() {
            let felt = (0..3).map(|column| (FORCE + column, row[column]));
            let shocked = (g.shocked[axis] != 0.0).then_some((SHOCK, -g.shocked[axis]));
            self.error_state.add_all(DRIFT + axis, std::iter::once(tilt).chain(felt).chain(shocked));
        }
        for (axis, row) in [x, y, z].into_iter().enumerate() {
            let bias = (0..3).map(|column| (BIAS + column, -row[column]));
            let gains = (0..9).map(|gain| (GAIN + gain, -g.turns[gain / 3].col(gain % 3)[axis]));
            self.error_state.add_all(TURN + axis, bias.chain(gains));
        }
        let (kept, added) = self.carriage.step(pushed.truncate(), g.dt_s);
        for axis in 0..2 {
            self.error_state.mix([PLACE + axis, VELOCITY + axis], kept, added);
        }
        self.error_state.pass_time(g.dt_s);
        self.walk(&g, pushed.length());
        self.unseen_s += g.dt_s;
        self.refused.pass_time(g.dt_s);
    }

    /// What chance adds while it is pushed by `pushed` m/s.
    fn walk(&mut self, g: &Gathered, pushed: f64) {
        let shares =
            (TURN_SHARE * g.turned.length()).powi(2) + (PUSH_TURN * pushed * pushed / g.dt_s).powi(2);
        let turn = self.noise.gyro.powi(2) * g.dt_s + shares;
        let bias = self.noise.bias_walk.powi(2) * g.dt_s + (BIAS_TURN * g.turned.length()).powi(2) / g.dt_s;
        let velocity = FORCE_NOISE * FORCE_NOISE * g.dt_s + (FORCE_SHARE * pushed).powi(2) + g.unfelt;
        self.error_state.walk_three(TURN, g.missed + DMat3::from_diagonal(DVec3::splat(turn)));
        for axis in 0..3 {
            if self.error_state.variance(BIAS + axis) < self.noise.bias[axis].powi(2) {
                self.error_state.walk(BIAS + axis, bias);
            }
        }
        for axis in 0..2 {
            self.error_state.walk(DRIFT + axis, velocity);
        }
    }

    /// Whether it is time for [`Self::hold`].
    pub(super) fn is_due(&self) -> bool {
        self.since_s >= if self.returns_s > 0.0 { SHOCKS_MOST_S } else { HOLD_S }
    }

    /// Holds the velocity that is integrated from specific force against how what carries the unit moves, and the orientation against plain
    /// VQF's direction of up (unit vector in the unit's axes).
    pub(super) fn hold(&mut self, world_from_imu: DQuat, up_imu: DVec3) -> Correction {
        self.predict();
        // What a camera has said since the last one.
        self.take_drift();
        let since_s = std::mem::take(&mut self.since_s);
        let change = std::mem::take(&mut self.change);
        let apart = (world_from_imu * up_imu).truncate();
        if self.fallen_s > 0.0 && self.unseen_s > SEEN_S {
            self.fallen_s -= since_s;
            return self.fall_to(world_from_imu, up_imu);
        }
        let rows: [MeasurementRow<STATES>; 2] = [0, 1].map(|axis| {
            let mut row = MeasurementRow::zeros();
            row[DRIFT + axis] = 1.0;
            row[VELOCITY + axis] = 1.0;
            row
        });
        let differ = self.velocity - self.error_state.two(VELOCITY);
        let noise = DMat2::from_diagonal(DVec2::splat(HOLD_NOISE * HOLD_NOISE));
        let (turn, outcome) = self.error_state.update(&rows, differ, noise, HOLD_GATE);
        self.take_drift();
        self.carriage.watch(self.velocity, change, since_s);
        let variance = 0.5 * (self.error_state.variance(TURN) + self.error_state.variance(TURN + 1));
        self.shaken_s -= since_s;
        // Blows tilt the mean force that VQF takes for up, and are no errors of the unit's.
        let holds = self.shaken_s > 0.0 || self.consistency.holds(outcome.nis, apart, variance, since_s);
        if !holds && self.unseen_s > SEEN_S {
            self.falls = self.falls.saturating_add(1);
            self.fallen_s = FALLEN_S;
            return self.fall_to(world_from_imu, up_imu);
        }
        turn
    }

    /// The orientation's inclination is plain VQF's, and nothing else that was learnt counts but what a rest has shown.
    fn fall_to(&mut self, world_from_imu: DQuat, up_imu: DVec3) -> Correction {
        self.begin(FALLEN_TILT);
        if let Some(bias) = self.rested {
            (0..3).for_each(|axis| self.error_state.set(BIAS + axis, bias[axis]));
        }
        DQuat::from_rotation_arc((world_from_imu * up_imu).normalize_or(DVec3::Z), DVec3::Z)
    }

    /// Puts what is known of the velocity's error into it.
    fn take_drift(&mut self) {
        self.velocity -= self.error_state.two(DRIFT);
        (0..2).for_each(|axis| self.error_state.set(DRIFT + axis, 0.0));
    }

    /// Takes in that the unit has been at rest and turned at that mean rate less the calibrated bias, rad/s.
    pub(super) fn rest(&mut self, rate: DVec3) -> Correction {
        self.predict();
        let (turn, all) = self.take_rest(rate);
        if all {
            self.refused = RefusedRests::default();
        } else if self.refused.refuse(rate) {
            self.refused = RefusedRests::default();
            self.rested = None;
            return self.take_rest(rate).0 * turn;
        }
        turn
    }

    /// The correction by a rest, and whether all of it was taken.
    fn take_rest(&mut self, rate: DVec3) -> (Correction, bool) {
        let mut turn = DQuat::IDENTITY;
        let mut all = true;
        for axis in 0..3 {
            let differ = rate[axis] - self.error_state.at(BIAS + axis);
            if self.rested.is_none() {
                // The first rest after a start, or one believed against what was learnt: the bias may be another start's.
                let known = self.error_state.variance(BIAS + axis);
                self.error_state.walk(BIAS + axis, (differ * differ - known).max(0.0));
            }
            let mut row = MeasurementRow::zeros();
            row[BIAS + axis] = 1.0;
            let (by, outcome) = self.error_state.update_one(&row, differ, REST_NOISE * REST_NOISE, REST_GATE);
            turn = by * turn;
            all &= outcome.taken;
        }
        self.take_drift();
        if all {
            self.rested = Some(rate);
        }
        (turn, all)
    }

    /// Up was seen otherwise than by specific force.
    pub(super) const fn saw_up(&mut self) {
        self.unseen_s = 0.0;
        self.fallen_s = 0.0;
    }

    /// The heading is set from outside: the world is turned by `off` about the vertical, which is then known to `deviation`.
    pub(super) fn set_heading(&mut self, off: f64, deviation: f64) {
        self.take_drift();
        let turned = DMat2::from_angle(off);
        self.velocity = turned * self.velocity;
        self.change = turned * self.change;
        self.error_state.set_heading(off, deviation, &[DRIFT, PLACE, VELOCITY]);
    }

    /// By how much the bias turns the world about the vertical, standard deviation, rad/s, with the unit as in `world_from_imu`.
    pub(super) fn drift_sigma(&self, world_from_imu: DQuat) -> f64 {
        let vertical = world_from_imu.inverse() * DVec3::Z;
        vertical.dot(self.error_state.covariance(BIAS) * vertical).max(0.0).sqrt()
    }
}
