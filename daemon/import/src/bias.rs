//! The gyro's bias, and how it is found from a span of rest.

use bowwave_core::{event::ImuSample, time::secs_to_ns};
use glam::DVec3;

use crate::ImportError;

/// A gyro's bias, measured at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyroBias {
    /// To be subtracted from the rates, rad/s in the unit's axes.
    pub rate: DVec3,
    /// Standard deviation, rad/s.
    pub sigma: DVec3,
    /// The span that it was taken from, seconds.
    pub seconds: f64,
    /// How it was found.
    pub source: BiasSource,
}

/// How a bias was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BiasSource {
    /// The rates less the turning that distant things in the pictures show.
    Pictures {
        /// Patches of the upper part of the picture that were followed.
        patches: usize,
    },
    /// The mean rate of a camera taken to be at rest, because the pictures show nothing to hold on to.
    Rest,
}

/// The rates are averaged over blocks of this length: longer than a hand's tremble, so that the averages' scatter is that of
/// slow motion and of the bias itself, not of noise that averages out.
const BLOCK_S: f64 = 0.5;
/// Fewer blocks tell nothing about their scatter.
const BLOCKS_MIN: usize = 4;
/// Blocks that scatter more than this are no rest, rad/s (1 deg/s).
const SCATTER_MAX: f64 = 1.0 * std::f64::consts::PI / 180.0;
/// No working gyro has more bias than this, rad/s (10 deg/s).
pub(crate) const BIAS_MAX: f64 = 10.0 * std::f64::consts::PI / 180.0;
/// The smallest deviation that is stated, rad/s (0.001 deg/s): a gyro whose last digit stands still is not known better.
pub(crate) const SIGMA_MIN: f64 = 0.001 * std::f64::consts::PI / 180.0;

/// The mean rate over the first `seconds` of `samples`, with the standard error that the scatter of half-second means gives.
pub(crate) fn at_rest(samples: &[ImuSample], seconds: f64) -> Result<GyroBias, ImportError> {
    let fail = |what: String| ImportError::Bias { seconds, what };
    if !(seconds >= BLOCK_S * BLOCKS_MIN as f64 && seconds <= 3600.0) {
        return Err(fail(format!("the span must be {} s to an hour", BLOCK_S * BLOCKS_MIN as f64)));
    }
    let Some(first) = samples.first() else { return Err(fail("there are no samples".to_owned())) };
    let blocks = (seconds / BLOCK_S).floor() as usize;
    let span_ns = secs_to_ns(BLOCK_S);
    let mut sums = vec![(DVec3::ZERO, 0_u32); blocks];
    for sample in samples {
        let since = sample.device_time_ns.saturating_sub(first.device_time_ns);
        if let Some(sum) = usize::try_from(since / span_ns).ok().and_then(|i| sums.get_mut(i)) {
            sum.0 += sample.rate;
            sum.1 += 1;
        }
    }
    if let Some(missing) = sums.iter().position(|s| s.1 == 0) {
        return Err(fail(format!("there are no samples {:.1} s after the start", missing as f64 * BLOCK_S)));
    }
    let means: Vec<DVec3> = sums.iter().map(|s| s.0 / f64::from(s.1)).collect();
    let n = means.len() as f64;
    let rate = means.iter().sum::<DVec3>() / n;
    let variance = means.iter().map(|m| (m - rate) * (m - rate)).sum::<DVec3>() / (n - 1.0);
    let scatter = DVec3::new(variance.x.sqrt(), variance.y.sqrt(), variance.z.sqrt());
    if !(scatter.is_finite() && scatter.max_element() <= SCATTER_MAX) {
        let degrees = scatter.max_element().to_degrees();
        return Err(fail(format!("the camera was not at rest, its rate changed by {degrees:.1} deg/s")));
    }
    if rate.abs().max_element() > BIAS_MAX {
        let degrees = rate.abs().max_element().to_degrees();
        return Err(fail(format!("the camera was turning at {degrees:.1} deg/s")));
    }
    Ok(GyroBias {
        rate,
        sigma: (scatter / n.sqrt()).max(DVec3::splat(SIGMA_MIN)),
        seconds,
        source: BiasSource::Rest,
    })
}

#[cfg(test)]
mod tests {
    use super::{GyroBias, at_rest};
    use bowwave_core::{event::ImuSample, time::Time};
    use glam::DVec3;

    fn samples(seconds: f64, rate: impl Fn(f64) -> DVec3) -> Vec<ImuSample> {
        (0..(seconds * 200.0) as i64)
            .map(|i| ImuSample {
                arrival: Time::from_ns(i * 5_000_000),
                device_time_ns: 77_000_000_000 + i * 5_000_000,
                rate: rate(i as f64 * 0.005),
                accel: DVec3::Z,
                world_from_imu: None,
            })
            .collect()
    }

    #[test]
    fn the_truth_is_within_the_stated_deviation() {
        let truth = DVec3::new(0.01, -0.02, 0.003);
        let wander = |t: f64| truth + DVec3::new((t * 1.7).sin(), (t * 2.3).cos(), (t * 40.0).sin()) * 0.002;
        let GyroBias { rate, sigma, .. } = at_rest(&samples(20.0, wander), 10.0).unwrap();
        let off = (rate - truth).abs();
        assert!(off.cmple(sigma * 3.0).all(), "{off} {sigma}");
        assert!(sigma.max_element() < 0.002 && sigma.min_element() > 1e-5, "{sigma}");
    }

    #[test]
    fn later_motion_does_not_count() {
        let late = |t: f64| if t < 5.0 { DVec3::X * 0.01 } else { DVec3::Y };
        assert!(at_rest(&samples(10.0, late), 5.0).unwrap().rate.distance(DVec3::X * 0.01) < 1e-12);
    }

    #[test]
    fn motion_gaps_and_nonsense_are_refused() {
        let cases: [(Vec<ImuSample>, f64, &str); 7] = [
            (vec![], 5.0, "no samples"),
            (samples(3.0, |_| DVec3::ZERO), 5.0, "3.0 s after"),
            (samples(9.0, |t| DVec3::X * t * 0.1), 5.0, "not at rest"),
            (samples(9.0, |_| DVec3::X * 0.5), 5.0, "turning"),
            (samples(9.0, |_| DVec3::NAN), 5.0, "not at rest"),
            (samples(9.0, |_| DVec3::ZERO), 1.0, "span"),
            (samples(9.0, |_| DVec3::ZERO), f64::NAN, "span"),
        ];
        for (samples, seconds, says) in cases {
            let message = at_rest(&samples, seconds).unwrap_err().to_string();
            assert!(message.contains(says), "{message}");
        }
    }
}
