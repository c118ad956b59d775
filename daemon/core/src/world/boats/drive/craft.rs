//! A boat as its helmsman has it: engine, helm, and the hull's answer to drift and turn.

use std::f64::consts::PI;

use super::resistance::HullRunning;
use crate::world::boats::hull::{HullForm, STRIPS, WATER_KG_M3};

/// The way in which a boat is driven and steered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Propulsor {
    /// Outboard engines that turn with the helm: thrust and the leg's side force steer.
    Outboard,
    /// A water jet: only thrust steers.
    Jet,
    /// A propeller on a shaft with a rudder behind it.
    Shaft,
}

impl Propulsor {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Outboard, Self::Jet, Self::Shaft];

    /// The name used in scenarios.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Outboard => "outboard",
            Self::Jet => "jet",
            Self::Shaft => "shaft",
        }
    }
}

/// Engine and helm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Machinery {
    pub propulsor: Propulsor,
    /// Thrust at rest with the throttle open, newtons.
    pub bollard_n: f64,
    /// Speed at which the open throttle gives no thrust, m/s.
    pub slipless_m_s: f64,
    /// Share of the engine's turns that it gives astern.
    pub astern: f64,
    /// Drag of what does not turn, by the thrust at rest and the square of the speed by `slipless_m_s`.
    pub braking: f64,
    /// Time constant of the engine's turns, seconds.
    pub spool_s: f64,
    /// Greatest angle of the helm, radians.
    pub steer_max: f64,
    /// How fast the helm turns, rad/s.
    pub steer_rate: f64,
    /// Area of rudder or legs, m^2.
    pub blade_m2: f64,
    /// Slope of the blade's normal force coefficient, 1/rad.
    pub blade_slope: f64,
}

/// Derivatives of the side force and the turning moment of a hull that floats, by Clarke, Gedling and Hine 1983 (Trans. RINA 125, 45),
/// made dimensional but for speed: newtons and newton metres by m/s of speed, about the middle of the hull.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SideForces {
    /// Side force by sway (m/s) and speed.
    pub y_v: f64,
    /// Side force by turn (rad/s) and speed.
    pub y_r: f64,
    /// Moment by sway and speed.
    pub n_v: f64,
    /// Moment by turn and speed.
    pub n_r: f64,
}

/// A boat that can be driven.
#[derive(Clone, Debug, PartialEq)]
pub struct Craft {
    /// Length at the waterline, metres.
    pub length_m: f64,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Greatest speed in calm water, m/s.
    pub speed_max_m_s: f64,
    pub(super) draught_m: f64,
    /// Centre of mass forward of the boat's origin, metres.
    pub(super) centre_m: f64,
    /// Middle of the hull forward of the centre of mass, metres.
    pub(super) middle_m: f64,
    /// Transom forward of the centre of mass, metres (negative).
    pub(super) transom_m: f64,
    /// Mass and the water that goes along ahead, kg.
    pub(super) surge_kg: f64,
    /// The same sideways, afloat.
    pub(super) sway_kg: f64,
    /// Moment of inertia with the water that goes along, kg m^2.
    pub(super) yaw_kg_m2: f64,
    pub(super) side: SideForces,
    pub(super) machinery: Machinery,
    pub(super) running: HullRunning,
}

impl Craft {
    /// A boat of that hull which reaches `speed_max_m_s` in calm water.
    pub fn new(form: &HullForm, propulsor: Propulsor, speed_max_m_s: f64) -> Self {
        /// Radius of gyration in yaw by the length.
        const GYRATION: f64 = 0.25;
        let speed_max_m_s = speed_max_m_s.max(0.5);
        let length_m = form.strip_m * STRIPS as f64;
        let (beam_m, draught_m) = (2.0 * form.half_beam_m, form.draught_m);
        let running = HullRunning::of(form, speed_max_m_s);
        let block = form.mass_kg / (WATER_KG_M3 * length_m * beam_m * draught_m);
        let hull = ClarkeHull { length_m, beam_m, draught_m, block };
        let after_m = form.centre_from_stern_m();
        let machinery =
            Machinery::of(propulsor, running.at(speed_max_m_s).resistance_n, speed_max_m_s, &hull);
        Self {
            length_m,
            mass_kg: form.mass_kg,
            speed_max_m_s,
            draught_m,
            centre_m: form.centre_m,
            middle_m: 0.5 * length_m - after_m,
            transom_m: -after_m,
            surge_kg: 1.05 * form.mass_kg,
            sway_kg: form.mass_kg + hull.added_sway_kg(),
            yaw_kg_m2: form.mass_kg * (GYRATION * length_m).powi(2) + hull.added_yaw_kg_m2(),
            side: hull.side_forces(),
            machinery,
            running,
        }
    }

