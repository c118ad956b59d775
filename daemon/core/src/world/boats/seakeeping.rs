//! A boat's motion in waves over time: steps on the grid of [`grid`](super::grid), of which the last seconds are kept.
//!
//! A boat's motion at a time is the same whatever frames were drawn on the way, and a round that was fired a little ago meets the boat
//! as it was drawn then.

use super::{
    course::CourseState,
    grid::{GridHistory, Lookup, STEP_S, seconds, step_after},
    hull::HullForm,
    motion::{BoatMotion, HullWater},
};
use crate::world::waves::WaveField;

/// Steps kept: what frames and rounds ask for lies within a quarter of a second; 4 s.
const KEPT: usize = 240;
/// A stretch of more steps than this without a frame (10 s) is not followed through, so that no frame waits for it: the boat begins
/// anew in the mean plane of the water, as many steps back as are kept.
pub(super) const GAP: i64 = 600;
/// Farther off than this, metres, a boat lies in the mean plane of the water: what inertia adds is a small part of a pixel.
pub(super) const FAR_M: f64 = 2500.0;

/// Heave, roll and pitch of one boat over the last seconds.
#[derive(Clone, Debug)]
pub struct SeakeepingState {
    form: HullForm,
    motions: GridHistory<BoatMotion>,
    /// The water at the step of that number, the newest.
    water: Option<(i64, Box<HullWater>)>,
    /// Step at which the boat begins.
    begins: i64,
}

impl SeakeepingState {
    /// A boat whose motion has not begun.
    pub fn new(form: HullForm) -> Self {
        Self { form, motions: GridHistory::new(KEPT), water: None, begins: 0 }
    }

    /// The same for a boat that begins at that step.
    pub fn begun_at(self, begins: i64) -> Self {
        Self { begins, ..self }
    }

    /// Follows the boat on its course (a state by seconds) up to `until_s`. Does nothing for what is already followed.
    pub fn follow(&mut self, until_s: f64, course: impl Fn(f64) -> CourseState, waves: &WaveField) {
        let last = step_after(until_s);
        let start = match self.motions.newest() {
            Some(newest) if last.saturating_sub(newest) <= GAP => newest,
            _ => {
                let is_young = last.saturating_sub(self.begins) <= GAP;
                let first = if is_young { self.begins } else { last - KEPT as i64 };
                let plane = self.plane(first, &course, waves);
                self.motions.restart(first, plane);
                first
            }
        };
        let mut from = course(seconds(start));
        for number in start..last {
            let to = course(seconds(number + 1));
            let motion = self.motions.last().copied().unwrap_or_default();
            let next = (!is_far(&to)).then(|| {
                let water = self.water_at(number, &from, waves);
                let then = Box::new(self.form.water(&to, waves, seconds(number + 1)));
                let next = self.form.step([&from, &to], [&water, &then], &motion, STEP_S);
                self.water = Some((number + 1, then));
                next
            });
            let next = next.filter(|next| self.form.is_sane(next, waves.crest_max_m(), STEP_S));
            let next = next.unwrap_or_else(|| self.plane(number + 1, &course, waves));
            self.motions.push(next);
            from = to;
        }
    }

    /// The water at the step of that number, kept or computed.
    fn water_at(&mut self, number: i64, course: &CourseState, waves: &WaveField) -> Box<HullWater> {
        match self.water.take() {
            Some((kept, water)) if kept == number => water,
            _ => Box::new(self.form.water(course, waves, seconds(number))),
        }
    }

    fn plane(&self, number: i64, course: &impl Fn(f64) -> CourseState, waves: &WaveField) -> BoatMotion {
        BoatMotion::of_plane(&self.form, course, waves, seconds(number))
    }

    /// Forgets what comes after `time_s`: the boat's course or sea is another from there on.
    pub fn forget_after(&mut self, time_s: f64) {
        self.motions.forget_after(time_s);
        self.water = None;
    }

    /// The motion at a time; `None` where it is not followed yet or no longer kept.
    pub fn at(&self, time_s: f64) -> Option<BoatMotion> {
        match self.motions.around(time_s)? {
            Lookup::Between(from, to, share) => Some(from.between(to, STEP_S, share)),
            Lookup::After(last, past_s) => (past_s <= 0.0).then_some(*last),
            Lookup::Before(..) => None,
        }
    }

    /// The hull.
    pub const fn form(&self) -> &HullForm {
        &self.form
    }
}

/// Whether a boat is so far off that its inertia does not show.
fn is_far(state: &CourseState) -> bool {
    state.position.length() > FAR_M
}

#[cfg(test)]
#[path = "seakeeping_tests.rs"]
mod tests;
