//! `bowwave calibrate camera`: the lens from pictures of the board.

use std::fmt::Write as _;

use anyhow::{Context, Result, bail};
use bowwave_calibration::{
    CalibrationFile, Date, Provenance,
    alignment::Grade,
    camera::{CELLS, Camera, Evidence, Model, View, solve},
    parse,
    sheet::at_range,
    target::varied,
};
use bowwave_import::{ImportOptions, assumed};
use serde_json::json;

use super::pictures::{Looked, look};
use crate::{cli::CalibrateCamera, import::today, outcome::Outcome, stdout};

/// Most pictures that the lens is solved from: more take longer and tell nothing new.
const USED_MOST: usize = 40;

/// Finds the lens, says how good it is, and writes it.
pub fn run(arguments: &CalibrateCamera) -> Result<Outcome> {
    let today = today()?;
    let looked = look(&arguments.pictures, &arguments.target)?;
    let seen: Vec<View> =
        looked.views.iter().map(|v| v.1.clone()).filter(|v| !v.corners.is_empty()).collect();
    if seen.is_empty() {
        bail!(
            "none of {} pictures shows the board {}; check --target, that at least two tags are whole and sharp, and that the \
             picture is not mirrored",
            looked.views.len(),
            arguments.target
        );
    }
    let used: Vec<View> = varied(&seen, USED_MOST).into_iter().map(|i| seen[i].clone()).collect();
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
        let file = with_lens(former(arguments, &looked, today)?, &camera, today);
        file.write(&arguments.out)?;
        eprintln!("{}: the lens is written; all else is as it was", arguments.out.display());
    } else {
        eprintln!("{} is left as it is; --accept-poor writes the lens", arguments.out.display());
    }
    Ok(if passed { Outcome::Done } else { Outcome::Failed })
}

/// The file as it stands, or the recording's own, or one in which all is assumed.
fn former(arguments: &CalibrateCamera, looked: &Looked, today: Date) -> Result<CalibrationFile> {
    if arguments.out.exists() {
        return Ok(CalibrationFile::read(&arguments.out)?);
    }
    let own =
        looked.calibration_toml.as_ref().and_then(|text| parse(text, "the recording's calibration").ok());
    Ok(own.unwrap_or_else(|| {
        let mut file = assumed(looked.size, &ImportOptions::new(today));
        file.source = "bowwave calibrate".to_owned();
        file
    }))
}

/// The file with another lens.
fn with_lens(mut file: CalibrationFile, camera: &Camera, today: Date) -> CalibrationFile {
    file.calibration.lens = camera.lens();
    file.calibration.focal_sigma_px = camera.focal_sigma_px();
    file.made = today;
    let how = format!(
        "{} pictures of a board, {:.2} px left, {} % of the picture covered, {:.2} mrad at its edge: {}",
        camera.poses.len(),
        camera.sigma_px,
        (camera.coverage.share * 100.0).round(),
        camera.edge_sigma() * 1e3,
        camera.grade()
    );
    file.lens = Provenance::new(today, how);
    file
}

const fn name(model: Model) -> &'static str {
    match model {
        Model::RadialTangential => "pinhole with radial and tangential distortion",
        Model::Fisheye => "fisheye",
    }
}

/// The parts of the picture: `.` without corners, `+` with some, `#` with many.
fn map(camera: &Camera) -> String {
    let mean = camera.coverage.cells.iter().flatten().sum::<usize>() / (CELLS.0 * CELLS.1);
    let sign = |count: &usize| match *count {
        0 => '.',
        count if count > mean / 2 => '#',
        _ => '+',
    };
    camera
        .coverage
        .cells
        .iter()
        .map(|row| format!("    {}\n", row.iter().map(sign).collect::<String>()))
        .collect()
}

