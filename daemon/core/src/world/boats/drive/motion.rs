//! How a boat moves over the water: surge, sway and yaw, in Fossen's notation (Handbook of Marine Craft Hydrodynamics and Motion
//! Control, 2011, ch. 6): u ahead and v to starboard (m/s), r clockwise (rad/s), about the centre of mass.

use glam::DVec2;

use super::craft::{Craft, Propulsor};
use crate::{
    geometry::{ahead, starboard},
    physics::GRAVITY_M_S2,
    world::{
        boats::{
            course::CourseState,
            floating::{PLANING_RISE, WayAttitude, lean},
            hull::WATER_KG_M3,
        },
        waves::WaveField,
    },
};

/// A propeller that turns slower than this, of 1, brakes.
const BRAKES_BELOW: f64 = 0.3;

/// Width over which the slope of the water is taken, by the length.
const BEAM: f64 = 0.3;

/// What a helmsman orders.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Orders {
    /// Throttle, -1 (astern) to 1.
    pub throttle: f64,
    /// Helm, -1 (hard to port) to 1 (hard to starboard).
    pub helm: f64,
}

/// A driven boat at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveState {
    /// World x and y of the centre of mass, metres.
    pub centre: DVec2,
    /// Radians clockwise from north.
    pub heading: f64,
    /// Speed ahead through the water, m/s: Fossen's u.
    pub surge: f64,
    /// Speed to starboard, m/s: v.
    pub sway: f64,
    /// Turn clockwise, rad/s: r.
    pub yaw_rate: f64,
    /// The engine's turns by their greatest, negative astern.
    pub engine: f64,
    /// Angle of the helm, radians; positive turns to starboard.
    pub steer: f64,
}

/// What acts on a boat besides its engine and the water that it goes through.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surroundings {
    /// Slope of the water under the hull along it, rise per metre forwards.
    pub forward_slope: f64,
    /// The same across it, per metre to port.
    pub port_slope: f64,
    /// Where its anchor lies, world x and y, metres.
    pub anchor: Option<DVec2>,
}

/// Changes a second of what the forces move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveRates {
    /// Velocity over the ground, world x and y, m/s.
    pub centre: DVec2,
    /// Of the heading, rad/s.
    pub heading: f64,
    /// Of the speed ahead, m/s^2.
    pub surge: f64,
    /// Of the speed to starboard, m/s^2.
    pub sway: f64,
    /// Of the turn, rad/s^2.
    pub yaw_rate: f64,
}

impl DriveState {
    /// A boat whose origin is at `position`, which goes ahead at `speed_m_s` with its engine set for that.
    pub fn steady(craft: &Craft, position: DVec2, heading: f64, speed_m_s: f64) -> Self {
        Self {
            centre: position + ahead(heading) * craft.centre_m,
            heading,
            surge: speed_m_s,
            engine: craft.throttle_for(speed_m_s),
            ..Self::default()
        }
    }

    /// As frames and rounds see it.
    pub fn course(&self, craft: &Craft) -> CourseState {
        CourseState {
            position: self.centre - ahead(self.heading) * craft.centre_m,
            heading: self.heading,
            speed_m_s: self.surge,
            // The origin lies forward or aft of the centre of mass, about which the boat turns.
            sway_m_s: self.sway - craft.centre_m * self.yaw_rate,
            turn_rate: self.yaw_rate,
        }
    }

    /// Velocity of the centre of mass over the ground, world x and y, m/s.
    fn velocity(&self) -> DVec2 {
        ahead(self.heading) * self.surge + starboard(self.heading) * self.sway
    }

    fn moved(&self, rates: &DriveRates, seconds: f64) -> Self {
        Self {
            centre: self.centre + rates.centre * seconds,
            heading: self.heading + rates.heading * seconds,
            surge: self.surge + rates.surge * seconds,
            sway: self.sway + rates.sway * seconds,
            yaw_rate: self.yaw_rate + rates.yaw_rate * seconds,
            ..*self
        }
    }

