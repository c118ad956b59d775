//! A point mass under gravity, drag and wind.

use std::f64::consts::PI;

use glam::DVec3;

use crate::physics::GRAVITY_M_S2;

use super::{Atmosphere, DragModel};

/// Step of the integrator, seconds. It holds the reference trajectories to 4 micrometres and, through the steep rise of
/// drag at Mach 1, flights of 5 s to 3 mm (a round of 0.1 lb/in^2; others to 0.4 mm); a second of flight costs 200
/// evaluations of the drag.
pub const STEP_S: f64 = 0.02;
/// kg/m^2 in one lb/in^2.
const KG_M2_PER_LB_IN2: f64 = 0.453_592_37 / (0.0254 * 0.0254);
/// Newest steps that are kept, so that a flight can be asked where it was up to 0.6 s ago.
const KEPT: usize = 32;

/// A round as its maker states it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projectile {
    drag: DragModel,
    ballistic_coefficient_lb_in2: f64,
    muzzle_velocity_m_s: f64,
}

impl Projectile {
    /// A round of a heavy machine gun, rounded.
    pub const HEAVY: Self =
        Self { drag: DragModel::G7, ballistic_coefficient_lb_in2: 0.33, muzzle_velocity_m_s: 890.0 };

    /// A round with the G7 ballistic coefficient `bc_g7_lb_in2` (at least 0.01; infinite means no drag) and that muzzle
    /// velocity (0 to 3000 m/s); `None` outside those.
    pub fn new(bc_g7_lb_in2: f64, muzzle_velocity_m_s: f64) -> Option<Self> {
        Self::with_drag(DragModel::G7, bc_g7_lb_in2, muzzle_velocity_m_s)
    }

    /// A round of that drag, with the ballistic coefficient that goes with it: sectional density by form factor.
    pub fn with_drag(
        drag: DragModel,
        ballistic_coefficient_lb_in2: f64,
        muzzle_velocity_m_s: f64,
    ) -> Option<Self> {
        let fits = ballistic_coefficient_lb_in2 >= 0.01 && (0.0..=3000.0).contains(&muzzle_velocity_m_s);
        fits.then_some(Self { drag, ballistic_coefficient_lb_in2, muzzle_velocity_m_s })
    }

    /// Its drag.
    pub const fn drag(&self) -> &DragModel {
        &self.drag
    }

    /// Ballistic coefficient, lb/in^2.
    pub const fn ballistic_coefficient_lb_in2(&self) -> f64 {
        self.ballistic_coefficient_lb_in2
    }

    /// Speed at the muzzle, m/s.
    pub const fn muzzle_velocity_m_s(&self) -> f64 {
        self.muzzle_velocity_m_s
    }
}

/// Where a round is and how it moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FlightState {
    /// Seconds since it left the muzzle.
    pub time_s: f64,
    /// Metres, world.
    pub position: DVec3,
    /// m/s, world.
    pub velocity: DVec3,
}

/// A short stretch of a flight, close to straight: at 900 m/s the path leaves the chord by less than a millimetre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightSegment {
    /// Its start.
    pub from: FlightState,
    /// Its end.
    pub to: FlightState,
}

/// One round in the air. Its path does not depend on how often or how far it is asked to advance.
#[derive(Clone, Debug)]
pub struct Flight {
    dynamics: Dynamics,
    /// Ring of the newest steps: step `n`, at `n * STEP_S`, is in slot `n % KEPT`.
    steps: [FlightState; KEPT],
    /// Number of the newest step.
    newest: u64,
    /// How far [`Flight::next_segment`] has handed out the path, seconds since the muzzle.
    swept_s: f64,
}

#[derive(Clone, Copy, Debug)]
struct Dynamics {
    atmosphere: Atmosphere,
    wind: DVec3,
    model: DragModel,
    /// Drag deceleration is this * density * drag coefficient * airspeed^2, m^2/kg.
    drag: f64,
}

impl Flight {
    /// A round that leaves `muzzle` (world, metres) along `direction` (any length) in a steady `wind` (the velocity of the
    /// air, world, m/s). `None` where a number is not finite or the direction is zero.
    pub fn new(
        projectile: Projectile,
        atmosphere: &Atmosphere,
        muzzle: DVec3,
        direction: DVec3,
        wind: DVec3,
    ) -> Option<Self> {
        let direction = direction.try_normalize()?;
        if !muzzle.is_finite() || !wind.is_finite() {
            return None;
        }
        let start = FlightState {
            time_s: 0.0,
            position: muzzle,
            velocity: direction * projectile.muzzle_velocity_m_s,
        };
        let dynamics = Dynamics {
            atmosphere: *atmosphere,
            wind,
            model: projectile.drag,
            drag: PI / (8.0 * projectile.ballistic_coefficient_lb_in2 * KG_M2_PER_LB_IN2),
        };
        Some(Self { dynamics, steps: [start; KEPT], newest: 0, swept_s: 0.0 })
    }

