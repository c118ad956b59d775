//! Further parts of the debrief, each with its tests.

mod compare;
