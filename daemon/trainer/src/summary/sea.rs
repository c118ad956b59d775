//! What a run tells of the sea in the video: in the summary.

use bowwave_core::estimate::{SeaReport, sea::SeaSource};
use serde::Serialize;

/// The sea at the end of a run. Heights in metres, periods in seconds, directions in degrees; sigma is one standard deviation.
#[derive(Clone, Debug, Serialize)]
pub struct SeaSummary {
    /// `ordered`, `measured`, `kept` or `assumed`.
    pub source: &'static str,
    /// WMO sea state that is drawn.
    pub state: u8,
    /// Significant height that is drawn.
    pub height_m: f64,
    /// Peak period that is drawn.
    pub period_s: f64,
    /// Where its waves come from, clockwise from north.
    pub from_deg: f64,
    /// Wind that reflections are drawn with, m/s.
    pub wind_m_s: f64,
    /// The newest estimate: height, its sigma, period, its sigma, direction, its sigma; null where there was none.
    pub newest: Option<[f64; 6]>,
    /// Why the newest look gave no estimate.
    pub refused_because: Option<String>,
    /// Estimates.
    pub estimates: u64,
    /// Looks that gave none.
    pub refused: u64,
}

impl From<SeaReport> for SeaSummary {
    fn from(report: SeaReport) -> Self {
        let round = |v: f64| (v * 1e3).round() / 1e3;
        let degrees = |v: f64| round(v.to_degrees());
        let c = report.in_use.conditions;
        let newest = report.newest.ok().map(|e| {
            let (h, t, d) = (e.significant_height_m, e.peak_period_s, e.direction_from_rad);
            [
                round(h.value),
                round(h.sigma),
                round(t.value),
                round(t.sigma),
                degrees(d.value),
                degrees(d.sigma),
            ]
        });
        Self {
            source: match report.in_use.source {
                SeaSource::Ordered => "ordered",
                SeaSource::Measured => "measured",
                SeaSource::Kept => "kept",
                SeaSource::Assumed => "assumed",
            },
            state: report.in_use.state.get(),
            height_m: round(c.significant_height_m),
            period_s: round(c.peak_period_s),
            from_deg: degrees(c.from_rad.rem_euclid(std::f64::consts::TAU)),
            wind_m_s: round(report.wind_m_s),
            newest,
            refused_because: report.newest.err().map(|why| why.to_string()),
            estimates: report.estimates,
            refused: report.refused,
        }
    }
}
