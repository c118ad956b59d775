//! The configuration file: raw TOML in, checked settings out. Unknown keys and bad values are refused with line and column.

mod devices;
mod heading;

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

pub use self::heading::HeadingChoice;
use anyhow::{Context, Result};
use bowwave_core::{
    estimate::attitude::Source as Orientation,
    text::toml::{OptionalKey, RenamedKey, Spanned, TEXT_BYTES_MAX, TomlError, TomlText, number, one_of},
};
use bowwave_devices::{
    camera::CameraSettings,
    lamps::LampSettings,
    lcd::LcdSettings,
    serial::ImuSettings,
    trigger::{InputLine, InterlockWiring},
};
use bowwave_files::plain_text;
use bowwave_trainer::{presenter::GpuSettings, supervisor::HealthSettings};
use serde::Deserialize;

use crate::{cli::parse_size, loading::warn_of_former_names};

/// Where frames are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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
    /// Former names of keys that the text uses, each with its place and the new name.
    pub warnings: Vec<String>,
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
    /// Trigger, interlock, power-fail input and lamps.
    pub gpio: GpioSettings,
    /// The GPU.
    pub gpu: GpuSettings,
    /// Files that are read and written.
    pub files: FileSettings,
    /// Sensors that are watched besides the devices.
    pub health: HealthSettings,
    /// The socket of the instructor's process.
    pub instructor: InstructorSettings,
}

/// The table `[instructor]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InstructorSettings {
    /// The socket that the instructor's process connects to; none without it.
    pub socket: Option<PathBuf>,
    /// Folder of the instructor's scenarios: models that these name lie there.
    pub scenarios: Option<PathBuf>,
}

/// Settings of the GPIO lines, those of the operator's buttons left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GpioSettings {
    /// The trigger's line; without it nothing fires.
    pub trigger: Option<TriggerChoice>,
    /// The input that tells that the gun is inert; without it the trainer does not arm.
    pub interlock: Option<InterlockWiring>,
    /// The input that tells that the supply voltage sinks.
    pub power_fail: Option<InputLine>,
    /// The lamps.
    pub lamps: Option<LampSettings>,
}

/// The table `[files]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileSettings {
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
}

/// Former names of keys.
const RENAMED: [RenamedKey; 4] = [
    RenamedKey { table: "heading", old: "shown_above_deg", new: "display_sigma_above_deg" },
    RenamedKey { table: "imu", old: "late_ms", new: "packet_jitter_ms_max" },
    RenamedKey { table: "gpu", old: "hang_ms", new: "gpu_timeout_ms" },
    RenamedKey { table: "health", old: "limit_c", new: "temperature_c_max" },
];

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawConfig {
    screen: RawScreen,
    camera: devices::RawCamera,
    imu: devices::RawImu,
    ship: Option<heading::RawShip>,
    rezero: Option<Spanned<heading::RawRezero>>,
    landmarks: heading::RawLandmarks,
    heading: heading::RawHeading,
    trigger: Option<devices::RawGpioLine>,
    buttons: devices::RawButtons,
    interlock: Option<devices::RawGpioLine>,
    power_fail: Option<devices::RawGpioLine>,
    lamps: Option<devices::RawLamps>,
    gpu: RawGpu,
    files: RawFiles,
    health: RawHealth,
    instructor: RawInstructor,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawInstructor {
    socket: Option<PathBuf>,
    scenarios: Option<PathBuf>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawScreen {
    output: OptionalKey<String>,
    size: Option<Spanned<String>>,
    card: Option<PathBuf>,
    connector: Option<String>,
    refresh_hz: OptionalKey<f64>,
    legacy: bool,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawGpu {
    device: Option<Spanned<String>>,
    validation: bool,
    gpu_timeout_ms: OptionalKey<f64>,
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
    temperature_c_max: OptionalKey<f64>,
}

/// Reads and checks a configuration file. Relative paths in it are taken from its own folder.
pub fn read(path: &Path) -> Result<Config> {
    let text = plain_text(path, TEXT_BYTES_MAX).with_context(|| {
        format!("cannot read the configuration {}; name an existing file with --config", path.display())
    })?;
    let base = path.parent().unwrap_or(Path::new("."));
    let config = parse(&text, &path.display().to_string(), base)?;
    warn_of_former_names(&config.warnings);
    Ok(config)
}

/// Checks configuration text; `origin` is its name in errors.
pub fn parse(text: &str, origin: &str, base: &Path) -> Result<Config> {
    let text = TomlText::new(text, origin)?;
    let (raw, warnings) = text.read::<RawConfig>(&RENAMED).map_err(|e| {
        let problem = format!("{}; systemd/bowwave.toml shows every key", e.problem);
        TomlError { problem, ..e }
    })?;
    if let Some(device) = raw.gpu.device.as_ref().filter(|d| d.get_ref().trim().is_empty()) {
        let why = "is empty; leave it out or give a number or part of a name";
        return Err(text.error(device, why).into());
    }
    let size = raw.screen.size.as_ref();
    let size = size.map(|s| parse_size(s.get_ref()).map_err(|why| text.error(s, why))).transpose()?;
    let mut lcd = LcdSettings {
        card: raw.screen.card,
        connector: raw.screen.connector,
        legacy: raw.screen.legacy,
        ..LcdSettings::default()
    };
    lcd.mode.size = size;
    lcd.mode.refresh_hz = text.given(&raw.screen.refresh_hz, number(1.0..=1000.0, "Hz"))?;
    let outputs =
        [("lcd", ScreenOutput::Lcd), ("window", ScreenOutput::Window), ("none", ScreenOutput::None)];
    let temperature_c_max =
        text.given(&raw.health.temperature_c_max, number(20.0..=150.0, "degrees Celsius"))?;
    let timeout_ms = text.given(&raw.gpu.gpu_timeout_ms, number(100.0..=60_000.0, "ms"))?;
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
    let mut heading = heading.check(text)?;
    heading.presses.extend(raw.buttons.presses(text)?);
    let input = |line: Option<devices::RawGpioLine>| line.map(|line| line.input(text)).transpose();
    Ok(Config {
        heading,
        output: text.given(&raw.screen.output, one_of(&outputs))?.unwrap_or_default(),
        size,
        lcd,
        camera: raw.camera.check(text)?,
        orientation: raw.imu.orientation(text)?,
        imu: raw.imu.check(text)?,
        gpio: GpioSettings {
            trigger: raw.trigger.map(|line| line.trigger(text)).transpose()?,
            interlock: raw.interlock.map(|line| line.interlock(text)).transpose()?,
            power_fail: input(raw.power_fail)?,
            lamps: raw.lamps.map(|lamps| lamps.settings(text)).transpose()?,
        },
        gpu: GpuSettings {
            device: raw.gpu.device.map(Spanned::into_inner),
            validation: raw.gpu.validation,
            timeout: timeout_ms.map(|ms| Duration::from_secs_f64(ms * 1e-3)),
        },
        files: FileSettings {
            scenario,
            calibration: raw.files.calibration.map(|p| base.join(p)),
            record: raw.files.record,
            record_exact: raw.files.record_exact,
            data: raw.files.data.map(|p| base.join(p)),
        },
        health: HealthSettings { thermal: raw.health.thermal, temperature_c_max },
        instructor: InstructorSettings {
            socket: raw.instructor.socket.map(|p| base.join(p)),
            scenarios: raw.instructor.scenarios.map(|p| base.join(p)),
        },
        warnings,
    })
}

#[cfg(test)]
mod tests;
