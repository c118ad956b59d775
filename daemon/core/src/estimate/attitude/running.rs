//! Rate and specific force of one unit without interruption, from sample to sample.

use glam::{DMat3, DQuat, DVec3};

use super::{
    RateKind, coning,
    filter::{Filter, Noise, SampleMotion},
    inclination::{Inclination, TAU_PUBLISHED_S, TAU_WAVES_S},
    rest::RestDetector,
    turn_between,
};
use crate::{estimate::pose::OrientationSample, time::Time};

/// A step that is longer than so many periods of the unit has samples missing.
const MISSING_PERIODS: f64 = 1.8;

/// How rate and specific force change is averaged over this long, seconds.
const CHANGES_S: f64 = 2.0;

/// ...and between samples so far apart: as long as what is missing usually is.
const APART_S: f64 = 0.1;

/// Specific force that changes by more than this from one sample to the next, m/s^2, is a shock: recoil or a blow. Hands and waves change it by
/// less. Units clip a shock or miss its peak, so that the filter estimates what share of it is so ([`Filter::shake`]).
const SHOCK: f64 = 100.0;
/// After so long it is no shock but what the unit has come to measure, seconds.
const SHOCK_MOST_S: f64 = 0.05;

/// No gyro's range is smaller, rad/s (30 deg/s).
const CLIPPED_LEAST: f64 = 0.52;

/// By what share of it a rate that stands at its range may be exceeded (one standard deviation).
const CLIPPED_SHARE: f64 = 0.5;

/// The filter of a unit's rate and specific force while it runs.
#[derive(Debug)]
pub(super) struct RunningFilter {
    /// Plain VQF in turns that are free of the bias as it is known...
    inclination: Inclination,
    /// ...and one that knows nothing but the unit's samples.
    pub(super) alone: Inclination,
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
    /// Mean squares of the changes of rate and specific force over their time on each axis, rad^2/s^3 and m^2/s^5.
    changes: [DVec3; 2],
    /// Both when these were looked at last, and how long ago that is, seconds.
    apart: [DVec3; 2],
    apart_s: f64,
    /// How long a shock has lasted, seconds.
    shock_s: f64,
}

impl RunningFilter {
    /// Begun with the unit as in `last`, wrong by `tilt` radians, where it felt `force` (m/s^2), for samples `period_s` apart.
    pub(super) fn new(noise: Noise, tilt: f64, period_s: f64, last: OrientationSample, force: DVec3) -> Self {
        Self {
            inclination: Inclination::new(TAU_PUBLISHED_S, period_s, last.world_from_imu),
            alone: Inclination::new(TAU_WAVES_S, period_s, last.world_from_imu),
            filter: Filter::new(noise, tilt),
            last,
            rest: RestDetector::default(),
            period_s,
            rate: last.rate,
            force,
            before: None,
            fastest: DVec3::ZERO,
            changes: [DVec3::ZERO; 2],
            apart: [last.rate, force],
            apart_s: 0.0,
            shock_s: 0.0,
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
            let missed = (rate.length() * CLIPPED_SHARE * dt_s).powi(2);
            self.filter.miss(DMat3::from_diagonal(DVec3::splat(missed)), 0.0);
        }
        let accel = self.without_shock(accel, dt_s);
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
        self.alone.update(turn, dt_s, accel);
        let from = self.last.world_from_imu;
        let half = small_turn(corrected * 0.5);
        let middle = from * half;
        self.filter.step(&SampleMotion { axes: DMat3::from_quat(middle), turn, force, dt_s });
        let world_from_imu = (middle * half).normalize();
        self.last = OrientationSample { time, world_from_imu, rate: rate - self.filter.bias() };
        let held = self.filter.is_due().then(|| self.filter.hold(world_from_imu, self.inclination.up_imu()));
        let turn = match (rested, held) {
            (None, None) => return None,
            (rested, held) => held.unwrap_or(DQuat::IDENTITY) * rested.unwrap_or(DQuat::IDENTITY),
        };
        self.turn(turn);
        Some(turn)
    }

    /// What was felt, or in a shock what was felt before it.
    fn without_shock(&mut self, accel: DVec3, dt_s: f64) -> DVec3 {
        let change = accel.distance(self.force);
        if change <= SHOCK || self.shock_s >= SHOCK_MOST_S {
            self.shock_s = 0.0;
            return accel;
        }
        self.shock_s += dt_s;
        let excess = accel - self.force;
        self.filter.shake(self.last.world_from_imu * excess * dt_s);
        self.force
    }

    /// What may have happened while samples were missing: rate and specific force between those that came are a Brownian bridge that changes as
    /// they did of late, whose integral over `T` has the variance `q T^3 / 12`.
    fn bridge(&mut self, rate: DVec3, force: DVec3, dt_s: f64, missing: bool) {
        if missing {
            let [turn, push] = self.changes.map(|change| change * (dt_s.powi(3) / 12.0));
            let axes = DMat3::from_quat(self.last.world_from_imu);
            self.filter.miss(axes * DMat3::from_diagonal(turn) * axes.transpose(), push.max_element());
        }
        self.apart_s += dt_s;
        if self.apart_s < APART_S {
            return;
        }
        let over_s = std::mem::take(&mut self.apart_s);
        for ((mean, now), before) in self.changes.iter_mut().zip([rate, force]).zip(&mut self.apart) {
            let change = now - *before;
            let square = change * change / over_s;
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

/// The turn of a scaled axis, radians; that of a sample is small, and needs no sine.
fn small_turn(turn: DVec3) -> DQuat {
    /// Up to a turn of which half, squared, is so large, the series err by less than 1e-17.
    const SMALL: f64 = 1e-3;
    let x = 0.25 * turn.length_squared();
    if x > SMALL {
        return DQuat::from_scaled_axis(turn);
    }
    let sine = 1.0 + x * (-1.0 / 6.0 + x * (1.0 / 120.0 + x * (-1.0 / 5040.0 + x / 362_880.0)));
    let cosine = 1.0 + x * (-0.5 + x * (1.0 / 24.0 + x * (-1.0 / 720.0 + x / 40_320.0)));
    let axis = turn * (0.5 * sine);
    DQuat::from_xyzw(axis.x, axis.y, axis.z, cosine)
}
