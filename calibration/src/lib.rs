//! The calibration file.
