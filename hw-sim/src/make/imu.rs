//! The simulated inertial unit: what it measures of the exact motion, and when the host hears of it.

use std::f64::consts::TAU;

use bowwave_core::{event::ImuSample, time::Time};
use glam::{DQuat, DVec3};
use rand_pcg::Pcg64;

use super::{
    motion::{GRAVITY, MotionState},
    recipe::{ImuRecipe, Jolt, Recipe},
};
use crate::ocean::random::{gaussian, stream, uniform};

/// Slow errors with a whole number of cycles in the recording: mean zero, deviation one on each axis.
struct SlowError {
    waves: Vec<[(f64, f64, f64); 3]>,
}

impl SlowError {
    fn new(rng: &mut Pcg64) -> Self {
        let scale = (2.0f64 / 3.0).sqrt();
        let waves = (1..=3)
            .map(|n| std::array::from_fn(|_| (TAU * f64::from(n), scale, TAU * uniform(rng))))
            .collect();
        Self { waves }
    }

    /// `turn` is the share of the recording that has passed.
    fn at(&self, turn: f64) -> DVec3 {
        self.waves
            .iter()
            .map(|axes| {
                DVec3::from_array(axes.map(|(cycles, scale, phase)| scale * (cycles * turn + phase).sin()))
            })
            .sum()
    }
}

/// A unit with its errors, noise and latency.
pub(crate) struct Unit {
    recipe: ImuRecipe,
    bias_walk: SlowError,
    attitude_error: SlowError,
    noise: Pcg64,
    latency: Pcg64,
}

impl Unit {
    /// The unit of a recipe.
    pub fn new(recipe: &Recipe) -> Self {
        let mut errors = stream(recipe.seed, 0x1e0);
        Self {
            bias_walk: SlowError::new(&mut errors),
            attitude_error: SlowError::new(&mut errors),
            noise: stream(recipe.seed, 0x1e1),
            latency: stream(recipe.seed, 0x1e2),
            recipe: recipe.imu.clone(),
        }
    }

    /// The next sample, measured so many seconds after the begin on the host's clock. `turn` is that in periods of the slow errors, `jolt` an acceleration along
    /// the unit's x, m/s^2.
    ///
    /// A sample measured at host time t carries the device time `clock_start + (t - start) * (1 + drift)` and arrives after t by a latency
    /// that is never below the least one.
    pub fn measure(
        &mut self,
        exact: &Exact,
        (start, time_s): (Time, f64),
        turn: f64,
        jolt: f64,
    ) -> ImuSample {
        let imu = &self.recipe;
        let white = |rng: &mut Pcg64| DVec3::new(gaussian(rng), gaussian(rng), gaussian(rng));
        let rate = exact.rate
            + imu.gyro_bias
            + self.bias_walk.at(turn) * imu.gyro_bias_walk
            + white(&mut self.noise) * imu.gyro_noise;
        let accel = exact.accel + DVec3::X * jolt + imu.accel_bias + white(&mut self.noise) * imu.accel_noise;
        let slow = self.attitude_error.at(turn);
        let tilt = DVec3::new(slow.x * imu.tilt_error, slow.y * imu.tilt_error, slow.z * imu.heading_error);
        let measured_ns = bowwave_core::time::secs_to_ns(time_s);
        ImuSample {
            arrival: start.plus_ns(measured_ns + draw_latency(&mut self.latency, imu.latency_ns)),
            device_time_ns: imu.clock_start_ns + device_ns(time_s, imu.clock_drift_ppm),
            rate: to_step(rate, imu.gyro_step),
            accel: to_step(accel, imu.accel_step),
            world_from_imu: Some((DQuat::from_scaled_axis(tilt) * exact.world_from_imu).normalize()),
        }
    }
}

/// All samples of a recording, in the order of measurement. `start` is the recording's start on the host's clock.
pub fn samples(recipe: &Recipe, start: Time) -> Vec<ImuSample> {
    let motion = recipe.motion();
    let imu_from_camera = recipe.camera_from_imu().inverse();
    let mut unit = Unit::new(recipe);
    let mut sear = stream(recipe.seed, 0x1e3);
    let jolts: Vec<(f64, &Jolt)> = recipe
        .imu
        .jolt
        .iter()
        .flat_map(|jolt| recipe.trigger.iter().map(move |burst| (burst.start_s + jolt.latency_s, jolt)))
        .map(|(late_s, jolt)| (late_s + jolt.spread_s * gaussian(&mut sear), jolt))
        .collect();
    let count = recipe.samples();
    (0..count)
        .map(|i| {
            let turn = f64::from(i) / f64::from(count);
            let t = turn * recipe.duration_s;
            let jolt = jolts.iter().map(|(at_s, jolt)| jolt.felt(t - at_s)).sum();
            unit.measure(&Exact::of(&motion.at(t), imu_from_camera), (start, t), turn, jolt)
        })
        .collect()
}

/// How far the unit's clock advances in `host_s` seconds, nanoseconds.
pub fn device_ns(host_s: f64, drift_ppm: f64) -> i64 {
    bowwave_core::time::secs_to_ns(host_s * (1.0 + drift_ppm * 1e-6))
}

