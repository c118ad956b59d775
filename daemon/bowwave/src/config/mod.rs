//! The configuration file: raw TOML in, checked settings out. Unknown keys and bad values are refused with line and column.

mod devices;
mod heading;

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

pub use self::heading::HeadingChoice;
use anyhow::{Context, Result, bail};
use bowwave_core::{
    estimate::attitude::Source as Orientation,
    text::{line_column, one_line},
};
use bowwave_devices::{
    camera::CameraSettings, lamps::LampSettings, lcd::LcdSettings, serial::ImuSettings, trigger::InputLine,
};
use bowwave_trainer::supervisor::HealthSettings;
use serde::Deserialize;
use toml::Spanned;

use crate::cli::parse_size;

/// Where frames are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ScreenOutput {
    /// On the LCD of the gun computer. `simulate` shows nothing then.
    #[default]
    Lcd,
    /// In a window on a desktop.
    Window,
    /// Nowhere.
    None,
}

/// The trigger's line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TriggerChoice {
    /// Which line.
    pub line: InputLine,
    /// How long contacts chatter.
    pub debounce: Duration,
}

/// Checked settings. Everything has a default; the command line overrides it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Where frames are shown.
    pub output: ScreenOutput,
    /// Picture size in pixels; without it the LCD's own.
    pub size: Option<(u32, u32)>,
    /// The LCD.
    pub lcd: LcdSettings,
    /// The camera; the calibrated size and serial number are the calibration's.
    pub camera: CameraSettings,
    /// The inertial unit.
    pub imu: ImuSettings,
    /// Whose estimate of the orientation is used.
    pub orientation: Orientation,
    /// Where headings come from beside the inertial unit.
    pub heading: HeadingChoice,
    /// The trigger's line; without it nothing fires.
    pub trigger: Option<TriggerChoice>,
    /// The input that tells that the gun is inert; without it the trainer does not arm.
    pub interlock: Option<InputLine>,
    /// The input that tells that the supply voltage sinks.
    pub power_fail: Option<InputLine>,
    /// The lamps.
    pub lamps: Option<LampSettings>,
    /// Vulkan device by number or part of its name.
    pub gpu: Option<String>,
    /// Whether to run with the validation layer.
    pub validation: bool,
    /// How long the GPU may take over a frame before it counts as hung.
    pub hang: Option<Duration>,
    /// Scenario file or the name of a built-in one.
    pub scenario: Option<PathBuf>,
    /// Calibration file.
    pub calibration: Option<PathBuf>,
    /// Whether to keep what went in as a recording.
    pub record: bool,
    /// Whether pictures that come without a JPEG are recorded as they are, so that a replay sees the very same pixels.
    pub record_exact: bool,
    /// Folder for hits, recordings and the last good configuration; without it the service's state folder.
    pub data: Option<PathBuf>,
    /// What is watched besides the devices.
    pub health: HealthSettings,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Raw {
    screen: RawScreen,
    camera: devices::RawCamera,
    imu: devices::RawImu,
    ship: Option<heading::RawShip>,
    rezero: Option<Spanned<heading::RawRezero>>,
    landmarks: heading::RawLandmarks,
    heading: heading::RawHeading,
    trigger: Option<devices::RawTrigger>,
    interlock: Option<devices::RawLine>,
    power_fail: Option<devices::RawLine>,
    lamps: Option<devices::RawLamps>,
    gpu: RawGpu,
    files: RawFiles,
    health: RawHealth,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawScreen {
    output: ScreenOutput,
    size: Option<Spanned<String>>,
    card: Option<PathBuf>,
    connector: Option<String>,
    refresh_hz: Option<Spanned<f64>>,
    legacy: bool,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawGpu {
    device: Option<Spanned<String>>,
    validation: bool,
    hang_ms: Option<Spanned<f64>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawFiles {
    scenario: Option<PathBuf>,
    calibration: Option<PathBuf>,
    record: bool,
    record_exact: bool,
    data: Option<PathBuf>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawHealth {
    thermal: Option<PathBuf>,
    limit_c: Option<Spanned<f64>>,
}

/// Reads and checks a configuration file. Relative paths in it are taken from its own folder.
pub fn read(path: &Path) -> Result<Config> {
    let text = std::fs::read_to_string(path).with_context(|| {
        format!("cannot read the configuration {}; name an existing file with --config", path.display())
    })?;
    let base = path.parent().unwrap_or(Path::new("."));
    parse(&text, &path.display().to_string(), base)
}

/// The text that is checked, and what errors call it.
#[derive(Clone, Copy)]
struct Source<'a> {
    text: &'a str,
    origin: &'a str,
}

impl Source<'_> {
    /// An error about the value at `place`.
    fn wrong(self, place: &std::ops::Range<usize>, why: impl std::fmt::Display) -> anyhow::Error {
        let (line, column) = line_column(self.text, place.start);
        anyhow::anyhow!("{}:{line}:{column}: {}", self.origin, one_line(&why.to_string()))
    }

    /// The value, where `good`; an error that says what it must be.
    fn number(
        self,
        value: Option<Spanned<f64>>,
        name: &str,
        range: std::ops::RangeInclusive<f64>,
    ) -> Result<Option<f64>> {
        match value {
            Some(v) if !range.contains(v.get_ref()) => {
                let why = format!("{name} is {}: give {} to {}", v.get_ref(), range.start(), range.end());
                Err(self.wrong(&v.span(), why))
            }
            v => Ok(v.map(Spanned::into_inner)),
        }
    }
}

/// Checks configuration text; `origin` is what errors call it.
pub fn parse(text: &str, origin: &str, base: &Path) -> Result<Config> {
    let source = Source { text, origin };
    let raw: Raw = match toml::from_str(text) {
        Ok(raw) => raw,
        Err(e) => {
            let (line, column) = line_column(text, e.span().map_or(0, |s| s.start));
            bail!(
                "{origin}:{line}:{column}: {}; systemd/bowwave.toml shows every key",
                one_line(e.message())
            );
        }
    };
    let size = match &raw.screen.size {
        None => None,
        Some(s) => Some(
            parse_size(s.get_ref()).map_err(|why| source.wrong(&s.span(), format!("screen.size: {why}")))?,
        ),
    };
    if let Some(device) = raw.gpu.device.as_ref().filter(|d| d.get_ref().trim().is_empty()) {
        let why = "gpu.device is empty; leave it out or give a number or part of a name";
        return Err(source.wrong(&device.span(), why));
    }
    let mut lcd = LcdSettings {
        card: raw.screen.card,
        connector: raw.screen.connector,
        legacy: raw.screen.legacy,
        ..LcdSettings::default()
    };
    lcd.mode.size = size;
    lcd.mode.refresh_hz = source.number(raw.screen.refresh_hz, "screen.refresh_hz", 1.0..=1000.0)?;
    let limit_c = source.number(raw.health.limit_c, "health.limit_c", 20.0..=150.0)?;
    // A built-in scenario's name is no path.
    let scenario = raw.files.scenario.map(|p| {
        let built_in = bowwave_core::world::scenario::BUILT_IN.iter().any(|(name, _)| p.as_os_str() == *name);
        if built_in { p } else { base.join(p) }
    });
    let heading = heading::RawHeadings {
        ship: raw.ship,
        rezero: raw.rezero,
        landmarks: raw.landmarks,
        heading: raw.heading,
    };
    Ok(Config {
        heading: heading.check(source)?,
        output: raw.screen.output,
        size,
        lcd,
        camera: raw.camera.check(source)?,
        orientation: raw.imu.orientation(source)?,
        imu: raw.imu.check(source)?,
        trigger: raw.trigger.map(|t| t.check(source)).transpose()?,
        interlock: raw.interlock.map(devices::RawLine::input),
        power_fail: raw.power_fail.map(devices::RawLine::input),
        lamps: raw.lamps.map(devices::RawLamps::settings),
        gpu: raw.gpu.device.map(Spanned::into_inner),
        validation: raw.gpu.validation,
        hang: source
            .number(raw.gpu.hang_ms, "gpu.hang_ms", 100.0..=60_000.0)?
            .map(|ms| Duration::from_secs_f64(ms * 1e-3)),
        scenario,
        calibration: raw.files.calibration.map(|p| base.join(p)),
        record: raw.files.record,
        record_exact: raw.files.record_exact,
        data: raw.files.data.map(|p| base.join(p)),
        health: HealthSettings { thermal: raw.health.thermal, limit_c },
    })
}

#[cfg(test)]
mod tests;
