//! What a task looks at: a recording played without a clock, and the calibration that goes with it.

use std::path::Path;

use anyhow::{Context, Result, bail};
use bowwave_calibration::{
    CalibrationFile, Date, capture::Capture, page::page, parse, sheet::Sheet, target::BoardFinder,
};
use bowwave_core::{
    event::{CameraFrame, Event},
    scenario::Scenario,
};
use bowwave_devices::camera::jpeg::Decoder;
use bowwave_record::{Entry, Properties, RecordError, RecordingReader};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use crate::cli::Material;

/// A recording that was looked at.
pub struct Looked {
    /// What was found in it.
    pub capture: Capture,
    /// The calibration that was asked for.
    pub file: CalibrationFile,
    /// The recording's own, where it has one that can be read.
    pub recorded: Option<CalibrationFile>,
    /// Whether the recording ends before its end.
    pub is_cut: bool,
}

/// Plays a recording.
pub fn look(recording: &Path, material: &Material) -> Result<Looked> {
    let reader = RecordingReader::open(recording)?;
    let properties = reader.properties();
    let recorded = parse(&properties.calibration_toml, "the recording's calibration");
    let file = match (&material.calibration, &recorded) {
        (Some(path), _) => CalibrationFile::read(path)?,
        (None, Ok(own)) => own.clone(),
        (None, Err(_)) if properties.calibration_toml.is_empty() => {
            bail!("{} has no calibration of its own; name one with --calibration", recording.display())
        }
        (None, Err(e)) => bail!("{e}; or name another one with --calibration"),
    };
    let height = match material.eye_height {
        Some(height) => height,
        None => recorded_height(properties).with_context(|| {
            format!("{} does not say how high the camera was; say it with --eye-height", recording.display())
        })?,
    };
    let lens = file.calibration.lens;
    if (lens.width, lens.height) != properties.picture {
        let (width, height) = properties.picture;
        bail!(
            "the calibrated lens is of pictures of {}x{}, those of {} are {width}x{height}; name the calibration of that camera \
             and mode with --calibration",
            lens.width,
            lens.height,
            recording.display()
        );
    }
    let mut capture = Capture::new(lens, height);
    if let Some(target) = material.target {
        capture = capture.with_board(Box::new(BoardFinder::new(target)));
    }
    let is_cut = play(&reader, &mut capture)?;
    Ok(Looked { capture, file, recorded: recorded.ok(), is_cut })
}

/// Whether the recording was cut short.
fn play(reader: &RecordingReader, capture: &mut Capture) -> Result<bool> {
    let bar = ProgressBar::new(reader.counts().frames);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} pictures, {eta} left") {
        bar.set_style(style);
    }
    let (mut decoder, mut damaged) = (Decoder::for_recordings(), 0u64);
    for entry in reader.entries()? {
        match entry {
            Ok(Entry::Imu(sample)) => capture.take(&Event::Imu(sample)),
            Ok(Entry::Trigger(edge)) => capture.take(&Event::Trigger(edge)),
            Ok(Entry::Frame(frame)) => {
                bar.inc(1);
                match decoder.decode(&frame.jpeg, None) {
                    Ok(picture) => capture.take(&Event::Frame(CameraFrame {
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
            Ok(Entry::Truth(_) | Entry::Pose(_)) => {}
            Err(e @ RecordError::Truncated { .. }) => {
                bar.finish_and_clear();
                log::warn!("{e}");
                return Ok(true);
            }
            Err(e) => return Err(e.into()),
        }
    }
    bar.finish_and_clear();
    Ok(false)
}

/// What the recording, or the scenario in it, says of the camera's height above the sea.
fn recorded_height(properties: &Properties) -> Option<f64> {
    let own = properties.extra.get("eye_height_m").and_then(|text| text.parse::<f64>().ok());
    let scenario = || Scenario::parse(properties.scenario_toml.as_deref()?, "the recording's scenario").ok();
    own.filter(|m| (0.5..=100.0).contains(m)).or_else(|| scenario().map(|s| s.eye_height_m))
}

/// Tells the result in all the ways that were asked for.
pub fn tell(sheet: &Sheet, material: &Material) -> Result<()> {
    if material.json {
        println!(
            "{}",
            serde_json::to_string_pretty(&as_json(sheet)).context("cannot put the result into JSON")?
        );
    } else {
        print!("{sheet}");
    }
    if let Some(path) = &material.report {
        std::fs::write(path, page(sheet)).with_context(|| {
            format!("cannot write {}; check the folder and its permissions", path.display())
        })?;
        eprintln!("{} shows the result", path.display());
    }
    Ok(())
}

fn as_json(sheet: &Sheet) -> serde_json::Value {
    json!({
        "verdict": sheet.verdict.to_string(),
        "says": sheet.says,
        "rows": sheet.rows.iter().map(|(what, value)| json!([what, value])).collect::<Vec<_>>(),
        "notes": sheet.notes,
        "rotation_covariance_mrad2": sheet.covariance.map(|c| (c * 1e6).to_cols_array_2d()),
    })
}

/// Adds what there is to warn of, on the day of `today`.
pub fn warn(sheet: &mut Sheet, looked: &Looked, today: Date) {
    sheet.warn_of_age(&looked.file, today);
    if let Some(recorded) = &looked.recorded {
        sheet.warn_of_others(&looked.file, recorded);
    }
    if looked.is_cut {
        sheet.notes.push("the recording was cut short; what there is of it was used".to_owned());
    }
}
