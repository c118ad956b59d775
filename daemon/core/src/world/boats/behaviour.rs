//! The behaviours of boats: a course that is known beforehand, or a crew.

use std::sync::Arc;

use glam::DVec2;

use super::{
    course::{BoatDamage, Course, CourseState},
    crew::CrewPlan,
    drive::Propulsor,
};

/// The behaviour of a boat, as a scenario gives it.
#[derive(Clone, Debug, PartialEq)]
pub enum Behaviour {
    /// It goes a course that is known beforehand, a closed function of time.
    ScriptedCourse(Course),
    /// A crew drives it.
    Crewed(CrewedStart),
}

/// A boat with a crew as the scenario begins.
#[derive(Clone, Debug, PartialEq)]
pub struct CrewedStart {
    /// States of its crew.
    pub plan: Arc<CrewPlan>,
    /// Seed of the crew's chance; in a scenario the crew's number, to which the session's seed is added.
    pub chance: u64,
    /// The crew keeps to the rules of the road.
    pub keeps_rules: bool,
    /// Engine and helm.
    pub propulsor: Propulsor,
    /// Greatest speed in calm water, m/s.
    pub speed_max_m_s: f64,
    /// Position of its origin, world x and y, metres.
    pub position: DVec2,
    /// Radians clockwise from north.
    pub heading: f64,
    /// Its speed, m/s.
    pub speed_m_s: f64,
    /// When it is to be where it attacks from, seconds since the scenario began; `None` as soon as it can.
    pub on_target_s: Option<f64>,
}

impl CrewedStart {
    /// State as the scenario begins.
    pub fn course(&self) -> CourseState {
        let Self { position, heading, speed_m_s, .. } = *self;
        CourseState { position, heading, speed_m_s, ..CourseState::default() }
    }
}

impl Behaviour {
    /// The same in a session with that seed.
    #[must_use]
    pub fn in_session(self, seed: u64) -> Self {
        match self {
            Self::Crewed(start) => {
                Self::Crewed(CrewedStart { chance: start.chance.wrapping_add(seed), ..start })
            }
            scripted => scripted,
        }
    }

    /// State of the boat as the scenario begins.
    pub fn begin(&self) -> CourseState {
        match self {
            Self::ScriptedCourse(course) => course.state(0.0, &BoatDamage::NONE),
            Self::Crewed(start) => start.course(),
        }
    }

    /// Greatest speed over ground, m/s.
    pub fn speed_max_m_s(&self) -> f64 {
        match self {
            Self::ScriptedCourse(course) => course.speed_max_m_s(),
            Self::Crewed(start) => start.speed_max_m_s,
        }
    }

    /// The first time before `until_s` at which the undamaged boat may be less than `radius_m` from (0, 0). Crews keep clear by
    /// themselves, once they are.
    pub fn first_within(&self, radius_m: f64, until_s: f64) -> Option<f64> {
        match self {
            Self::ScriptedCourse(course) => course.first_within(radius_m, until_s),
            Self::Crewed(start) => (start.position.length() < radius_m).then_some(0.0),
        }
    }
}
