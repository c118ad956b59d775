//! GoPro's public clip of a drone over a shore, calibrated from nothing but itself.
//!
//! Clouds in every other stripe of the picture are used; the others are held out and measure by how much an overlay that follows the
//! calibrated gyro would drift. The camera hangs on a gimbal and hardly turns before the last half second, so that what comes
//! before tells next to nothing of clock and lens.

pub mod clip;
pub mod fit;
pub mod report;
