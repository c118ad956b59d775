//! Report of an alignment of camera and inertial unit.

use std::fmt;

use super::{AXES, CalibrationReport, CalibrationVerdict, PlacedResidual, at_range, deg_per_s, ms};
use crate::{
    alignment::{Alignment, AlignmentError, Grade, LeftOutCounts, Movement, NoiseFound, Residual},
    capture::{Capture, CaptureCounts},
};
use bowwave_core::statistics::quantile;

impl CalibrationReport {
    /// Of an alignment that was found, or why there is none.
    pub fn of_alignment(title: &str, capture: &Capture, found: &Result<Alignment, AlignmentError>) -> Self {
        let a = match found {
            Ok(a) => a,
            Err(why) => return Self::refused(title, CalibrationVerdict::Fail, why, capture),
        };
        let verdict =
            if a.grade >= Grade::Usable { CalibrationVerdict::Pass } else { CalibrationVerdict::Fail };
        let across = a.rotation_sigma().truncate().length();
        let says = format!(
            "{}; boats lie within {} (one standard deviation), in time within {:.2} ms",
            a.grade,
            at_range(across),
            a.offset_sigma_s * 1e3
        );
        let mut report = Self::new(title, verdict, says, capture);
        let [x, y, z] = (a.rotation_sigma() * 1e3).to_array();
        let q = a.camera_from_imu;
        report.row(
            "rotation camera from unit",
            format!("{:.6}, {:.6}, {:.6}, {:.6} (wxyz)", q.w, q.x, q.y, q.z),
        );
        report.row("uncertain by", format!("elevation {x:.2}, traverse {y:.2}, roll {z:.2} mrad"));
        report.row("time offset", ms(a.offset_s, a.offset_sigma_s));
        report.row("gyro bias", deg_per_s(a.gyro_bias));
        report.row("uncertain by", deg_per_s(a.gyro_bias_sigma));
        if let Some((readout, sigma)) = a.readout_s {
            report.row("read-out of the picture", ms(readout, sigma));
        }
        report.row("evenness of the movement", format!("{:.2} (1: all axes alike)", a.information_ratio));
        report.residual_rows(&a.noise, &a.residuals, &a.left_out);
        report.notes.extend(a.findings().iter().map(ToString::to_string));
        report.notes.extend(Wanting::of(a, capture.shared_sigma()).map(|w| w.to_string()));
        report.covariance = Some(a.rotation_covariance);
        report.place(capture, &a.residuals);
        report
    }

    pub(super) fn refused(
        title: &str,
        verdict: CalibrationVerdict,
        why: &AlignmentError,
        capture: &Capture,
    ) -> Self {
        let mut report = Self::new(title, verdict, why.to_string(), capture);
        let counts = capture.counts();
        if let AlignmentError::NotObservable { missing, .. } = why {
            report.notes.push(format!("the movement that was missing: {missing}"));
        }
        if counts.pictures > 0 && counts.horizons + counts.boards == 0 {
            report.notes.push(
                "no picture has a horizon that is sharp, straight and clear of land: look at open sea, or at a board"
                    .to_owned(),
            );
        }
        report
    }

    pub(super) fn residual_rows(&mut self, noise: &NoiseFound, residuals: &[Residual], left: &LeftOutCounts) {
        let at = |share: f64| quantile(residuals.iter().map(|r| r.turn.length()), share);
        self.row("left over, median, p95", format!("{:.2}, {:.2} mrad", at(0.5) * 1e3, at(0.95) * 1e3));
        self.row("jitter of the camera's stamps", format!("{:.2} ms", noise.jitter_s * 1e3));
        self.row("gyro's random walk", format!("{:.3} deg/sqrt(h)", noise.gyro_walk.to_degrees() * 60.0));
        self.row(
            "left out",
            format!(
                "{} no numbers, {} out of order, {} clipped, {} without gyro",
                left.not_finite, left.out_of_order, left.clipped, left.without_gyro
            ),
        );
    }

    pub(super) fn place(&mut self, capture: &Capture, residuals: &[Residual]) {
        let Some(first) = residuals.first().map(|r| r.stamp) else { return };
        let middle = self.picture.0 / 2.0;
        let mut sightings: Vec<_> = capture.sightings().iter().collect();
        sightings.sort_by_key(|s| s.stamp);
        self.residuals = residuals
            .iter()
            .map(|r| PlacedResidual {
                seconds: r.stamp.secs_since(first),
                residual: *r,
                pixel: sightings
                    .binary_search_by_key(&r.stamp, |s| s.stamp)
                    .map_or(middle, |i| sightings[i].pixel),
            })
            .collect();
    }
}

/// Rows that say what was recorded and seen.
pub(super) fn seen(capture: &Capture) -> Vec<(String, String)> {
    let CaptureCounts { readings, pictures, other_size, horizons, blurred, boards, restarts } =
        capture.counts();
    let mut what = format!("{horizons} of {pictures} pictures with a horizon");
    if blurred > 0 {
        what += &format!(", {blurred} blurred");
    }
    if boards > 0 {
        what += &format!(", {boards} with a board");
    }
    if other_size > 0 {
        what += &format!("; {other_size} of another size");
    }
    let mut rows = vec![
        ("recorded".to_owned(), format!("{:.1} s, {readings} readings", capture.seconds())),
        ("seen".to_owned(), what),
    ];
    if restarts > 0 {
        rows.push(("restarts of the unit".to_owned(), restarts.to_string()));
    }
    rows
}

/// Quantity that keeps an alignment from being good.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wanting {
    /// The time offset.
    Faster,
    /// Elevation, of which no horizon tells more than this, radians.
    Board(f64),
    /// The angle about that axis of the camera, which that movement tells better.
    Moving(usize, Movement),
}

impl Wanting {
    /// The least known quantity; `shared` is the error that all horizons share, where nothing else was seen.
    pub(crate) fn of(a: &Alignment, shared: Option<f64>) -> Option<Self> {
        if a.grade == Grade::Good {
            return None;
        }
        let sigma = a.rotation_sigma();
        let worst = (0..3).max_by(|i, j| sigma[*i].total_cmp(&sigma[*j]))?;
        if sigma[worst] <= Grade::ROTATION[0] {
            return (a.offset_sigma_s > Grade::OFFSET_S[0]).then_some(Self::Faster);
        }
        Some(match shared {
            Some(limit) if worst == 0 && sigma.x < 1.2 * limit => Self::Board(limit),
            _ => Self::Moving(worst, a.missing),
        })
    }
}

impl fmt::Display for Wanting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Faster => f.write_str("faster movements to and fro tell the time offset better"),
            Self::Board(limit) => write!(
                f,
                "of elevation the horizon tells no more than {:.1} mrad (refraction, and where its edge is found); a board tells it better",
                limit * 1e3
            ),
            Self::Moving(axis, missing) => {
                let what = AXES.get(*axis).copied().unwrap_or("rotation");
                write!(f, "{what} is what is known least; more {missing} tells it better")
            }
        }
    }
}
