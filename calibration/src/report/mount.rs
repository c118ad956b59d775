//! Reports of boresight and trigger latency.

use bowwave_core::calibration::Calibration;
use glam::DVec2;

use super::{CalibrationReport, CalibrationVerdict, at_range, ms};
use crate::{
    alignment::Grade,
    boresight::{Boresight, BoresightError},
    trigger::{Latency, LatencyError},
};

impl CalibrationReport {
    /// Of a trigger's latency that was found, or why there is none.
    pub fn of_trigger(title: &str, found: &Result<Latency, LatencyError>) -> Self {
        let found = match found {
            Ok(found) => found,
            Err(why) => return Self::bare(title, CalibrationVerdict::Fail, why.to_string()),
        };
        let says = format!("rounds leave {} after the line's edge", ms(found.latency_s, found.sigma_s));
        let mut report = Self::bare(title, CalibrationVerdict::Pass, says);
        let all: Vec<String> = found.jolts.iter().map(|(_, late)| format!("{:.1}", late * 1e3)).collect();
        report.row("jolts after, ms", all.join(", "));
        report.row("spread of one press", format!("{:.2} ms", found.spread_s * 1e3));
        report.row("presses without a jolt", found.without.to_string());
        report
    }

    /// Of a boresight that was found, or why there is none. `known` is the calibration before.
    pub fn of_boresight(title: &str, found: &Result<Boresight, BoresightError>, known: &Calibration) -> Self {
        let found = match found {
            Ok(found) => found,
            Err(why) => return Self::bare(title, CalibrationVerdict::Fail, why.to_string()),
        };
        let sigma = found.sigma();
        let verdict =
            if sigma <= Grade::ROTATION[1] { CalibrationVerdict::Pass } else { CalibrationVerdict::Fail };
        let says =
            format!("where the barrel points is known within {} (one standard deviation)", at_range(sigma));
        let mut report = Self::bare(title, verdict, says);
        let degrees = |a: DVec2| format!("{:.3} right, {:.3} down, deg", a.x.to_degrees(), a.y.to_degrees());
        report.row("barrel off the optical axis", degrees(found.angles));
        report.row("before", degrees(known.boresight));
        report.row("scatter of one pull", at_range(found.scatter));
        let [right, down, ahead] = known.muzzle_in_camera.to_array();
        report
            .row("muzzle from the camera", format!("{right:.2} right, {down:.2} down, {ahead:.2} ahead, m"));
        let mrad = |r: &DVec2| format!("{:+.2} {:+.2}", r.x * 1e3, r.y * 1e3);
        let each: Vec<String> = found.residuals.iter().map(mrad).collect();
        report.row("pulls off the mean, mrad", each.join(", "));
        if verdict == CalibrationVerdict::Fail {
            report.notes.push("hold the gun on the mark for each pull, and pull more often".to_owned());
        }
        report
    }
}
