//! The simulated gun on its mount: inertia, friction, stops, and the hands that move it on a ship that moves.

use std::collections::VecDeque;

use bowwave_core::geometry::{CameraPose, wrapped};
use glam::{DVec2, DVec3};

use crate::{
    make::{Motion, MotionState},
    panorama::{ELEVATION, TRAVERSE_MAX},
};

/// Step of the mount, seconds.
pub(super) const STEP_S: f64 = 1e-3;
/// Time over which the gun's way is kept, seconds.
const KEPT_S: f64 = 0.4;
/// Way of the barrel back along its bore, metres, and until it is forward again, seconds: a heavy machine gun's 1 1/8 inch.
const STROKE_M: f64 = 0.0286;
const STROKE_S: f64 = 0.05;
/// Rounds that can go off while the gun's way is kept.
const ROUNDS_KEPT: usize = 32;

/// A gun on its pintle. Angles are traverse (clockwise from the bow) and elevation (above the deck).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MountModel {
    /// Moments of inertia about the two axes, kg m^2: a machine gun of 38 kg and 1.65 m with cradle and display.
    pub inertia: DVec2,
    /// Viscous friction, N m s.
    pub viscous: DVec2,
    /// Dry friction, N m.
    pub dry: DVec2,
    /// Most torque that hands exert, N m: 150 N at the grips, .6 m behind the pintle.
    pub torque_max: f64,
    /// Natural frequency of hands that hold the gun where they want it, rad/s (arm and tool: 2 to 4 Hz), and their damping ratio.
    pub hands: [f64; 2],
}

impl Default for MountModel {
    fn default() -> Self {
        Self {
            inertia: DVec2::new(14.0, 10.0),
            viscous: DVec2::new(4.0, 3.0),
            dry: DVec2::new(2.5, 1.5),
            torque_max: 90.0,
            hands: [16.0, 0.9],
        }
    }
}

/// Wish of the hands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wish {
    /// Traverse and elevation on the mount, radians, and their rates: somebody who moves the gun by what the picture shows.
    Mount(DVec2, DVec2),
    /// Azimuth and elevation in the world, radians, and their rates: somebody who keeps it on a place whatever the ship does.
    World(DVec2, DVec2),
}

/// A gun that moves.
#[derive(Clone, Debug)]
pub struct Gun {
    model: MountModel,
    motion: Motion,
    angles: DVec2,
    rates: DVec2,
    /// Steps done: the time is theirs.
    steps: u64,
    /// Angles and rates of the last moments, oldest first.
    way: VecDeque<[DVec2; 2]>,
    /// When the last rounds went off, seconds, oldest first.
    rounds: VecDeque<f64>,
}

impl Gun {
    /// A gun at rest that looks to the north, on a ship that moves as `motion` says; its gun motion is not used.
    pub fn new(model: MountModel, motion: Motion) -> Self {
        let mut gun = Self {
            model,
            motion,
            angles: DVec2::ZERO,
            rates: DVec2::ZERO,
            steps: 0,
            way: VecDeque::new(),
            rounds: VecDeque::new(),
        };
        gun.angles = gun.clamped(gun.on_mount(BEGIN, 0.0));
        gun.way.push_back([gun.angles, gun.rates]);
        gun
    }

    /// Seconds since the begin.
    pub fn time_s(&self) -> f64 {
        self.steps as f64 * STEP_S
    }

    /// Traverse and elevation, radians.
    pub const fn angles(&self) -> DVec2 {
        self.angles
    }

    /// A shot's blow, rad/s.
    pub fn kick(&mut self, rates: DVec2) {
        self.rates += rates;
        self.rounds.push_back(self.time_s());
        if self.rounds.len() > ROUNDS_KEPT {
            self.rounds.pop_front();
        }
    }

    /// How far back along its bore the barrel is at a time that has been reached, metres.
    pub fn recoil_m(&self, time_s: f64) -> f64 {
        let since = self.rounds.iter().rev().map(|round| time_s - round).find(|since| *since >= 0.0);
        let stroke = |since: f64| STROKE_M * (std::f64::consts::PI * since / STROKE_S).sin();
        since.filter(|since| *since < STROKE_S).map_or(0.0, stroke)
    }

