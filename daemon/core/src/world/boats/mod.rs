//! Boats: what they do, where they were, and how waves move them.

pub mod behaviour;
mod course;
mod floating;
mod grid;
mod history;
mod hull;
mod motion;
mod path;
mod seakeeping;

pub use behaviour::{Behaviour, BehaviourStep};
pub use course::{Arrival, BoatDamage, Course, CourseError, CourseState};
pub use floating::{Floating, afloat_in_waves, facing, quasi_static};
pub use history::{BoatHistory, HISTORY_S};
pub use hull::{Hull, HullForm};
pub use motion::BoatMotion;
pub use seakeeping::SeakeepingState;
