//! Further parts of the debrief, each with its tests.

mod compare;
mod paper;
mod places;
mod video;
