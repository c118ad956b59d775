//! Answer of a session to a tick.

use super::notes::Note;
use crate::{
    event::Picture,
    fault::FaultChange,
    frame::scene::Scene,
    time::Time,
    world::{exercise::ExerciseEvent, score::ShotRecord, track::TrackBlock},
};

/// The answer to one tick.
#[derive(Debug)]
pub struct TickAnswer<'a> {
    /// The frame to draw.
    pub view: View<'a>,
    /// Rounds that ended, in the order in which they were fired within the step.
    pub records: &'a [ShotRecord],
    /// Events of the exercise, for the score.
    pub events: &'a [ExerciseEvent],
    /// Tracks of boats, rounds and gun since the last tick, for the debrief.
    pub tracks: &'a TrackBlock,
    /// Faults that the session itself has found to come or go. It knows of them already: they are for the log only.
    pub faults: &'a [FaultChange],
    /// Notes for the log.
    pub notes: &'a [Note],
}

/// The frame to draw.
#[derive(Debug)]
pub struct View<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The picture that it is drawn over.
    pub picture: &'a Picture,
    /// No picture has come yet: the scene is black and says what is wrong.
    pub blind: bool,
    /// Whether the picture is another than the last step's.
    pub picture_is_new: bool,
    /// The picture's own time stamp, to find it again.
    pub mid_exposure: Time,
    /// Whether the camera's pose was known.
    pub pose_known: bool,
}
