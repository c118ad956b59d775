//! `bowwave calibrate intrinsics`: the lens from pictures of the board.

use anyhow::{Context, Result, bail};
use bowwave_calibration::{
    CalibrationFile, Date,
    alignment::Grade,
    lens::{BoardView, LensCalibration, solve},
    parse,
    report::CalibrationReport,
    target::varied,
};
use serde_json::json;

use super::{
    input::begun,
    pictures::{BoardPictures, look},
};
use crate::{cli::CalibrateIntrinsics, outcome::Outcome, stdout, today::today};

/// Most pictures that the lens is solved from: more take longer and tell nothing new.
const USED_MOST: usize = 40;

/// Finds the lens, says how good it is, and writes it.
pub fn run(arguments: &CalibrateIntrinsics) -> Result<Outcome> {
    let today = today()?;
    let looked = look(&arguments.pictures, &arguments.target)?;
    let seen: Vec<BoardView> =
        looked.views.iter().map(|v| v.1.clone()).filter(|v| !v.corners.is_empty()).collect();
    if seen.is_empty() {
        bail!(
            "none of {} pictures shows the board {}; check --target, that at least two tags are whole and sharp, and that the \
             picture is not mirrored",
            looked.views.len(),
            arguments.target
        );
    }
    let used: Vec<BoardView> = varied(&seen, USED_MOST).into_iter().map(|i| seen[i].clone()).collect();
    let camera = solve(&used, looked.size)
        .with_context(|| format!("no lens from the {} pictures that show the board", seen.len()))?;
    if arguments.json {
        stdout::print_json(&as_json(&camera, &looked))?;
    } else {
        stdout::print(as_text(&camera, &looked))?;
    }
    let passed = camera.grade() > Grade::Poor;
    if arguments.dry_run {
        eprintln!("nothing was written");
    } else if passed || arguments.accept_poor {
        let mut file = former(arguments, &looked, today)?;
        file.set_lens(&camera, today);
        file.write(&arguments.out)?;
        eprintln!("{}: the lens is written; all else is as it was", arguments.out.display());
    } else {
        eprintln!("{} is left as it is; --accept-poor writes the lens", arguments.out.display());
    }
    Ok(if passed { Outcome::Done } else { Outcome::Failed })
}

/// The file as it stands, or the recording's own, or one in which all is assumed.
fn former(arguments: &CalibrateIntrinsics, looked: &BoardPictures, today: Date) -> Result<CalibrationFile> {
    if arguments.out.exists() {
        return Ok(CalibrationFile::read(&arguments.out)?);
    }
    let own =
        looked.calibration_toml.as_ref().and_then(|text| parse(text, "the recording's calibration").ok());
    Ok(own.unwrap_or_else(|| begun(looked.size, today)))
}

fn as_text(camera: &LensCalibration, looked: &BoardPictures) -> String {
    let seen = looked.views.iter().filter(|v| !v.1.corners.is_empty());
    let corners: usize = camera.coverage.cells.iter().flatten().sum();
    let mut report = CalibrationReport::of_lens("", &Ok(camera.clone()));
    report.rows.insert(
        0,
        (
            "pictures".to_owned(),
            format!(
                "{} of {} show the board, {} differ enough to be used, {corners} corners",
                seen.count(),
                looked.views.len(),
                camera.poses.len()
            ),
        ),
    );
    let blind: Vec<&str> =
        looked.views.iter().filter(|v| v.1.corners.is_empty()).map(|v| v.0.as_str()).collect();
    if let Some(first) = blind.first() {
        report.notes.push(format!("no board was found in {} pictures, as in {first}", blind.len()));
    }
    report.to_string()
}

fn as_json(camera: &LensCalibration, looked: &BoardPictures) -> serde_json::Value {
    let finite = |v: f64| v.is_finite().then_some(v);
    json!({
        "grade": camera.grade().to_string(),
        "model": camera.model.to_string(),
        "size_px": [looked.size.0, looked.size.1],
        "intrinsics": camera.intrinsics,
        "sigma": camera.sigma,
        "left_px": camera.sigma_px,
        "edge_sigma_mrad": finite(camera.edge_sigma() * 1e3),
        "pictures": { "looked_at": looked.views.len(), "used": camera.poses.len() },
        "coverage": { "share": camera.coverage.share, "cells": camera.coverage.cells,
            "tilt_deg": camera.coverage.tilt.map(f64::to_degrees) },
        "evidence": camera.evidence.iter().map(|e| json!({
            "model": e.model.to_string(), "left_px": finite(e.sigma_px), "bic": finite(e.bic), "held_out_px": finite(e.held_out_px),
        })).collect::<Vec<_>>(),
        "missing": camera.missing().iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}
