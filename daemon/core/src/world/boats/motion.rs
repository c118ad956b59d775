//! How waves move a hull: heave, roll and pitch of its strips, stepped through time.
//!
//! A strip model (Korvin-Kroukovsky 1955, SNAME Transactions 63, 590, for the strips; von Karman 1929, NACA TN 321, for the blow of a
//! widening wedge): buoyancy, radiation, cross flow and slamming of each half of each strip in the undisturbed waves. Surge, sway and
//! yaw are the course's. Waves are averaged over a strip and over half the beam, so that those shorter than the hull do not move it.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use super::{
    course::CourseState,
    hull::{HullForm, STRIPS, WATER_KG_M3},
};
use crate::{geometry::ahead, physics::GRAVITY_M_S2, world::waves::WaveField};

/// Heave of the centre of buoyancy (metres, up from rest), roll (radians, port up) and pitch (radians, bow up), and their rates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoatMotion {
    /// Heave, roll, pitch.
    pub at: DVec3,
    /// Their changes a second.
    pub rate: DVec3,
}

impl BoatMotion {
    /// In the mean plane of the water under the hull, going along with it.
    pub fn of_plane(form: &HullForm, course: impl Fn(f64) -> CourseState, waves: &WaveField, t: f64) -> Self {
        const APART_S: f64 = 0.02;
        let at = |t: f64| {
            let state = course(t);
            let centre = state.position + ahead(state.heading) * form.centre_m;
            let (length, beam) = (form.strip_m * STRIPS as f64, 2.0 * form.half_beam_m);
            let plane = waves.plane_under(centre, state.heading, length, beam, t);
            DVec3::new(plane.height_m, plane.port_slope.atan(), plane.forward_slope.atan())
        };
        Self { at: at(t), rate: (at(t + APART_S) - at(t - APART_S)) / (2.0 * APART_S) }
    }

    /// Between two motions `span_s` apart, at `share` (0 to 1) of the way: the cubic with their rates.
    pub fn between(&self, next: &Self, span_s: f64, share: f64) -> Self {
        let (s, t) = (share, 1.0 - share);
        let at = self.at * (t * t * (1.0 + 2.0 * s))
            + next.at * (s * s * (1.0 + 2.0 * t))
            + (self.rate * (t * t * s) - next.rate * (s * s * t)) * span_s;
        Self { at, rate: self.rate.lerp(next.rate, share) }
    }
}

/// Height of the water and its rate at each strip of a hull: at the middle, and half the difference between port and starboard.
///
/// It is where the strips lie of a hull that lies level: of one that is pitched by five degrees the bow is ten millimetres further aft. So it
/// does not depend on the motion, and a step begins with what the one before has ended with: half of a step's time.
#[derive(Clone, Debug)]
pub(super) struct HullWater {
    middle: [[f64; 2]; STRIPS],
    side: [[f64; 2]; STRIPS],
}

/// Accelerations of a hull, and how fast damping alone would bring each rate to rest (1/s).
struct Forces {
    acceleration: DVec3,
    damping: DVec3,
}

impl HullForm {
    /// Distance from the middle at which both sides' water is taken, metres.
    fn reach_m(&self) -> f64 {
        self.half_beam_m / 3f64.sqrt()
    }

    /// Radiation damping a metre of wetted half beam and of length, kg/(m^2 s).
    fn radiation(&self) -> f64 {
        /// Radiation damping of a triangular section by its area, the water's density and the root of g over its beam, near its own
        /// frequency (of the order of the measurements of Vugts 1968, Int. Shipbuild. Prog. 15, 251).
        const RADIATION: f64 = 0.7;
        let beam_m = 2.0 * self.half_beam_m;
        0.5 * RADIATION * WATER_KG_M3 * self.draught_m * (GRAVITY_M_S2 / beam_m).sqrt()
    }

    /// The water under a hull on its course.
    pub(super) fn water(&self, course: &CourseState, waves: &WaveField, t: f64) -> HullWater {
        let forward = ahead(course.heading);
        let centre = course.position + forward * self.centre_m;
        let mut water = HullWater { middle: [[0.0; 2]; STRIPS], side: [[0.0; 2]; STRIPS] };
        let first_m = self.strips[0].x_m;
        for (factor, wave) in waves.waves_at(t) {
            let k = wave.cycles_per_m * TAU;
            let (along, across) = (k.dot(forward), k.dot(forward.perp()));
            // Mean over the strip's length and over each half beam.
            let half_step = 0.5 * along * self.strip_m;
            let (sin_half, cos_half) = half_step.sin_cos();
            let mean = ratio(sin_half, half_step) * {
                let half = 0.5 * across * self.half_beam_m;
                ratio(half.sin(), half)
            };
            let amplitude = factor * wave.amplitude_m * mean;
            let (sin_side, cos_side) = (across * self.reach_m()).sin_cos();
            let (mut sin, mut cos) = (wave.phase(centre, t) + along * first_m).sin_cos();
            let (sin_step, cos_step) = (2.0 * sin_half * cos_half, 1.0 - 2.0 * sin_half * sin_half);
            let rad_s = TAU * wave.hz;
            let (a_middle, a_side) = (amplitude * cos_side, amplitude * sin_side);
            for (middle, side) in water.middle.iter_mut().zip(&mut water.side) {
                middle[0] += a_middle * cos;
                middle[1] += a_middle * rad_s * sin;
                side[0] -= a_side * sin;
                side[1] += a_side * rad_s * cos;
                (sin, cos) = (sin * cos_step + cos * sin_step, cos * cos_step - sin * sin_step);
            }
        }
        water
    }

