//! The behaviours of boats: a course that is known beforehand, or a crew.

use std::sync::Arc;

use glam::DVec2;

use super::{
    course::{BoatDamage, Course, CourseState},
    crew::CrewPlan,
    drive::Propulsor,
};
use crate::geometry::heading_of;

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
    /// When it begins, seconds since the scenario began: 0 but for a boat of the reserve.
    pub begins_s: f64,
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

    /// When it begins, seconds since the scenario began.
    pub const fn begins_s(&self) -> f64 {
        match self {
            Self::ScriptedCourse(course) => course.begins_s(),
            Self::Crewed(start) => start.begins_s,
        }
    }

    /// State of the boat as it begins.
    pub fn begin(&self) -> CourseState {
        match self {
            Self::ScriptedCourse(course) => course.state(course.begins_s(), &BoatDamage::NONE),
            Self::Crewed(start) => start.course(),
        }
    }

    /// The same about another place: the gun's `middle` of it is taken to `to`, world x and y, metres, and headings turn with the bearing. A course
    /// that is known beforehand stays where it is.
    #[must_use]
    pub fn moved(self, middle: DVec2, to: DVec2) -> Self {
        match self {
            Self::Crewed(start) => {
                let turn = heading_of(to) - heading_of(middle);
                let off = start.position - middle;
                let (sin, cos) = turn.sin_cos();
                // Clockwise from north, as headings count.
                let off = DVec2::new(off.x * cos + off.y * sin, off.y * cos - off.x * sin);
                Self::Crewed(CrewedStart { position: to + off, heading: start.heading + turn, ..start })
            }
            scripted => scripted,
        }
    }

    /// The same, begun so many seconds after the scenario.
    #[must_use]
    pub fn begun_at(self, seconds: f64) -> Self {
        match self {
            Self::Crewed(start) => Self::Crewed(CrewedStart {
                begins_s: seconds,
                on_target_s: start.on_target_s.map(|due| due + seconds),
                ..start
            }),
            Self::ScriptedCourse(course) => Self::ScriptedCourse(course.begun_at(seconds)),
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
