//! Running means of what is watched.

use std::ops::{AddAssign, Mul, Sub};

use glam::DVec3;

/// Deviation of the rate at which the sea and what swims on it move by themselves in the picture, rad/s: waves go by at 10 m/s some hundred
/// metres off.
pub(super) const SEA_RATE: f64 = 1.0 * std::f64::consts::PI / 180.0;

/// Mean of values: of all of them at first, later of about the last `MOST`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RecentMean<T, const MOST: u32> {
    pub(super) mean: T,
    pub(super) count: u32,
}

impl<T: Copy + AddAssign + Sub<Output = T> + Mul<f64, Output = T>, const MOST: u32> RecentMean<T, MOST> {
    pub(super) fn take(&mut self, value: T) {
        self.count = (self.count + 1).min(MOST);
        self.mean += (value - self.mean) * (1.0 / f64::from(self.count));
    }

    pub(super) const fn is_full(&self) -> bool {
        self.count >= MOST
    }
}

/// The mean of turns, over some ten seconds.
pub(super) type MeanOff = RecentMean<DVec3, 100>;
/// The same over some two: a ship's turn moves it by a degree in ten, late pictures move it to and fro with the waves.
pub(super) type MeanSway = RecentMean<DVec3, 20>;
/// Age of that mean: from the middle of its seconds.
pub(super) const SWAY_AGE_S: f64 = 1.0;

impl<const MOST: u32> RecentMean<DVec3, MOST> {
    pub(super) const NOTHING: Self = Self { mean: DVec3::ZERO, count: 0 };

    /// Takes in a turn; what it differs from the mean before by.
    pub(super) fn take_apart(&mut self, off: DVec3) -> f64 {
        let apart = if self.count == 0 { 0.0 } else { off.distance(self.mean) };
        self.take(off);
        apart
    }
}

/// Mean difference of turns of the picture from expected ones over some ten seconds, rad/s: waves go by the same way for as long as a ship
/// holds its course, or turns.
pub(super) type SeaDrift = RecentMean<DVec3, 50>;

impl SeaDrift {
    /// Takes in a turn's difference; the sea's drift in it by those before.
    pub(super) fn take_in(&mut self, off: DVec3) -> DVec3 {
        /// Deviations of the sea's movement that it may be.
        const MOST: f64 = 1.5;
        let known = f64::from(self.count) / f64::from(self.count + 1);
        let drift = (self.mean * known).clamp_length_max(MOST * SEA_RATE);
        self.take(off);
        drift
    }
}

/// The mean, over some ten seconds, of the costs of turns by what is believed, where they are large enough to tell.
pub(super) type TurnCost = RecentMean<f64, 50>;

impl TurnCost {
    /// Three numbers cost three by chance; nine is the most that is counted. What costs more is a way to be set up wrongly that no hypothesis
    /// has, as a unit that is turned by 30 degrees about the vertical.
    pub(super) fn is_usual(&self) -> bool {
        const FEWEST: u32 = 10;
        const USUAL_MOST: f64 = 5.5;
        self.count < FEWEST || self.mean < USUAL_MOST
    }
}
