//! Pulls of the trigger, for boresight and latency.

use bowwave_core::{calibration::Calibration, time::Time};
use glam::DVec2;

use crate::boresight::Pull;

/// Pulls that are enough.
pub(super) const PULLS: usize = 5;
/// After a pull, pictures and jolts come in for so long, seconds.
pub(super) const SETTLE_S: f64 = 0.4;
/// Marks that are remembered for a pull that is reported late: a second's.
const MARKS_MOST: usize = 64;
/// Pulls that are taken.
const PULLS_MOST: usize = 100;

/// Pulls, and where the mark was.
#[derive(Clone, Debug, Default)]
pub(super) struct AimWatch {
    pulls: Vec<Pull<Option<DVec2>>>,
    marks: Vec<(Time, Option<DVec2>)>,
}

impl AimWatch {
    pub(super) fn pull(&mut self, edge: Time, calibration: &Calibration) {
        if self.pulls.len() >= PULLS_MOST {
            return;
        }
        let mut pull = Pull::new(edge, calibration);
        for (stamp, pixel) in &self.marks {
            pull.offer(*stamp, calibration, || *pixel);
        }
        self.pulls.push(pull);
    }

    pub(super) fn mark(&mut self, stamp: Time, pixel: Option<DVec2>, calibration: &Calibration) {
        for pull in &mut self.pulls {
            pull.offer(stamp, calibration, || pixel);
        }
        if self.marks.len() >= MARKS_MOST {
            self.marks.remove(0);
        }
        self.marks.push((stamp, pixel));
    }

    fn is_settled(pull: &Pull<Option<DVec2>>, now: Time) -> bool {
        now.secs_since(pull.fired) > SETTLE_S
    }

    /// Pulls whose pictures and jolts have come in.
    pub(super) fn settled(&self, now: Time) -> usize {
        self.pulls.iter().filter(|p| Self::is_settled(p, now)).count()
    }

    /// Where the mark was at each of them that had one in its picture.
    pub(super) fn aimed(&self, now: Time) -> Vec<DVec2> {
        let settled = self.pulls.iter().filter(|p| Self::is_settled(p, now));
        settled.filter_map(|p| p.nearest.and_then(|n| n.1)).collect()
    }

    /// Whether the mark was seen last.
    pub(super) fn is_seen(&self) -> bool {
        self.marks.last().is_some_and(|m| m.1.is_some())
    }
}
