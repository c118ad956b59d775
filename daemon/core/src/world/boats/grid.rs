//! States of one thing on a fixed grid of times, of which the newest are kept.
//!
//! States lie at whole multiples of [`STEP_S`] since the scenario began, so that what is known of a time does not depend on which
//! frames were drawn on the way.

use std::collections::VecDeque;

/// Grid times a second.
const STEPS_PER_S: f64 = 60.0;
/// Time between two states, seconds.
pub(super) const STEP_S: f64 = 1.0 / STEPS_PER_S;
/// A time this close to a grid time, in steps, is that grid time: seconds are rounded, steps are not.
const SAME: f64 = 1e-6;

/// The newest states of one thing, at most as many as [`GridHistory::new`] was told.
#[derive(Clone, Debug)]
pub(super) struct GridHistory<T> {
    /// Step number of the oldest state.
    first: i64,
    states: VecDeque<T>,
    kept: usize,
}

/// Where a time lies among the states that are kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Lookup<'a, T> {
    /// Before the oldest state, by so many seconds.
    Before(&'a T, f64),
    /// At `share` (0 to 1) of the step from one state to the next.
    Between(&'a T, &'a T, f64),
    /// After the newest state, by so many seconds (0 at it).
    After(&'a T, f64),
}

impl<T> GridHistory<T> {
    /// An empty history that will hold up to `kept` states.
    pub fn new(kept: usize) -> Self {
        Self { first: 0, states: VecDeque::new(), kept }
    }

    /// Step number of the newest state.
    pub fn newest(&self) -> Option<i64> {
        (!self.states.is_empty()).then(|| self.first + self.states.len() as i64 - 1)
    }

    /// The newest state.
    pub fn last(&self) -> Option<&T> {
        self.states.back()
    }

    /// The newest state, to be changed.
    pub fn last_mut(&mut self) -> Option<&mut T> {
        self.states.back_mut()
    }

    /// Forgets everything and begins anew with `state` at step `number`.
    pub fn restart(&mut self, number: i64, state: T) {
        self.states.clear();
        self.first = number;
        self.states.push_back(state);
    }

    /// Appends the state of the step after the newest. The oldest goes where there are too many.
    pub fn push(&mut self, state: T) {
        self.states.push_back(state);
        if self.states.len() > self.kept {
            self.states.pop_front();
            self.first += 1;
        }
    }

    /// Forgets the states after `time_s`, but for the oldest: from that one it goes on.
    pub fn forget_after(&mut self, time_s: f64) {
        let kept = (time_s * STEPS_PER_S).floor() as i64 - self.first + 1;
        self.states.truncate(usize::try_from(kept).unwrap_or(0).max(1));
    }

    /// The states about `time_s`; `None` where there is none at all.
    pub fn around(&self, time_s: f64) -> Option<Lookup<'_, T>> {
        let steps = time_s * STEPS_PER_S;
        let nearest = steps.round();
        let steps = if (steps - nearest).abs() < SAME { nearest } else { steps };
        let number = steps.floor();
        let Ok(index) = usize::try_from(number as i64 - self.first) else {
            return Some(Lookup::Before(self.states.front()?, seconds(self.first) - time_s));
        };
        match (self.states.get(index), self.states.get(index + 1)) {
            (Some(from), Some(to)) => Some(Lookup::Between(from, to, steps - number)),
            _ => Some(Lookup::After(self.states.back()?, (steps - self.newest()? as f64) * STEP_S)),
        }
    }

    /// How many states there are.
    #[cfg(test)]
    pub fn len(&self) -> usize {
        self.states.len()
    }
}

/// Step at or after a time. A time that is no number is step 0.
pub(crate) fn step_after(time_s: f64) -> i64 {
    (time_s * STEPS_PER_S).ceil() as i64
}

/// Time of a step, seconds.
pub(crate) fn seconds(step: i64) -> f64 {
    step as f64 / STEPS_PER_S
}
