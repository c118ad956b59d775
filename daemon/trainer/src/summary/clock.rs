//! What a run tells of the inertial unit's clock: in the summary.

use bowwave_core::estimate::clock::ClockReport;
use serde::Serialize;

/// The unit's clock at the end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ClockSummary {
    /// How much faster than the host's it runs, parts per million.
    pub drift_ppm: f64,
    /// Standard deviation of that.
    pub drift_sigma_ppm: f64,
    /// By how much mapped times jitter, milliseconds, one standard deviation.
    pub jitter_ms: f64,
    /// The most of that, milliseconds.
    pub jitter_max_ms: f64,
    /// By how much arrivals jitter, milliseconds, one standard deviation.
    pub arrival_jitter_ms: f64,
}

impl From<ClockReport> for ClockSummary {
    fn from(report: ClockReport) -> Self {
        Self {
            drift_ppm: report.drift_ppm,
            drift_sigma_ppm: report.drift_sigma_ppm,
            jitter_ms: report.jitter_s * 1e3,
            jitter_max_ms: report.jitter_max_s * 1e3,
            arrival_jitter_ms: report.arrival_jitter_s * 1e3,
        }
    }
}
