//! The sections of the configuration that say which devices there are.

use std::{path::PathBuf, time::Duration};

use anyhow::Result;
use bowwave_core::estimate::attitude::Source as Orientation;
use bowwave_devices::{
    camera::{CameraSettings, Coding, Controls, Exposure, Focus, Rate, WantedMode, WhiteBalance},
    imu::ImuFormat,
    lamps::LampSettings,
    serial::{Baud, ImuSettings},
    trigger::{Bias, InputLine},
};
use serde::Deserialize;
use toml::Spanned;

use super::{Source, TriggerChoice};
use crate::cli::parse_size;

/// A number, or the word "auto".
#[derive(Deserialize)]
#[serde(untagged)]
enum NumberOrAuto {
    Number(u32),
    Word(String),
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawCamera {
    device: Option<PathBuf>,
    serial: Option<String>,
    modes: Vec<Spanned<String>>,
    exposure_us: Option<Spanned<NumberOrAuto>>,
    white_balance_k: Option<Spanned<NumberOrAuto>>,
    focus: Option<u32>,
    gain: Option<u32>,
    buffers: Option<Spanned<u32>>,
    readout_us: Option<u32>,
}

impl RawCamera {
    pub(super) fn check(self, source: Source<'_>) -> Result<CameraSettings> {
        let modes = self
            .modes
            .iter()
            .map(|m| mode(m.get_ref()).map_err(|why| source.wrong(&m.span(), format!("camera.modes: {why}"))))
            .collect::<Result<Vec<_>>>()?;
        let exposure = match locked(source, self.exposure_us, "camera.exposure_us")? {
            None => Exposure::Leave,
            Some(None) => Exposure::Auto,
            Some(Some(time_us)) => Exposure::Locked { time_us },
        };
        let white_balance = match locked(source, self.white_balance_k, "camera.white_balance_k")? {
            None => WhiteBalance::Leave,
            Some(None) => WhiteBalance::Auto,
            Some(Some(kelvin)) => WhiteBalance::Locked { kelvin },
        };
        let defaults = CameraSettings::default();
        let buffers = match self.buffers {
            None => defaults.buffers,
            Some(b) if (3..=32).contains(b.get_ref()) => b.into_inner(),
            Some(b) => {
                return Err(
                    source.wrong(&b.span(), format!("camera.buffers is {}: give 3 to 32", b.get_ref()))
                );
            }
        };
        Ok(CameraSettings {
            device: self.device,
            serial: self.serial,
            modes,
            controls: Controls {
                exposure,
                white_balance,
                focus: self.focus.map_or(Focus::Still, |position| Focus::Locked { position }),
                gain: self.gain,
            },
            buffers,
            readout_us: self.readout_us,
            ..defaults
        })
    }
}

/// `None`: not said. `Some(None)`: the camera's own choice. `Some(Some(n))`: locked to `n`.
fn locked(
    source: Source<'_>,
    value: Option<Spanned<NumberOrAuto>>,
    name: &str,
) -> Result<Option<Option<u32>>> {
    let Some(value) = value else { return Ok(None) };
    match value.get_ref() {
        NumberOrAuto::Number(n) if *n > 0 => Ok(Some(Some(*n))),
        NumberOrAuto::Word(word) if word == "auto" => Ok(Some(None)),
        _ => Err(source.wrong(&value.span(), format!("{name}: give a number above 0, or \"auto\""))),
    }
}

/// "YUYV 1280x720@30": coding, size, frames per second (a fraction as 30000/1001 as well).
fn mode(text: &str) -> Result<WantedMode, String> {
    let usage = || format!("'{text}' is no mode: write as \"YUYV 1280x720@30\" (YUYV, NV12 or MJPEG)");
    let (coding, rest) = text.trim().split_once(char::is_whitespace).ok_or_else(usage)?;
    let coding = match coding.to_ascii_uppercase().as_str() {
        "YUYV" => Coding::Yuyv,
        "NV12" => Coding::Nv12,
        "MJPEG" | "MJPG" => Coding::Mjpeg,
        _ => return Err(usage()),
    };
    let (size, rate) = rest.trim().split_once('@').ok_or_else(usage)?;
    let (width, height) = parse_size(size)?;
    let (frames, seconds) = rate.trim().split_once('/').unwrap_or((rate.trim(), "1"));
    let rate = match (frames.parse(), seconds.parse()) {
        (Ok(frames), Ok(seconds)) => Rate::new(frames, seconds).ok_or_else(usage)?,
        _ => return Err(usage()),
    };
    let wanted = WantedMode { coding, width, height, rate };
    let settings = CameraSettings { modes: vec![wanted], ..CameraSettings::default() };
    settings.check().map_err(|e| e.to_string())?;
    Ok(wanted)
}

#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum RawBaud {
    One(u32),
    Several(Vec<u32>),
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawImu {
    device: Option<PathBuf>,
    baud: Option<Spanned<RawBaud>>,
    format: Option<Spanned<String>>,
    low_latency: Option<bool>,
    late_ms: Option<Spanned<f64>>,
    orientation: Option<Spanned<String>>,
}

impl RawImu {
    /// Whose estimate of the orientation is used.
    pub(super) fn orientation(&self, source: Source<'_>) -> Result<Orientation> {
        let Some(name) = &self.orientation else { return Ok(Orientation::default()) };
        match name.get_ref().as_str() {
            "auto" => Ok(Orientation::Auto),
            "fused" => Ok(Orientation::Fused),
            other => {
                let why = format!("imu.orientation: '{other}' is neither \"auto\" nor \"fused\"");
                Err(source.wrong(&name.span(), why))
            }
        }
    }

