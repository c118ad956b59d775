//! The solvers: each takes measurements and gives one part of the calibration with its uncertainty, without I/O.

pub mod alignment;
pub mod boresight;
pub mod lens;
pub(crate) mod so3;
pub mod trigger;