    /// Whether every number is finite and small enough for a boat.
    pub fn is_sane(&self) -> bool {
        let speed = self.surge.hypot(self.sway);
        self.centre.is_finite() && self.heading.is_finite() && speed < 100.0 && self.yaw_rate.abs() < 10.0
    }
}

impl Craft {
    /// What the boat's way does to its attitude: trim as its bottom runs, lean into its turns on the plane.
    pub fn way_attitude(&self, state: &CourseState) -> WayAttitude {
        let running = self.running.at(state.speed_m_s);
        WayAttitude {
            trim: running.trim,
            lean: lean(state.speed_m_s, state.turn_rate) * running.planing,
            rise_m: PLANING_RISE * self.length_m * running.planing,
        }
    }

    /// Throttle that keeps a speed in calm water, -1 to 1.
    pub fn throttle_for(&self, speed_m_s: f64) -> f64 {
        let m = &self.machinery;
        let wanted = self.running.at(speed_m_s).resistance_n / m.bollard_n;
        // Thrust is n^2 - n u / slipless.
        let half = 0.5 * speed_m_s.abs() / m.slipless_m_s;
        let turns = half + (half * half + wanted).sqrt();
        if speed_m_s >= 0.0 { turns.min(1.0) } else { -turns.min(m.astern) }
    }

    /// The most helm that is given at a speed: a fast boat with its helm hard over spins out, but for one with a jet.
    pub fn hard_over(&self, surge: f64) -> f64 {
        /// Speed from which helms are eased, m/s.
        const FAST_M_S: f64 = 5.0;
        let eased = self.machinery.propulsor != Propulsor::Jet && surge > FAST_M_S;
        if eased { 0.7 } else { 1.0 }
    }

    /// Helm, -1 to 1, that holds a turn (rad/s) at a speed, about.
    pub fn helm_for(&self, surge: f64, turn_rate: f64) -> f64 {
        let m = &self.machinery;
        // The stern's drift meets the blade from inside; a jet feels none of it and pushes against the hull alone.
        let share = if m.propulsor == Propulsor::Jet { 4.6 } else { 2.7 };
        share * -self.transom_m * turn_rate / (surge.abs().max(1.0) * m.steer_max)
    }

    /// Force on the boat of engines at `turns` (share of their greatest) that point `steer` off, ahead and to starboard, newtons. What
    /// leaves a propeller or a nozzle goes with the turns squared and can be turned; what has to be brought up to the boat's speed goes with
    /// turns and speed, along the boat (Fossen 2011, eq. 12.236). A propeller that idles, or turns against the stream, brakes.
    fn thrust(&self, turns: f64, surge: f64, steer: f64) -> (f64, f64) {
        let m = &self.machinery;
        let (sin, cos) = if m.propulsor == Propulsor::Shaft { (0.0, 1.0) } else { steer.sin_cos() };
        let share = surge / m.slipless_m_s;
        let gross = turns * turns.abs();
        let brakes = (1.0 - turns * surge.signum() / BRAKES_BELOW).clamp(0.0, 1.0);
        let drag = m.braking * brakes * share * share.abs();
        (m.bollard_n * (gross * cos - turns.abs() * share - drag), -m.bollard_n * gross * sin)
    }

    /// The slopes of the waves under a boat, in the middle of a step of `h` seconds from `time_s` on.
    pub fn slopes(&self, boat: &DriveState, waves: &WaveField, time_s: f64, h: f64) -> Surroundings {
        if waves.is_flat() {
            return Surroundings::default();
        }
        let (centre, heading) =
            (boat.centre + boat.velocity() * (0.5 * h), boat.heading + boat.yaw_rate * (0.5 * h));
        let plane = waves.plane_under(centre, heading, self.length_m, BEAM * self.length_m, time_s + 0.5 * h);
        Surroundings { forward_slope: plane.forward_slope, port_slope: plane.port_slope, anchor: None }
    }