    /// Moves by one step.
    pub fn step(&mut self, wish: &Wish) {
        let time_s = self.time_s();
        let (wanted, wanted_rate) = match *wish {
            Wish::Mount(angles, rates) => (angles, rates),
            Wish::World(direction, rates) => {
                let (now, ahead) = (
                    self.on_mount(direction, time_s),
                    self.on_mount(direction + rates * STEP_S, time_s + STEP_S),
                );
                (now, (ahead - now) / STEP_S)
            }
        };
        let wanted = self.clamped(wanted);
        let MountModel { inertia, viscous, dry, torque_max, hands: [natural, damping] } = self.model;
        let pull = inertia
            * (natural * natural * (wanted - self.angles)
                + 2.0 * damping * natural * (wanted_rate - self.rates))
            + viscous * self.rates;
        let limit = DVec2::splat(torque_max);
        let torque =
            pull.clamp(-limit, limit) - viscous * self.rates - inertia * self.ship_acceleration(time_s);
        let free = self.rates + torque / inertia * STEP_S;
        // Dry friction stops what it can and slows the rest (Coulomb).
        let brake = dry / inertia * STEP_S;
        self.rates = free - free.clamp(-brake, brake);
        self.angles += self.rates * STEP_S;
        let within = self.clamped(self.angles);
        if within.x != self.angles.x {
            self.rates.x = 0.0;
        }
        if within.y != self.angles.y {
            self.rates.y = 0.0;
        }
        self.angles = within;
        self.steps += 1;
        self.way.push_back([self.angles, self.rates]);
        while self.way.len() as f64 * STEP_S > KEPT_S {
            self.way.pop_front();
        }
    }

    /// The camera's state at a time that has been reached, no longer ago than .4 s; nearest to it elsewhere.
    pub fn state(&self, time_s: f64) -> MotionState {
        let since = (self.time_s() - time_s) / STEP_S;
        let newest = self.way.len() - 1;
        let at = (newest as f64 - since).clamp(0.0, newest as f64);
        let (low, share) = (at as usize, at.fract());
        let [mut angles, mut rates] = self.way[low];
        if let Some([next, next_rates]) = self.way.get(low + 1) {
            // Hermite's cubic would change nothing: a step's curvature is below 1e-5 rad.
            angles += (*next - angles) * share;
            rates += (*next_rates - rates) * share;
        }
        self.motion.with_gun(time_s, angles, rates)
    }

    /// The camera's pose at such a time.
    pub fn pose(&self, time_s: f64) -> CameraPose {
        self.state(time_s).pose
    }

    /// Traverse and elevation that look to an azimuth and elevation in the world.
    fn on_mount(&self, direction: DVec2, time_s: f64) -> DVec2 {
        let (flat, up) = (direction.y.cos(), direction.y.sin());
        let world = DVec3::new(direction.x.sin() * flat, direction.x.cos() * flat, up);
        let deck = self.motion.world_from_deck(time_s).inverse() * world;
        DVec2::new(deck.x.atan2(deck.y), deck.z.clamp(-1.0, 1.0).asin())
    }

    /// Acceleration of the ship's turn under the gun about its two axes, rad/s^2.
    fn ship_acceleration(&self, time_s: f64) -> DVec2 {
        let [heading, pitch, roll] = self.motion.ship_accelerations(time_s);
        let (sin, cos) = self.angles.x.sin_cos();
        DVec2::new(heading, pitch * cos - roll * sin)
    }

    /// Angles within the stops: to each side of where north was at the begin.
    fn clamped(&self, angles: DVec2) -> DVec2 {
        let middle = -self.motion.heading_mean();
        let off = wrapped(angles.x - middle);
        DVec2::new(
            middle + off.clamp(-TRAVERSE_MAX, TRAVERSE_MAX),
            angles.y.clamp(ELEVATION[0], ELEVATION[1]),
        )
    }
}

