//! How the ship and the gun move: sums of sines with whole numbers of cycles in the recording, so that it loops without a
//! seam and every derivative is exact.

use std::f64::consts::TAU;

use bowwave_core::geometry::CameraPose;
use glam::{DMat3, DQuat, DVec2, DVec3};

/// Standard gravity, m/s^2 (CGPM 1901).
pub use crate::ocean::spectrum::GRAVITY;

/// One sine of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmonic {
    /// Whole cycles in the recording.
    pub cycles: u32,
    /// Amplitude, in the motion's unit.
    pub amplitude: f64,
    /// Phase at the start, radians.
    pub phase: f64,
}

/// A motion that repeats after the recording's length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Periodic {
    /// Mean value.
    pub mean: f64,
    /// Swings about it.
    pub harmonics: Vec<Harmonic>,
}

impl Periodic {
    /// A motion about `mean` made of (cycles, amplitude, phase).
    pub fn new(mean: f64, harmonics: &[(u32, f64, f64)]) -> Self {
        let harmonics = harmonics
            .iter()
            .map(|&(cycles, amplitude, phase)| Harmonic { cycles, amplitude, phase })
            .collect();
        Self { mean, harmonics }
    }

    /// Value, first and second derivative by time at `time_s`, for a period of `period_s` seconds.
    pub fn at(&self, time_s: f64, period_s: f64) -> [f64; 3] {
        let mut sum = [self.mean, 0.0, 0.0];
        for h in &self.harmonics {
            let omega = TAU * f64::from(h.cycles) / period_s;
            let (sin, cos) = (omega * time_s + h.phase).sin_cos();
            sum[0] += h.amplitude * sin;
            sum[1] += h.amplitude * omega * cos;
            sum[2] -= h.amplitude * omega * omega * sin;
        }
        sum
    }

    fn is_finite(&self) -> bool {
        self.mean.is_finite() && self.harmonics.iter().all(|h| h.amplitude.is_finite() && h.phase.is_finite())
    }
}

/// The ship under the mount. It has no way on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShipMotion {
    /// Heading, radians clockwise from north.
    pub heading: Periodic,
    /// Bow up, radians.
    pub pitch: Periodic,
    /// Starboard down, radians.
    pub roll: Periodic,
    /// Up, metres.
    pub heave: Periodic,
}

/// The gun on its mount.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GunMotion {
    /// Clockwise from the bow, radians.
    pub traverse: Periodic,
    /// Above the deck, radians.
    pub elevation: Periodic,
}

/// Ship and gun together: where the camera is and how it turns, at any time.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    ship: ShipMotion,
    gun: GunMotion,
    eye_height_m: f64,
    period_s: f64,
}

/// The camera's exact state at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionState {
    /// Place and attitude.
    pub pose: CameraPose,
    /// Angular rate in the camera's axes, rad/s.
    pub rate: DVec3,
    /// Acceleration in the world, gravity not included, m/s^2.
    pub acceleration: DVec3,
}

impl Motion {
    /// The motion of a camera `eye_height_m` above the mean sea, repeating after `period_s`.
    pub fn new(ship: ShipMotion, gun: GunMotion, eye_height_m: f64, period_s: f64) -> Self {
        Self { ship, gun, eye_height_m, period_s }
    }

    pub(super) fn is_finite(&self) -> bool {
        let Self { ship, gun, .. } = self;
        [&ship.heading, &ship.pitch, &ship.roll, &ship.heave, &gun.traverse, &gun.elevation]
            .iter()
            .all(|p| p.is_finite())
    }

    /// The ship's heading (clockwise from north), pitch (bow up) and roll (starboard down) `time_s` seconds after the recording's
    /// start, radians.
    pub fn ship_at(&self, time_s: f64) -> [f64; 3] {
        [&self.ship.heading, &self.ship.pitch, &self.ship.roll].map(|p| p.at(time_s, self.period_s)[0])
    }

    /// The state `time_s` seconds after the recording's start.
    pub fn at(&self, time_s: f64) -> MotionState {
        let gun = [&self.gun.traverse, &self.gun.elevation].map(|p| p.at(time_s, self.period_s));
        self.compose(time_s, gun)
    }

    /// The state where the gun is turned by traverse and elevation (radians) at these rates, whatever its own motion says.
    pub(crate) fn with_gun(&self, time_s: f64, angles: DVec2, rates: DVec2) -> MotionState {
        self.compose(time_s, [[angles.x, rates.x, 0.0], [angles.y, rates.y, 0.0]])
    }

    /// Second derivatives of the ship's heading, pitch and roll, rad/s^2.
    pub(crate) fn ship_accelerations(&self, time_s: f64) -> [f64; 3] {
        [&self.ship.heading, &self.ship.pitch, &self.ship.roll].map(|p| p.at(time_s, self.period_s)[2])
    }

    /// Most that the ship's roll or pitch is, radians.
    pub(crate) fn sway(&self) -> f64 {
        let most = |p: &Periodic| p.mean.abs() + p.harmonics.iter().map(|h| h.amplitude.abs()).sum::<f64>();
        most(&self.ship.roll).max(most(&self.ship.pitch))
    }

