//! What is known of the heading of a unit whose own orientation is taken: two states, its error and the gun's bearing on its mount.

use glam::{DMat2, DVec2};

use super::Outcome;

/// A filter of a unit's own heading. What is wrong with it grows steadily, as a unit's gyro has it drift: variances of a random walk would
/// have it drift ever slower.
#[derive(Clone, Debug)]
pub(super) struct Own {
    /// By what the unit's world is turned about the vertical, radians.
    pub(super) turn: f64,
    /// Covariance of that turn's error and of the mount's, rad^2.
    covariance: DMat2,
    mount: f64,
    /// By how much the deviation of the unit's heading grows, rad/s.
    growth: f64,
}

/// How a measured number changes with heading and mount.
const HEADING: DVec2 = DVec2::X;
const DIFFERENCE: DVec2 = DVec2::new(1.0, -1.0);

impl Own {
    /// A unit whose heading counts as right now.
    pub(super) const fn new(growth: f64) -> Self {
        Self { turn: 0.0, covariance: DMat2::ZERO, mount: 0.0, growth }
    }

    /// Standard deviation of the heading, radians.
    pub(super) fn sigma(&self) -> f64 {
        self.covariance.x_axis.x.max(0.0).sqrt()
    }

    /// How fast that grows, rad/s.
    pub(super) const fn drift_sigma(&self) -> f64 {
        self.growth
    }

    /// `dt_s` seconds went by.
    pub(super) fn predict(&mut self, dt_s: f64) {
        let grown = self.growth * dt_s;
        self.covariance.x_axis.x += (2.0 * self.sigma() + grown) * grown;
    }

    /// The heading is set from outside and known to that deviation.
    pub(super) fn set_heading(&mut self, deviation: f64) {
        self.covariance = DMat2::from_diagonal(DVec2::new(deviation * deviation, 10.0));
    }

    pub(super) fn anchor_mount(&mut self, variance: f64) {
        let heading = self.covariance.x_axis.x;
        self.covariance = DMat2::from_cols_array(&[heading, heading, heading, heading + variance]);
        self.mount = 0.0;
    }

    pub(super) fn walk_mount(&mut self, variance: f64) {
        self.covariance.y_axis.y += variance;
    }

    /// As the filter's; gives by what the world is to be turned.
    pub(super) fn see_heading(&mut self, off: f64, variance: f64, limit: f64) -> (f64, Outcome) {
        self.update(HEADING, off, variance, limit)
    }

    pub(super) fn see_mount(&mut self, off: f64, variance: f64, limit: f64) -> (f64, Outcome) {
        self.update(DIFFERENCE, off + self.mount, variance, limit)
    }

    fn update(&mut self, row: DVec2, differ: f64, variance: f64, limit: f64) -> (f64, Outcome) {
        let across = self.covariance * row;
        let expected = row.dot(across) + variance;
        let surprise = differ * differ / expected;
        if surprise.is_nan() || surprise > limit {
            return (0.0, Outcome { surprise, taken: false });
        }
        self.covariance -= DMat2::from_cols(across * across.x, across * across.y) * expected.recip();
        let error = across * (differ / expected);
        self.mount += error.y;
        (error.x, Outcome { surprise, taken: true })
    }
}
