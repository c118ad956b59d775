//! A test problem: heave, pitch and roll of a 7 m planing hull that slams, by strips. It has the size, weight, deadrise, number of
//! strips and kinds of force of data/boat_heave_pitch_work_precision.csv; it stands for such boats and is no validated one. The forces
//! are those that the product's strip model is documented with, written down once more.

use std::f64::consts::{FRAC_PI_2, TAU};

use bowwave_core::world::{
    boats::{BoatMotion, CourseState, Hull, HullForm, SeakeepingState, quasi_static},
    waves::{Wave, WaveField},
};
use glam::{DVec2, DVec3};

use super::system::RigidSystem;

/// Acceleration of free fall, m/s^2.
pub const GRAVITY: f64 = 9.806_65;
const WATER_KG_M3: f64 = 1025.0;
const LENGTH_M: f64 = 7.0;
const HALF_BEAM_M: f64 = 1.1;
const MASS_KG: f64 = 1800.0;
/// Pitch radius of gyration: a quarter of the length.
const INERTIA_KG_M2: f64 = MASS_KG * (LENGTH_M / 4.0) * (LENGTH_M / 4.0);
const STRIPS: usize = 11;
/// Tangent of 20 degrees, the deadrise.
const DEADRISE: f64 = 0.363_970_234_266_202_4;
/// Cross-flow drag coefficient (about that of a V section in plane flow).
const CROSS_FLOW: f64 = 1.0;
/// Radiation damping by the section's area, density and the root of g over the beam.
const RADIATION: f64 = 0.7;

/// Radius of gyration in roll: 0.4 of the beam.
const ROLL_INERTIA_KG_M2: f64 = MASS_KG * (0.8 * HALF_BEAM_M) * (0.8 * HALF_BEAM_M);

/// Waves that the boat meets.
#[derive(Clone, Debug)]
pub struct DrivenBoat {
    /// The sea.
    pub waves: WaveField,
    /// Speed northwards, m/s.
    pub speed_m_s: f64,
    /// Draught of the keel at rest, metres.
    draught_m: f64,
}

/// Heave of the middle (metres, up from rest), pitch (radians, bow up), roll (radians, port up), and their rates.
pub type BoatState = [f64; 6];

/// Mean of a cosine over -a to a.
fn mean(a: f64) -> f64 {
    if a == 0.0 { 1.0 } else { a.sin() / a }
}

/// Water that a section displaces, m^2, at the draught `d` of its keel.
fn section(d: f64) -> f64 {
    let chine = HALF_BEAM_M * DEADRISE;
    if d <= 0.0 {
        0.0
    } else if d <= chine {
        d * d / DEADRISE
    } else {
        chine * chine / DEADRISE + 2.0 * HALF_BEAM_M * (d - chine)
    }
}

/// Half the beam at the water, metres.
fn half_beam(d: f64) -> f64 {
    (d / DEADRISE).clamp(0.0, HALF_BEAM_M)
}

impl DrivenBoat {
    /// A boat of that speed on that sea.
    pub fn new(waves: WaveField, speed_m_s: f64) -> Self {
        // The draught whose displacement is its weight, by bisection.
        let (mut low, mut high) = (0.0, 2.0);
        for _ in 0..80 {
            let mid = 0.5 * (low + high);
            if section(mid) * LENGTH_M * WATER_KG_M3 < MASS_KG { low = mid } else { high = mid }
        }
        Self { waves, speed_m_s, draught_m: 0.5 * (low + high) }
    }

    /// On head waves of one height and period.
    pub fn in_regular_waves(height_m: f64, period_s: f64, speed_m_s: f64) -> Self {
        let hz = 1.0 / period_s;
        let wavenumber = (TAU * hz).powi(2) / GRAVITY;
        let wave = Wave {
            amplitude_m: height_m / 2.0,
            cycles_per_m: DVec2::NEG_Y * (wavenumber / TAU),
            hz,
            phase: 0.25,
        };
        let waves = if height_m > 0.0 { WaveField::of(vec![wave]) } else { WaveField::FLAT };
        Self::new(waves, speed_m_s)
    }

