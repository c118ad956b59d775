//! Attitude from a gyro alone, over a span that is known whole.

use bowwave_core::{event::ImuSample, time::Time};
use glam::{DQuat, DVec3};

/// Attitude over time; the world is where the unit was at the first sample.
#[derive(Clone, Debug)]
pub struct GyroPath {
    points: Vec<(Time, DQuat)>,
}

impl GyroPath {
    /// Turns from sample to sample about the mean of both rates (exact for a rate that grows evenly about a fixed axis).
    pub fn integrate(samples: &[ImuSample], bias: DVec3) -> Self {
        let mut points: Vec<(Time, DQuat)> = Vec::with_capacity(samples.len());
        let mut last: Option<&ImuSample> = None;
        for sample in samples {
            let q = match (last, points.last()) {
                (Some(before), Some((_, q))) => {
                    let seconds = sample.arrival.secs_since(before.arrival);
                    let turn = ((before.rate + sample.rate) / 2.0 - bias) * seconds;
                    (*q * DQuat::from_scaled_axis(turn)).normalize()
                }
                _ => DQuat::IDENTITY,
            };
            points.push((sample.arrival, q));
            last = Some(sample);
        }
        Self { points }
    }

    /// Attitude at a time, interpolated; held before the first and after the last sample.
    pub fn world_from_imu(&self, time: Time) -> DQuat {
        let after = self.points.partition_point(|p| p.0 < time);
        match (after.checked_sub(1).and_then(|i| self.points.get(i)), self.points.get(after)) {
            (Some(a), Some(b)) => a.1.slerp(b.1, time.secs_since(a.0) / b.0.secs_since(a.0)),
            (Some(end), None) | (None, Some(end)) => end.1,
            (None, None) => DQuat::IDENTITY,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::GyroPath;
    use bowwave_core::{event::ImuSample, time::Time};
    use glam::{DQuat, DVec3};

    #[test]
    fn an_even_turn_with_a_bias_is_exact() {
        let (rate, bias) = (DVec3::new(0.3, -0.2, 0.5), DVec3::new(0.01, 0.02, -0.03));
        let samples: Vec<_> = (0..=400)
            .map(|i| ImuSample {
                arrival: Time::from_ns(i * 2_500_000),
                device_time_ns: 0,
                rate: rate + bias,
                accel: DVec3::ZERO,
                world_from_imu: None,
            })
            .collect();
        let path = GyroPath::integrate(&samples, bias);
        for ns in [0, 1_234_567, 500_000_000, 1_000_000_000] {
            let truth = DQuat::from_scaled_axis(rate * (ns as f64 * 1e-9));
            assert!(path.world_from_imu(Time::from_ns(ns)).angle_between(truth) < 1e-7, "{ns}");
        }
        // Held at both ends.
        assert_eq!(path.world_from_imu(Time::from_ns(-5)), DQuat::IDENTITY);
        assert_eq!(
            path.world_from_imu(Time::from_ns(2_000_000_000)),
            path.world_from_imu(Time::from_ns(1_000_000_000))
        );
        assert_eq!(GyroPath::integrate(&[], bias).world_from_imu(Time::from_ns(1)), DQuat::IDENTITY);
    }
}
