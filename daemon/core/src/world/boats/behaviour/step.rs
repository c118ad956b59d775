//! A step of a boat.

use crate::world::boats::course::{BoatDamage, CourseState};

/// A boat at the begin of a step.
#[derive(Clone, Copy, Debug)]
pub struct BehaviourStep<'a> {
    /// Where it is.
    pub from: &'a CourseState,
    /// Seconds since the scenario began at the end of the step.
    pub to_s: f64,
    /// The hits that it has taken.
    pub damage: &'a BoatDamage,
}