    /// Half the beam at the water at rest, metres.
    fn rest_half_beam_m(&self) -> f64 {
        half_beam(self.draught_m)
    }

    /// Mean height and vertical speed of the water under half a strip of a level hull, by the waves' own formula; `x` forward, `y` to
    /// port of the middle.
    fn water(&self, x: f64, y: f64, t: f64) -> (f64, f64) {
        let at = DVec2::new(-y, x + self.speed_m_s * t);
        let half = DVec2::new(0.5 * self.rest_half_beam_m(), 0.5 * LENGTH_M / STRIPS as f64);
        self.waves.waves().iter().fold((0.0, 0.0), |(height, speed), w| {
            let (sin, cos) = (TAU * (w.cycles_per_m.dot(at) - w.hz * t + w.phase)).sin_cos();
            let k = w.cycles_per_m * TAU;
            let amplitude = w.amplitude_m * mean(k.x * half.x) * mean(k.y * half.y);
            (height + amplitude * cos, speed + amplitude * TAU * w.hz * sin)
        })
    }

    fn course(&self, t: f64) -> CourseState {
        CourseState {
            position: DVec2::new(0.0, self.speed_m_s * t),
            heading: 0.0,
            speed_m_s: self.speed_m_s,
            sway_m_s: 0.0,
            turn_rate: 0.0,
        }
    }

    /// The product's hull of this size.
    fn form(&self) -> HullForm {
        let half = self.rest_half_beam_m();
        HullForm::new((-LENGTH_M / 2.0, LENGTH_M / 2.0), self.draught_m, HALF_BEAM_M / half, |_| half)
    }

    /// How the product has the boat begin.
    pub fn start(&self) -> BoatState {
        let BoatMotion { at, rate } =
            BoatMotion::of_plane(&self.form(), |t| self.course(t), &self.waves, 0.0);
        [at.x, at.z, at.y, rate.x, rate.z, rate.y]
    }

    /// Motion by the product, so many times a second: heave, pitch, roll.
    pub fn ridden(&self, hz: usize, frames: usize) -> Vec<[f64; 3]> {
        let mut ride = SeakeepingState::new(self.form());
        let frame = |i: usize| {
            let t = i as f64 / hz as f64;
            ride.follow(t, |t| self.course(t), &self.waves);
            ride.at(t).map_or([f64::NAN; 3], |BoatMotion { at, .. }| [at.x, at.z, at.y])
        };
        (0..frames).map(frame).collect()
    }

    /// The boat in the mean plane of the water, without inertia.
    pub fn quasi_static(&self, t: f64) -> BoatState {
        // Trim and rise on the plane are constants that the strip model leaves out.
        let state = CourseState { speed_m_s: 0.0, ..self.course(t) };
        let hull = Hull { length_m: LENGTH_M, beam_m: 2.0 * self.rest_half_beam_m() };
        let pose = quasi_static(&state, &hull, &self.waves, t).pose;
        let pitch = (pose.world_from_body * DVec3::X).z.asin();
        [pose.position.z, pitch, (pose.world_from_body * DVec3::Y).z.asin(), 0.0, 0.0, 0.0]
    }
}

