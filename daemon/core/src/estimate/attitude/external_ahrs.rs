//! Errors of an orientation that the unit finds by itself, and their covariance.
//!
//! Such a unit corrects itself by ways that it does not tell, so that nothing can be said of its gyro. What can be said: its error on an axis
//! goes to and fro about a mean within seconds and that mean creeps within minutes; its heading's mean drifts for as long as it runs.

use glam::{DQuat, DVec2, DVec3};

use super::error_state::{COMMON, ErrorState, HEADING, TURN, UpdateOutcome};

/// Beside what all have: mean of the turn that the world needs (3), the rate of the heading's.
const MEAN: usize = COMMON;
const MEAN_HEADING: usize = MEAN + HEADING;
const RATE: usize = MEAN + 3;
const STATES: usize = RATE + 1;

/// The mean inclination is wrong by this: data sheets of the class have half a degree at rest, radians.
const MEAN_SIGMA: f64 = 0.5f64.to_radians();
/// A unit that is found to be worse than its class counts as worse, up to this, radians: twice as bad where horizons are not believed, ...
const MEAN_SIGMA_MOST: f64 = 4f64.to_radians();
/// ...and else by how far it has gone while no horizon was seen, for so long at least, seconds, ...
const UNSEEN_S: f64 = 3.0;
/// ...of which each time tells so much.
const UNSEEN_SHARE: f64 = 0.3;
/// No normalised innovation squared counts as more than this (chi squared with two degrees of freedom).
const UNSEEN_MOST: f64 = 20.0;
/// It forgets itself in this time, seconds.
const MEAN_TAU_S: f64 = 300.0;
/// What goes to and fro about it, on an axis, before that has been watched, radians...
const SWAY_START: f64 = 0.1f64.to_radians();
/// ...at least, ...
const SWAY_LEAST: f64 = 0.01f64.to_radians();
/// ...and at most.
const SWAY_MOST: f64 = 1f64.to_radians();
/// It forgets itself in this time, seconds.
const SWAY_TAU_S: f64 = 3.0;
/// How far it goes is told by errors this long apart, seconds,...
const APART_S: f64 = 1.0;
/// ...over so long, seconds.
const WATCHED_MOST_S: f64 = 60.0;
/// So many horizons in a row that are not believed mean that it is what was known of the unit that is wrong, as after its start.
const REFUSED_MAX: u32 = 10;
/// What the heading has of that. An inclination is held by gravity, a heading by nothing that a wave turns; radians.
const HEADING_SWAY: f64 = 0.03f64.to_radians();
/// A drift forgets itself in this time, seconds.
const RATE_TAU_S: f64 = 3600.0;
/// Errors are brought to the present this often at least, seconds.
const STEP_S: f64 = 0.1;

/// A filter of the turn by which a unit's own world is to be turned.
#[derive(Clone, Debug)]
pub(super) struct ExternalAhrs {
    /// States and how far they are known.
    pub(super) error_state: ErrorState<STATES>,
    /// By what the unit's world is turned: about the vertical first, then by a small tilt; radians.
    heading: f64,
    tilt: DVec2,
    /// By how much the deviation of the unit's heading grows, rad/s.
    growth: f64,
    /// Time since the last prediction, seconds.
    dt_s: f64,
    /// By what the mean inclination is wrong, radians.
    mean_sigma: f64,
    bias: GaussMarkovBias,
    /// Time since a horizon was seen.
    unseen_s: f64,
    refused_in_a_row: u32,
}

/// How far inclination goes to and fro, by what was seen of it.
#[derive(Clone, Copy, Debug)]
struct GaussMarkovBias {
    /// Variance on an axis, rad^2.
    variance: f64,
    watched_s: f64,
    /// An error that was seen, with the variance of that, and how long ago.
    before: Option<(DVec2, f64)>,
    since_s: f64,
}

impl ExternalAhrs {
    /// A unit whose mean heading counts as right now.
    pub(super) fn new(growth: f64, mounting: DVec3) -> Self {
        let mut error_state = ErrorState::new(mounting);
        error_state.forget(HEADING, HEADING_SWAY);
        error_state.forget(RATE, growth);
        let mut external_ahrs = Self {
            error_state,
            heading: 0.0,
            tilt: DVec2::ZERO,
            growth,
            dt_s: 0.0,
            mean_sigma: MEAN_SIGMA,
            bias: GaussMarkovBias::START,
            unseen_s: 0.0,
            refused_in_a_row: 0,
        };
        external_ahrs.forget_tilt();
        external_ahrs
    }

    /// Nothing is known of the inclination but the unit's class and how far it has been seen to sway. What it is turned by stays until
    /// something else is seen.
    fn forget_tilt(&mut self) {
        for axis in 0..2 {
            self.error_state.forget(MEAN + axis, self.mean_sigma);
            self.error_state.copy(TURN + axis, MEAN + axis);
            self.error_state.walk(TURN + axis, self.bias.variance);
        }
    }

    /// The unit's own orientation `dt_s` seconds after the one before, without what is known to be wrong with it.
    pub(super) fn corrected(&mut self, world_from_imu: DQuat, dt_s: f64) -> DQuat {
        self.dt_s += dt_s;
        if self.dt_s >= STEP_S {
            self.predict();
        }
        // Where nothing was ever seen it stays as it was sent.
        if self.heading == 0.0 && self.tilt == DVec2::ZERO {
            return world_from_imu;
        }
        let turn = DQuat::from_scaled_axis(self.tilt.extend(0.0)) * DQuat::from_rotation_z(self.heading);
        (turn * world_from_imu).normalize()
    }

