//! Error against run time of every numerical part.
//!
//! A [`parts::Part`] holds the ways of doing one thing against a truth that shares no code with them: [`mod@bench`] times the ways
//! of a scene in turns, [`front`] finds those that nothing beats, [`row`] writes the table and [`page`] the page.

pub mod aided;
pub mod alignment;
pub mod bench;
pub mod front;
pub mod horizon;
pub mod karma;
pub mod metric;
pub mod page;
pub mod parts;
pub mod photograph;
pub mod plot;
pub mod recorded;
pub mod reflection;
pub mod registration;
pub mod row;
pub mod sea_video;
pub mod ship;
pub mod target;
pub mod truth;

/// Counts the heap, so that what a way takes of it can be told.
#[global_allocator]
static HEAP: peak_alloc::PeakAlloc = peak_alloc::PeakAlloc;
