//! Report of a calibration that was held against a recording, and warnings of age and of other devices.

use bowwave_core::{calibration::Calibration, statistics::quantile};
use glam::DVec3;

use super::{AXES, CalibrationReport, CalibrationVerdict, at_range, deg_per_s};
use crate::{
    CalibrationFile, Date, Provenance,
    alignment::{AlignmentError, Comparison, Grade},
    capture::Capture,
};

/// Chi-squared with four degrees of freedom that one in a thousand sound recordings exceeds.
const SURPRISE_MAX: f64 = 18.47;
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
        let c = match found {
            Ok(c) => c,
            Err(why @ AlignmentError::Mirrored { .. }) => {
                return Self::refused(title, CalibrationVerdict::Stale, why, capture);
            }
            Err(why) => return Self::refused(title, CalibrationVerdict::CannotTell, why, capture),
        };
        let told = c.turn_sigma();
        let offset_sigma = (known.time_offset_sigma_ns as f64 * 1e-9).hypot(c.offset_sigma_s);
        let is_told = |axis: usize| told[axis] <= Grade::ROTATION[1];
        let offset_told = c.offset_sigma_s <= Grade::OFFSET_S[1];
        let moved = (0..3).any(|axis| is_told(axis) && c.turn[axis].abs() > Grade::ROTATION[0])
            || offset_told && c.offset_s.abs() > Grade::OFFSET_S[0];
        let blind: Vec<&str> = (0..3).filter(|axis| !is_told(*axis)).map(|axis| AXES[axis]).collect();
        let left = quantile(c.residuals.iter().map(|r| r.turn.length()), 0.5);
        let (verdict, says) = if c.surprise > SURPRISE_MAX && moved {
            let seen = DVec3::from_array([0, 1, 2].map(|i| if is_told(i) { c.turn[i] } else { 0.0 }));
            let says = format!(
                "boats lie off by {} and {:.2} ms; calibrate again",
                at_range(seen.truncate().length()),
                c.offset_s.abs() * 1e3
            );
            (CalibrationVerdict::Stale, says)
        } else if left > LEFT_MOST {
            let says = format!(
                "what is seen is {} off where it is expected, and no rotation or time offset that the recording tells explains it; look \
                 for mirrored axes of the unit and for a loose mount",
                at_range(left)
            );
            (CalibrationVerdict::Stale, says)
        } else if !blind.is_empty() || !offset_told {
            let mut what: Vec<&str> = blind;
            what.extend((!offset_told).then_some("time offset"));
            let says = format!(
                "the recording does not tell {}; what it tells agrees. Record with more {}",
                what.join(", "),
                c.missing
            );
            (CalibrationVerdict::CannotTell, says)
        } else {
            let says = format!(
                "rotation and time offset are what they were, as far as {} and {:.2} ms can be told",
                at_range(told.truncate().length()),
                c.offset_sigma_s * 1e3
            );
            (CalibrationVerdict::Good, says)
        };
        let mut report = Self::new(title, verdict, says, capture);
        for axis in 0..3 {
            let sigma = known.camera_from_imu_sigma[axis].hypot(told[axis]);
            let value = if is_told(axis) {
                format!("{:+.2} +- {:.2} mrad", c.turn[axis] * 1e3, sigma * 1e3)
            } else {
                format!("not told (uncertain by {:.0} mrad)", told[axis] * 1e3)
            };
            report.row(&format!("{} off by", AXES[axis]), value);
        }
        let offset = if offset_told {
            format!("{:+.2} +- {:.2} ms", c.offset_s * 1e3, offset_sigma * 1e3)
        } else {
            format!("not told (uncertain by {:.0} ms)", c.offset_sigma_s * 1e3)
        };
        report.row("time offset off by", offset);
        report.row("gyro bias off by", deg_per_s(c.gyro_bias));
        report.row("surprise", format!("{:.1} (above {SURPRISE_MAX} one in a thousand)", c.surprise));
        report.residual_rows(&c.noise, &c.residuals, &c.left_out);
        report.covariance = Some(c.turn_covariance);
        report.place(capture, &c.residuals);
        report
    }

    /// Warns where what was measured is old. `today` is the day on which it is judged.
    pub fn warn_of_age(&mut self, file: &CalibrationFile, today: Date) {
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
