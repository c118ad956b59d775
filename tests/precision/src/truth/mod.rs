//! The truth: a CPU ray tracer of a boat on a sea, which shares no code with the trainer's reflections.

pub mod boat;
pub mod cell;
pub mod field;
pub mod files;
pub mod grid;
pub mod masks;
pub mod mesh;
pub mod micro;
pub mod rng;
pub mod sky;
pub mod spectrum;
pub mod study;
pub mod trace;
pub mod video;
