//! Flight of a virtual round: standard atmosphere, drag, point mass.

mod atmosphere;
mod dispersion;
mod drag;
mod flight;
mod solution;

pub use atmosphere::{Air, Atmosphere};
pub use dispersion::dispersed;
pub use drag::{DragModel, DragTable};
pub use flight::{Flight, FlightSegment, FlightState, Projectile, STEP_S};
pub use solution::{AimSolution, aim_to_hit};
