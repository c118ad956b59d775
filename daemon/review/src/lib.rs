//! The debrief of a run, from its journal: [`ReviewedRun`] reads it, [`page`] makes one HTML file of it, [`compare`]
//! one of several runs, [`export`] what other programs read.
//!
//! Every number on the page is the journal's or the score's; nothing is computed here that the score defines.

#![forbid(unsafe_code)]

mod cells;
pub mod compare;
mod data;
mod document;
pub mod export;
mod meshes;
mod page;
mod run;
mod scored;
mod tables;
mod video;
mod words;

pub use document::Document;
pub use page::page;
pub use run::ReviewedRun;
pub use scored::{ExplainedRound, ScoredRun};
pub use video::{RunVideo, VIDEO, VideoError, VideoPlace, VideoTimes};
