//! Stage one: what the sensors say. Orientation over time, the horizon and the sky in the picture, the light and the sea's state.
//!
//! This stage knows nothing of boats, rounds or of what is drawn.

pub mod attitude;
pub mod clock;
mod estimator;
mod heading_aiding;
pub mod horizon;
mod horizon_aiding;
pub mod light;
pub mod plausibility;
pub mod pose;
pub mod recoil;
pub mod registration;
mod schedule;
pub mod sea;
mod sea_state;
mod sensors;
pub mod skyline;
mod visual_compass;

pub use estimator::{CameraEstimate, Estimator, EstimatorSettings, SceneLight};
pub use heading_aiding::{HeadingCounts, HeadingSettings, Landmark, ShipHeadings, Stow};
pub use horizon_aiding::HorizonCounts;
pub use sea_state::{SeaReport, SeaStateTracker};
pub use sensors::{SensorCounts, Sensors};
pub use visual_compass::SkylineCounts;
