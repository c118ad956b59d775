//! Distributions of times, for the summary.

use serde::Serialize;

/// Percentiles of a set of values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentiles {
    /// Median.
    pub p50: f64,
    /// 95th percentile.
    pub p95: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Largest.
    pub max: f64,
}

/// Values gathered over a run, 4 bytes each.
#[derive(Clone, Debug, Default)]
pub struct Samples(Vec<f32>);

impl Samples {
    /// With room for `n` values, so that a run of known length does not allocate on the way.
    pub fn with_capacity(n: usize) -> Self {
        Self(Vec::with_capacity(n))
    }

    /// Adds a value; one that is not finite is left out.
    pub fn push(&mut self, value: f64) {
        if value.is_finite() {
            self.0.push(value as f32);
        }
    }

    /// Nearest-rank percentiles; `None` without values.
    pub fn percentiles(&self) -> Option<Percentiles> {
        let mut sorted = self.0.clone();
        sorted.sort_by(f32::total_cmp);
        let rank = |share: f64| {
            let place = (share * sorted.len() as f64).ceil() as usize;
            sorted.get(place.saturating_sub(1)).copied().map(round)
        };
        Some(Percentiles { p50: rank(0.5)?, p95: rank(0.95)?, p99: rank(0.99)?, max: rank(1.0)? })
    }

    /// Root mean square; `None` without values.
    pub fn rms(&self) -> Option<f64> {
        if self.0.is_empty() {
            return None;
        }
        let sum: f64 = self.0.iter().map(|v| f64::from(*v) * f64::from(*v)).sum();
        Some(round((sum / self.0.len() as f64).sqrt() as f32))
    }
}

/// Microseconds are enough digits for a time in milliseconds.
fn round(value: f32) -> f64 {
    (f64::from(value) * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_rank() {
        let mut s = Samples::default();
        assert_eq!(s.percentiles(), None);
        for i in (1..=100).rev() {
            s.push(f64::from(i));
        }
        s.push(f64::NAN);
        assert_eq!(s.percentiles(), Some(Percentiles { p50: 50.0, p95: 95.0, p99: 99.0, max: 100.0 }));
    }
}
