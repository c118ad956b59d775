//! Input of a task: a recording played without a clock, and the calibration that goes with it; and how its result is shown and written.

use std::path::Path;

use anyhow::{Context, Result, bail};
use bowwave_calibration::{
    CalibrationFile, Date,
    alignment::{Deviation, Judgement},
    capture::{Capture, Watcher},
    parse,
    report::CalibrationReport,
    report::html,
    target::BoardFinder,
};
use bowwave_core::{
    event::{CameraFrame, Event},
    world::scenario::Scenario,
};
use bowwave_devices::camera::jpeg::Decoder;
use bowwave_import::{ImportOptions, assumed};
use bowwave_record::{Entry, RecordError, RecordingReader};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use crate::{
    cli::{CalibrationFiles, InputArgs, OutputArgs},
    stdout,
};

/// A recording, with the calibration that goes with it.
pub struct OpenedRecording {
    reader: RecordingReader,
    /// The calibration that was asked for.
    pub file: CalibrationFile,
    /// The recording's own, where it has one that can be read.
    recorded: Option<CalibrationFile>,
}

/// A calibration in which all is assumed, for pictures of that size.
pub fn begun(size: (u32, u32), today: Date) -> CalibrationFile {
    let mut file = assumed(size, &ImportOptions::new(today));
    file.source = "bowwave calibrate".to_owned();
    file
}

/// A bar of so many pictures.
pub fn progress(pictures: u64) -> ProgressBar {
    let bar = ProgressBar::new(pictures);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} pictures, {eta} left") {
        bar.set_style(style);
    }
    bar
}

/// Hands over what a recording holds, in its order. Tells whether it was cut short.
pub fn read(reader: &RecordingReader, mut take: impl FnMut(Entry) -> Result<()>) -> Result<bool> {
    for entry in reader.entries()? {
        match entry {
            Ok(entry) => take(entry)?,
            Err(e @ RecordError::Truncated { .. }) => {
                log::warn!("{e}");
                return Ok(true);
            }
            Err(e) => return Err(e.into()),
        }
    }
    Ok(false)
}

/// Opens a recording. The calibration is that at `calibration`, or the recording's own.
pub fn open(recording: &Path, calibration: Option<&Path>) -> Result<OpenedRecording> {
    let reader = RecordingReader::open(recording)?;
    let text = &reader.properties().calibration_toml;
    let recorded = parse(text, "the recording's calibration");
    let file = match (calibration, &recorded) {
        (Some(path), _) => CalibrationFile::read(path)?,
        (None, Ok(own)) => own.clone(),
        (None, Err(_)) if text.is_empty() => {
            bail!("{} has no calibration of its own; name one with --calibration", recording.display())
        }
        (None, Err(e)) => bail!("{e}; or name another one with --calibration"),
    };
    let lens = &file.calibration.lens;
    if (lens.width, lens.height) != reader.properties().picture {
        let (width, height) = reader.properties().picture;
        bail!(
            "the calibrated lens is of pictures of {}x{}, those of {} are {width}x{height}; name the calibration of that camera \
             and mode with --calibration",
            lens.width,
            lens.height,
            recording.display()
        );
    }
    Ok(OpenedRecording { reader, file, recorded: recorded.ok() })
}

impl OpenedRecording {
    /// Hands over what the recording holds, in its order; pictures only where they are asked for. Tells whether the recording was cut
    /// short.
    pub fn play(&self, pictures: bool, mut take: impl FnMut(Event)) -> Result<bool> {
        let bar = progress(self.reader.counts().frames);
        let (mut decoder, mut damaged) = (Decoder::for_recordings(), 0u64);
        let is_cut = read(&self.reader, |entry| {
            match entry {
                Entry::Imu(sample) => take(Event::Imu(sample)),
                Entry::Trigger(edge) => take(Event::Trigger(edge)),
                Entry::Frame(frame) if pictures => {
                    bar.inc(1);
                    match decoder.decode(&frame.jpeg, None) {
                        Ok(picture) => take(Event::Frame(CameraFrame {
                            arrival: frame.arrival,
                            mid_exposure: frame.mid_exposure,
                            sequence: frame.sequence,
                            picture,
                            jpeg: None,
                        })),
                        Err(why) => {
                            if damaged == 0 {
                                log::warn!("a picture that is no whole JPEG ({why}): left out");
                            }
                            damaged += 1;
                        }
                    }
                }
                Entry::Picture(raw) if pictures => {
                    bar.inc(1);
                    take(Event::Frame(raw.into()));
                }
                _ => {}
            }
            Ok(())
        })?;
        bar.finish_and_clear();
        Ok(is_cut)
    }

