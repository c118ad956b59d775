//! The sea: scales of its state (two different ones) and the optics of its surface.

mod optics;

pub use optics::{Facets, SEA_INDEX, fresnel, mean_square_slope, rms_slope};

/// Beaufort wind force, 0 to 12 (WMO-No. 306, code table 1100). What the thesis calls "sea state" 0-4 is this scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BeaufortForce(u8);

/// WMO sea state, 0 to 9 (WMO-No. 306, code table 3700): a class of significant wave height, not of wind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WmoSeaState(u8);

/// Least wind of each force 0 to 12, 10 m above the sea, m/s (WMO-No. 306, code table 1100).
const FORCE_FROM_M_S: [f64; 13] = [0.0, 0.3, 1.6, 3.4, 5.5, 8.0, 10.8, 13.9, 17.2, 20.8, 24.5, 28.5, 32.7];
/// Probable height of the waves of each force on the open sea, metres (WMO-No. 306, code table 1100).
const FORCE_WAVES_M: [f64; 13] = [0.0, 0.1, 0.2, 0.6, 1.0, 2.0, 3.0, 4.0, 5.5, 7.0, 9.0, 11.5, 14.0];
/// Least significant wave height of each state 0 to 9, metres (WMO-No. 306, code table 3700).
const STATE_FROM_M: [f64; 10] = [0.0, 0.0, 0.1, 0.5, 1.25, 2.5, 4.0, 6.0, 9.0, 14.0];

impl BeaufortForce {
    /// `None` above 12.
    pub fn new(force: u8) -> Option<Self> {
        (force <= 12).then_some(Self(force))
    }

    /// The number, 0 to 12.
    pub const fn get(self) -> u8 {
        self.0
    }

    /// The force of a wind of `wind_m_s`, 10 m above the sea; force 0 for what is no speed.
    pub fn of_wind(wind_m_s: f64) -> Self {
        Self(last_reached(&FORCE_FROM_M_S, wind_m_s))
    }

    /// Winds of this force, m/s: the least, and the least of the next force (infinite for force 12).
    pub fn wind_range_m_s(self) -> (f64, f64) {
        range_of(&FORCE_FROM_M_S, self.0)
    }

    /// The wind that stands for this force, m/s 10 m above the sea: 0.836 B^1.5 (WMO Marine Science Affairs report 3, 1970).
    pub fn wind_mean_m_s(self) -> f64 {
        0.836 * f64::from(self.0).powf(1.5)
    }

    /// Probable height of the waves on the open sea, metres (WMO-No. 306, code table 1100).
    pub fn probable_wave_height_m(self) -> f64 {
        FORCE_WAVES_M.get(usize::from(self.0)).copied().unwrap_or_default()
    }
}

impl WmoSeaState {
    /// `None` above 9.
    pub fn new(state: u8) -> Option<Self> {
        (state <= 9).then_some(Self(state))
    }

    /// The number, 0 to 9.
    pub const fn get(self) -> u8 {
        self.0
    }

    /// The state with a significant wave height of `height_m`: 0 only for a glassy sea, 1 up to 0.1 m.
    pub fn of_wave_height(height_m: f64) -> Self {
        if height_m > 0.0 { Self(last_reached(&STATE_FROM_M, height_m)) } else { Self(0) }
    }

    /// Significant wave heights of this state, metres: the least, and the least of the next state (infinite for 9).
    pub fn wave_height_range_m(self) -> (f64, f64) {
        range_of(&STATE_FROM_M, self.0)
    }
}

/// Index of the last class whose lower end `value` reaches; 0 where it reaches none.
fn last_reached(lower_ends: &[f64], value: f64) -> u8 {
    let reached = lower_ends.iter().filter(|&&end| end <= value).count();
    u8::try_from(reached.saturating_sub(1)).unwrap_or(u8::MAX)
}

fn range_of(lower_ends: &[f64], class: u8) -> (f64, f64) {
    let end = |i: usize| lower_ends.get(i).copied().unwrap_or(f64::INFINITY);
    (end(usize::from(class)), end(usize::from(class) + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_force_and_state_lies_in_its_own_class() {
        for n in 0..=12 {
            let force = BeaufortForce::new(n).expect("on the scale");
            let (from, to) = force.wind_range_m_s();
            assert!((from..to).contains(&force.wind_mean_m_s()), "force {n}: {from} to {to} m/s");
            assert_eq!(BeaufortForce::of_wind(from), force);
            assert_eq!(BeaufortForce::of_wind(force.wind_mean_m_s()), force);
        }
        for n in 0..=9 {
            let state = WmoSeaState::new(n).expect("on the scale");
            let (from, to) = state.wave_height_range_m();
            let middle = if to.is_finite() { (from + to) / 2.0 } else { from + 1.0 };
            assert_eq!(WmoSeaState::of_wave_height(middle), state, "{from} to {to} m");
        }
        assert!(BeaufortForce::new(13).is_none() && WmoSeaState::new(10).is_none());
    }

    #[test]
    fn values_off_the_scales_take_its_ends() {
        for (value, force, state) in [(f64::NAN, 0, 0), (-1.0, 0, 0), (1e9, 12, 9), (f64::INFINITY, 12, 9)] {
            assert_eq!(BeaufortForce::of_wind(value).get(), force, "{value} m/s");
            assert_eq!(WmoSeaState::of_wave_height(value).get(), state, "{value} m");
        }
    }

    #[test]
    fn the_two_scales_agree_where_the_wmo_prints_them_side_by_side() {
        // Handbooks give for a fully arisen sea: force 4 state 3, force 6 state 5, force 8 state 6.
        for (force, state) in [(0, 0), (2, 2), (4, 3), (6, 5), (8, 6), (12, 9)] {
            let height = BeaufortForce::new(force).expect("on the scale").probable_wave_height_m();
            let got = WmoSeaState::of_wave_height(height).get();
            assert_eq!(got, state, "force {force}: {height} m");
        }
    }
}
