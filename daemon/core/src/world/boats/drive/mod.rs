//! Boats that are driven: a helmsman gives throttle and helm, engine and hull turn them into motion.

mod craft;
mod motion;
mod resistance;

pub use craft::{Craft, Propulsor};
pub use motion::{DriveRates, DriveState, Orders, Surroundings};
pub use resistance::{HullRunning, PlaningSurface, Running};