    /// The state `h` seconds later under orders. Heun's method; engine and helm go to what is ordered by their own laws, which have closed
    /// forms, before and after half of the step.
    pub fn step(&self, state: &DriveState, orders: &Orders, around: &Surroundings, h: f64) -> DriveState {
        let start = self.obey(state, orders, 0.5 * h);
        let now = self.rates(&start, around);
        let then = self.rates(&start.moved(&now, h), around);
        let mean = DriveRates {
            centre: 0.5 * (now.centre + then.centre),
            heading: 0.5 * (now.heading + then.heading),
            surge: 0.5 * (now.surge + then.surge),
            sway: 0.5 * (now.sway + then.sway),
            yaw_rate: 0.5 * (now.yaw_rate + then.yaw_rate),
        };
        let next = self.obey(&start.moved(&mean, h), orders, 0.5 * h);
        if next.is_sane() { next } else { DriveState { surge: 0.0, sway: 0.0, yaw_rate: 0.0, ..*state } }
    }

    /// Engine and helm after `seconds` under orders: the rest stays.
    pub fn obey(&self, state: &DriveState, orders: &Orders, seconds: f64) -> DriveState {
        let m = &self.machinery;
        let throttle = orders.throttle.clamp(-m.astern, 1.0);
        let engine = throttle + (state.engine - throttle) * (-seconds / m.spool_s).exp();
        let off = orders.helm.clamp(-1.0, 1.0) * m.steer_max - state.steer;
        let turned = m.steer_rate * seconds;
        DriveState { engine, steer: state.steer + off.clamp(-turned, turned), ..*state }
    }

    /// What the forces on a boat make of its motion, engine and helm as they stand.
    pub fn rates(&self, state: &DriveState, around: &Surroundings) -> DriveRates {
        let DriveState { surge: u, sway: v, yaw_rate: r, .. } = *state;
        let running = self.running.at(u);
        let (drive_x, drive_y) = self.drive(state);
        let (hull_y, hull_n) = self.hull(state, running.planing, running.depth_m, running.keel_m);
        // A bottom that leans presses the boat into its turn.
        let weight = self.mass_kg * GRAVITY_M_S2;
        let leant = running.planing * weight * lean(u, r).tan();
        let astern = if u < 0.0 { 1.5 } else { 1.0 };
        let (rode_x, rode_y) = around.anchor.map_or((0.0, 0.0), |anchor| self.rode(state, anchor));
        let x = drive_x + rode_x - astern * running.resistance_n * u.signum() - weight * around.forward_slope;
        let y = drive_y + rode_y + hull_y + leant + weight * around.port_slope;
        let n = self.transom_m * drive_y + self.bow_m() * rode_y + hull_n;
        // On the plane less water goes along sideways.
        let sway_kg = self.mass_kg + (self.sway_kg - self.mass_kg) * (1.0 - 0.7 * running.planing);
        DriveRates {
            centre: state.velocity(),
            heading: r,
            surge: (x + 0.5 * (self.mass_kg + sway_kg) * v * r) / self.surge_kg,
            sway: (y - self.surge_kg * u * r) / sway_kg,
            yaw_rate: n / self.yaw_kg_m2,
        }
    }

    /// Force of engine and helm on the boat, ahead and to starboard, newtons; it acts at the transom.
    fn drive(&self, state: &DriveState) -> (f64, f64) {
        /// Angle at which a blade stalls, radians.
        const STALL: f64 = 0.35;
        let m = &self.machinery;
        let (thrust_x, thrust_y) = self.thrust(state.engine, state.surge, state.steer);
        let (sin, cos) = state.steer.sin_cos();
        let along = self.inflow(state.surge, thrust_x);
        let across = state.sway + self.transom_m * state.yaw_rate;
        let drift = (across / along.abs().max(0.5)).atan() * along.signum();
        let attack = (state.steer + drift).clamp(-STALL, STALL);
        let flow2 = along * along + across * across;
        let normal = 0.5 * WATER_KG_M3 * m.blade_m2 * m.blade_slope * flow2 * attack.sin() * along.signum();
        (thrust_x - normal * sin, thrust_y - normal * cos)
    }

