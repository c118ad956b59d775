//! Agreement of a unit's samples with each other, and the deviation of the up that it finds alone.

use glam::{DQuat, DVec3};

use super::means::{RecentMean, SWAY_AGE_S};
use crate::{
    estimate::attitude::TAU_WAVES_S, event::ImuSample, geometry::rotation_vector, physics::GRAVITY_M_S2,
    time::Time,
};

/// Deviation of a unit's up, found alone, on a ship in waves that keeps its course, radians.
pub(super) const UP_SIGMA: f64 = 1.0 * std::f64::consts::PI / 180.0;
/// Way of a ship, one standard deviation, m/s: while it turns, specific force leans by that times its rate over gravity.
const SHIP_SPEED_M_S: f64 = 8.0;
/// No ship turns faster, rad/s.
pub(super) const SHIP_TURN_MOST: f64 = 6.0 * std::f64::consts::PI / 180.0;
/// Time constant with which a unit alone takes in and forgets that, and over which its turn is averaged, seconds, ...
const LEANS_S: f64 = TAU_WAVES_S;
/// ...at first over no less.
const LEANS_LEAST_S: f64 = 2.0;
/// Deviation of up by which a unit begins on a ship in a turn or in waves, and which it forgets in that time as well, radians.
const BEGUN_SIGMA: f64 = 3.0 * std::f64::consts::PI / 180.0;
/// Deviation of a unit's up, found alone, about its mean of the last two seconds on a ship that keeps its course, radians.
pub(super) const SWAY_SIGMA: f64 = 0.25 * std::f64::consts::PI / 180.0;
/// No ship's turn tilts it further, radians.
pub(super) const LEANS_MOST: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// Running means of a unit's samples.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UnitWatch {
    /// Size of the specific force and the force itself, m/s^2, its own axes.
    size: RecentMean<f64, 100>,
    force: RecentMean<DVec3, 100>,
    /// Size of the rate, rad/s.
    rate: RecentMean<f64, 100>,
    /// The unit's own orientation some time ago, the time, and how it turned since by its rates.
    own: Option<(Time, DQuat, DQuat)>,
    last: Option<Time>,
    /// Mean turn about the vertical over [`LEANS_S`], rad/s, and that of its square, (rad/s)^2; at first over how long they are known.
    turning: f64,
    turning_square: f64,
    /// The same mean with the turns of a gun on its mount, which cancel out over some of its swings, rad/s.
    swung: f64,
    known_s: f64,
    /// Turn about the vertical since the start, radians, its mean over [`LEANS_S`] and the mean square off that, radians^2.
    heading: f64,
    heading_mean: f64,
    heading_square: f64,
    /// The fastest mean turn of late, rad/s, that of the gun on its mount included, and the same of a turn that was steady.
    fastest: f64,
    fastest_swung: f64,
    steadiest: f64,
}

/// Turn of a unit by its own orientation and by its rates: rotation vectors, its own axes, radians.
#[derive(Clone, Copy, Debug)]
pub(super) struct OwnTurn {
    pub seen: DVec3,
    pub by_rates: DVec3,
    pub span_s: f64,
    /// Up by its own orientation, unit vector.
    pub up: DVec3,
    /// Mean specific force, m/s^2, where it is known.
    pub force: Option<DVec3>,
}

impl UnitWatch {
    /// Takes in a sample; `rate` is its rate without its bias, rad/s. Its own turn each tenth of a second.
    pub(super) fn sample(&mut self, time: Time, sample: &ImuSample, rate: DVec3) -> Option<OwnTurn> {
        const SPAN_S: f64 = 0.1;
        /// Samples that are farther apart are not of one turn, seconds.
        const GAP_S: f64 = 0.05;
        self.size.take(sample.accel.length());
        self.force.take(sample.accel);
        self.rate.take(rate.length());
        let step_s = self.last.replace(time).map_or(0.0, |last| time.secs_since(last));
        let is_next = (0.0..GAP_S).contains(&step_s);
        if is_next {
            self.turn(rate, step_s);
        }
        let (Some(own), true) = (sample.world_from_imu, is_next) else {
            self.own = None;
            return None;
        };
        let (from, first, turned) = self.own.get_or_insert((time, own, DQuat::IDENTITY));
        if *from < time {
            *turned = (*turned * DQuat::from_scaled_axis(rate * step_s)).normalize();
        }
        let span_s = time.secs_since(*from);
        if span_s < SPAN_S {
            return None;
        }
        let (seen, by_rates) = (rotation_vector(first.inverse() * own), rotation_vector(*turned));
        self.own = Some((time, own, DQuat::IDENTITY));
        let force = self.force.is_full().then_some(self.force.mean);
        Some(OwnTurn { seen, by_rates, span_s, up: own.inverse() * DVec3::Z, force })
    }

