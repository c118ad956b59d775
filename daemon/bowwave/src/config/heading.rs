//! The sections of the configuration that say where headings come from.

use std::path::PathBuf;

use anyhow::Result;
use bowwave_core::{
    estimate::{HeadingSettings, Landmark, Stow},
    event::MarkKind,
};
use bowwave_devices::{
    serial::ShipSettings,
    trigger::{InputLine, Press},
};
use serde::Deserialize;
use toml::Spanned;

use super::{
    Source,
    devices::{RawBaud, RawLine, baud},
};

/// Landmarks that one place has at most.
const LANDMARKS_MOST: usize = 64;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawShip {
    device: Spanned<PathBuf>,
    baud: Option<Spanned<RawBaud>>,
    latency_ms: Option<Spanned<f64>>,
    sigma_deg: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRezero {
    input: Option<RawLine>,
    from_bow_deg: Option<Spanned<f64>>,
    from_north_deg: Option<Spanned<f64>>,
    sigma_deg: Option<Spanned<f64>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawLandmarks {
    input: Option<RawLine>,
    at: Vec<RawLandmark>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLandmark {
    bearing_deg: Spanned<f64>,
    sigma_deg: Option<Spanned<f64>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawHeading {
    growth_deg_per_h: Option<Spanned<f64>>,
    sky_drift_deg_per_h: Option<Spanned<f64>>,
    shown_above_deg: Option<Spanned<f64>>,
}

/// The raw sections together.
pub(super) struct RawHeadings {
    pub(super) ship: Option<RawShip>,
    pub(super) rezero: Option<Spanned<RawRezero>>,
    pub(super) landmarks: RawLandmarks,
    pub(super) heading: RawHeading,
}

/// Where headings come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HeadingChoice {
    /// What the session is told.
    pub settings: HeadingSettings,
    /// The ship's own heading.
    pub ship: Option<ShipSettings>,
    /// Buttons of the operator.
    pub presses: Vec<Press>,
}

impl RawHeadings {
    pub(super) fn check(self, source: Source<'_>) -> Result<HeadingChoice> {
        let mut choice = HeadingChoice::default();
        if let Some(raw) = self.ship {
            choice.ship = Some(raw.check(source, &mut choice.settings)?);
        }
        if let Some(raw) = self.rezero {
            let place = raw.span();
            let (stow, input) = raw.into_inner().check(source, &place)?;
            choice.settings.stow = Some(stow);
            choice.presses.extend(input.map(|line| Press { line, kind: MarkKind::Stow }));
        }
        let (landmarks, input) = self.landmarks.check(source)?;
        choice.settings.landmarks = landmarks;
        choice.presses.extend(input.map(|line| Press { line, kind: MarkKind::Landmark }));
        let growth =
            source.number(self.heading.growth_deg_per_h, "heading.growth_deg_per_h", 0.0..=3600.0)?;
        choice.settings.own_growth = growth.map(|g| g.to_radians() / 3600.0);
        let drift =
            source.number(self.heading.sky_drift_deg_per_h, "heading.sky_drift_deg_per_h", 0.0..=3600.0)?;
        if let Some(deg) = drift {
            choice.settings.sky_drift = deg.to_radians() / 3600.0;
        }
        if let Some(deg) =
            source.number(self.heading.shown_above_deg, "heading.shown_above_deg", 0.0..=180.0)?
        {
            choice.settings.shown_above = deg.to_radians();
        }
        Ok(choice)
    }
}

impl RawShip {
    fn check(self, source: Source<'_>, settings: &mut HeadingSettings) -> Result<ShipSettings> {
        let device = self.device.get_ref();
        if let Err(e) = glob::Pattern::new(&device.to_string_lossy()) {
            return Err(source.wrong(&self.device.span(), format!("ship.device: {e}")));
        }
        if let Some(ms) = source.number(self.latency_ms, "ship.latency_ms", 0.0..=1500.0)? {
            settings.ship_latency_ns = bowwave_core::time::secs_to_ns(ms * 1e-3);
        }
        if let Some(deg) = source.number(self.sigma_deg, "ship.sigma_deg", 0.01..=20.0)? {
            settings.ship_sigma = deg.to_radians();
        }
        let usual = ShipSettings::new(self.device.into_inner());
        let baud = baud(source, self.baud, "ship.baud")?.unwrap_or_else(|| usual.baud.clone());
        Ok(ShipSettings { baud, ..usual })
    }
}

impl RawRezero {
    fn check(self, source: Source<'_>, place: &std::ops::Range<usize>) -> Result<(Stow, Option<InputLine>)> {
        let bearing = |value, name| {
            Ok::<_, anyhow::Error>(source.number(value, name, -360.0..=360.0)?.map(f64::to_radians))
        };
        let from_bow = bearing(self.from_bow_deg, "rezero.from_bow_deg")?;
        let from_north = bearing(self.from_north_deg, "rezero.from_north_deg")?;
        if from_bow.is_none() && from_north.is_none() {
            let why = "rezero: give from_bow_deg (with a ship feed) or from_north_deg, where the gun stands when it is pressed";
            return Err(source.wrong(place, why));
        }
        let sigma = source.number(self.sigma_deg, "rezero.sigma_deg", 0.01..=20.0)?.unwrap_or(0.5);
        let stow = Stow { from_bow, from_north, sigma: sigma.to_radians() };
        Ok((stow, self.input.map(RawLine::input)))
    }
}

impl RawLandmarks {
    fn check(self, source: Source<'_>) -> Result<(Vec<Landmark>, Option<InputLine>)> {
        if let Some(beyond) = self.at.get(LANDMARKS_MOST) {
            let why = format!("landmarks.at: more than {LANDMARKS_MOST} landmarks");
            return Err(source.wrong(&beyond.bearing_deg.span(), why));
        }
        let landmark = |raw: RawLandmark| {
            let bearing = source.number(Some(raw.bearing_deg), "bearing_deg", -360.0..=360.0)?;
            let sigma = source.number(raw.sigma_deg, "sigma_deg", 0.01..=20.0)?.unwrap_or(0.3);
            Ok(Landmark { bearing: bearing.unwrap_or_default().to_radians(), sigma: sigma.to_radians() })
        };
        let landmarks = self.at.into_iter().map(landmark).collect::<Result<_>>()?;
        Ok((landmarks, self.input.map(RawLine::input)))
    }
}
