//! The numerical parts.

pub mod attitude;
pub mod clock;
pub mod flight;
pub mod lens;
pub mod pacing;

use crate::table::Row;

/// A ranked row with no note that is no default; change the fields that differ.
pub fn row(
    part: &'static str,
    scene: &str,
    method: &str,
    setting: &str,
    error: f64,
    unit: &'static str,
    time_ns: f64,
) -> Row {
    Row {
        part,
        scene: scene.into(),
        method: method.into(),
        setting: setting.into(),
        error,
        error_unit: unit,
        time_ns,
        memory_bytes: 0,
        default: false,
        extreme: false,
        note: String::new(),
        pareto: false,
    }
}
