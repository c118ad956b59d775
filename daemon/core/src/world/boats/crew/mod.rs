//! Crews: what boats do that are not bound to a course.

mod avoid;
mod mind;
mod plan;

pub use avoid::Traffic;
#[cfg(test)]
pub(crate) use mind::hard_turn;
pub use mind::{CrewMemory, Signals, Situation};
pub use plan::{Act, CrewPlan, CrewState, Exit, Guard};