/// Readings of a perfect unit: rate and specific force in its axes, and how it is turned.
pub(crate) struct Exact {
    rate: DVec3,
    accel: DVec3,
    world_from_imu: DQuat,
}

impl Exact {
    /// Of a unit on a camera in that state.
    pub fn of(state: &MotionState, imu_from_camera: DQuat) -> Self {
        let world_from_imu = state.pose.world_from_camera * imu_from_camera.inverse();
        Self {
            rate: imu_from_camera * state.rate,
            accel: world_from_imu.inverse() * (state.acceleration + DVec3::Z * GRAVITY),
            world_from_imu,
        }
    }
}

/// Mostly near the least, with a tail to the most.
pub(crate) fn draw_latency(rng: &mut Pcg64, [least, most]: [i64; 2]) -> i64 {
    let span = (most - least) as f64;
    // Exponential with a mean of a sixth of the span.
    let late = -(1.0 - uniform(rng)).ln() * span / 6.0;
    least + late.min(span) as i64
}

fn to_step(value: DVec3, step: f64) -> DVec3 {
    if step > 0.0 { (value / step).round() * step } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrated_rates_follow_the_truth() {
        let recipe = Recipe::default();
        let samples = samples(&recipe, Time::from_ns(5_000));
        let (motion, camera_from_imu) = (recipe.motion(), recipe.camera_from_imu());
        let mut world_from_imu = motion.at(0.0).pose.world_from_camera * camera_from_imu;
        let dt = 1.0 / recipe.imu.rate_hz;
        let mut worst: f64 = 0.0;
        for (i, pair) in samples.windows(2).enumerate() {
            let rate = 0.5 * (pair[0].rate + pair[1].rate) - recipe.imu.gyro_bias;
            world_from_imu *= DQuat::from_scaled_axis(rate * dt);
            let truth = motion.at((i + 1) as f64 * dt).pose.world_from_camera;
            worst = worst.max((world_from_imu * camera_from_imu.inverse()).angle_between(truth).to_degrees());
        }
        // 20 s of a random walk of 0.035 deg/s * sqrt(5 ms) and of the bias's own walk.
        assert!(worst < 0.06, "{worst} deg");
        assert!(worst > 1e-4, "noise and bias are missing: {worst} deg");
    }

    #[test]
    fn the_units_own_attitude_is_good_and_repeats() {
        let recipe = Recipe::default();
        let samples = samples(&recipe, Time::from_ns(0));
        let (motion, camera_from_imu) = (recipe.motion(), recipe.camera_from_imu());
        let mut sum = 0.0;
        for (i, s) in samples.iter().enumerate() {
            let used = s.world_from_imu.unwrap() * camera_from_imu.inverse();
            sum += used.angle_between(motion.at(i as f64 * 0.005).pose.world_from_camera).powi(2);
        }
        let rms = (sum / samples.len() as f64).sqrt().to_degrees();
        assert!((0.02..0.06).contains(&rms), "{rms} deg rms");
        // The step over the seam is like any other step.
        let (last, first) = (samples[samples.len() - 1], samples[0]);
        let step =
            |a: &ImuSample, b: &ImuSample| a.world_from_imu.unwrap().angle_between(b.world_from_imu.unwrap());
        let seam = step(&last, &first);
        let before = step(&samples[samples.len() - 2], &last);
        assert!((seam - before).abs() < 1e-4, "{seam} {before}");
        assert!((last.rate - first.rate).length() < 0.02);
    }

    #[test]
    fn at_rest_it_feels_gravity_upwards() {
        let recipe = Recipe {
            ship: Default::default(),
            gun: Default::default(),
            imu: super::super::recipe::ImuRecipe { misalignment: DVec3::ZERO, ..Default::default() },
            ..Recipe::default()
        };
        let sample = samples(&recipe, Time::from_ns(0))[7];
        // z of the unit points down.
        let felt = sample.accel - recipe.imu.accel_bias;
        assert!((felt - DVec3::new(0.0, 0.0, -GRAVITY)).length() < 0.1, "{felt}");
    }

    #[test]
    fn the_clock_drifts_and_packets_are_late_one_sidedly() {
        let recipe = Recipe::default();
        let start = Time::from_ns(3_000_000);
        let samples = samples(&recipe, start);
        let (first, last) = (samples[0], samples[samples.len() - 1]);
        let device = (last.device_time_ns - first.device_time_ns) as f64;
        let host = 19.995e9;
        assert!((device / host - 1.0 - 35e-6).abs() < 1e-9);
        let late: Vec<i64> = samples
            .iter()
            .enumerate()
            .map(|(i, s)| s.arrival.ns_since(start) - i as i64 * 5_000_000)
            .collect();
        assert!(late.iter().all(|l| (300_000..=2_000_000).contains(l)));
        assert!(late.iter().any(|l| *l < 305_000) && late.iter().any(|l| *l > 1_200_000));
    }
}
