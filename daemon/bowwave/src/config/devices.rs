//! The sections of the configuration about devices.

use std::{path::PathBuf, time::Duration};

use anyhow::Result;
use bowwave_core::{
    act::Act,
    estimate::attitude::Source as Orientation,
    side::Side,
    text::toml::{OptionalKey, RequiredKey, Spanned, TomlError, TomlText, ValueRule, number, one_of, whole},
};
use bowwave_devices::{
    camera::{CameraSettings, Coding, Controls, Exposure, Focus, Rate, WantedMode, WhiteBalance},
    imu::ImuFormat,
    lamps::LampSettings,
    serial::{Baud, ImuSettings, LineSettings},
    trigger::{Bias, InputLine, InterlockWiring, Press, PressKind},
};
use serde::Deserialize;

use super::TriggerChoice;
use crate::cli::parse_size;

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawCamera {
    device: Option<PathBuf>,
    serial: Option<String>,
    modes: Vec<Spanned<String>>,
    exposure_us: OptionalKey<NumberOrWord>,
    white_balance_k: OptionalKey<NumberOrWord>,
    focus: OptionalKey<i64>,
    gain: OptionalKey<i64>,
    buffers: OptionalKey<i64>,
    readout_us: OptionalKey<i64>,
}

impl RawCamera {
    pub(super) fn check(self, text: TomlText<'_>) -> Result<CameraSettings> {
        let wanted = |name: &Spanned<String>| mode(name.get_ref()).map_err(|why| text.error(name, why));
        let exposure = match text.given(&self.exposure_us, locked_or_auto())? {
            None => Exposure::Leave,
            Some(None) => Exposure::Auto,
            Some(Some(time_us)) => Exposure::Locked { time_us },
        };
        let white_balance = match text.given(&self.white_balance_k, locked_or_auto())? {
            None => WhiteBalance::Leave,
            Some(None) => WhiteBalance::Auto,
            Some(Some(kelvin)) => WhiteBalance::Locked { kelvin },
        };
        let step = |value| text.given(value, whole(0..=u32::MAX));
        let defaults = CameraSettings::default();
        Ok(CameraSettings {
            device: self.device,
            serial: self.serial,
            modes: self.modes.iter().map(wanted).collect::<Result<_, _>>()?,
            controls: Controls {
                exposure,
                white_balance,
                focus: step(&self.focus)?.map_or(Focus::Still, |position| Focus::Locked { position }),
                gain: step(&self.gain)?,
            },
            buffers: text.given(&self.buffers, whole(3..=32))?.unwrap_or(defaults.buffers),
            readout_us: step(&self.readout_us)?,
            ..defaults
        })
    }
}

/// A number or a word, as they stand in the text.
#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum NumberOrWord {
    Number(i64),
    Word(String),
}

/// A control locked to a number above 0, or left to the camera (`None`).
fn locked_or_auto() -> ValueRule<'static, NumberOrWord, Option<u32>> {
    ValueRule::new("a number above 0, or \"auto\"", |raw: &NumberOrWord| match raw {
        NumberOrWord::Number(n) => u32::try_from(*n).ok().filter(|n| *n > 0).map(Some),
        NumberOrWord::Word(word) => (word == "auto").then_some(None),
    })
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

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawImu {
    device: Option<PathBuf>,
    baud: OptionalKey<RawBaud>,
    format: OptionalKey<String>,
    low_latency: Option<bool>,
    packet_jitter_ms_max: OptionalKey<f64>,
    orientation: OptionalKey<String>,
}

impl RawImu {
    /// The orientation that is used: the unit's own or the one estimated here.
    pub(super) fn orientation(&self, text: TomlText<'_>) -> Result<Orientation, TomlError> {
        let sources = [("auto", Orientation::Auto), ("fused", Orientation::Fused)];
        Ok(text.given(&self.orientation, one_of(&sources))?.unwrap_or_default())
    }

    pub(super) fn check(self, text: TomlText<'_>) -> Result<ImuSettings> {
        let formats = ImuFormat::ALL.map(|format| (format.key(), format));
        let jitter = text.given(&self.packet_jitter_ms_max, number(1.0..=1000.0, "ms"))?;
        let usual = ImuSettings::default();
        Ok(ImuSettings {
            line: LineSettings {
                device: self.device,
                baud: text.given(&self.baud, baud_rates())?.unwrap_or_default(),
                low_latency: self.low_latency.unwrap_or(usual.line.low_latency),
            },
            format: text.given(&self.format, one_of(&formats))?,
            late: jitter.map_or(usual.late, |ms| Duration::from_secs_f64(ms * 1e-3)),
        })
    }
}

/// A rate or several, as they stand in the text.
#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum RawBaud {
    One(u32),
    Several(Vec<u32>),
}

/// The rate of a serial line, or up to 16 that are tried.
pub(super) fn baud_rates() -> ValueRule<'static, RawBaud, Baud> {
    ValueRule::new("a rate such as 115200, or 1 to 16 to try", |raw: &RawBaud| match raw {
        RawBaud::One(rate) => (*rate > 0).then_some(Baud::Fixed(*rate)),
        RawBaud::Several(rates) => {
            let good = (1..=16).contains(&rates.len()) && !rates.contains(&0);
            good.then(|| Baud::Scan(rates.clone()))
        }
    })
}

