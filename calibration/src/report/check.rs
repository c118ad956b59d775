//! Report of a calibration that was held against a recording, and warnings of age and of other devices.

use std::fmt;

use bowwave_core::{calibration::Calibration, statistics::quantile};

use super::{CalibrationReport, CalibrationVerdict, RANGE_M, at_range};
use crate::{
    CalibrationFile, Date, Provenance, SIMULATED,
    alignment::{AlignmentError, Comparison, Deviation, Judgement, Movement, Parameter},
    capture::Capture,
};

/// Residuals of which the median is larger fit nothing, radians.
const LEFT_MOST: f64 = 0.01;
/// A calibration older than this is said to be, days.
const OLD_DAYS: i64 = 183;

impl CalibrationReport {
    /// Of a calibration held against a recording. `known` is the calibration that was held.
    pub fn of_check(
        title: &str,
        capture: &Capture,
        known: &Calibration,
        found: &Result<Comparison, AlignmentError>,
    ) -> Self {
        let counts = capture.counts();
        let c = match found {
            Ok(c) => c,
            Err(_) if counts.pictures == 0 && counts.other_size > 0 => {
                let says = format!(
                    "the picture's size is wrong: no picture has the calibrated {}x{}; name the calibration of that camera and mode",
                    known.lens.width, known.lens.height
                );
                return Self::new(title, CalibrationVerdict::Stale, says, capture);
            }
            Err(why @ AlignmentError::Mirrored { .. }) => {
                return Self::refused(title, CalibrationVerdict::Stale, why, capture);
            }
            Err(why) => return Self::refused(title, CalibrationVerdict::CannotTell, why, capture),
        };
        let of = |judgement: Judgement| c.deviations.iter().filter(move |d| d.judgement == judgement);
        let names = |judgement: Judgement| {
            let all: Vec<String> = of(judgement).map(|d| d.parameter.to_string()).collect();
            all.join(", ")
        };
        let left = quantile(c.residuals.iter().map(|r| r.turn.length()), 0.5);
        let (verdict, says) = if of(Judgement::Wrong).next().is_some() {
            (CalibrationVerdict::Stale, format!("{} not what the calibration says", is_or_are(c)))
        } else if left > LEFT_MOST {
            let says = format!(
                "what is seen is {} off where it is expected, and no number of the calibration explains it; look for a mirrored picture, for mirrored \
                 axes of the unit and for a loose mount",
                at_range(left)
            );
            (CalibrationVerdict::Stale, says)
        } else if of(Judgement::NotTold).next().is_some() {
            let says =
                format!("not told by this recording: {}; what it tells agrees", names(Judgement::NotTold));
            (CalibrationVerdict::CannotTell, says)
        } else {
            let least = of(Judgement::Agrees).map(Deviation::unseen_below).fold(0.0, f64::max);
            let says = format!(
                "all that a recording can tell is as the calibration says; an error of more than {} would have been found",
                at_range(least)
            );
            (CalibrationVerdict::Good, says)
        };
        let mut report = Self::new(title, verdict, says, capture);
        for d in &c.deviations {
            report.row(&d.parameter.to_string(), line(d, known));
        }
        report.row("boresight, muzzle, trigger", "not told by this recording".to_owned());
        report.notes.extend(of(Judgement::Wrong).map(|d| failing(d, known)));
        if verdict == CalibrationVerdict::CannotTell {
            report.notes.extend(advice(c, capture.is_by_horizon()));
        }
        report.residual_rows(&c.noise, &c.residuals, &c.left_out);
        report.covariance = Some(c.turn_covariance);
        report.place(capture, &c.residuals);
        report.deviations.clone_from(&c.deviations);
        report
    }

    /// Warns where what was measured is old. `today` is the day on which it is judged.
    pub fn warn_of_age(&mut self, file: &CalibrationFile, today: Date) {
        if file.source == SIMULATED {
            return;
        }
        let parts: [(&str, &Provenance); 4] = [
            ("the lens", &file.lens),
            ("the rotation", &file.camera_from_imu),
            ("the time offset", &file.time_offset),
            ("the boresight", &file.boresight),
        ];
        let days = |p: &Provenance| today.days_since(p.measured);
        let mut warn = |is_odd: &dyn Fn(i64) -> bool, says: &str| {
            let odd = parts.iter().filter(|(_, p)| is_odd(days(p)));
            let odd: Vec<String> = odd.map(|(what, p)| format!("{what} on {}", p.measured)).collect();
            if !odd.is_empty() {
                self.notes.push(format!("{says}: {}", odd.join(", ")));
            }
        };
        warn(&|days| days > OLD_DAYS, "measured long ago, to be measured again when there is time");
        warn(&|days| days < 0, "measured on a day yet to come (is the clock set?)");
    }

    /// Warns where camera or unit of the recording are not those of the calibration.
    pub fn warn_of_others(&mut self, file: &CalibrationFile, recorded: &CalibrationFile) {
        for (what, ours, theirs) in [
            ("camera", &file.camera_serial, &recorded.camera_serial),
            ("inertial unit", &file.imu_serial, &recorded.imu_serial),
        ] {
            if !ours.is_empty() && !theirs.is_empty() && ours != theirs {
                self.notes
                    .push(format!("the calibration is of the {what} {ours}, the recording of {theirs}"));
            }
        }
    }
}

/// The wrong ones, with their verb.
fn is_or_are(c: &Comparison) -> String {
    let wrong: Vec<String> = c
        .deviations
        .iter()
        .filter(|d| d.judgement == Judgement::Wrong)
        .map(|d| d.or.iter().fold(d.parameter.to_string(), |all, other| format!("{all} or {other}")))
        .collect();
    format!("{} {}", wrong.join(", "), if wrong.len() > 1 { "are" } else { "is" })
}

