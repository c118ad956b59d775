//! Faults of the field: one name, one code in the log, one word to the sailor for each.
//!
//! Whoever notices a fault reports a [`FaultChange`]; the [`FaultBoard`] keeps which faults are active, and what the log is
//! to be told. Time is an argument here as everywhere in this crate.

mod board;
mod kinds;
mod part;
mod permission;

pub use board::{FaultBoard, LogEntry, LogEvent};
pub use kinds::{Change, Fault, FaultChange, Severity};
pub use part::DevicePart;
pub use permission::{FirePermission, NotScored};
