//! A boat's motion over time: steps on a fixed grid, of which the last seconds are kept.
//!
//! Steps lie at whole multiples of [`STEP_S`] since the scenario began, so a boat's motion at a time is the same whatever frames were
//! drawn on the way, and a round that was fired a little ago meets the boat as it was drawn then.

use std::collections::VecDeque;

use super::{CourseState, hull::HullForm, motion::Motion};
use crate::world::waves::WaveField;

/// Steps a second.
const STEPS_PER_S: f64 = 60.0;
/// Time between two steps, seconds.
const STEP_S: f64 = 1.0 / STEPS_PER_S;
/// Steps kept: what frames and rounds ask for lies within a quarter of a second; 4 s.
const KEPT: usize = 240;
/// A stretch of more steps than this without a frame (10 s) is not followed through, so that no frame waits for it: the boat begins
/// anew in the mean plane of the water, as many steps back as are kept.
const GAP: i64 = 600;
/// Farther off than this, metres, a boat lies in the mean plane of the water: what inertia adds is a small part of a pixel.
const FAR_M: f64 = 2500.0;

/// The motion of one boat.
#[derive(Clone, Debug)]
pub struct Ride {
    form: HullForm,
    /// Number of the first step kept.
    first: i64,
    motions: VecDeque<Motion>,
}

impl Ride {
    /// A boat whose motion has not begun.
    pub fn new(form: HullForm) -> Self {
        Self { form, first: 0, motions: VecDeque::with_capacity(KEPT + 1) }
    }

    /// Number of the newest step.
    fn newest(&self) -> Option<i64> {
        (!self.motions.is_empty()).then(|| self.first + self.motions.len() as i64 - 1)
    }

    /// Follows the boat on its course (a state by seconds) up to `until_s`. Does nothing for what is already followed.
    pub fn follow(&mut self, until_s: f64, course: impl Fn(f64) -> CourseState, waves: &WaveField) {
        // A time that is no number is step 0.
        let last = (until_s * STEPS_PER_S).ceil() as i64;
        let start = match self.newest() {
            Some(newest) if last.saturating_sub(newest) <= GAP => newest,
            _ => {
                self.motions.clear();
                self.first = if last <= GAP { 0 } else { last - KEPT as i64 };
                self.motions.push_back(self.plane(self.first, &course, waves));
                self.first
            }
        };
        let mut from = course(seconds(start));
        for number in start..last {
            let to = course(seconds(number + 1));
            let motion = self.motions.back().copied().unwrap_or_default();
            let near = !is_far(&to);
            let next = near.then(|| self.form.step([&from, &to], waves, seconds(number), &motion, STEP_S));
            let next = next.filter(|next| self.form.is_sane(next, waves.crest_max_m()));
            self.motions.push_back(next.unwrap_or_else(|| self.plane(number + 1, &course, waves)));
            if self.motions.len() > KEPT {
                self.motions.pop_front();
                self.first += 1;
            }
            from = to;
        }
    }

    fn plane(&self, number: i64, course: &impl Fn(f64) -> CourseState, waves: &WaveField) -> Motion {
        Motion::of_plane(&self.form, course, waves, seconds(number))
    }

    /// Forgets what comes after `time_s`: the boat's course or sea is another from there on.
    pub fn forget_after(&mut self, time_s: f64) {
        let kept = (time_s * STEPS_PER_S).floor() as i64 - self.first + 1;
        self.motions.truncate(usize::try_from(kept).unwrap_or(0));
    }

    /// The motion at a time; `None` where it is not followed yet or no longer kept.
    pub fn at(&self, time_s: f64) -> Option<Motion> {
        let steps = time_s * STEPS_PER_S;
        let number = steps.floor();
        let index = usize::try_from(number as i64 - self.first).ok()?;
        let from = self.motions.get(index)?;
        let share = steps - number;
        if share <= 0.0 {
            return Some(*from);
        }
        Some(from.between(self.motions.get(index + 1)?, STEP_S, share))
    }

    /// The hull.
    pub const fn form(&self) -> &HullForm {
        &self.form
    }
}

fn seconds(step: i64) -> f64 {
    step as f64 / STEPS_PER_S
}

/// Whether a boat is so far off that its inertia does not show.
fn is_far(state: &CourseState) -> bool {
    state.position.length() > FAR_M
}

#[cfg(test)]
#[path = "ride_tests.rs"]
mod tests;
