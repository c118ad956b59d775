//! Whether the unit is at rest, when its gyro measures nothing but its bias.

use glam::DVec3;

/// Rate and specific force are smoothed over this long, seconds.
const SMOOTH_S: f64 = 0.1;
/// At rest these stay within this range on each axis, rad/s...
const RATE_RANGE: f64 = 0.15f64.to_radians();
/// ...and m/s^2, ...
const FORCE_RANGE: f64 = 0.05;
/// ...for this long, seconds (VQF's `rest_min_t`).
const REST_S: f64 = 1.5;
/// No gyro's bias is larger, rad/s (VQF's `bias_clip`).
const BIAS_MOST: f64 = 2f64.to_radians();

/// Finds rests. A gun that creeps at a steady rate on a calm sea rolls by a tenth of a degree, which changes rate and force by more than
/// this within seconds; VQF's own limits (2 deg/s, 0.5 m/s^2) take it for one at rest.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RestDetector {
    smooth: Option<[DVec3; 2]>,
    least: [DVec3; 2],
    most: [DVec3; 2],
    turned: DVec3,
    for_s: f64,
}

impl RestDetector {
    /// Takes in rate and specific force over `dt_s` seconds; the mean rate since the last one where the unit has been at rest for long enough.
    pub fn watch(&mut self, rate: DVec3, force: DVec3, dt_s: f64) -> Option<DVec3> {
        let share = (dt_s / SMOOTH_S).min(1.0);
        let [smooth_rate, smooth_force] = self.smooth.unwrap_or([rate, force]);
        let smooth =
            [smooth_rate + (rate - smooth_rate) * share, smooth_force + (force - smooth_force) * share];
        self.smooth = Some(smooth);
        if self.for_s <= 0.0 {
            (self.least, self.most) = (smooth, smooth);
        }
        for (i, value) in smooth.into_iter().enumerate() {
            self.least[i] = self.least[i].min(value);
            self.most[i] = self.most[i].max(value);
        }
        self.turned += rate * dt_s;
        self.for_s += dt_s;
        let range = |i: usize| (self.most[i] - self.least[i]).max_element();
        let moves = !(range(0) <= RATE_RANGE && range(1) <= FORCE_RANGE);
        if !moves && self.for_s < REST_S {
            return None;
        }
        let mean = self.turned / self.for_s;
        *self = Self { smooth: self.smooth, ..Self::default() };
        (!moves && mean.abs().max_element() <= BIAS_MOST).then_some(mean)
    }
}

/// Refused rests agree within this on each axis, rad/s: three deviations of what a rest shows.
const AGREE: f64 = 0.1f64.to_radians();
/// They count once in so long, seconds: a ship that turns steadily on calm water is found at rest again and again, ...
const OCCASION_S: f64 = 30.0;
/// ...and so many of them are believed rather than what was learnt before.
const OCCASIONS: u32 = 3;

/// Rests that were refused, since what they show of the bias contradicts what was learnt. What was learnt may be wrong: the first rest is
/// taken whatever it shows, and may have been a ship's steady turn.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RefusedRests {
    rate: DVec3,
    occasions: u32,
    since_s: f64,
}

impl RefusedRests {
    /// That much time passes, seconds.
    pub fn pass_time(&mut self, dt_s: f64) {
        self.since_s += dt_s;
    }

    /// A rest of that mean rate, rad/s, is refused; whether it is to be believed after all.
    pub fn refuse(&mut self, rate: DVec3) -> bool {
        let agrees = self.occasions > 0 && (rate - self.rate).abs().max_element() <= AGREE;
        if !agrees {
            *self = Self { rate, occasions: 1, since_s: 0.0 };
        } else if self.since_s >= OCCASION_S {
            self.occasions += 1;
            self.since_s = 0.0;
        }
        self.occasions >= OCCASIONS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::GRAVITY_M_S2;

    /// How many rests are found in a minute, and the last one's mean, where rate and tilt are these.
    fn rests(rate: impl Fn(f64) -> DVec3, tilt: impl Fn(f64) -> f64) -> (usize, Option<DVec3>) {
        let mut detector = RestDetector::default();
        let found = (0..12_000).filter_map(|i| {
            let t = f64::from(i) * 0.005;
            let force = DVec3::new(GRAVITY_M_S2 * tilt(t).sin(), 0.0, GRAVITY_M_S2);
            detector.watch(rate(t), force, 0.005)
        });
        let found: Vec<_> = found.collect();
        (found.len(), found.last().copied())
    }

    #[test]
    fn a_creeping_gun_on_a_calm_sea_is_not_at_rest() {
        let bias = DVec3::new(4e-3, -3e-3, 5e-3);
        let (count, mean) = rests(|_| bias, |_| 0.1);
        assert!(count >= 38 && mean.unwrap().abs_diff_eq(bias, 1e-12), "{count} {mean:?}");
        // A roll of 0.4 deg in 8 s, and a traverse of 1.4 deg/s.
        let (roll, wave) = (7e-3, 0.785);
        let creep = |t: f64| {
            DVec3::new(0.0, roll * wave * (wave * t).cos(), 0.024) + DVec3::splat(1e-5 * (50.0 * t).sin())
        };
        assert_eq!(rests(creep, |t| roll * (wave * t).sin()).0, 0);
        assert_eq!(rests(|_| DVec3::Z * 0.05, |_| 0.0).0, 0, "3 deg/s are no bias");
    }
}
