//! Boats: what they do, where they were, and how waves move them.

pub mod behaviour;
mod course;
mod crew;
mod crewed;
mod drive;
mod fire;
mod floating;
mod flooding;
mod grid;
mod history;
mod hull;
mod lights;
mod motion;
mod path;
mod seakeeping;

pub use behaviour::{Behaviour, CrewedStart};
pub use course::{Arrival, BoatDamage, Course, CourseError, CourseState, RoundStrike};
pub use crew::{Act, CrewPlan, CrewState, Exit, Guard, Signals, Traffic};
pub use crewed::StepView;
pub use drive::{
    Craft, DriveRates, DriveState, HullRunning, Orders, PlaningSurface, Propulsor, Running, Surroundings,
};
pub use fire::{FIRE_CANDELA_KW, fire_heat_kw};
pub use floating::{Floating, WayAttitude, facing, quasi_static};
pub(crate) use grid::{seconds as step_seconds, step_after};
pub use history::{BoatHistory, HISTORY_S};
pub use hull::{Hull, HullForm};
pub use lights::{Conduct, LightColour, LightsKept, LightsRigged, NavigationLight};
pub use motion::BoatMotion;
pub use seakeeping::SeakeepingState;