    /// The camera's height above the sea, by the recording or the scenario in it.
    pub fn height(&self) -> Option<f64> {
        let properties = self.reader.properties();
        let own = properties.extra.get("eye_height_m").and_then(|text| text.parse::<f64>().ok());
        let scenario =
            || Scenario::parse(properties.scenario_toml.as_deref()?, "the recording's scenario").ok();
        own.filter(|m| (0.5..=100.0).contains(m)).or_else(|| scenario().map(|s| s.eye_height_m))
    }

    /// Adds what there is to warn of on the day of `today`.
    pub fn warn(&self, report: &mut CalibrationReport, is_cut: bool, today: Date) {
        report.warn_of_age(&self.file, today);
        if let Some(recorded) = &self.recorded {
            report.warn_of_others(&self.file, recorded);
        }
        if is_cut {
            report.notes.push("the recording was cut short; what there is of it was used".to_owned());
        }
    }
}

/// Looks for horizon and board in all of a recording; tells whether that was cut short, too.
pub fn look(
    recording: &Path,
    calibration: Option<&Path>,
    input: &InputArgs,
) -> Result<(OpenedRecording, Capture, bool)> {
    let opened = open(recording, calibration)?;
    let height = match input.eye_height {
        Some(height) => height,
        None => opened.height().with_context(|| {
            format!("{} does not say how high the camera was; say it with --eye-height", recording.display())
        })?,
    };
    let calibration = &opened.file.calibration;
    let mut watcher = Watcher::new(calibration.lens, height).with_mask(opened.file.own_ship().mask);
    let mut capture = Capture::new(calibration.lens, height);
    if opened.file.shutter.is_some() {
        capture = capture.with_readout(calibration.readout_ns as f64 * 1e-9);
    }
    if let Some(target) = input.target {
        watcher = watcher.with_board(Box::new(BoardFinder::new(target)));
    }
    let is_cut = opened.play(true, |event| match &event {
        Event::Frame(frame) => capture.see(&watcher.look(frame)),
        event => capture.take(event),
    })?;
    Ok((opened, capture, is_cut))
}

/// Tells the result in all the ways that were asked for.
pub fn tell(report: &CalibrationReport, told: &OutputArgs) -> Result<()> {
    if told.json {
        stdout::print_json(&as_json(report))?;
    } else {
        stdout::print(report.to_string())?;
    }
    if let Some(path) = &told.report {
        std::fs::write(path, html(report)).with_context(|| {
            format!("cannot write {}; check the folder and its permissions", path.display())
        })?;
        eprintln!("{} shows the result", path.display());
    }
    Ok(())
}

fn as_json(report: &CalibrationReport) -> serde_json::Value {
    let told =
        |d: &Deviation, value: f64| (d.judgement != Judgement::NotTold && value.is_finite()).then_some(value);
    json!({
        "verdict": report.verdict.to_string(),
        "says": report.says,
        "rows": report.rows.iter().map(|(what, value)| json!([what, value])).collect::<Vec<_>>(),
        "notes": report.notes,
        "parameters": report.deviations.iter().map(|d| json!({
            "name": d.parameter.to_string(),
            "judged": match d.judgement {
                Judgement::Wrong => "wrong",
                Judgement::Agrees => "agrees",
                Judgement::NotTold => "not told",
            },
            "off": told(d, d.off),
            "sigma": told(d, d.sigma),
            "effect_mrad": told(d, d.effect * 1e3),
            "or": d.or.iter().map(ToString::to_string).collect::<Vec<_>>(),
        })).collect::<Vec<_>>(),
        "rotation_covariance_mrad2": report.covariance.map(|c| (c * 1e6).to_cols_array_2d()),
    })
}

/// Writes the calibration where `files` say.
pub fn write(mut file: CalibrationFile, today: Date, files: &CalibrationFiles) -> Result<()> {
    let Some(out) = files.out.as_ref().or(files.calibration.as_ref()) else {
        eprintln!("nothing is written; name a file with --out or --calibration");
        return Ok(());
    };
    file.made = today;
    let replaces = out.exists();
    file.write(out)?;
    let kept = if replaces { "; what stood there before is kept (bowwave calibrate restore)" } else { "" };
    eprintln!("{} written{kept}", out.display());
    Ok(())
}
