//! The debrief of a run, from its journal: [`ReviewedRun`] reads it, [`page`] makes one HTML file of it.
//!
//! Every number on the page is the journal's or the score's; nothing is computed here that the score defines.

#![forbid(unsafe_code)]

mod data;
mod meshes;
mod page;
mod run;
mod scored;
mod tables;
mod words;

pub use page::page;
pub use run::ReviewedRun;
pub use scored::{ExplainedRound, ScoredRun};