impl RigidSystem<6> for DrivenBoat {
    fn rate(&self, t: f64, y: &BoatState) -> BoatState {
        let [heave, pitch, roll, heave_rate, pitch_rate, roll_rate] = *y;
        let strip_m = LENGTH_M / STRIPS as f64;
        let rest = self.rest_half_beam_m();
        let lever = rest / 3f64.sqrt();
        // The metacentre by the waterplane, less the height of the centre of mass over that of buoyancy.
        let metacentre = 2.0 / 3.0 * rest.powi(3) / section(self.draught_m);
        let stiffness = 1.0 - (self.draught_m / 3.0 + 0.1 * 2.0 * rest) / metacentre;
        // A metre of wetted half beam and of length: the area of the triangle at rest is half beam times draught.
        let radiation = RADIATION * WATER_KG_M3 * self.draught_m / 2.0 * (GRAVITY / (2.0 * rest)).sqrt();
        let (mut force, mut moment, mut heel, mut added, mut added_inertia) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for i in 0..2 * STRIPS {
            let x = ((i as f64 / 2.0).floor() + 0.5 - STRIPS as f64 / 2.0) * strip_m;
            let side = if i % 2 == 0 { lever } else { -lever };
            let (water, water_speed) = self.water(x, side, t);
            let d = water - (heave + x * pitch.sin() + side * roll.sin() - self.draught_m);
            if d <= 0.0 {
                continue;
            }
            let b = half_beam(d);
            // Of the water against the hull, upwards; the hull's forward speed meets the bottom's slope.
            let up = water_speed
                - (heave_rate + x * pitch_rate * pitch.cos() + side * roll_rate * roll.cos())
                + self.speed_m_s * pitch.sin();
            let half_cylinder = 0.5 * WATER_KG_M3 * FRAC_PI_2 * b * b;
            let buoyancy = WATER_KG_M3 * GRAVITY * section(d) / 2.0;
            let mut flow = radiation * b * up + 0.5 * WATER_KG_M3 * CROSS_FLOW * b * up * up.abs();
            if up > 0.0 && b < HALF_BEAM_M {
                // Momentum that the widening wedge takes up (von Karman 1929): d(added mass)/dt times the speed.
                flow += WATER_KG_M3 * FRAC_PI_2 * b * up * up / DEADRISE;
            }
            force += (buoyancy + flow) * strip_m;
            moment += (buoyancy + flow) * strip_m * x;
            heel += (stiffness * buoyancy + flow) * strip_m * side;
            added += half_cylinder * strip_m;
            added_inertia += half_cylinder * strip_m * x * x;
        }
        let heave_acceleration = (force - MASS_KG * GRAVITY) / (MASS_KG + added);
        let pitch_acceleration = moment / (INERTIA_KG_M2 + added_inertia);
        [heave_rate, pitch_rate, roll_rate, heave_acceleration, pitch_acceleration, heel / ROLL_INERTIA_KG_M2]
    }

    fn depends_on_time(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_rest_on_flat_water_nothing_moves() {
        let boat = DrivenBoat::in_regular_waves(0.0, 3.0, 0.0);
        let rate = boat.rate(0.0, &[0.0; 6]);
        assert!(rate.iter().all(|r| r.abs() < 1e-9), "{rate:?}, draught {} m", boat.draught_m);
        let pushed = |i: usize, by: f64| {
            let mut state = [0.0; 6];
            state[i] = by;
            boat.rate(0.0, &state)[i + 3]
        };
        assert!(pushed(0, 0.1) < -0.5, "lifted, it falls");
        assert!(pushed(0, 2.0) == -GRAVITY, "out of the water, it falls freely");
        assert!(pushed(1, 0.1) < 0.0 && pushed(2, 0.1) < 0.0, "heeled or bow up, it rights itself");
    }

    #[test]
    fn long_waves_carry_it_as_the_quasi_static_boat_goes() {
        // A swell of 20 s: the boat follows the water.
        let boat = DrivenBoat::in_regular_waves(1.0, 20.0, 0.0);
        let mut y = boat.quasi_static(0.0);
        let h = 1.0 / 240.0;
        let mut worst = 0f64;
        for i in 0..240 * 60 {
            let t = f64::from(i) * h;
            y = super::super::system::runge_kutta(&boat, t, &y, h);
            if t > 30.0 {
                worst = worst.max((y[0] - boat.quasi_static(t + h)[0]).abs());
            }
        }
        assert!(worst < 0.02, "{worst} m off the water of a 1 m swell");
    }
}