    fn forces(&self, course: &CourseState, motion: &BoatMotion, water: &HullWater) -> Forces {
        /// Cross-flow drag coefficient of a V section, about.
        const CROSS_FLOW: f64 = 1.0;
        let DVec3 { x: heave, y: roll, z: pitch } = motion.at;
        let ((sin_roll, cos_roll), (sin_pitch, cos_pitch)) = (roll.sin_cos(), pitch.sin_cos());
        let radiation = self.radiation();
        // Upwards, port up, bow up.
        let (mut force, mut damping) = (DVec3::new(-self.weight_n(), 0.0, 0.0), DVec3::ZERO);
        let (mut added_kg, mut added_kg_m2) = (0.0, 0.0);
        for ((strip, middle), side) in self.strips.iter().zip(&water.middle).zip(&water.side) {
            let height = heave + strip.x_m * sin_pitch - self.draught_m;
            let rise = motion.rate.x + strip.x_m * cos_pitch * motion.rate.z;
            for port in [-1.0, 1.0] {
                let lever = port * strip.lever_m;
                let share = lever / self.reach_m();
                let depth = middle[0] + share * side[0] - height - lever * sin_roll;
                if depth <= 0.0 {
                    continue;
                }
                // Of the water against the hull; the hull's way meets the bottom's slope.
                let up = middle[1] + share * side[1] - rise - lever * cos_roll * motion.rate.y
                    + course.speed_m_s * sin_pitch;
                let half_beam = strip.half_beam_m(depth);
                let lift = WATER_KG_M3 * GRAVITY_M_S2 * strip.half_area_m2(depth) * self.strip_m;
                let drag = 0.5 * WATER_KG_M3 * CROSS_FLOW * half_beam * up.abs();
                let blow = if up > 0.0 && half_beam < strip.chine_m {
                    // Momentum that the widening wedge takes up: the change of the added mass times the speed.
                    WATER_KG_M3 * FRAC_PI_2 * half_beam * up / strip.deadrise
                } else {
                    0.0
                };
                let resistance = radiation * half_beam + drag + blow;
                let moved = resistance * up * self.strip_m;
                force += DVec3::new(
                    lift + moved,
                    lever * (self.roll_stiffness * lift + moved),
                    strip.x_m * (lift + moved),
                );
                // Drag and blow go with the square of the speed.
                let slope = (resistance + drag + blow) * self.strip_m;
                damping += DVec3::new(1.0, lever * lever, strip.x_m * strip.x_m) * slope;
                let half_cylinder = 0.5 * WATER_KG_M3 * FRAC_PI_2 * half_beam * half_beam * self.strip_m;
                added_kg += half_cylinder;
                added_kg_m2 += half_cylinder * strip.x_m * strip.x_m;
            }
        }
        let inertia = DVec3::new(
            self.mass_kg + added_kg,
            self.roll_inertia_kg_m2,
            self.pitch_inertia_kg_m2 + added_kg_m2,
        );
        Forces { acceleration: force / inertia, damping: damping / inertia }
    }

    /// One step of `h` seconds, course and water given at its begin and end.
    ///
    /// Heun's method whose speeds are taken implicitly in their own damping: the two-stage W method of Verwer et al. 1999 (SIAM J. Sci.
    /// Comput. 20, 1456, eq. 1.3), of order 2 whatever stands for the Jacobian. Where nothing is stiff it is Heun's method; where a slam
    /// would throw that one off, it stays.
    pub(super) fn step(
        &self,
        courses: [&CourseState; 2],
        waters: [&HullWater; 2],
        motion: &BoatMotion,
        h: f64,
    ) -> BoatMotion {
        /// 1 - 1 / sqrt 2: makes [`step`] L-stable in a damping that is known.
        const GAMMA: f64 = 0.292_893_218_813_452_4;
        let now = self.forces(courses[0], motion, waters[0]);
        let first = |damping: DVec3| now.acceleration / (DVec3::ONE + damping * (GAMMA * h));
        let ahead =
            BoatMotion { at: motion.at + motion.rate * h, rate: motion.rate + first(now.damping) * h };
        let then = self.forces(courses[1], &ahead, waters[1]);
        // A hull that strikes the water within the step is damped there, not before.
        let damping = now.damping.max(then.damping);
        let one = first(damping);
        let two = (then.acceleration - 2.0 * one) / (DVec3::ONE + damping * (GAMMA * h));
        BoatMotion {
            at: motion.at + motion.rate * h + one * (0.5 * h * h),
            rate: motion.rate + one * (1.5 * h) + two * (0.5 * h),
        }
    }

    /// Whether a motion is one that a boat can have on a sea with crests of that height, and so is all [`BoatMotion::between`] it and
    /// another such one `span_s` apart; else the numbers have gone wrong.
    pub(super) fn is_sane(&self, motion: &BoatMotion, crest_m: f64, span_s: f64) -> bool {
        let reach = crest_m + 3.0 + 2.0 * self.draught_m + self.strip_m * STRIPS as f64;
        // Between places within bounds a cubic passes them by a quarter of what the greater rate makes of the span, at most.
        let farthest = motion.at.abs() + motion.rate.abs() * (0.25 * span_s);
        farthest.x < reach && farthest.y < 0.4 * PI && farthest.z < 0.4 * PI && motion.rate.is_finite()
    }
}

/// sin a / a, given both.
fn ratio(sine: f64, a: f64) -> f64 {
    if a.abs() < 1e-4 { 1.0 - a * a / 6.0 } else { sine / a }
}
