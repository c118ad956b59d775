//! Whether the filter errs by what it says, watched while it runs.

use glam::DVec2;

/// Differences are averaged over this long, seconds: longer than a wave.
const MEAN_S: f64 = 10.0;
/// Mean normalised innovation squared of two degrees of freedom, whose mean is two, that chance does not explain.
const NIS_MOST: f64 = 8.0;
/// So far from plain VQF in the mean is too far, radians, beside so many of the filter's own deviations: waves and a wrong scale make VQF err
/// by less in the mean.
const APART_MOST: f64 = 3f64.to_radians();
const DEVIATIONS: f64 = 3.0;

/// Running means of how the filter differs from what it expects and from plain VQF.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Consistency {
    nis: f64,
    apart: DVec2,
}

impl Consistency {
    /// Takes in the normalised innovation squared of `since_s` seconds, what VQF's direction of up lies beside the filter's (radians, the
    /// world's axes) and the filter's variance on an axis. `false` where it errs by more than it says.
    pub fn holds(&mut self, nis: f64, apart: DVec2, variance: f64, since_s: f64) -> bool {
        let share = (since_s / MEAN_S).min(1.0);
        // One surprise is no reason: what is left out by a gate counts as much as a few.
        self.nis += (nis.min(10.0 * NIS_MOST) - self.nis) * share;
        self.apart += (apart - self.apart) * share;
        self.nis <= NIS_MOST && self.apart.length() <= APART_MOST + DEVIATIONS * variance.max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_are_no_reason_but_what_stays_is() {
        let run = |nis: f64, apart: &dyn Fn(f64) -> DVec2, variance: f64| {
            let mut consistency = Consistency::default();
            (0..600).all(|i| consistency.holds(nis, apart(f64::from(i) * 0.1), variance, 0.1))
        };
        let wave = |t: f64| DVec2::X * 0.06 * (0.6 * t).sin();
        let off = |_: f64| DVec2::Y * 0.1;
        assert!(run(2.0, &wave, 1e-6));
        assert!(!run(2.0, &off, 1e-6));
        assert!(run(2.0, &off, 1e-3), "it says itself that it may err so");
        assert!(!run(9.0, &|_| DVec2::ZERO, 1e-6));
    }
}