    /// Integrates until the flight covers `dt` seconds more than it was asked for so far, and discards the segments in
    /// between. For hit tests use [`Flight::next_segment`].
    pub fn advance(&mut self, dt: f64) {
        let until = self.swept_s + dt.max(0.0);
        while self.next_segment(until).is_some() {}
    }

    /// The next stretch of the path that was not handed out yet, at most one step long and not beyond `until_s` seconds
    /// since the muzzle; `None` once the path is handed out up to there. Call until `None`.
    pub fn next_segment(&mut self, until_s: f64) -> Option<FlightSegment> {
        if until_s.is_nan() || until_s <= self.swept_s {
            return None;
        }
        // The step that holds the start of the segment ends at number `end`.
        let mut end = (self.swept_s / STEP_S).floor() as u64 + 1;
        if end as f64 * STEP_S <= self.swept_s {
            end += 1;
        }
        while self.newest < end {
            self.step();
        }
        let from = self.state_at(self.swept_s);
        self.swept_s = until_s.min(end as f64 * STEP_S);
        Some(FlightSegment { from, to: self.state_at(self.swept_s) })
    }

    /// Seconds since the muzzle up to which the path has been handed out.
    pub const fn time_s(&self) -> f64 {
        self.swept_s
    }

    /// The state at the end of what has been handed out.
    pub fn state(&self) -> FlightState {
        self.state_at(self.swept_s)
    }

    /// The state `time_s` seconds after the muzzle, by cubic Hermite interpolation between steps (within a micrometre of
    /// the integrated path). Times outside the newest 0.6 s of what was integrated give the nearest that is kept.
    pub fn state_at(&self, time_s: f64) -> FlightState {
        let newest = self.newest as f64 * STEP_S;
        let oldest_number = self.newest.saturating_sub(KEPT as u64 - 1);
        let time_s = time_s.max(oldest_number as f64 * STEP_S).min(newest);
        let number = ((time_s / STEP_S).floor() as u64).clamp(oldest_number, self.newest);
        let a = self.kept(number);
        if number == self.newest || time_s <= a.time_s {
            return a;
        }
        hermite(&a, &self.kept(number + 1), time_s)
    }

    fn kept(&self, number: u64) -> FlightState {
        self.steps[(number % KEPT as u64) as usize]
    }

    fn step(&mut self) {
        let mut next = self.dynamics.runge_kutta(&self.kept(self.newest), STEP_S);
        self.newest += 1;
        // A product, not a sum: the clock of a long flight must not gather rounding errors.
        next.time_s = self.newest as f64 * STEP_S;
        self.steps[(self.newest % KEPT as u64) as usize] = next;
    }
}

impl Dynamics {
    fn acceleration(&self, position: DVec3, velocity: DVec3) -> DVec3 {
        let air = self.atmosphere.at(position.z);
        let through_air = velocity - self.wind;
        let speed = through_air.length();
        let cd = self.model.coefficient(speed / air.sound_m_s);
        -through_air * (self.drag * air.density_kg_m3 * cd * speed) - DVec3::Z * GRAVITY_M_S2
    }

    /// One classical Runge-Kutta step of order 4.
    fn runge_kutta(&self, s: &FlightState, h: f64) -> FlightState {
        let (x, v) = (s.position, s.velocity);
        let a1 = self.acceleration(x, v);
        let v2 = v + a1 * (h / 2.0);
        let a2 = self.acceleration(x + v * (h / 2.0), v2);
        let v3 = v + a2 * (h / 2.0);
        let a3 = self.acceleration(x + v2 * (h / 2.0), v3);
        let v4 = v + a3 * h;
        let a4 = self.acceleration(x + v3 * h, v4);
        FlightState {
            time_s: s.time_s + h,
            position: x + (v + 2.0 * (v2 + v3) + v4) * (h / 6.0),
            velocity: v + (a1 + 2.0 * (a2 + a3) + a4) * (h / 6.0),
        }
    }
}

/// The cubic through both positions with both velocities, at `time_s` between them.
fn hermite(a: &FlightState, b: &FlightState, time_s: f64) -> FlightState {
    let h = b.time_s - a.time_s;
    let t = (time_s - a.time_s) / h;
    let (u, chord) = (1.0 - t, b.position - a.position);
    let position = a.position + chord * (t * t * (3.0 - 2.0 * t)) + a.velocity * (h * t * u * u)
        - b.velocity * (h * t * t * u);
    let velocity =
        chord * (6.0 * t * u / h) + a.velocity * (u * (1.0 - 3.0 * t)) + b.velocity * (t * (3.0 * t - 2.0));
    FlightState { time_s, position, velocity }
}

#[cfg(test)]
#[path = "flight_tests.rs"]
mod tests;
