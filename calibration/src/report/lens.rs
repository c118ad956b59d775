//! The sheet of a lens.

use std::fmt;

use bowwave_core::guide::Cell;
use glam::DVec2;

use super::{CalibrationReport, CalibrationVerdict, at_range};
use crate::{
    alignment::Grade,
    lens::{CELLS, Evidence, LensCalibration, LensError, LensModel},
};

impl CalibrationReport {
    /// Of a lens that was found, or why there is none.
    pub fn of_lens(title: &str, found: &Result<LensCalibration, LensError>) -> Self {
        let camera = match found {
            Ok(camera) => camera,
            Err(why) => return Self::bare(title, CalibrationVerdict::Fail, why.to_string()),
        };
        let verdict =
            if camera.grade() > Grade::Poor { CalibrationVerdict::Pass } else { CalibrationVerdict::Fail };
        let mut report = Self::bare(title, verdict, format!("the lens is {}", camera.grade()));
        let [fx, fy, cx, cy, ..] = camera.intrinsics;
        let [sx, sy, scx, scy, ..] = camera.sigma;
        let (width, height) = camera.size;
        report.row("lens", evidence(camera));
        report.row("focal length", format!("{fx:.2} +- {sx:.2}, {fy:.2} +- {sy:.2} px"));
        report.row("centre", format!("{cx:.2} +- {scx:.2}, {cy:.2} +- {scy:.2} px of {width}x{height}"));
        report.row("left over", format!("{:.2} px", camera.sigma_px));
        report.row("uncertain at the edge", at_edge(camera));
        let tilt = camera.coverage.tilt.map(f64::to_degrees);
        report.row("tilt of the board", format!("{:.0} to {:.0} deg", tilt[0], tilt[1]));
        report.row("covered", format!("{:.0} % of the picture", camera.coverage.share * 100.0));
        report.row("corners by place", map(camera));
        report.notes.extend(camera.missing().iter().map(ToString::to_string));
        report.picture = (DVec2::new(width.into(), height.into()), DVec2::new(fx, fy));
        report
    }
}

/// Residuals of both models, and the difference of their BIC.
fn evidence(camera: &LensCalibration) -> String {
    let of = |chosen: bool| camera.evidence.iter().find(|e| (e.model == camera.model) == chosen);
    let left =
        |e: &Evidence| format!("{:.3} px left, {:.3} px where it took no part", e.sigma_px, e.held_out_px);
    match (of(true), of(false)) {
        (Some(own), Some(other)) => format!(
            "{}: {}; as {}: {}; BIC {:+.0}",
            own.model,
            left(own),
            other.model,
            left(other),
            own.bic - other.bic
        ),
        (Some(own), None) => format!("{}: {}; the other one fits nothing", own.model, left(own)),
        _ => camera.model.to_string(),
    }
}

/// How uncertain the picture's edge is.
fn at_edge(camera: &LensCalibration) -> String {
    let sigma = camera.edge_sigma();
    if sigma.is_finite() {
        format!("{}, one sigma", at_range(sigma))
    } else {
        "not known: the lens folds back before a corner of the picture".to_owned()
    }
}

/// The parts of the picture, a line for each row: `.` without corners, `+` with some, `#` with many.
fn map(camera: &LensCalibration) -> String {
    let sign = |cell: &Cell| match cell {
        Cell::Empty => '.',
        Cell::Few => '+',
        Cell::Many => '#',
    };
    let rows = camera.coverage.levels();
    rows.chunks(CELLS.0).map(|row| format!("\n    {}", row.iter().map(sign).collect::<String>())).collect()
}

impl fmt::Display for LensModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::RadialTangential => "pinhole with radial and tangential distortion",
            Self::Fisheye => "fisheye",
        })
    }
}
