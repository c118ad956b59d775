//! When the waves go over to a sea that was measured.

use super::waves::{CHANGE_S, Spectrum, WaveSpec};
use crate::estimate::sea::SeaConditions;

/// Changes of the sea that waves are made anew for: shares of height and period, radians.
const CHANGED: (f64, f64, f64) = (0.04, 0.02, 0.05);
/// Mean peak enhancement of JONSWAP (Hasselmann 1973): what the picture does not tell.
const GAMMA: f64 = 3.3;

/// The conditions that the waves are made of, and when they may change next.
#[derive(Clone, Copy, Debug)]
pub(super) struct SeaChange {
    drawn: SeaConditions,
    changes_from_s: f64,
}

impl SeaChange {
    /// Waves of `spec`, which may change at any time.
    pub fn new(spec: &WaveSpec) -> Self {
        Self { drawn: conditions_of(spec), changes_from_s: f64::NEG_INFINITY }
    }

    /// The waves to go over to from `now_s` on; `None` where `measured` is about the sea that is drawn, or the last change is not over.
    pub fn next(&mut self, measured: &SeaConditions, now_s: f64) -> Option<WaveSpec> {
        if now_s < self.changes_from_s || !differs(&self.drawn, measured) {
            return None;
        }
        self.drawn = *measured;
        self.changes_from_s = now_s + CHANGE_S;
        let (height, period) = (measured.significant_height_m, measured.peak_period_s);
        let spectrum = Spectrum::jonswap(height.clamp(0.0, 20.0), period.clamp(0.5, 30.0), GAMMA);
        Some(WaveSpec { spectrum: spectrum.unwrap_or(Spectrum::FLAT), wind_from: measured.from_rad })
    }
}

/// Height, period and direction of the waves of `spec`.
pub(super) fn conditions_of(spec: &WaveSpec) -> SeaConditions {
    SeaConditions {
        significant_height_m: spec.spectrum.significant_height_m(),
        peak_period_s: spec.spectrum.peak_period_s(),
        from_rad: spec.wind_from,
    }
}

fn differs(a: &SeaConditions, b: &SeaConditions) -> bool {
    let height = (a.significant_height_m - b.significant_height_m).abs();
    let period = (a.peak_period_s - b.peak_period_s).abs();
    height > CHANGED.0 * a.significant_height_m.max(0.1)
        || period > CHANGED.1 * a.peak_period_s
        || (a.from_rad - b.from_rad).sin().abs() > CHANGED.2
        || (a.from_rad - b.from_rad).cos() < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_change_once_they_differ_and_not_before_the_last_change_is_over() {
        let spec =
            WaveSpec { spectrum: Spectrum::jonswap(1.0, 6.0, GAMMA).expect("in range"), wind_from: 0.3 };
        let mut change = SeaChange::new(&spec);
        let drawn = conditions_of(&spec);
        assert!(change.next(&drawn, 5.0).is_none());
        let higher = SeaConditions { significant_height_m: 1.2, ..drawn };
        let next = change.next(&higher, 5.0).expect("it differs");
        assert!((next.spectrum.significant_height_m() - 1.2).abs() < 1e-12 && next.wind_from == 0.3);
        let highest = SeaConditions { significant_height_m: 1.5, ..drawn };
        assert!(change.next(&highest, 5.0 + 0.9 * CHANGE_S).is_none());
        assert!(change.next(&highest, 5.0 + CHANGE_S).is_some());
    }
}