/// A difference and its standard deviation in the parameter's usual unit.
fn size(d: &Deviation, sigma: f64, known: &Calibration) -> String {
    let (by_unit, unit, digits) = match d.parameter {
        Parameter::Elevation | Parameter::Traverse | Parameter::Roll => (1e3, "mrad", 2),
        Parameter::Offset | Parameter::Readout => (1e3, "ms", 2),
        Parameter::Bias(_) => (1f64.to_degrees(), "deg/s", 4),
        Parameter::Scale(_) => (100.0, "%", 2),
        Parameter::Focal | Parameter::CentreRight => (known.lens.focal.x, "px", 1),
        Parameter::CentreDown => (known.lens.focal.y, "px", 1),
        Parameter::Distortion => (1.0, "of k1", 3),
    };
    format!("{:+.digits$} +- {:.digits$} {unit}", d.off * by_unit, sigma * by_unit)
}

/// What an error does to the picture.
fn effect(parameter: Parameter, radians: f64, known: &Calibration) -> String {
    let where_from = match parameter {
        Parameter::Elevation | Parameter::Traverse | Parameter::CentreRight | Parameter::CentreDown => "",
        Parameter::Roll | Parameter::Focal | Parameter::Distortion => " at the picture's edge",
        Parameter::Offset | Parameter::Readout => " while the gun is swung at 40 deg/s",
        Parameter::Scale(_) => " after a turn of 90 deg",
        Parameter::Bias(_) => " after 10 s without a horizon or a landmark",
    };
    let here = format!(
        "{:.1} px, {:.2} m at {RANGE_M:.0} m{where_from}",
        radians * known.lens.focal.x,
        radians * RANGE_M
    );
    match parameter {
        Parameter::Bias(_) => {
            let a_day = (radians / parameter.effect(known)).to_degrees() * 86_400.0;
            format!("{here}, {a_day:.0} deg in a day")
        }
        _ => here,
    }
}

fn line(d: &Deviation, known: &Calibration) -> String {
    match d.judgement {
        Judgement::NotTold => "not told by this recording".to_owned(),
        judgement => {
            let word = if judgement == Judgement::Wrong { "WRONG" } else { "agrees" };
            let sigma = d.sigma.hypot(d.stated);
            format!("{word}: {} ({})", size(d, sigma, known), effect(d.parameter, d.effect, known))
        }
    }
}

/// Name, size, effect and what to do.
fn failing(d: &Deviation, known: &Calibration) -> String {
    let or: String = d.or.iter().map(|other| format!(" or {other}")).collect();
    format!(
        "{}{or} is off by {}: {}; {}",
        d.parameter,
        size(d, d.sigma, known),
        effect(d.parameter, d.effect, known),
        remedy(d.parameter)
    )
}

fn remedy(parameter: Parameter) -> &'static str {
    match parameter {
        Parameter::Elevation | Parameter::Traverse | Parameter::Roll => {
            "fasten camera and unit, then measure again with `bowwave calibrate extrinsics`"
        }
        Parameter::Offset => "measure it again with `bowwave calibrate extrinsics`",
        Parameter::Bias(_) => {
            "measure it again with `bowwave calibrate extrinsics`, the unit as warm as in use"
        }
        Parameter::Scale(_) => "set the unit to its own scale, or replace it",
        Parameter::Readout => "measure it again with `bowwave calibrate extrinsics --target`",
        Parameter::Focal | Parameter::CentreRight | Parameter::CentreDown | Parameter::Distortion => {
            "fix zoom and focus, then measure the lens again with `bowwave calibrate intrinsics`"
        }
    }
}

/// What would tell what the recording does not: one line each, none twice.
fn advice(c: &Comparison, is_by_horizon: bool) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for d in c.deviations.iter().filter(|d| d.judgement == Judgement::NotTold) {
        let says = match d.parameter {
            Parameter::Elevation if is_by_horizon => {
                "a board (--target) tells elevation better than the horizon".to_owned()
            }
            Parameter::Elevation | Parameter::Traverse | Parameter::Roll => {
                let missing = if c.missing == Movement::Any { Movement::Elevation } else { c.missing };
                format!("more {missing} tells the rotation")
            }
            Parameter::Offset | Parameter::Readout => {
                "faster movements to and fro tell time offset and read-out".to_owned()
            }
            Parameter::Bias(_) if is_by_horizon => {
                "a horizon does not tell how the unit drifts about the vertical; a board (--target) does"
                    .to_owned()
            }
            Parameter::Bias(_) => "a longer recording tells the gyro's bias".to_owned(),
            Parameter::Scale(_) => {
                "wide turns about all axes before a board (--target) tell the gyro's scale".to_owned()
            }
            Parameter::Focal | Parameter::CentreRight | Parameter::CentreDown | Parameter::Distortion => {
                "a board (--target), tilted and all over the picture, tells the lens".to_owned()
            }
        };
        if !all.contains(&says) {
            all.push(says);
        }
    }
    all
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axis = |axis: &usize| ["x", "y", "z"].get(*axis).copied().unwrap_or("?");
        match self {
            Self::Elevation => f.write_str("elevation"),
            Self::Traverse => f.write_str("traverse"),
            Self::Roll => f.write_str("roll"),
            Self::Offset => f.write_str("time offset"),
            Self::Bias(about) => write!(f, "gyro bias about {}", axis(about)),
            Self::Readout => f.write_str("read-out of the picture"),
            Self::Scale(about) => write!(f, "gyro scale about {}", axis(about)),
            Self::Focal => f.write_str("focal length"),
            Self::CentreRight => f.write_str("principal point (right)"),
            Self::CentreDown => f.write_str("principal point (down)"),
            Self::Distortion => f.write_str("distortion"),
        }
    }
}
