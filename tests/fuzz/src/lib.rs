//! The fuzz targets; `tests/tests/corpus.rs` runs the same functions over the files that are kept.

pub mod targets;
