//! Sun and moon in the summary of a run.

use bowwave_core::{estimate::light::Luminaries, geometry::bearing_and_elevation_deg};
use serde::Serialize;

/// The sun at the end of a run, and what told where it stands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SunSummary {
    /// Degrees clockwise from north.
    pub bearing_deg: f64,
    /// Degrees above the horizon.
    pub elevation_deg: f64,
    /// `scenario`, or `ship` for the place and time of her instruments.
    pub source: &'static str,
    /// The moon, where it gives more light than the sun.
    pub moonlight: Option<MoonSummary>,
}

/// The moon that lights a scene.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MoonSummary {
    /// Degrees clockwise from north.
    pub bearing_deg: f64,
    /// Degrees above the horizon.
    pub elevation_deg: f64,
    /// Share of its disc that is lit.
    pub lit: f64,
}

impl From<&Luminaries> for SunSummary {
    fn from(seen: &Luminaries) -> Self {
        let [bearing_deg, elevation_deg] = bearing_and_elevation_deg(seen.sun);
        let moonlight = seen.moonlight().map(|moon| {
            let [bearing_deg, elevation_deg] = bearing_and_elevation_deg(moon.direction);
            MoonSummary { bearing_deg, elevation_deg, lit: moon.lit }
        });
        let source = if seen.from_ship { "ship" } else { "scenario" };
        Self { bearing_deg, elevation_deg, source, moonlight }
    }
}
