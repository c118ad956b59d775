//! Rate and specific force of one unit without interruption, from sample to sample.

use glam::{DMat3, DQuat, DVec3};

use super::{
    RateKind, coning,
    filter::{Filter, Noise, SampleMotion},
    inclination::Inclination,
    rest::RestDetector,
    turn_between,
};
use crate::{estimate::pose::OrientationSample, physics::GRAVITY_M_S2, time::Time};

/// A step that is longer than so many periods of the unit has samples missing.
const MISSING_PERIODS: f64 = 1.8;

/// How rate and specific force change is averaged over this long, seconds.
const CHANGES_S: f64 = 2.0;

/// ...and between samples so far apart: as long as what is missing usually is.
const APART_S: f64 = 0.1;

/// Specific force that exceeds gravity by more than this, m/s^2, is a shock: recoil or a blow. Its samples are taken in, because a blow has two
/// sides and one of them alone tilts the mean, but what exceeds it counts as not known: the unit may have clipped it or missed its peak.
const SHOCK: f64 = 60.0;

/// No gyro's range is smaller, rad/s (30 deg/s).
const CLIPPED_LEAST: f64 = 0.52;

/// By what share of it a rate that stands at its range may be exceeded (one standard deviation).
const CLIPPED_SHARE: f64 = 0.5;

/// The filter of a unit's rate and specific force while it runs.
#[derive(Debug)]
pub(super) struct RunningFilter {
    inclination: Inclination,
    pub(super) filter: Filter,
    pub(super) last: OrientationSample,
    rest: RestDetector,
    /// The unit's usual period, seconds.
    period_s: f64,
    /// The newest rate less the calibrated bias and specific force, and the rate before with its distance in time.
    rate: DVec3,
    force: DVec3,
    before: Option<(DVec3, i64)>,
    /// The largest rate so far on each axis.
    fastest: DVec3,
    /// Mean squares of the changes of rate and specific force over their time, rad^2/s^3 and m^2/s^5.
    changes: [f64; 2],
    /// Both when these were looked at last, and how long ago that is, seconds.
    apart: [DVec3; 2],
    apart_s: f64,
}

impl RunningFilter {
    /// Begun with the unit as in `last`, wrong by `tilt` radians, where it felt `force` (m/s^2), for samples `period_s` apart.
    pub(super) fn new(noise: Noise, tilt: f64, period_s: f64, last: OrientationSample, force: DVec3) -> Self {
        Self {
            inclination: Inclination::new(period_s, last.world_from_imu),
            filter: Filter::new(noise, tilt),
            last,
            rest: RestDetector::default(),
            period_s,
            rate: last.rate,
            force,
            before: None,
            fastest: DVec3::ZERO,
            changes: [0.0; 2],
            apart: [last.rate, force],
            apart_s: 0.0,
        }
    }

    /// Goes on to a sample; by what the world is to be turned for all that was before.
    pub(super) fn step(
        &mut self,
        kind: RateKind,
        (time, dt_ns): (Time, i64),
        rate: DVec3,
        accel: DVec3,
    ) -> Option<DQuat> {
        let dt_s = dt_ns as f64 * 1e-9;
        let missing = dt_s > MISSING_PERIODS * self.period_s;
        let turn = match kind {
            // What a sample says of its own time says nothing of those that are missing.
            _ if missing => turn_between(None, self.rate, rate, dt_s),
            RateKind::Mean => rate * dt_s + coning(self.rate, rate, dt_s),
            RateKind::Instant => {
                // Times from a shifting clock map differ by microseconds; only about equal steps have a parabola.
                let even = self.before.filter(|(_, step_ns)| (step_ns - dt_ns).abs() * 5 < dt_ns);
                turn_between(even.map(|(w, _)| w), self.rate, rate, dt_s)
            }
        };
        if self.is_clipped(rate) {
            self.filter.miss(rate.length() * CLIPPED_SHARE * dt_s, 0.0);
        }
        self.filter.miss(0.0, (accel.length() - GRAVITY_M_S2 - SHOCK).max(0.0) * dt_s);
        self.bridge(rate, accel, dt_s, missing);
        let rested = self.rest.watch(rate, accel, dt_s).map(|mean| self.filter.rest(mean));
        let force = match kind {
            RateKind::Mean => accel,
            RateKind::Instant => (accel + self.force) * 0.5,
        };
        self.before = Some((self.rate, dt_ns));
        (self.rate, self.force) = (rate, accel);
        let corrected = self.filter.corrected(turn, dt_s);
        self.inclination.update(corrected, dt_s, accel);
        let from = self.last.world_from_imu;
        let axes = DMat3::from_quat(from * DQuat::from_scaled_axis(corrected * 0.5));
        self.filter.step(&SampleMotion { axes, turn, force, dt_s });
        let world_from_imu = (from * DQuat::from_scaled_axis(corrected)).normalize();
        self.last = OrientationSample { time, world_from_imu, rate: rate - self.filter.bias() };
        let held = self.filter.is_due().then(|| self.filter.hold(world_from_imu, self.inclination.up_imu()));
        let turn = match (rested, held) {
            (None, None) => return None,
            (rested, held) => held.unwrap_or(DQuat::IDENTITY) * rested.unwrap_or(DQuat::IDENTITY),
        };
        self.turn(turn);
        Some(turn)
    }

    /// What may have happened while samples were missing: rate and specific force between those that came are a Brownian bridge that changes as
    /// they did of late, whose integral over `T` has the variance `q T^3 / 12`.
    fn bridge(&mut self, rate: DVec3, force: DVec3, dt_s: f64, missing: bool) {
        if missing {
            let [turn, push] = self.changes.map(|change| (change * dt_s.powi(3) / 12.0).sqrt());
            self.filter.miss(turn, push);
        }
        self.apart_s += dt_s;
        if self.apart_s < APART_S {
            return;
        }
        let over_s = std::mem::take(&mut self.apart_s);
        for ((mean, now), before) in self.changes.iter_mut().zip([rate, force]).zip(&mut self.apart) {
            let square = now.distance_squared(*before) / (3.0 * over_s);
            *mean += (square - *mean) * (over_s / CHANGES_S).min(1.0);
            *before = now;
        }
    }

    /// Whether the gyro stands at its range: on one axis as fast as ever, and exactly as fast as before, which noise would not let it be.
    fn is_clipped(&mut self, rate: DVec3) -> bool {
        let size = rate.abs();
        self.fastest = self.fastest.max(size);
        let stands = |axis: usize| {
            size[axis] > CLIPPED_LEAST && size[axis] >= self.fastest[axis] && rate[axis] == self.rate[axis]
        };
        stands(0) || stands(1) || stands(2)
    }

    /// The world is turned.
    pub(super) fn turn(&mut self, turn: DQuat) {
        self.last.world_from_imu = (turn * self.last.world_from_imu).normalize();
    }
}
