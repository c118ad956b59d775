//! Effect of constant errors of rate and of specific force on an inclination that follows specific force with a lag.

use std::f64::consts::SQRT_2;

use glam::DMat3;

/// VQF's inclination is specific force, in axes that its rates turn, through Butterworth's low-pass filter of the second order (Laidig & Seel
/// 2023, section 3.2): `w'' + sqrt(2) c w' + c^2 (w - u) = 0` with `c = sqrt(2) / tau`. What is constant in the unit's axes turns with
/// the unit, so that it comes through as it lay some seconds ago; and what the rates turn too far is felt until the filter has followed.
/// Both are linear in the error, and what multiplies it is kept here.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lag {
    /// Frequency of the filter's corner, rad/s.
    corner: f64,
    axes: Followed,
    screw: Followed,
}

/// An input through the filter, and the integral of what the filter has left of it.
#[derive(Clone, Copy, Debug)]
struct Followed {
    through: DMat3,
    behind: DMat3,
}

impl Lag {
    /// One of that time constant that has seen nothing yet.
    pub fn new(tau_s: f64) -> Self {
        Self { corner: SQRT_2 / tau_s, axes: Followed::NOTHING, screw: Followed::NOTHING }
    }

    /// Goes on by `dt_s` seconds: the integral over them of the unit's axes in the world, and of these times the rate about its upright
    /// axis.
    pub fn step(&mut self, axes: DMat3, screw: DMat3, dt_s: f64) {
        self.axes.step(self.corner, axes, dt_s);
        self.screw.step(self.corner, screw, dt_s);
    }

    /// The world is turned, and what is kept in its axes with it.
    pub fn turn(&mut self, turn: DMat3) {
        for followed in [&mut self.axes, &mut self.screw] {
            followed.through = turn * followed.through;
            followed.behind = turn * followed.behind;
        }
    }

    /// The upright axis is another.
    pub fn forget_screw(&mut self) {
        self.screw = Followed::NOTHING;
    }

    /// Where specific force that is too large by one along the unit's axes shows, in the world.
    pub fn axes(&self) -> DMat3 {
        self.axes.through
    }

    /// By how much a rate that is too large by one about these axes has turned the axes that the filter works in, since what it shows, seconds.
    pub fn behind(&self) -> DMat3 {
        self.axes.behind
    }

    /// The same for a rate that is too large by the rate about the upright axis.
    pub fn screwed(&self) -> DMat3 {
        self.screw.behind
    }
}

impl Followed {
    const NOTHING: Self = Self { through: DMat3::ZERO, behind: DMat3::ZERO };

    /// The trapezoidal rule on `behind' = u - through` and `through' = c^2 behind - sqrt(2) c through`, `input` being the integral of `u`.
    fn step(&mut self, corner: f64, input: DMat3, dt_s: f64) {
        let half = 0.5 * dt_s;
        let (pulled, damped) = (corner * corner * half, SQRT_2 * corner * half);
        let behind = self.behind + input - self.through * half;
        let through = self.through * (1.0 - damped) + self.behind * pulled;
        self.through = (through + behind * pulled) * (1.0 / (1.0 + damped + pulled * half));
        self.behind = behind - self.through * half;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn follows_what_stays_and_lags_by_the_time_constant() {
        let mut lag = Lag::new(10.0);
        let axes = DMat3::from_rotation_x(0.3);
        lag.step(axes * 0.1, DMat3::ZERO, 0.1);
        assert!(lag.axes().abs_diff_eq(DMat3::ZERO, 1e-3), "it cannot follow at once: {}", lag.axes());
        for dt_s in [0.1, 0.25].into_iter().cycle().take(1000) {
            lag.step(axes * dt_s, DMat3::ZERO, dt_s);
        }
        assert!(lag.axes().abs_diff_eq(axes, 1e-6), "{}", lag.axes());
        assert!(lag.behind().abs_diff_eq(axes * 10.0, 1e-5), "{}", lag.behind());
        assert_eq!(lag.screwed(), DMat3::ZERO);
    }
}