/// An input line of a chip: trigger, interlock, power-fail or a button. One type holds what each of them may have, since refused unknown
/// keys and flattened structures do not go together; what a line may not have is refused by name.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawGpioLine {
    chip: String,
    line: RequiredKey<NumberOrWord>,
    #[serde(default)]
    active_low: bool,
    bias: OptionalKey<String>,
    debounce_ms: OptionalKey<i64>,
    second: Option<Spanned<Box<Self>>>,
    discrepancy_ms: OptionalKey<i64>,
}

/// The table `[buttons]`: lines of the trainee's acts, and of calls that an instructor marks.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawButtons {
    report: Option<RawGpioLine>,
    hostile: Option<RawGpioLine>,
    neutral: Option<RawGpioLine>,
    warn: Option<RawGpioLine>,
    reload: Option<RawGpioLine>,
    clear: Option<RawGpioLine>,
    safe: Option<RawGpioLine>,
    ready: Option<RawGpioLine>,
    light: Option<RawGpioLine>,
}

impl RawButtons {
    pub(super) fn presses(self, text: TomlText<'_>) -> Result<Vec<Press>, TomlError> {
        let lines = [
            (Act::Report, self.report),
            (Act::Identify(Side::Hostile), self.hostile),
            (Act::Identify(Side::Neutral), self.neutral),
            (Act::Warn, self.warn),
            (Act::Reload, self.reload),
            (Act::Clear, self.clear),
            (Act::Safe, self.safe),
            (Act::Ready, self.ready),
            (Act::Light, self.light),
        ];
        let given = lines.into_iter().filter_map(|(act, line)| Some((act, line?)));
        given.map(|(act, line)| Ok(Press { line: line.input(text)?, kind: PressKind::Act(act) })).collect()
    }
}

/// A line by its number on the chip or by its name.
fn gpio_line_name() -> ValueRule<'static, NumberOrWord, String> {
    ValueRule::new("the line's number, or its name in quotes", |raw: &NumberOrWord| match raw {
        NumberOrWord::Number(n) => u32::try_from(*n).ok().map(|n| n.to_string()),
        NumberOrWord::Word(name) => Some(name.clone()),
    })
}

/// A switch of ordinary make chatters for less, and nobody presses twice in that time.
const DEBOUNCE_MS: u64 = 15;

impl RawGpioLine {
    /// An input whose edges are taken as they come.
    pub(super) fn input(self, text: TomlText<'_>) -> Result<InputLine, TomlError> {
        match &self.debounce_ms {
            Some(ms) => Err(text.error(ms, "is for [trigger] alone; leave it out")),
            None => self.line(text),
        }
    }

    /// The trigger's input.
    pub(super) fn trigger(self, text: TomlText<'_>) -> Result<TriggerChoice, TomlError> {
        let ms = text.given(&self.debounce_ms, whole(10..=20))?.unwrap_or(DEBOUNCE_MS);
        Ok(TriggerChoice { line: self.line(text)?, debounce: Duration::from_millis(ms) })
    }

    /// The inert interlock: a line, and where there are two contacts the other one.
    pub(super) fn interlock(mut self, text: TomlText<'_>) -> Result<InterlockWiring, TomlError> {
        let discrepancy = text.given(&self.discrepancy_ms.take(), whole(10..=5000))?;
        let second = self.second.take().map(|line| line.into_inner().input(text)).transpose()?;
        Ok(InterlockWiring {
            contact: self.input(text)?,
            second,
            discrepancy: discrepancy.map_or(InterlockWiring::DISCREPANCY, Duration::from_millis),
        })
    }

    fn line(self, text: TomlText<'_>) -> Result<InputLine, TomlError> {
        const CONTACTS: &str = "is for [interlock] alone; leave it out";
        if let Some(second) = &self.second {
            return Err(text.error(second, CONTACTS));
        }
        if let Some(ms) = &self.discrepancy_ms {
            return Err(text.error(ms, CONTACTS));
        }
        let biases = [
            ("as-is", Bias::AsIs),
            ("pull-up", Bias::PullUp),
            ("pull-down", Bias::PullDown),
            ("disabled", Bias::Disabled),
            ("external-pull-up", Bias::ExternalPullUp),
            ("external-pull-down", Bias::ExternalPullDown),
        ];
        let bias = text.given(&self.bias, one_of(&biases))?.unwrap_or(Bias::AsIs);
        let line = text.needed(&self.line, gpio_line_name())?;
        Ok(InputLine { chip: self.chip, line, active_low: self.active_low, bias })
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLamps {
    chip: String,
    ready: OptionalKey<NumberOrWord>,
    hit: OptionalKey<NumberOrWord>,
    fault: OptionalKey<NumberOrWord>,
    #[serde(default)]
    active_low: bool,
}

impl RawLamps {
    pub(super) fn settings(self, text: TomlText<'_>) -> Result<LampSettings, TomlError> {
        let line = |name| text.given(name, gpio_line_name());
        Ok(LampSettings {
            ready: line(&self.ready)?,
            hit: line(&self.hit)?,
            fault: line(&self.fault)?,
            chip: self.chip,
            active_low: self.active_low,
        })
    }
}
