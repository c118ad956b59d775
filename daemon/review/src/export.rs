//! A run in formats that other programs read.

mod acmi;
mod earth;
mod geojson;
mod rows;

pub use acmi::acmi;
pub use geojson::geojson;
pub use rows::{csv, json_lines};