    /// By what the unit's world is turned about the vertical, radians.
    pub(super) const fn heading(&self) -> f64 {
        self.heading
    }

    /// By how much the heading may drift, standard deviation, rad/s.
    pub(super) fn drift_sigma(&self) -> f64 {
        self.error_state.variance(RATE).max(0.0).sqrt()
    }

    /// Brings all to the present.
    pub(super) fn predict(&mut self) {
        let dt = std::mem::take(&mut self.dt_s);
        if dt <= 0.0 {
            return;
        }
        self.bias.since_s += dt;
        self.unseen_s += dt;
        self.error_state.pass_time(dt);
        let (creeps, sways) = ((-dt / MEAN_TAU_S).exp(), (-dt / SWAY_TAU_S).exp());
        for axis in 0..2 {
            let mean = self.error_state.at(MEAN + axis);
            // The world turns back towards where the unit's own mean has it.
            self.tilt[axis] += (1.0 - sways) * (mean - self.tilt[axis]);
            self.revert(TURN + axis, MEAN + axis, sways, self.bias.variance);
            self.error_state.fade(MEAN + axis, creeps, self.mean_sigma * self.mean_sigma);
        }
        self.heading += (1.0 - sways) * (self.error_state.at(MEAN_HEADING) - self.heading);
        self.revert(HEADING, MEAN_HEADING, sways, HEADING_SWAY * HEADING_SWAY);
        self.error_state.carry(MEAN_HEADING, RATE, dt);
        self.error_state.fade(RATE, (-dt / RATE_TAU_S).exp(), self.growth * self.growth);
    }

    /// A state keeps that share of how it differs from its mean, and chance makes up what its variance loses. What is known of it is kept
    /// elsewhere.
    fn revert(&mut self, state: usize, mean: usize, kept: f64, variance: f64) {
        self.error_state.fade(state, kept, variance);
        self.error_state.add(state, mean, 1.0 - kept);
    }

    /// The heading is set from outside: the world is turned by `off` about the vertical, which is then known to `deviation`.
    pub(super) fn set_heading(&mut self, off: f64, deviation: f64) {
        self.error_state.set_heading(off, deviation, &[MEAN]);
        self.heading += off;
        self.tilt = DVec2::from_angle(off).rotate(self.tilt);
        self.error_state.copy(MEAN_HEADING, HEADING);
        self.error_state.walk(MEAN_HEADING, HEADING_SWAY * HEADING_SWAY);
        self.error_state.set(MEAN_HEADING, self.heading);
    }

    /// The world has been turned by what an aid told; where that was up, `seen` is by what it was to be turned, with that variance.
    pub(super) fn turn(&mut self, turn: DQuat) {
        let turn = turn.to_scaled_axis();
        self.tilt += turn.truncate();
        self.heading += turn.z;
    }

    /// Learns from an error of inclination that was seen, as the turn that the world as it was believed needs, and its variance on an axis;
    /// whether it was believed or not: else a unit that sways farther than was thought would never be.
    pub(super) fn watch(&mut self, turn: DVec2, variance: f64, outcome: UpdateOutcome) {
        self.bias.watch(self.tilt + turn, variance);
        if std::mem::take(&mut self.unseen_s) >= UNSEEN_S && outcome.nis.is_finite() {
            // Two is as far as was expected.
            let beyond = 0.5 * outcome.nis.min(UNSEEN_MOST) - 1.0;
            let now = self.mean_sigma * (1.0 + UNSEEN_SHARE * beyond).sqrt();
            self.mean_sigma = now.clamp(MEAN_SIGMA, MEAN_SIGMA_MOST);
        }
        self.refused_in_a_row = if outcome.taken { 0 } else { self.refused_in_a_row + 1 };
        if self.refused_in_a_row >= REFUSED_MAX {
            self.refused_in_a_row = 0;
            self.mean_sigma = (2.0 * self.mean_sigma).min(MEAN_SIGMA_MOST);
            self.forget_tilt();
        }
    }
}

impl GaussMarkovBias {
    const START: Self =
        Self { variance: SWAY_START * SWAY_START, watched_s: 0.0, before: None, since_s: 0.0 };

    /// Takes in a whole error of the unit: two that lie apart differ by twice the variance that has not stayed and by what seeing errs by.
    fn watch(&mut self, error: DVec2, seen: f64) {
        match self.before {
            Some((_, _)) if self.since_s < APART_S => return,
            Some((before, seen_before)) if self.since_s < 2.0 * APART_S => {
                let kept = (-self.since_s / SWAY_TAU_S).exp();
                let apart = 0.5 * before.distance_squared(error) - seen - seen_before;
                let variance = 0.5 * apart / (1.0 - kept);
                self.watched_s = (self.watched_s + self.since_s).min(WATCHED_MOST_S);
                // A few look like chance: what was expected counts as much as ten seconds.
                let share = self.since_s / (self.watched_s + 10.0).min(WATCHED_MOST_S);
                let now = self.variance + share * (variance - self.variance);
                self.variance = now.clamp(SWAY_LEAST * SWAY_LEAST, SWAY_MOST * SWAY_MOST);
            }
            _ => {}
        }
        (self.before, self.since_s) = (Some((error, seen)), 0.0);
    }
}