    /// The heading that the ship swings about, radians.
    pub(crate) const fn heading_mean(&self) -> f64 {
        self.ship.heading.mean
    }

    /// Turn from the deck (x to starboard, y to the bow, z up) to the world.
    pub(crate) fn world_from_deck(&self, time_s: f64) -> DQuat {
        let [heading, pitch, roll] = self.ship_at(time_s);
        let turn = DQuat::from_axis_angle;
        turn(DVec3::NEG_Z, heading) * turn(DVec3::X, pitch) * turn(DVec3::Y, roll)
    }

    fn compose(&self, time_s: f64, [traverse, elevation]: [[f64; 3]; 2]) -> MotionState {
        let value = |p: &Periodic| p.at(time_s, self.period_s);
        // From the world to the gun, each turn about an axis of the body so far (x right, y forward, z up).
        let chain = [
            (DVec3::NEG_Z, value(&self.ship.heading)),
            (DVec3::X, value(&self.ship.pitch)),
            (DVec3::Y, value(&self.ship.roll)),
            (DVec3::NEG_Z, traverse),
            (DVec3::X, elevation),
        ];
        let mut world_from_body = DQuat::IDENTITY;
        let mut rate = DVec3::ZERO;
        for (axis, [angle, angle_rate, _]) in chain {
            let turn = DQuat::from_axis_angle(axis, angle);
            world_from_body *= turn;
            rate = turn.inverse() * rate + axis * angle_rate;
        }
        // Camera axes in that body: x right, y down, z forward.
        let body_from_camera = DQuat::from_mat3(&DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y));
        let [heave, _, heave_acceleration] = value(&self.ship.heave);
        MotionState {
            pose: CameraPose {
                world_from_camera: (world_from_body * body_from_camera).normalize(),
                position: DVec3::new(0.0, 0.0, self.eye_height_m + heave),
            },
            rate: body_from_camera.inverse() * rate,
            acceleration: DVec3::Z * heave_acceleration,
        }
    }
}

#[cfg(test)]
mod tests {
    use bowwave_core::geometry::look;

    use super::*;

    fn tangled() -> Motion {
        let p = |mean, list: &[(u32, f64, f64)]| Periodic::new(mean, list);
        Motion::new(
            ShipMotion {
                heading: p(5.2, &[(1, 0.02, 0.3)]),
                pitch: p(0.01, &[(4, 0.03, 1.0)]),
                roll: p(0.0, &[(3, 0.09, 0.0), (4, 0.03, 2.0)]),
                heave: p(0.0, &[(3, 0.2, 0.7)]),
            },
            GunMotion { traverse: p(0.9, &[(2, 0.5, 0.0)]), elevation: p(-0.1, &[(3, 0.05, 0.5)]) },
            8.0,
            20.0,
        )
    }

    #[test]
    fn a_level_ship_gives_the_core_convention() {
        let gun = GunMotion { traverse: Periodic::new(0.4, &[]), elevation: Periodic::new(-0.2, &[]) };
        let ship = ShipMotion { heading: Periodic::new(0.7, &[]), ..ShipMotion::default() };
        let state = Motion::new(ship, gun, 8.0, 20.0).at(3.0);
        let expected = look(1.1, -0.2, 0.0);
        assert!(state.pose.world_from_camera.angle_between(expected) < 1e-12);
        assert_eq!(state.rate, DVec3::ZERO);
    }

    #[test]
    fn starboard_down_rolls_a_camera_that_looks_ahead_clockwise() {
        let ship = ShipMotion { roll: Periodic::new(0.1, &[]), ..ShipMotion::default() };
        let state = Motion::new(ship, GunMotion::default(), 8.0, 20.0).at(0.0);
        assert!(state.pose.world_from_camera.angle_between(look(0.0, 0.0, 0.1)) < 1e-12);
    }

    #[test]
    fn the_rate_is_the_derivative_of_the_attitude() {
        let motion = tangled();
        for i in 0..40 {
            let t = f64::from(i) * 0.51;
            let h = 1e-5;
            let (a, b) = (motion.at(t - h).pose.world_from_camera, motion.at(t + h).pose.world_from_camera);
            let numeric = (a.inverse() * b).to_scaled_axis() / (2.0 * h);
            assert!((numeric - motion.at(t).rate).length() < 1e-6, "at {t}");
            let z = |t: f64| motion.at(t).pose.position.z;
            let wide = 1e-3;
            let numeric = (z(t + wide) - 2.0 * z(t) + z(t - wide)) / (wide * wide);
            assert!((numeric - motion.at(t).acceleration.z).abs() < 1e-5, "at {t}");
        }
    }

    #[test]
    fn the_end_is_the_start() {
        let (start, end) = (tangled().at(0.0), tangled().at(20.0));
        assert!(start.pose.world_from_camera.angle_between(end.pose.world_from_camera) < 1e-7);
        assert!((start.rate - end.rate).length() < 1e-9);
    }
}
