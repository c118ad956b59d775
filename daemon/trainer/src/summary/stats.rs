//! Distributions of times, for the summary, in memory that does not grow with the run.

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

/// Values below this are counted as this.
const LEAST: f64 = 1e-4;
/// Logarithm of the ratio between the bounds of a class: values are known to a quarter of a per cent.
const LOG_STEP: f64 = 0.005;

/// Values gathered over a run, counted in classes.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// Empty until the first value comes.
    counts: Vec<u64>,
    count: u64,
    sum_of_squares: f64,
    max: f64,
}

impl Samples {
    /// Adds a value; one that is not finite is left out.
    pub fn push(&mut self, value: f64) {
        /// Classes up to 100,000.
        const CLASSES: usize = 4146;
        if !value.is_finite() {
            return;
        }
        if self.counts.is_empty() {
            self.counts = vec![0; CLASSES];
            self.max = value;
        }
        let class = ((value.max(LEAST) / LEAST).ln() / LOG_STEP) as usize;
        if let Some(count) = self.counts.get_mut(class.min(CLASSES - 1)) {
            *count += 1;
        }
        self.count += 1;
        self.sum_of_squares += value * value;
        self.max = self.max.max(value);
    }

    /// Adds all values of `more`.
    pub fn add(&mut self, more: &Self) {
        if more.counts.is_empty() {
            return;
        }
        if self.counts.is_empty() {
            *self = more.clone();
            return;
        }
        self.counts.iter_mut().zip(&more.counts).for_each(|(all, n)| *all += n);
        self.count += more.count;
        self.sum_of_squares += more.sum_of_squares;
        self.max = self.max.max(more.max);
    }

    /// Nearest-rank percentiles to a quarter of a per cent, the largest exactly; `None` without values.
    pub fn percentiles(&self) -> Option<Percentiles> {
        let rank = |share: f64| {
            let place = (share * self.count as f64).ceil() as u64;
            let mut below = 0;
            let class = self.counts.iter().position(|count| {
                below += count;
                below >= place
            })?;
            Some(round((LEAST * ((class as f64 + 0.5) * LOG_STEP).exp()).min(self.max)))
        };
        Some(Percentiles { p50: rank(0.5)?, p95: rank(0.95)?, p99: rank(0.99)?, max: round(self.max) })
    }

    /// Root mean square; `None` without values.
    pub fn rms(&self) -> Option<f64> {
        (self.count > 0).then(|| round((self.sum_of_squares / self.count as f64).sqrt()))
    }
}

/// A tenth of a microsecond is enough for a time in milliseconds.
fn round(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_rank_to_a_quarter_of_a_per_cent() {
        let mut s = Samples::default();
        assert_eq!((s.percentiles(), s.rms()), (None, None));
        for i in (1..=100).rev() {
            s.push(f64::from(i));
        }
        s.push(f64::NAN);
        let p = s.percentiles().unwrap();
        for (found, exact) in [(p.p50, 50.0), (p.p95, 95.0), (p.p99, 99.0)] {
            assert!((found / exact - 1.0).abs() < 0.0026, "{found} for {exact}");
        }
        assert_eq!(p.max, 100.0);
        assert_eq!(s.rms(), Some(round((338_350.0f64 / 100.0).sqrt())));
    }

    #[test]
    fn extremes_have_a_class() {
        let mut s = Samples::default();
        [0.0, -1.0, 1e-9, 1e12].into_iter().for_each(|v| s.push(v));
        assert_eq!(s.percentiles().map(|p| (p.p50, p.max)), Some((LEAST, 1e12)));
    }
}
