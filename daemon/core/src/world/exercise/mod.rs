//! The exercise around boats and rounds: rules of engagement, what is to happen and to be called, what the trainee does besides shooting,
//! and what is noted of all that for the score.

mod event;
mod spec;
mod watch;

pub use event::{ExerciseEvent, ExerciseFact};
pub use spec::{
    About, CallSpec, Engagement, ExerciseSpec, Goals, Happening, HappeningCause, HappeningEffect, group_of,
    is_called,
};
pub use watch::{ExerciseWatch, STOPPED_M_S, WatchedBoat, pointed_at};
