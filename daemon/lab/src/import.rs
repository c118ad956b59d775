//! `bowwave import`: recordings from pictures and videos.

use std::{ops::ControlFlow, sync::atomic::Ordering};

use anyhow::{Context, Result, bail};
use bowwave::{ending, outcome::Outcome, stdout, today::today};
use bowwave_calibration::CalibrationFile;
use bowwave_import::{ImportOptions, ImportReport, Progress, TelemetryReport, import_pictures, import_video};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use crate::cli::ImportArgs;

/// Imports a folder of pictures or a video.
pub fn run(arguments: &ImportArgs) -> Result<Outcome> {
    if !arguments.source.exists() {
        bail!("no file or folder {}; name a video or a folder of pictures", arguments.source.display());
    }
    let mut options = ImportOptions::new(today()?);
    if let Some(path) = &arguments.calibration {
        options.calibration = Some(CalibrationFile::read(path)?);
    }
    if let Some(path) = &arguments.scenario {
        let text = bowwave_files::plain_text(path, bowwave_core::text::toml::TEXT_BYTES_MAX)
            .with_context(|| format!("cannot read the scenario {}; name an existing file", path.display()))?;
        let scenario = bowwave_core::world::scenario::Scenario::parse(&text, &path.display().to_string())?;
        bowwave::loading::warn_of_former_names(&scenario.warnings);
        options.scenario_toml = Some(text);
    }
    options.bias_from_s = arguments.bias_from;
    options.level = arguments.level;
    options.replace = arguments.force;
    let bar = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {pos} pictures {elapsed}") {
        bar.set_style(style);
    }
    let end = ending::watch()?;
    let mut known = false;
    let mut progress = |p: Progress| {
        if let (Some(total), false) = (p.frames_total, known) {
            known = true;
            bar.set_length(total);
            if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} pictures, {eta} left") {
                bar.set_style(style);
            }
        }
        bar.set_position(p.frames);
        // The importer then removes what it has written so far.
        if end.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let report = if arguments.source.is_dir() {
        import_pictures(&arguments.source, arguments.rate, &arguments.out, &options, &mut progress)?
    } else {
        import_video(&arguments.source, &arguments.out, &options, &mut progress)?
    };
    bar.finish_and_clear();
    if arguments.json {
        stdout::print_json(&as_json(&report))?;
    }
    eprint!("{}", lines(&report));
    for warning in &report.warnings {
        log::warn!("{warning}");
    }
    Ok(if report.warnings.is_empty() { Outcome::Done } else { Outcome::Partly })
}

fn as_json(report: &ImportReport) -> serde_json::Value {
    json!({
        "recording": report.path.display().to_string(),
        "pictures": report.frames,
        "imu_samples": report.imu_samples,
        "duration_s": report.duration_ns as f64 * 1e-9,
        "bytes": report.bytes,
        "size": format!("{}x{}", report.picture.0, report.picture.1),
        "gyro": match &report.telemetry {
            TelemetryReport::Used { .. } => "used",
            TelemetryReport::LeftOut => "left_out",
            TelemetryReport::Absent => "absent",
            TelemetryReport::None => "none",
        },
        "warnings": report.warnings,
    })
}

fn lines(report: &ImportReport) -> String {
    let gyro = match &report.telemetry {
        TelemetryReport::Used { camera, rate_hz, bias } => {
            let camera = if camera.is_empty() { "the camera" } else { camera };
            let bias = bias.as_ref().map_or_else(String::new, |b| {
                let [x, y, z] = (b.rate * 1e3).to_array();
                let sigma = b.sigma.max_element() * 1e3;
                format!(
                    "; bias of the first {} s: {x:.3}, {y:.3}, {z:.3} mrad/s, each +- {sigma:.3}",
                    b.seconds
                )
            });
            format!("gyro of {camera} at {rate_hz:.0} Hz, {} samples{bias}", report.imu_samples)
        }
        TelemetryReport::LeftOut => "its gyro was left out".to_owned(),
        TelemetryReport::Absent => "no gyro in this video: boats cannot be placed in it".to_owned(),
        TelemetryReport::None => "pictures have no gyro: boats cannot be placed in them".to_owned(),
    };
    format!(
        "{}: {} pictures of {}x{}, {:.2} s, {:.1} MB\n{gyro}\n",
        report.path.display(),
        report.frames,
        report.picture.0,
        report.picture.1,
        report.duration_ns as f64 * 1e-9,
        report.bytes as f64 * 1e-6
    )
}
