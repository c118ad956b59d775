//! Which sea is drawn: the measured one, steadied, or the one that the operator orders.

use super::{MeasuredValue, SeaEstimate, Unknown, summary::wind_m_s};
use crate::sea::WmoSeaState;

/// Conditions that a sea is made from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeaConditions {
    /// Four standard deviations of the water's height, metres.
    pub significant_height_m: f64,
    /// Period at the spectrum's peak, seconds.
    pub peak_period_s: f64,
    /// Where the waves come from, radians clockwise from north.
    pub from_rad: f64,
}

impl SeaConditions {
    /// Wind that would raise such waves (Toba 1972), m/s 10 m above the sea.
    pub fn wind_m_s(&self) -> f64 {
        wind_m_s(self.significant_height_m, self.peak_period_s)
    }
}

/// Order of the operator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum SeaOrder {
    /// The measured sea.
    #[default]
    Measured,
    /// These conditions, whatever is measured.
    Conditions(SeaConditions),
    /// The measured sea, scaled to the middle of this state.
    State(WmoSeaState),
}

/// Where the conditions in use come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SeaSource {
    /// The operator.
    Ordered,
    /// The newest estimate is among them.
    Measured,
    /// Estimates of before; the newest look told nothing.
    Kept,
    /// The scenario: nothing was measured yet.
    Assumed,
}

/// The sea in use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeaInUse {
    /// Height, period, direction.
    pub conditions: SeaConditions,
    /// Its state, which does not flicker at borders.
    pub state: WmoSeaState,
    /// Where it comes from.
    pub source: SeaSource,
}

/// Follows estimates and orders.
#[derive(Clone, Copy, Debug)]
pub struct SeaFollower {
    order: SeaOrder,
    conditions: SeaConditions,
    state: WmoSeaState,
    source: SeaSource,
    waiting: (WmoSeaState, u32),
}

impl SeaFollower {
    /// Begins with the sea that the scenario assumes.
    pub fn new(assumed: SeaConditions) -> Self {
        let state = WmoSeaState::of_wave_height(assumed.significant_height_m);
        Self {
            order: SeaOrder::Measured,
            conditions: assumed,
            state,
            source: SeaSource::Assumed,
            waiting: (state, 0),
        }
    }

    /// The operator decides.
    pub fn order(&mut self, order: SeaOrder) {
        self.order = order;
    }

    /// Takes a new outcome of the meter in; call it once per outcome.
    pub fn update(&mut self, outcome: &Result<SeaEstimate, Unknown>) {
        /// Share of a new estimate in the conditions in use.
        const SHARE: f64 = 0.35;
        let Ok(estimate) = outcome else {
            if self.source == SeaSource::Measured {
                self.source = SeaSource::Kept;
            }
            return;
        };
        let first = self.source == SeaSource::Assumed;
        let share = if first { 1.0 } else { SHARE };
        let blend = |old: f64, new: f64| old + (new - old) * share;
        let c = &mut self.conditions;
        c.significant_height_m = blend(c.significant_height_m, estimate.significant_height_m.value);
        c.peak_period_s = blend(c.peak_period_s, estimate.peak_period_s.value);
        let MeasuredValue { value: from, sigma } = estimate.direction_from_rad;
        if sigma < 1.0 {
            let turn = (from - c.from_rad + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU)
                - std::f64::consts::PI;
            c.from_rad = (c.from_rad + turn * share).rem_euclid(std::f64::consts::TAU);
        }
        self.settle(first);
        self.source = SeaSource::Measured;
    }

    /// Lets the state follow the height, not at once at a border.
    fn settle(&mut self, first: bool) {
        /// A height must lie this share beyond the border of a state to change it at once.
        const BEYOND: f64 = 0.15;
        /// Successive estimates of a new state that change it however near the border they lie.
        const AGREE: u32 = 3;
        let height = self.conditions.significant_height_m;
        let seen = WmoSeaState::of_wave_height(height);
        if seen == self.state {
            self.waiting.1 = 0;
            return;
        }
        self.waiting = if self.waiting.0 == seen { (seen, self.waiting.1 + 1) } else { (seen, 1) };
        let (low, high) = self.state.wave_height_range_m();
        let clear = height > high * (1.0 + BEYOND) || height < low * (1.0 - BEYOND);
        if first || clear || self.waiting.1 >= AGREE {
            self.state = seen;
            self.waiting.1 = 0;
        }
    }

    /// The sea in use.
    pub fn in_use(&self) -> SeaInUse {
        let mut conditions = self.conditions;
        let (state, source) = match self.order {
            SeaOrder::Measured => (self.state, self.source),
            SeaOrder::Conditions(ordered) => {
                conditions = ordered;
                (WmoSeaState::of_wave_height(ordered.significant_height_m), SeaSource::Ordered)
            }
            SeaOrder::State(state) => {
                scale_to(&mut conditions, state);
                (state, SeaSource::Ordered)
            }
        };
        SeaInUse { conditions, state, source }
    }
}

/// Gives conditions the height in the middle of a state, and the period along with it at the same steepness.
fn scale_to(conditions: &mut SeaConditions, state: WmoSeaState) {
    let (low, high) = state.wave_height_range_m();
    let middle = if state.get() == 0 {
        0.0
    } else if high.is_finite() {
        0.5 * (low + high)
    } else {
        1.1 * low
    };
    let old = conditions.significant_height_m;
    conditions.significant_height_m = middle;
    // From next to nothing there is no steepness to keep: the one of an arisen sea, T = 4.65 sqrt(H).
    let period =
        if old > 0.05 { conditions.peak_period_s * (middle / old).sqrt() } else { 4.65 * middle.sqrt() };
    conditions.peak_period_s = period.clamp(1.0, 25.0);
}
