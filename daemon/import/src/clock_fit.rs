//! A stream's sample clock from the few stamps that a camera gives: one for the first sample of each block.

/// The line `time = first_ms + index * interval_ms` through the stamps of a stream's blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ClockFit {
    /// Time of sample 0, milliseconds.
    pub first_ms: f64,
    /// Time between samples, milliseconds.
    pub interval_ms: f64,
    /// The farthest that a stamp lies from the line, milliseconds.
    pub worst_ms: f64,
}

impl ClockFit {
    /// Least squares through (index of a block's first sample, its stamp in milliseconds); `None` for less than two
    /// different indices or where time does not run forward.
    pub(crate) fn through(stamps: &[(f64, f64)]) -> Option<Self> {
        let n = stamps.len() as f64;
        let mean_index = stamps.iter().map(|s| s.0).sum::<f64>() / n;
        let mean_ms = stamps.iter().map(|s| s.1).sum::<f64>() / n;
        let spread = stamps.iter().map(|s| (s.0 - mean_index).powi(2)).sum::<f64>();
        let joint = stamps.iter().map(|s| (s.0 - mean_index) * (s.1 - mean_ms)).sum::<f64>();
        let interval_ms = joint / spread;
        if !(interval_ms.is_finite() && interval_ms > 0.0) {
            return None;
        }
        let first_ms = mean_ms - interval_ms * mean_index;
        let worst_ms = stamps.iter().map(|s| (s.1 - first_ms - interval_ms * s.0).abs()).fold(0.0, f64::max);
        Some(Self { first_ms, interval_ms, worst_ms })
    }

    /// Time of a sample, milliseconds.
    pub(crate) fn at(&self, index: f64) -> f64 {
        self.first_ms + self.interval_ms * index
    }
}

#[cfg(test)]
mod tests {
    use super::ClockFit;

    #[test]
    fn stamps_rounded_to_milliseconds_give_the_rate() {
        let interval = 2.515_43;
        let stamps: Vec<_> =
            (0..13).map(|k| (f64::from(k * 399), (17.3 + f64::from(k * 399) * interval).floor())).collect();
        let fit = ClockFit::through(&stamps).unwrap();
        assert!((fit.interval_ms - interval).abs() < 2e-4, "{fit:?}");
        assert!((fit.at(0.0) - 16.8).abs() < 0.5, "{fit:?}");
        assert!(fit.worst_ms < 1.0);
    }

    #[test]
    fn no_line_without_two_points_that_rise() {
        assert_eq!(ClockFit::through(&[]), None);
        assert_eq!(ClockFit::through(&[(0.0, 1.0)]), None);
        assert_eq!(ClockFit::through(&[(5.0, 1.0), (5.0, 2.0)]), None);
        assert_eq!(ClockFit::through(&[(0.0, 2.0), (5.0, 1.0)]), None);
        assert_eq!(ClockFit::through(&[(0.0, f64::NAN), (5.0, 1.0)]), None);
    }
}