    /// Bow forward of the centre of mass, metres.
    fn bow_m(&self) -> f64 {
        self.transom_m + self.length_m
    }

    /// Pull of the anchor's rode at the bow, ahead and to starboard, newtons: slack within two lengths, then a spring that holds a quarter of
    /// the weight at two lengths more.
    fn rode(&self, state: &DriveState, anchor: DVec2) -> (f64, f64) {
        let forward = ahead(state.heading);
        let off = anchor - (state.centre + forward * self.bow_m());
        let scope_m = 2.0 * self.length_m;
        let pull = 0.25 * self.mass_kg * GRAVITY_M_S2 * (off.length() - scope_m).max(0.0) / scope_m;
        let along = off.normalize_or_zero() * pull;
        (along.dot(forward), along.dot(starboard(state.heading)))
    }

    /// Speed of the water along the blade, m/s.
    fn inflow(&self, surge: f64, thrust: f64) -> f64 {
        let m = &self.machinery;
        if m.propulsor != Propulsor::Shaft || thrust <= 0.0 {
            return surge;
        }
        // A rudder stands in its propeller's race: momentum theory, over a disc of about the rudder's own area.
        (surge * surge.abs() + thrust / (WATER_KG_M3 * m.blade_m2)).max(0.0).sqrt()
    }

    /// Side force (to starboard) and moment (clockwise) of the hull, about the centre of mass.
    fn hull(&self, state: &DriveState, planing: f64, depth_m: f64, keel_m: f64) -> (f64, f64) {
        let DriveState { surge: u, sway: v, yaw_rate: r, .. } = *state;
        let s = &self.side;
        // Afloat, about the middle.
        let v_middle = v + self.middle_m * r;
        let y_float = u.abs() * s.y_v * v_middle + u * s.y_r * r;
        let n_float = u * s.n_v * v_middle + u.abs() * s.n_r * r + self.middle_m * y_float;
        // Planing: a slender wing whose depth grows from the stem's foot to the transom (Jones 1946), two thirds of the way aft.
        let base = 0.5 * WATER_KG_M3 * std::f64::consts::PI * depth_m * depth_m * u.abs();
        let x_plane = self.transom_m + keel_m / 3.0;
        let y_plane = -base * (v + x_plane * r);
        let n_plane = x_plane * y_plane - base * keel_m * keel_m / 18.0 * r;
        let (y_cross, n_cross) = self.cross_flow(v, r);
        let cross = 1.0 - 0.5 * planing;
        let mix = |float: f64, plane: f64| float + (plane - float) * planing;
        (mix(y_float, y_plane) + cross * y_cross, mix(n_float, n_plane) + cross * n_cross)
    }

    /// Cross-flow drag, by five points of Gauss's rule along the hull (Faltinsen 1990, eq. 6.29).
    fn cross_flow(&self, v: f64, r: f64) -> (f64, f64) {
        /// Drag coefficient of a section across the flow.
        const DRAG: f64 = 0.9;
        const POINTS: [(f64, f64); 5] = [
            (-0.906_179_845_938_664, 0.236_926_885_056_189),
            (-0.538_469_310_105_683, 0.478_628_670_499_366),
            (0.0, 0.568_888_888_888_889),
            (0.538_469_310_105_683, 0.478_628_670_499_366),
            (0.906_179_845_938_664, 0.236_926_885_056_189),
        ];
        let half = 0.5 * self.length_m;
        let base = 0.5 * WATER_KG_M3 * DRAG * self.draught_m * half;
        POINTS.iter().fold((0.0, 0.0), |(y, n), (at, weight)| {
            let x = self.middle_m + half * at;
            let flow = v + x * r;
            let force = -base * weight * flow * flow.abs();
            (y + force, n + x * force)
        })
    }
}

#[cfg(test)]
#[path = "motion_tests.rs"]
mod tests;