/// What speaks for the model that was chosen, and against the other.
fn evidence(camera: &Camera) -> String {
    let of = |chosen: bool| camera.evidence.iter().find(|e| (e.model == camera.model) == chosen);
    let left =
        |e: &Evidence| format!("{:.3} px left, {:.3} px where it took no part", e.sigma_px, e.held_out_px);
    match (of(true), of(false)) {
        (Some(own), Some(other)) => format!(
            "{}: {}; as {}: {}; BIC {:+.0}",
            name(own.model),
            left(own),
            name(other.model),
            left(other),
            own.bic - other.bic
        ),
        (Some(own), None) => format!("{}: {}; the other one fits nothing", name(own.model), left(own)),
        _ => name(camera.model).to_owned(),
    }
}

/// How uncertain the picture's edge is.
fn at_edge(camera: &Camera) -> String {
    let sigma = camera.edge_sigma();
    if sigma.is_finite() {
        format!("{}, one sigma", at_range(sigma))
    } else {
        "not known: the lens folds back before a corner of the picture".to_owned()
    }
}

fn as_text(camera: &Camera, looked: &Looked) -> String {
    let seen = looked.views.iter().filter(|v| !v.1.corners.is_empty());
    let corners: usize = camera.coverage.cells.iter().flatten().sum();
    let [fx, fy, cx, cy, ..] = camera.intrinsics;
    let [sx, sy, scx, scy, ..] = camera.sigma;
    let tilt = camera.coverage.tilt.map(f64::to_degrees);
    let rows = [
        (
            "pictures",
            format!(
                "{} of {} show the board, {} differ enough to be used, {corners} corners",
                seen.count(),
                looked.views.len(),
                camera.poses.len()
            ),
        ),
        ("lens", evidence(camera)),
        ("focal length", format!("{fx:.2} +- {sx:.2}, {fy:.2} +- {sy:.2} px")),
        (
            "centre",
            format!("{cx:.2} +- {scx:.2}, {cy:.2} +- {scy:.2} px of {}x{}", looked.size.0, looked.size.1),
        ),
        ("left over", format!("{:.2} px", camera.sigma_px)),
        ("uncertain at the edge", at_edge(camera)),
        ("tilt of the board", format!("{:.0} to {:.0} deg", tilt[0], tilt[1])),
        ("covered", format!("{:.0} % of the picture", camera.coverage.share * 100.0)),
    ];
    let mut out = String::new();
    let verdict = if camera.grade() > Grade::Poor { "PASS" } else { "FAIL" };
    let _ = writeln!(out, "{verdict}: the lens is {}", camera.grade());
    for (what, value) in rows {
        let _ = writeln!(out, "  {what:21}  {value}");
    }
    let _ = write!(out, "{}", map(camera));
    for missing in camera.missing() {
        let _ = writeln!(out, "* {missing}");
    }
    let blind: Vec<&str> =
        looked.views.iter().filter(|v| v.1.corners.is_empty()).map(|v| v.0.as_str()).collect();
    if let Some(first) = blind.first() {
        let _ = writeln!(out, "* no board was found in {} pictures, as in {first}", blind.len());
    }
    out
}

fn as_json(camera: &Camera, looked: &Looked) -> serde_json::Value {
    let finite = |v: f64| v.is_finite().then_some(v);
    json!({
        "grade": camera.grade().to_string(),
        "model": name(camera.model),
        "size_px": [looked.size.0, looked.size.1],
        "intrinsics": camera.intrinsics,
        "sigma": camera.sigma,
        "left_px": camera.sigma_px,
        "edge_sigma_mrad": finite(camera.edge_sigma() * 1e3),
        "pictures": { "looked_at": looked.views.len(), "used": camera.poses.len() },
        "coverage": { "share": camera.coverage.share, "cells": camera.coverage.cells,
            "tilt_deg": camera.coverage.tilt.map(f64::to_degrees) },
        "evidence": camera.evidence.iter().map(|e| json!({
            "model": name(e.model), "left_px": finite(e.sigma_px), "bic": finite(e.bic), "held_out_px": finite(e.held_out_px),
        })).collect::<Vec<_>>(),
        "missing": camera.missing().iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}
