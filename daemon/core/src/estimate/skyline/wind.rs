//! How clouds go: one layer that wind carries over a round Earth.
//!
//! A cloud `height` above the sea that stands in the direction d lies `distance` away along it, and wind that blows by v m/s against the ship
//! takes it in t seconds to where d + (height / distance) (v / height) t points. The first factor is the cloud's `nearness`, a matter of its
//! elevation, the second is the same for all of the layer: the wind, two numbers. Near the horizon hardly anything of it is left, so points at
//! several elevations tell wind from a turn of the camera.

use glam::{DMat2, DQuat, DVec2, DVec3};

use crate::geometry::{horizon_dip, turn_about_vertical};

/// Height that clouds are taken to have, metres: it only matters within some degrees of the horizon.
const HEIGHT_M: f64 = 1500.0;
/// By how much the nearness of all clouds may be wrong: a layer of another height, one that rises or falls away (by a tenth where it is seen
/// five degrees high and more), an inclination that is off by .1 deg.
pub(super) const NEARNESS_SIGMA: f64 = 0.01;
/// By what share clouds of a layer differ in how far they go, in height and in how they change: usually, and at most.
pub(super) const SPREAD: f64 = 0.2;
pub(super) const SPREAD_MOST: f64 = 0.5;
/// Looks that lie so far apart tell of the wind by themselves: until then they are held against the same pictures, seconds.
const SHARED_S: f64 = 10.0;
/// Knowledge of the wind fades in this time, seconds: layers and wind change.
const KEPT_S: f64 = 120.0;

/// Height of the clouds over their distance towards the unit vector `d`: h = r sin(elevation) + r^2 (1 - refraction) / (2 R).
pub(super) fn nearness(d: DVec3) -> f64 {
    let dip = horizon_dip(HEIGHT_M);
    0.5 * (d.z + (d.z * d.z + dip * dip).sqrt())
}

/// Where clouds that stood towards `d` are seen after wind has carried them by `gone` of their heights.
pub(super) fn carried(d: DVec3, gone: DVec2) -> DVec3 {
    (d + (nearness(d) * gone).extend(0.0)).normalize()
}

/// Estimate of the wind: heights of the clouds a second, in the anchor's world. A normal distribution, by information: the inverse of
/// the covariance, and that times the mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wind {
    pub information: DMat2,
    pub pull: DVec2,
}

impl Wind {
    /// Nothing: it has no mean.
    pub const UNKNOWN: Self = Self { information: DMat2::ZERO, pull: DVec2::ZERO };

    /// As from nowhere, to that deviation on an axis.
    pub fn calm(sigma: f64) -> Self {
        Self { information: DMat2::from_diagonal(DVec2::splat(sigma.powi(-2))), pull: DVec2::ZERO }
    }

    /// Both together.
    pub fn and(&self, other: &Self) -> Self {
        Self { information: self.information + other.information, pull: self.pull + other.pull }
    }

    /// The likeliest one.
    pub fn mean(&self) -> DVec2 {
        self.information.inverse() * self.pull
    }

    /// Standard deviation of that on an axis.
    pub fn sigma(&self) -> f64 {
        let covariance = self.covariance();
        (0.5 * (covariance.x_axis.x + covariance.y_axis.y)).max(0.0).sqrt()
    }

    /// Covariance of that.
    pub fn covariance(&self) -> DMat2 {
        self.information.inverse()
    }

    /// Takes in what a look says, `dt_s` after the one before.
    pub fn learn(&mut self, told: &Self, dt_s: f64) {
        let kept = (-dt_s / KEPT_S).exp();
        let share = (dt_s / SHARED_S).min(1.0);
        self.information = self.information * kept + told.information * share;
        self.pull = self.pull * kept + told.pull * share;
    }

    /// The same in a world that is turned by `turn`.
    #[must_use]
    pub fn turned(&self, turn: DQuat) -> Self {
        let about = DMat2::from_angle(turn_about_vertical(turn));
        Self { information: about * self.information * about.transpose(), pull: about * self.pull }
    }
}
