//! The sections of the configuration about sources of heading.

use std::path::PathBuf;

use anyhow::Result;
use bowwave_core::{
    estimate::{HeadingSettings, Landmark, Stow},
    event::MarkKind,
    text::toml::{OptionalKey, RequiredKey, Spanned, TomlError, TomlText, ValueRule, number},
};
use bowwave_devices::{
    serial::LineSettings,
    trigger::{InputLine, Press, PressKind},
};
use serde::Deserialize;

use super::devices::{RawBaud, RawGpioLine, baud_rates};

/// Most landmarks of one place.
const LANDMARKS_MAX: usize = 64;

/// A bearing: clockwise, from the bow or from north.
fn bearing() -> ValueRule<'static, f64, f64> {
    number(-360.0..=360.0, "degrees")
}

/// The standard deviation of a heading that somebody gives.
fn sigma() -> ValueRule<'static, f64, f64> {
    number(0.01..=20.0, "degrees")
}

/// A rate at which a heading may drift.
fn drift() -> ValueRule<'static, f64, f64> {
    number(0.0..=3600.0, "degrees/h")
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawShip {
    device: Spanned<PathBuf>,
    baud: OptionalKey<RawBaud>,
    latency_ms: OptionalKey<f64>,
    sigma_deg: OptionalKey<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawRezero {
    input: Option<RawGpioLine>,
    from_bow_deg: OptionalKey<f64>,
    from_north_deg: OptionalKey<f64>,
    sigma_deg: OptionalKey<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawLandmarks {
    input: Option<RawGpioLine>,
    at: Vec<RawLandmark>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLandmark {
    bearing_deg: RequiredKey<f64>,
    sigma_deg: OptionalKey<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawHeading {
    growth_deg_per_h: OptionalKey<f64>,
    sky_drift_deg_per_h: OptionalKey<f64>,
    display_sigma_above_deg: OptionalKey<f64>,
}

/// The raw sections together.
pub(super) struct RawHeadings {
    pub(super) ship: Option<RawShip>,
    pub(super) rezero: Option<Spanned<RawRezero>>,
    pub(super) landmarks: RawLandmarks,
    pub(super) heading: RawHeading,
}

/// Sources of heading beside the inertial unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HeadingChoice {
    /// The session's part.
    pub settings: HeadingSettings,
    /// The ship's own heading.
    pub ship: Option<LineSettings>,
    /// Buttons of the operator.
    pub presses: Vec<Press>,
}

impl RawHeadings {
    pub(super) fn check(self, text: TomlText<'_>) -> Result<HeadingChoice> {
        let mut choice = HeadingChoice::default();
        if let Some(raw) = self.ship {
            choice.ship = Some(raw.check(text, &mut choice.settings)?);
        }
        if self.rezero.is_some() {
            let (stow, input) = rezero(text, self.rezero)?;
            choice.settings.stow = Some(stow);
            choice.presses.extend(input.map(|line| Press { line, kind: PressKind::Mark(MarkKind::Stow) }));
        }
        let (landmarks, input) = self.landmarks.check(text)?;
        choice.settings.landmarks = landmarks;
        choice.presses.extend(input.map(|line| Press { line, kind: PressKind::Mark(MarkKind::Landmark) }));
        let per_hour =
            |value| Ok::<_, TomlError>(text.given(value, drift())?.map(|d| d.to_radians() / 3600.0));
        choice.settings.own_growth = per_hour(&self.heading.growth_deg_per_h)?;
        if let Some(drift) = per_hour(&self.heading.sky_drift_deg_per_h)? {
            choice.settings.sky_drift = drift;
        }
        let shown = number(0.0..=180.0, "degrees");
        if let Some(deg) = text.given(&self.heading.display_sigma_above_deg, shown)? {
            choice.settings.shown_above = deg.to_radians();
        }
        Ok(choice)
    }
}

impl RawShip {
    fn check(self, text: TomlText<'_>, settings: &mut HeadingSettings) -> Result<LineSettings> {
        let device = self.device.get_ref();
        if let Err(e) = glob::Pattern::new(&device.to_string_lossy()) {
            return Err(text.error(&self.device, e).into());
        }
        if let Some(ms) = text.given(&self.latency_ms, number(0.0..=1500.0, "ms"))? {
            settings.ship.latency_ns = bowwave_core::time::secs_to_ns(ms * 1e-3);
        }
        if let Some(deg) = text.given(&self.sigma_deg, sigma())? {
            settings.ship.sigma = deg.to_radians();
        }
        let usual = LineSettings::ship(self.device.into_inner());
        let baud = text.given(&self.baud, baud_rates())?.unwrap_or_else(|| usual.baud.clone());
        Ok(LineSettings { baud, ..usual })
    }
}

fn rezero(text: TomlText<'_>, raw: Option<Spanned<RawRezero>>) -> Result<(Stow, Option<InputLine>)> {
    let (section, raw) = text.section("rezero", raw);
    let radians = |value| Ok::<_, TomlError>(text.given(value, bearing())?.map(f64::to_radians));
    let (from_bow, from_north) = (radians(&raw.from_bow_deg)?, radians(&raw.from_north_deg)?);
    if from_bow.is_none() && from_north.is_none() {
        let what = "it (with a ship feed) or from_north_deg: where the gun stands when the operator presses";
        return Err(section.missing("from_bow_deg", what).into());
    }
    let sigma = text.given(&raw.sigma_deg, sigma())?.unwrap_or(0.5);
    let stow = Stow { from_bow, from_north, sigma: sigma.to_radians() };
    Ok((stow, raw.input.map(|line| line.input(text)).transpose()?))
}

impl RawLandmarks {
    fn check(self, text: TomlText<'_>) -> Result<(Vec<Landmark>, Option<InputLine>)> {
        if let Some(beyond) = self.at.get(LANDMARKS_MAX) {
            let why = format!("is beyond {LANDMARKS_MAX} landmarks, the most of one place");
            return Err(text.error(&beyond.bearing_deg, why).into());
        }
        let landmark = |raw: RawLandmark| -> Result<Landmark, TomlError> {
            let bearing = text.needed(&raw.bearing_deg, bearing())?;
            let sigma = text.given(&raw.sigma_deg, sigma())?.unwrap_or(0.3);
            Ok(Landmark { bearing: bearing.to_radians(), sigma: sigma.to_radians() })
        };
        let landmarks = self.at.into_iter().map(landmark).collect::<Result<_, _>>()?;
        Ok((landmarks, self.input.map(|line| line.input(text)).transpose()?))
    }
}
