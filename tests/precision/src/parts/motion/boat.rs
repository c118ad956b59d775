//! A test problem: heave and pitch of a 7 m planing hull that slams, by strips. It has the size, weight, deadrise, number of
//! strips and kinds of force of data/boat_heave_pitch_work_precision.csv; it stands for such boats and is no validated one.

use std::f64::consts::{FRAC_PI_2, TAU};

use bowwave_core::{
    boats::{CourseState, Hull, float},
    sea::{Wave, WaveField},
};
use glam::{DVec2, DVec3};

use super::system::System;

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
/// Radiation damping of the wetted beam, kg/(m^2 s) a metre of length.
const RADIATION: f64 = 250.0;

/// What the boat meets.
#[derive(Clone, Debug)]
pub struct Boat {
    /// The sea.
    pub waves: WaveField,
    /// Speed northwards, m/s.
    pub speed_m_s: f64,
    /// Draught of the keel at rest, metres.
    draught_m: f64,
}

/// Heave of the middle (metres, up from rest), pitch (radians, bow up), and their rates.
pub type State = [f64; 4];

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

impl Boat {
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

    /// Height of the water and its vertical speed, by the waves' own formula.
    fn water(&self, x: f64, t: f64) -> (f64, f64) {
        let at = DVec2::new(0.0, x + self.speed_m_s * t);
        self.waves.waves().iter().fold((0.0, 0.0), |(height, speed), w| {
            let (sin, cos) = (TAU * (w.cycles_per_m.dot(at) - w.hz * t + w.phase)).sin_cos();
            (height + w.amplitude_m * cos, speed + w.amplitude_m * TAU * w.hz * sin)
        })
    }

    /// What the product shows: the boat in the mean plane of the water, without inertia.
    pub fn quasi_static(&self, t: f64) -> State {
        let state = CourseState {
            position: DVec2::new(0.0, self.speed_m_s * t),
            heading: 0.0,
            // Trim and rise on the plane are constants that the strip model leaves out.
            speed_m_s: 0.0,
            turn_rate: 0.0,
        };
        let hull = Hull { length_m: LENGTH_M, beam_m: 2.0 * HALF_BEAM_M };
        let pose = float(&state, &hull, &self.waves, t).pose;
        [pose.position.z, (pose.world_from_body * DVec3::X).z.asin(), 0.0, 0.0]
    }
}

impl System<4> for Boat {
    fn rate(&self, t: f64, y: &State) -> State {
        let [heave, pitch, heave_rate, pitch_rate] = *y;
        let strip_m = LENGTH_M / STRIPS as f64;
        let (mut force, mut moment, mut added, mut added_inertia) = (0.0, 0.0, 0.0, 0.0);
        for i in 0..STRIPS {
            let x = ((i as f64 + 0.5) / STRIPS as f64 - 0.5) * LENGTH_M;
            let (water, water_speed) = self.water(x * pitch.cos(), t);
            let d = water - (heave + x * pitch.sin() - self.draught_m);
            if d <= 0.0 {
                continue;
            }
            let b = half_beam(d);
            // Of the water against the hull, upwards; the hull's forward speed meets the bottom's slope.
            let up = water_speed - (heave_rate + x * pitch_rate * pitch.cos()) + self.speed_m_s * pitch.sin();
            let half_cylinder = WATER_KG_M3 * FRAC_PI_2 * b * b;
            let mut pressure = WATER_KG_M3 * GRAVITY * section(d)
                + RADIATION * 2.0 * b * up
                + 0.5 * WATER_KG_M3 * CROSS_FLOW * 2.0 * b * up * up.abs();
            if up > 0.0 && b < HALF_BEAM_M {
                // Momentum that the widening wedge takes up (von Karman 1929): d(added mass)/dt times the speed.
                pressure += WATER_KG_M3 * std::f64::consts::PI * b * up * up / DEADRISE;
            }
            force += pressure * strip_m;
            moment += pressure * strip_m * x;
            added += half_cylinder * strip_m;
            added_inertia += half_cylinder * strip_m * x * x;
        }
        let heave_acceleration = (force - MASS_KG * GRAVITY) / (MASS_KG + added);
        [heave_rate, pitch_rate, heave_acceleration, moment / (INERTIA_KG_M2 + added_inertia)]
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
        let boat = Boat::in_regular_waves(0.0, 3.0, 0.0);
        let rate = boat.rate(0.0, &[0.0; 4]);
        assert!(rate.iter().all(|r| r.abs() < 1e-9), "{rate:?}, draught {} m", boat.draught_m);
        assert!(boat.rate(0.0, &[0.1, 0.0, 0.0, 0.0])[2] < -0.5, "lifted, it falls");
        assert!(boat.rate(0.0, &[2.0, 0.0, 0.0, 0.0])[2] == -GRAVITY, "out of the water, it falls freely");
        assert!(boat.rate(0.0, &[0.0, 0.1, 0.0, 0.0])[3] < 0.0, "bow up, it rights itself");
    }

    #[test]
    fn long_waves_carry_it_as_the_quasi_static_boat_goes() {
        // A swell of 20 s: the boat follows the water.
        let boat = Boat::in_regular_waves(1.0, 20.0, 0.0);
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