    pub(super) fn check(self, source: Source<'_>) -> Result<ImuSettings> {
        let baud = baud(source, self.baud, "imu.baud")?.unwrap_or_default();
        let format = self.format.map(|name| imu_format(source, &name)).transpose()?;
        let late = source.number(self.late_ms, "imu.late_ms", 1.0..=1000.0)?;
        let usual = ImuSettings::default();
        Ok(ImuSettings {
            device: self.device,
            baud,
            format,
            low_latency: self.low_latency.unwrap_or(usual.low_latency),
            late: late.map_or(usual.late, |ms| Duration::from_secs_f64(ms * 1e-3)),
        })
    }
}

pub(super) fn baud(source: Source<'_>, value: Option<Spanned<RawBaud>>, name: &str) -> Result<Option<Baud>> {
    let Some(value) = value else { return Ok(None) };
    let place = value.span();
    let (rates, baud) = match value.into_inner() {
        RawBaud::One(rate) => (vec![rate], Baud::Fixed(rate)),
        RawBaud::Several(rates) => (rates.clone(), Baud::Scan(rates)),
    };
    if rates.is_empty() || rates.len() > 16 || rates.contains(&0) {
        return Err(source.wrong(&place, format!("{name}: give a rate such as 115200, or 1 to 16 to try")));
    }
    Ok(Some(baud))
}

fn imu_format(source: Source<'_>, name: &Spanned<String>) -> Result<ImuFormat> {
    ImuFormat::from_key(name.get_ref()).ok_or_else(|| {
        let known = ImuFormat::ALL.map(ImuFormat::key).join(", ");
        source.wrong(&name.span(), format!("imu.format: '{}' is none of {known}", name.get_ref()))
    })
}

#[derive(Deserialize)]
#[serde(untagged)]
enum RawLineName {
    Number(u32),
    Name(String),
}

impl RawLineName {
    fn text(self) -> String {
        match self {
            Self::Number(n) => n.to_string(),
            Self::Name(name) => name,
        }
    }
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum RawBias {
    #[default]
    AsIs,
    PullUp,
    PullDown,
    Disabled,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLine {
    chip: String,
    line: RawLineName,
    #[serde(default)]
    active_low: bool,
    #[serde(default)]
    bias: RawBias,
}

impl RawLine {
    pub(super) fn input(self) -> InputLine {
        let bias = match self.bias {
            RawBias::AsIs => Bias::AsIs,
            RawBias::PullUp => Bias::PullUp,
            RawBias::PullDown => Bias::PullDown,
            RawBias::Disabled => Bias::Disabled,
        };
        InputLine { chip: self.chip, line: self.line.text(), active_low: self.active_low, bias }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTrigger {
    chip: String,
    line: RawLineName,
    #[serde(default)]
    active_low: bool,
    #[serde(default)]
    bias: RawBias,
    debounce_ms: Option<Spanned<u32>>,
}

/// A switch of ordinary make chatters for less, and nobody presses twice in that time.
const DEBOUNCE_MS: u32 = 15;

impl RawTrigger {
    pub(super) fn check(self, source: Source<'_>) -> Result<TriggerChoice> {
        let ms = match self.debounce_ms {
            None => DEBOUNCE_MS,
            Some(ms) if (10..=20).contains(ms.get_ref()) => ms.into_inner(),
            Some(ms) => {
                let why = format!("trigger.debounce_ms is {}: give 10 to 20", ms.get_ref());
                return Err(source.wrong(&ms.span(), why));
            }
        };
        let line = RawLine { chip: self.chip, line: self.line, active_low: self.active_low, bias: self.bias };
        Ok(TriggerChoice { line: line.input(), debounce: Duration::from_millis(u64::from(ms)) })
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLamps {
    chip: String,
    ready: Option<RawLineName>,
    hit: Option<RawLineName>,
    fault: Option<RawLineName>,
    #[serde(default)]
    active_low: bool,
}

impl RawLamps {
    pub(super) fn settings(self) -> LampSettings {
        LampSettings {
            chip: self.chip,
            ready: self.ready.map(RawLineName::text),
            hit: self.hit.map(RawLineName::text),
            fault: self.fault.map(RawLineName::text),
            active_low: self.active_low,
        }
    }
}