    /// How the hull runs in calm water at a speed, m/s.
    pub fn running(&self) -> &HullRunning {
        &self.running
    }
}

impl Machinery {
    /// Machinery that balances `resistance_n` at `speed_m_s`.
    fn of(propulsor: Propulsor, resistance_n: f64, speed_m_s: f64, hull: &ClarkeHull) -> Self {
        let length2 = hull.length_m * hull.length_m;
        let large = hull.length_m > 15.0;
        // Thrust falls with speed to its value at top speed: a propeller of fixed pitch on an engine of fixed power. That of a ship is bound by
        // its shaft and falls less.
        let slipless_m_s = if large { 4.0 } else { 2.0 } * speed_m_s;
        let bollard_n = resistance_n / (1.0 - speed_m_s / slipless_m_s);
        match propulsor {
            Propulsor::Outboard => Self {
                propulsor,
                bollard_n,
                slipless_m_s,
                astern: 0.6,
                braking: 4.5,
                spool_s: 0.8,
                steer_max: 30_f64.to_radians(),
                steer_rate: 30_f64.to_radians(),
                blade_m2: 0.0022 * length2,
                blade_slope: fujii(1.5),
            },
            Propulsor::Jet => Self {
                propulsor,
                bollard_n,
                slipless_m_s,
                astern: 0.8,
                braking: 1.5,
                spool_s: 0.6,
                steer_max: 30_f64.to_radians(),
                steer_rate: 40_f64.to_radians(),
                blade_m2: 0.0,
                blade_slope: 0.0,
            },
            Propulsor::Shaft => Self {
                propulsor,
                bollard_n,
                slipless_m_s,
                astern: 0.6,
                braking: 3.0,
                spool_s: if large { 6.0 } else { 1.0 },
                steer_max: 35_f64.to_radians(),
                steer_rate: if large { 3_f64 } else { 15.0 }.to_radians(),
                blade_m2: if large { 0.022 } else { 0.04 } * hull.length_m * hull.draught_m,
                blade_slope: fujii(1.5),
            },
        }
    }
}

/// Slope of a rudder's normal force coefficient by its aspect ratio (Fujii and Tsuda 1961), 1/rad.
fn fujii(aspect: f64) -> f64 {
    6.13 * aspect / (aspect + 2.25)
}

/// The four numbers that the regressions of Clarke et al. are in.
#[derive(Clone, Copy, Debug)]
struct ClarkeHull {
    length_m: f64,
    beam_m: f64,
    draught_m: f64,
    block: f64,
}

impl ClarkeHull {
    /// -pi (T / L)^2 and the three ratios. Beyond the ships that were measured, ratios are held to their edge.
    fn ratios(&self) -> (f64, f64, f64, f64) {
        let slim = self.draught_m / self.length_m;
        let breadth = (self.beam_m / self.length_m).min(0.3);
        let flat = (self.beam_m / self.draught_m).min(6.0);
        (-PI * slim * slim, slim, breadth, flat)
    }

    fn side_forces(&self) -> SideForces {
        let (base, slim, breadth, flat) = self.ratios();
        let (area, length_m) = (0.5 * WATER_KG_M3 * self.length_m * self.length_m, self.length_m);
        SideForces {
            y_v: area * base * (1.0 + 0.40 * self.block * flat),
            y_r: area * length_m * base * (-0.5 + 2.2 * breadth - 0.08 * flat),
            n_v: area * length_m * base * (0.5 + 2.4 * slim),
            n_r: area * length_m * length_m * base * (0.25 + 0.039 * flat - 0.56 * breadth),
        }
    }

    fn added_sway_kg(&self) -> f64 {
        let (base, _, breadth, flat) = self.ratios();
        let share = (1.0 + 0.16 * self.block * flat - 5.1 * breadth * breadth).max(0.3);
        -0.5 * WATER_KG_M3 * self.length_m.powi(3) * base * share
    }

    fn added_yaw_kg_m2(&self) -> f64 {
        let (base, _, breadth, flat) = self.ratios();
        let share = (1.0 / 12.0 + 0.017 * self.block * flat - 0.33 * breadth).max(0.02);
        -0.5 * WATER_KG_M3 * self.length_m.powi(5) * base * share
    }
}
