//! Facts that an exercise leaves for the score, besides its rounds.

use serde::{Deserialize, Serialize};

use super::spec::Engagement;
use crate::{
    act::{Act, by_name},
    side::Side,
    time::Time,
    world::score::MissExplanation,
};

/// Something that happened, with its time.
#[derive(Clone, Debug, PartialEq)]
pub struct ExerciseEvent {
    /// When.
    pub time: Time,
    /// What.
    pub fact: ExerciseFact,
}

/// Something that happened. Ranges are from the gun, metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "fact", rename_all = "snake_case")]
pub enum ExerciseFact {
    /// The exercise began.
    Began {
        /// Rounds that the gunner has, spare belts included.
        rounds: u32,
        /// Hostile boats.
        hostile: u32,
        /// Range that hostile boats are to be kept beyond.
        keep_off_m: f64,
        /// Range within which a hostile boat may be fired at under any rules; 0 for none.
        self_defence_m: f64,
        /// Hostile boats that are to be stopped.
        stop: u32,
    },
    /// Rules of engagement hold from now on.
    Rules {
        /// The rules.
        rules: Engagement,
    },
    /// A call was asked for.
    CallAsked {
        /// What is to be called.
        call: Act,
        /// The boat that it is about.
        boat: String,
        /// Range before which it is to be made, if any.
        before_m: Option<f64>,
        /// Seconds from now within which it is to be made, if any.
        within_s: Option<f64>,
    },
    /// A boat could be seen from now on.
    InView {
        /// Its name.
        boat: String,
        /// Whom it belongs to.
        #[serde(with = "by_name")]
        side: Side,
        /// Where.
        range_m: f64,
    },
    /// The gun pointed at a boat for the first time.
    Pointed {
        /// Its name.
        boat: String,
        /// Where.
        range_m: f64,
    },
    /// The trainee did something.
    Did {
        /// What.
        act: Act,
        /// The boat that the gun pointed at, where it pointed at one.
        boat: Option<String>,
        /// Where that was.
        range_m: Option<f64>,
    },
    /// A round was fired.
    Fired {
        /// Its number.
        shot: u64,
        /// The boat that the gun pointed at, where it pointed at one.
        boat: Option<String>,
        /// Where that was.
        range_m: Option<f64>,
    },
    /// A hostile boat that nobody had stopped came within the range that it is to be kept beyond.
    CameClose {
        /// Its name.
        boat: String,
    },
    /// It is beyond that again, or was stopped within.
    NoLongerClose {
        /// Its name.
        boat: String,
    },
    /// A boat that was struck has lost its way.
    Stopped {
        /// Its name.
        boat: String,
        /// Where.
        range_m: f64,
    },
    /// A boat that was holed is full of water and sinks.
    Sank {
        /// Its name.
        boat: String,
        /// Where.
        range_m: f64,
    },
    /// A boat's engine burns.
    CaughtFire {
        /// Its name.
        boat: String,
        /// Where.
        range_m: f64,
    },
    /// A hostile boat that was struck, or warned, goes away or gives up.
    TurnedAway {
        /// Its name.
        boat: String,
        /// Where.
        range_m: f64,
    },
    /// A boat that had turned away comes on again.
    CameBack {
        /// Its name.
        boat: String,
    },
    /// The virtual weapon has a stoppage.
    Stoppage,
    /// An instructor ordered that the weapon has one with its next round.
    StoppageOrdered,
    /// The exercise stands still from now on.
    Paused,
    /// It goes on.
    Resumed,
    /// A boat of the reserve joined.
    Joined {
        /// Its name.
        boat: String,
        /// Whom it belongs to.
        #[serde(with = "by_name")]
        side: Side,
        /// Where.
        range_m: f64,
        /// The goals ask for one more boat to be stopped.
        is_to_stop: bool,
    },
    /// A note of the instructor's for the debrief.
    Note {
        /// The text.
        text: String,
    },
    /// The barrel is so hot that rounds scatter.
    BarrelHot,
    /// Fragments of a round that burst beside a boat struck its crew; the round's own record names another boat, or none.
    Fragments {
        /// The round's number.
        shot: u64,
        /// The boat's name.
        boat: String,
        /// Whom it belongs to.
        #[serde(with = "by_name")]
        side: Side,
    },
    /// Text for the trainee.
    Message {
        /// The text.
        text: String,
    },
    /// Why a round missed the boat that it came closest to.
    Missed {
        /// The round's number.
        shot: u64,
        /// The boat's name.
        boat: String,
        /// Why.
        why: MissExplanation,
    },
    /// The nearest that a boat has come, as the exercise ended.
    Nearest {
        /// Its name.
        boat: String,
        /// Whom it belongs to.
        #[serde(with = "by_name")]
        side: Side,
        /// Where.
        range_m: f64,
    },
    /// The exercise ended.
    Ended {
        /// Rounds that were left.
        rounds_left: u32,
    },
}
