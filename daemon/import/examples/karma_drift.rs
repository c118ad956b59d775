//! Imports a GoPro video with its gyro and reports how far an overlay carried by that gyro drifts against the clouds.
//!
//! `cargo run --release -p bowwave-import --example karma_drift -- VIDEO [CALIBRATION]`

#[path = "../measure/mod.rs"]
mod measure;

use std::{ops::ControlFlow, path::PathBuf};

use anyhow::Context as _;
use bowwave_calibration::{CalibrationFile, Date};
use bowwave_import::{ImportOptions, import_video};

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let video = arguments.next().context("say which video")?;
    let calibration = arguments.next().unwrap_or_else(|| {
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../calibration/examples/gopro_karma.toml")
    });
    let folder = tempfile::tempdir()?;
    let recording = folder.path().join("karma.mcap");
    let today = Date::new(2026, 11, 21).context("no such day")?;
    let options = ImportOptions {
        calibration: Some(CalibrationFile::read(&calibration)?),
        bias_from_s: Some(5.0),
        ..ImportOptions::new(today)
    };
    let report = import_video(&video, &recording, &options, &mut |_| ControlFlow::Continue(()))?;
    println!("{report:#?}");
    let clip = measure::DriftClip::read(&recording)?;
    let tracks = measure::Tracks::follow(&clip, 200)?;
    println!("drift in pixels at {} wide:", measure::SCREEN_WIDTH);
    for (name, from, to) in
        [("first 11 s", 0.0, 11.0), ("after the bias, 5 to 11 s", 5.0, 11.0), ("swing", 11.0, 100.0)]
    {
        println!("{name}: {}", measure::drift(&clip, &tracks, from, to)?);
    }
    Ok(())
}
