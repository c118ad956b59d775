//! The report as a page of the head-up display, which the wizard shows on display and terminal.

use bowwave_core::guide::{Gauge, Guide};

use super::{CalibrationReport, CalibrationVerdict};

/// The page of a result. `problem` is why it could not be saved; `has_ended` tells that no more can be gathered.
pub(crate) fn guide(
    report: &CalibrationReport,
    gauges: Vec<Gauge>,
    problem: Option<String>,
    has_ended: bool,
) -> Guide {
    let passed = report.verdict == CalibrationVerdict::Pass;
    let says = match (passed, has_ended) {
        (true, _) => "Press Enter to save",
        (false, false) => "Press Enter to gather more",
        (false, true) => "Record again as the lines say; press Enter to end",
    };
    Guide {
        says: says.to_owned(),
        problem,
        gauges,
        passed: Some(passed),
        lines: [&report.says].into_iter().chain(&report.notes).cloned().collect(),
        keys: if passed {
            "Enter or trigger: save   b: gather more   q: end"
        } else {
            "Enter or trigger: gather more   q: end"
        },
        ..Guide::default()
    }
}
