//! What a run tells of the heading: in the log as its uncertainty crosses limits, and in the summary.

use bowwave_core::{estimate::HeadingCounts, session::Session};
use serde::Serialize;

/// The log is told when the heading's standard deviation crosses one of these, degrees: what a boat is long at 500 m, a boat's own
/// distance from its neighbour, and what no round is worth anything with.
const LIMITS_DEG: [f64; 4] = [0.5, 1.0, 2.0, 5.0];
/// It is told again only where it came back below a limit by this share.
const BACK: f64 = 0.8;

/// Tells the log.
#[derive(Debug, Default)]
pub struct HeadingLog {
    above: usize,
    counts: HeadingCounts,
}

impl HeadingLog {
    /// Takes in what is known after a frame; says what is new of it.
    pub fn follow(&mut self, sigma: Option<f64>, counts: &HeadingCounts) {
        if counts.marks > self.counts.marks {
            log::info!(
                "the heading was set by the operator, to {:.2} deg",
                sigma.unwrap_or(0.0).to_degrees()
            );
        }
        if counts.marks_refused > self.counts.marks_refused {
            log::warn!(
                "the operator's press could not be used: set [rezero] or [landmarks] in the configuration, with from_bow_deg the ship's \
                 heading must come, and of two landmarks that are as near none is taken"
            );
        }
        self.counts = *counts;
        let Some(deg) = sigma.map(f64::to_degrees) else { return };
        if let Some(line) = self.cross(deg) {
            log::info!("{line}");
        }
    }

    /// What to say of a deviation of `deg` degrees, where it crossed a limit.
    fn cross(&mut self, deg: f64) -> Option<String> {
        let above = LIMITS_DEG.iter().filter(|limit| deg > **limit).count();
        let held = LIMITS_DEG.iter().filter(|limit| deg > **limit * BACK).count();
        if above > self.above {
            self.above = above;
            let limit = LIMITS_DEG.get(above - 1)?;
            return Some(format!(
                "the heading is known to {deg:.2} deg only (1 sigma, above {limit} deg): re-zero the gun at its stow or on a landmark"
            ));
        }
        if held < self.above {
            self.above = held;
            return Some(format!("the heading is known to {deg:.2} deg again (1 sigma)"));
        }
        None
    }
}

/// The heading at the end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HeadingSummary {
    /// Standard deviation since it was set or began, degrees.
    pub sigma_deg: f64,
    /// Headings of the ship that came.
    pub ship: u64,
    /// Of these, taken in.
    pub ship_taken: u64,
    /// Of these, not believed.
    pub ship_refused: u64,
    /// Rests of the gun on its mount at whose start the ship's heading was tied to the gun's.
    pub rests: u64,
    /// Presses of the operator that set the heading.
    pub marks: u64,
    /// Presses that could not be used.
    pub marks_refused: u64,
}

impl HeadingSummary {
    /// Of a session; `None` where there was no heading.
    pub fn of(session: &Session) -> Option<Self> {
        let c = session.sensor_counts().headings;
        Some(Self {
            sigma_deg: session.heading_sigma()?.to_degrees(),
            ship: c.ship,
            ship_taken: c.ship_taken,
            ship_refused: c.ship_refused,
            rests: c.rests,
            marks: c.marks,
            marks_refused: c.marks_refused,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_told_once_and_its_end_once() {
        let mut log = HeadingLog::default();
        let said: Vec<_> = [0.1, 0.4, 0.6, 0.7, 1.2, 0.95, 1.1, 0.3, 0.2]
            .into_iter()
            .map(|deg| log.cross(deg).is_some())
            .collect();
        assert_eq!(said, [false, false, true, false, true, false, false, true, false]);
    }

    #[test]
    fn what_crosses_two_limits_at_once_is_one_line() {
        let mut log = HeadingLog::default();
        assert!(log.cross(3.0).expect("said").contains("above 2 deg"));
        assert!(log.cross(0.0).expect("said").contains("0.00 deg again"));
    }
}
