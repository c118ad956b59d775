//! What a run tells of the sea in the video: in the log as it changes, and in the summary.

use bowwave_core::estimate::{
    SeaReport,
    sea::{SeaSource, Unknown},
};
use serde::Serialize;

/// Tells the log.
#[derive(Debug, Default)]
pub struct SeaLog {
    told: Option<(u8, SeaSource)>,
    refused: Option<std::mem::Discriminant<Unknown>>,
}

impl SeaLog {
    /// Takes in what is known after a frame; says what is new of it.
    pub fn follow(&mut self, report: &SeaReport) {
        let in_use = report.in_use;
        let now = (in_use.state.get(), in_use.source);
        if self.told.replace(now) != Some(now) {
            log::info!("{}", words(report));
        }
        let refused = match &report.newest {
            // That it takes time is no refusal.
            Ok(_) | Err(Unknown::TooShort { after: None, .. }) => None,
            Err(why) => Some(std::mem::discriminant(why)),
        };
        if self.refused != refused {
            self.refused = refused;
            if let (Some(_), Err(why)) = (refused, &report.newest) {
                log::info!("the sea is not measured at present: {why}");
            }
        }
    }
}

fn words(report: &SeaReport) -> String {
    let c = report.in_use.conditions;
    let sea = format!(
        "{:.2} m, {:.1} s, from {:.0} deg",
        c.significant_height_m,
        c.peak_period_s,
        c.from_rad.to_degrees().rem_euclid(360.0)
    );
    let source = match report.in_use.source {
        SeaSource::Ordered => "as ordered",
        SeaSource::Measured => "measured in the video",
        SeaSource::Kept => "kept from before, not measured at present",
        SeaSource::Assumed => "of the scenario, not measured yet",
    };
    format!(
        "sea state {} ({source}): {sea}, wind for reflections {:.1} m/s",
        report.in_use.state.get(),
        report.wind_m_s
    )
}

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