    /// Tests for a unit that sends an orientation of its own.
    pub(super) const fn has_own(&self) -> bool {
        self.own.is_some()
    }

    /// Turn of the gun about the vertical since the start, radians.
    pub(super) const fn heading(&self) -> f64 {
        self.heading
    }

    /// Mean size of the rate, rad/s.
    pub(super) const fn rate(&self) -> f64 {
        self.rate.mean
    }

    /// No gun on the Earth feels that on average: it is a number of g.
    pub(super) fn is_in_g(&self) -> bool {
        self.size.is_full() && self.size.mean < 5.0
    }

    /// Takes in a rate, rad/s, that lasted `step_s`.
    fn turn(&mut self, rate: DVec3, step_s: f64) {
        let about_up = rate.dot(self.force.mean.normalize_or_zero());
        self.known_s += step_s;
        let share = step_s / self.known_s.clamp(LEANS_LEAST_S, LEANS_S);
        self.swung += (about_up - self.swung) * share;
        self.heading += about_up * step_s;
        let off = self.heading - self.heading_mean;
        self.heading_mean += off * share;
        self.heading_square += (off * off * (1.0 - share) - self.heading_square) * share;
        // What turns faster is a gun on its mount.
        let about_up = if about_up.abs() > SHIP_TURN_MOST { 0.0 } else { about_up };
        self.turning += (about_up - self.turning) * share;
        self.turning_square += (about_up * about_up - self.turning_square) * share;
        let now = self.turning.abs();
        let steady = self.turning * self.turning / self.turning_square.max(f64::MIN_POSITIVE);
        // A tilt outlasts its turn, and one to the other side goes through none.
        let kept = 1.0 - step_s / (2.0 * LEANS_S);
        self.fastest = now.max(self.fastest * kept);
        self.fastest_swung = self.swung.abs().max(self.fastest_swung * kept);
        self.steadiest = (now * steady).max(self.steadiest * kept);
    }

    /// Tilt of the unit's up by a turn of the ship, standard deviation, radians.
    fn leans(&self) -> f64 {
        tilt(self.fastest)
    }

    /// Error of the unit's up, standard deviation, radians.
    pub(super) fn up_sigma(&self) -> f64 {
        UP_SIGMA
            .hypot(tilt(self.fastest.max(self.fastest_swung)))
            .hypot(BEGUN_SIGMA * (-self.known_s / LEANS_S).exp())
    }

    /// The same as a mount that is off is held against it: how the unit began passes. A tilt by the ship's turn is as the mean turn is, and
    /// what a gun's swing adds to that is of either sign: as much as it moved in that time.
    pub(super) fn lasting_up_sigma(&self) -> f64 {
        let swung = self.heading_square.sqrt() / LEANS_S;
        UP_SIGMA.hypot(tilt(self.steadiest.max(self.swung.abs()).max(swung)))
    }

    /// Deviation of the unit's up without the turns of a gun on its mount, radians: too small for a gun that is swung while the ship turns. A
    /// mount that is off by it alone blocks READY and is not reported.
    pub(super) fn doubted_up_sigma(&self) -> f64 {
        UP_SIGMA.hypot(tilt(self.steadiest))
    }

    /// Deviation of how up, found alone, sways about its mean of the last two seconds, which is off by `off`, radians: the tilt by a ship's
    /// turn grows meanwhile, and stays where it is in the world while a gun is swung.
    pub(super) fn sway_sigma(&self, off: f64) -> f64 {
        SWAY_SIGMA.hypot(self.leans() * SWAY_AGE_S / LEANS_S).hypot(off * self.rate() * SWAY_AGE_S)
    }
}

/// Tilt of the specific force by a ship's turn at `rate`, rad/s, standard deviation, radians.
fn tilt(rate: f64) -> f64 {
    SHIP_SPEED_M_S * rate / GRAVITY_M_S2
}