/// Azimuth and elevation at the begin, radians: to the north, with more sea than sky in the picture.
pub(super) const BEGIN: DVec2 = DVec2::new(0.0, -4.0 * std::f64::consts::PI / 180.0);

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::make::Recipe;

    fn gun() -> Gun {
        Gun::new(MountModel::default(), Recipe::default().motion())
    }

    fn look(gun: &Gun) -> DVec2 {
        let forward = gun.pose(gun.time_s()).world_from_camera * DVec3::Z;
        DVec2::new(forward.x.atan2(forward.y), forward.z.asin())
    }

    #[test]
    fn hands_hold_a_place_in_the_world_while_the_ship_rolls() {
        let mut gun = gun();
        let place = DVec2::new(0.3, -0.05);
        let mut worst = 0.0_f64;
        for step in 0..20_000 {
            gun.step(&Wish::World(place, DVec2::ZERO));
            if step > 2000 {
                worst = worst.max((look(&gun) - place).length());
            }
        }
        // Dry friction holds off what its torque is against the hands' stiffness: 2.5 / (14 * 16^2) = .7 mrad.
        assert!(worst < 1.5e-3, "{worst}");
    }

    #[test]
    fn a_gun_left_where_it_is_rolls_with_the_ship() {
        let mut gun = gun();
        let rest = gun.angles();
        let mut turned = 0.0_f64;
        let begin = look(&gun);
        for _ in 0..5000 {
            gun.step(&Wish::Mount(rest, DVec2::ZERO));
            turned = turned.max((look(&gun) - begin).length());
        }
        assert!((gun.angles() - rest).length() < 2e-3);
        assert!(turned > 0.01, "{turned}");
    }

    #[test]
    fn a_step_of_the_wish_is_followed_within_half_a_second_without_swinging() {
        let mut gun = gun();
        let rest = gun.angles();
        let to = rest + DVec2::new(0.1, 0.02);
        let mut beyond = 0.0_f64;
        for _ in 0..500 {
            gun.step(&Wish::Mount(to, DVec2::ZERO));
            beyond = beyond.max(gun.angles().x - to.x);
        }
        assert!((gun.angles() - to).length() < 2e-3, "{}", gun.angles() - to);
        assert!(beyond < 0.01, "{beyond}");
    }

    #[test]
    fn stops_hold_and_blows_die_out() {
        let mut gun = gun();
        for _ in 0..6000 {
            gun.step(&Wish::Mount(DVec2::new(gun.angles().x + 1.0, -3.0), DVec2::ZERO));
        }
        let heading = Recipe::default().ship.heading.mean;
        let off = (gun.angles().x + heading).rem_euclid(std::f64::consts::TAU);
        // Dry friction holds the gun a little off the lower stop, which it is not pushed against.
        assert!((off - TRAVERSE_MAX).abs() < 1e-9 && (gun.angles().y - ELEVATION[0]).abs() < 2e-3, "{off}");
        let rest = DVec2::new(-heading, 0.0);
        (0..2000).for_each(|_| gun.step(&Wish::Mount(rest, DVec2::ZERO)));
        let before = gun.angles();
        gun.kick(DVec2::new(0.05, 0.2));
        let mut most = 0.0_f64;
        for _ in 0..1000 {
            gun.step(&Wish::Mount(rest, DVec2::ZERO));
            most = most.max((gun.angles() - before).length());
        }
        assert!(most > 2e-3 && (gun.angles() - before).length() < 2e-3, "{most}");
    }

    #[test]
    fn the_rates_are_those_of_the_way() {
        let mut gun = gun();
        let mut turned = gun.pose(0.0).world_from_camera;
        for step in 0..4000 {
            let azimuth = 0.3 * (f64::from(step) * 2e-3).sin();
            gun.step(&Wish::World(DVec2::new(azimuth, -0.05), DVec2::ZERO));
            turned *= DQuat::from_scaled_axis(gun.state(gun.time_s()).rate * STEP_S);
        }
        let truth = gun.pose(gun.time_s()).world_from_camera;
        assert!(turned.angle_between(truth) < 2e-3, "{}", turned.angle_between(truth));
    }
}
