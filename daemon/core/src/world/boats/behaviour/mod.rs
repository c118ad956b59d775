//! The behaviours of boats: each gives a boat's next state from its last.
//!
//! A new one is a file in this folder, an entry of [`Behaviour`], and a course of the scenario's reader.

mod step;

pub use step::BehaviourStep;

use super::course::{BoatDamage, Course, CourseState};

/// The behaviour of a boat. It holds no state of its own: what it does next follows from the boat's last state, the time and the
/// damage, so that a stretch can be stepped anew after a round has struck.
#[derive(Clone, Debug, PartialEq)]
pub enum Behaviour {
    /// It goes a course that is known beforehand, a closed function of time.
    ScriptedCourse(Course),
}

impl Behaviour {
    /// The state from which the boat is stepped on at `time_s`, where nothing is known of the time before: at the scenario's begin.
    pub fn begin(&self, time_s: f64, damage: &BoatDamage) -> CourseState {
        match self {
            Self::ScriptedCourse(course) => course.state(time_s, damage),
        }
    }

    /// The state from which the boat is stepped on at `time_s`, after a stretch that nobody followed; `last` is from before it.
    pub fn resume(&self, _last: &CourseState, time_s: f64, damage: &BoatDamage) -> CourseState {
        match self {
            Self::ScriptedCourse(course) => course.state(time_s, damage),
        }
    }

    /// The state at the end of a step.
    pub fn next(&self, step: &BehaviourStep<'_>) -> CourseState {
        match self {
            Self::ScriptedCourse(course) => course.state(step.to_s, step.damage),
        }
    }

    /// Greatest speed over ground, m/s.
    pub fn speed_max_m_s(&self) -> f64 {
        match self {
            Self::ScriptedCourse(course) => course.speed_max_m_s(),
        }
    }

    /// The first time before `until_s` at which the undamaged boat may be less than `radius_m` from (0, 0).
    pub fn first_within(&self, radius_m: f64, until_s: f64) -> Option<f64> {
        match self {
            Self::ScriptedCourse(course) => course.first_within(radius_m, until_s),
        }
    }
}
