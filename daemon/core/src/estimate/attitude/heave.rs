//! How waves make an inclination err: to and fro, and by nothing in the mean.

use glam::DMat2;

/// Waves carry a gun away and bring it back, so that specific force through a low-pass filter errs by what is the slope of something that
/// stays: `x'' + 2 z w x' + w^2 x = noise`, whose slope `x'` has nothing at the lowest frequencies. A filter that takes it for what forgets
/// itself in the same time holds a gun that no camera helps three times worse.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeaveAcceleration {
    /// Frequency without damping, rad/s.
    frequency: f64,
}

/// Share of critical damping: the band is about as wide as it is high.
const DAMPING: f64 = 0.5;
/// The frequency times the time constant of the filter that waves come through. From 4 to 9 the simulated gun's error changes by a third.
const FREQUENCY_TAUS: f64 = 5.0;

impl HeaveAcceleration {
    /// Of an inclination with that time constant.
    pub fn new(tau_s: f64) -> Self {
        Self { frequency: FREQUENCY_TAUS / tau_s }
    }

    /// Variance of what has the slope, where that of the slope is one.
    pub fn place_variance(self) -> f64 {
        self.frequency.powi(-2)
    }

    /// What `(x, x')` becomes in `dt_s` seconds, and the covariance of what chance adds where the slope's variance stays one.
    pub fn step(self, dt_s: f64) -> (DMat2, DMat2) {
        let w = self.frequency;
        let damped = w * (1.0 - DAMPING * DAMPING).sqrt();
        let (sin, cos) = (damped * dt_s).sin_cos();
        let (fades, sin) = ((-DAMPING * w * dt_s).exp(), sin / damped);
        let change =
            DMat2::from_cols_array(&[cos + DAMPING * w * sin, -w * w * sin, sin, cos - DAMPING * w * sin])
                * fades;
        let stays = DMat2::from_diagonal(glam::DVec2::new(self.place_variance(), 1.0));
        (change, stays - change * stays * change.transpose())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_steps_are_one_of_twice_the_length() {
        let heave = HeaveAcceleration::new(10.0);
        let ((half, added), (whole, all)) = (heave.step(0.2), heave.step(0.4));
        assert!((half * half).abs_diff_eq(whole, 1e-12), "{whole}");
        assert!((half * added * half.transpose() + added).abs_diff_eq(all, 1e-12), "{all}");
        assert!(added.determinant() > 0.0 && all.y_axis.y > added.y_axis.y, "{added} {all}");
        // The slope is the slope.
        let (change, _) = heave.step(1e-6);
        assert!((change.y_axis.x - 1e-6).abs() < 1e-11, "{change}");
    }
}
