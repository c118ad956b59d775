//! Pictures of the calibration target with known truth.

pub mod draw;
pub mod moved;
pub mod shots;
