//! The calibration file: what maintainers measured about one camera and one inertial unit on one mount; and the solvers that its
//! numbers come from ([`alignment`], [`lens`] from pictures of a [`target`], [`boresight`]).
//!
//! A file is TOML with human units (pixels, degrees, milliradians, milliseconds, metres); in memory everything is a checked
//! [`bowwave_core::calibration::Calibration`] in radians and nanoseconds. Every measured value comes with its uncertainty
//! (one standard deviation, always above zero: nothing is known exactly), the date on which it was measured and, optionally,
//! how. Unknown keys and values that cannot be right are refused with line and column.
//!
//! | Section | Keys |
//! |---|---|
//! | (top) | `made` (date), `source`; optional `camera_name`, `camera_serial`, `imu_name`, `imu_serial` |
//! | `[lens]` | `size_px = [width, height]`, `focal_px = [fx, fy]`, `focal_sigma_px`, `centre_px = [cx, cy]` (the centre of the first pixel is 0.5, 0.5), `radial = [k1, k2]` and `tangential = [p1, p2]`, or `fisheye = [k1, k2, k3, k4]` |
//! | `[camera_from_imu]` | `rotation_wxyz`, `sigma_mrad = [x, y, z]` (about the camera's axes) |
//! | `[time_offset]` | `offset_ms` (add to a frame's mid-exposure stamp to get the time on the unit's clock), `sigma_ms` |
//! | `[shutter]` | `readout_ms` (from reading the picture's first row to its last, negative where the last is read first), `sigma_ms`; left out where all rows are exposed at once |
//! | `[boresight]` | `right_deg`, `down_deg` (of the optical axis), `sigma_mrad`, `muzzle_m = [right, down, forward]` from the camera |
//! | `[trigger]` | `latency_ms` (from the line's edge to the round, negative where the line is the later one), `sigma_ms`; left out where it was not measured |
//! | `[own_ship]` | optional; `hidden_px`: polygons in which the sea is not looked for; `[[own_ship.phantom]]`: `outline_px`, traced along the edges of what the camera sees of the gun ([`outline`]), optional `name` |
//! | `[gyro_bias]` | `bias_deg_per_s = [x, y, z]` (subtracted from the rates, unit's axes), `sigma_deg_per_s` |
//!
//! Every section also has `measured` (a TOML date, unquoted) and may have `how`.
//!
//! Lens: Brown-Conrady in the direction of OpenCV, from undistorted to distorted normalised coordinates (barrel distortion
//! has a negative `k1`); or Kannala-Brandt, OpenCV's fisheye. `rotation_wxyz` is a unit Hamilton quaternion, scalar first, that turns a vector's coordinates in the
//! unit's axes into its coordinates in the camera's (x right, y down, z forward): `v_camera = q v_imu q*`. For a unit mounted
//! x forward, y right, z down it is `[0.5, -0.5, -0.5, -0.5]`.
//!
//! [`to_toml`] and [`parse`] are exact inverses for everything that came from a file. A calibration computed elsewhere may move
//! by one unit in the last place (2e-16 of the value) when it is first written, because not every number of radians is a
//! number of degrees.

#![forbid(unsafe_code)]

pub mod capture;
mod file;
pub mod gun;
pub mod outline;
pub mod plane;
pub mod polygon;
pub mod report;
mod rolling_shutter;
mod sight;
pub mod simulated;
mod solve;
pub mod target;
pub mod wizard;

pub use file::{
    CalibrationError, CalibrationFile, Date, POLYGONS_MOST, Provenance, SIMULATED, history, parse, to_toml,
};
pub use solve::{alignment, boresight, lens, trigger};
