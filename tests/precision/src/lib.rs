//! Error against run time of every numerical part.
//!
//! A [`parts::NumericalPart`] holds the ways of doing one thing against a truth that shares no code with them: [`mod@bench`] times the ways
//! of a scene in turns, [`front`] finds those that nothing beats, [`row`] writes the table and [`page`] the page. A study goes into one
//! part in full and is a command of its own ([`alignment`], [`check`], [`documents`], [`horizon`], [`karma`], [`overload`], [`photograph`], [`reflection`], [`registration`],
//! [`sea_video`], [`truth`]). The sea of the truths is `hw_sim::ocean`'s. [`table`] prints all tables.

#![forbid(unsafe_code)]

pub mod aided;
pub mod alignment;
pub mod bench;
mod broad;
pub mod check;
pub mod documents;
pub mod front;
pub mod horizon;
pub mod karma;
pub mod metric;
pub mod overload;
pub mod page;
pub mod parts;
pub mod path_traced;
pub mod photograph;
pub mod plot;
pub mod recorded;
pub mod reflection;
pub mod registration;
pub mod row;
pub mod sea_video;
pub mod setups;
pub mod shadows;
pub mod ship;
pub mod sky;
pub mod table;
pub mod target;
pub mod truth;

/// Counter of the heap that a way takes.
#[global_allocator]
static HEAP: peak_alloc::PeakAlloc = peak_alloc::PeakAlloc;
