//! A run in formats that other programs read.

mod acmi;
mod rows;

pub use acmi::acmi;
pub use rows::{csv, json_lines};
