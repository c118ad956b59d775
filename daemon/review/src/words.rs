//! Events and outcomes of rounds in plain words.

use bowwave_core::{
    side::Side,
    text::one_line,
    world::{
        exercise::ExerciseFact,
        score::{Outcome, ShotRecord},
    },
};

use crate::scored::ExplainedRound;

/// Weight of an event on the time line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Weight {
    /// Something that the instructor wants to see at once: a neutral struck, a boat too close.
    Alarm,
    /// A thing that went well: a boat stopped or turned away.
    Good,
    /// Everything else.
    Plain,
}

/// An event in words, with its weight for a hostile boat and the boat that it is about; `None` for what the rounds' own table says.
pub fn event(fact: &ExerciseFact) -> Option<(Weight, String, Option<&str>)> {
    use ExerciseFact as F;
    let at = |range_m: &f64| format!("at {range_m:.0} m");
    let (weight, words, boat) = match fact {
        F::Fired { .. } | F::Missed { .. } | F::Nearest { .. } => return None,
        F::Began { rounds, hostile, keep_off_m, .. } => {
            let words = format!(
                "exercise began: {hostile} hostile boats to be kept beyond {keep_off_m:.0} m, {rounds} rounds"
            );
            (Weight::Plain, words, None)
        }
        F::Rules { rules } => (Weight::Plain, format!("rules of engagement: {}", rules.name()), None),
        F::CallAsked { call, boat, .. } => {
            (Weight::Plain, format!("call asked for: {}", call.name()), Some(boat))
        }
        F::InView { boat, range_m, .. } => {
            (Weight::Plain, format!("could be seen {}", at(range_m)), Some(boat))
        }
        F::Pointed { boat, range_m } => (Weight::Plain, format!("gun on it {}", at(range_m)), Some(boat)),
        F::Did { act, boat, range_m } => {
            let place = range_m.as_ref().map_or_else(String::new, |m| format!(", {}", at(m)));
            (Weight::Plain, format!("trainee: {}{place}", act.name()), boat.as_ref())
        }
        F::CameClose { boat } => (Weight::Alarm, "came within the range to be kept".to_owned(), Some(boat)),
        F::NoLongerClose { boat } => {
            (Weight::Plain, "no longer within the range to be kept".to_owned(), Some(boat))
        }
        F::Stopped { boat, range_m } => (Weight::Good, format!("stopped {}", at(range_m)), Some(boat)),
        F::Sank { boat, range_m } => (Weight::Good, format!("sank {}", at(range_m)), Some(boat)),
        F::CaughtFire { boat, range_m } => {
            (Weight::Plain, format!("caught fire {}", at(range_m)), Some(boat))
        }
        F::TurnedAway { boat, range_m } => (Weight::Good, format!("turned away {}", at(range_m)), Some(boat)),
        F::CameBack { boat } => (Weight::Plain, "came on again".to_owned(), Some(boat)),
        F::Stoppage => (Weight::Plain, "weapon stopped".to_owned(), None),
        F::StoppageOrdered => (Weight::Plain, "instructor: stoppage with the next round".to_owned(), None),
        F::Paused => (Weight::Plain, "instructor: exercise stands still".to_owned(), None),
        F::Resumed => (Weight::Plain, "instructor: exercise goes on".to_owned(), None),
        F::Joined { boat, range_m, .. } => (Weight::Plain, format!("joined {}", at(range_m)), Some(boat)),
        F::Note { text } => (Weight::Plain, format!("instructor's note: {}", one_line(text)), None),
        F::BarrelHot => (Weight::Plain, "barrel hot: rounds scatter".to_owned(), None),
        F::Fragments { shot, boat, side } => {
            let weight = if *side == Side::Neutral { Weight::Alarm } else { Weight::Plain };
            (weight, format!("crew struck by fragments of round {shot}"), Some(boat))
        }
        F::Message { text } => (Weight::Plain, format!("message: {}", one_line(text)), None),
        F::Ended { rounds_left } => {
            (Weight::Plain, format!("exercise ended, {rounds_left} rounds left"), None)
        }
    };
    Some((weight, words, boat.map(String::as_str)))
}

/// The outcome of a round in words, and its weight.
pub fn round(record: &ShotRecord, explained: Option<&ExplainedRound>) -> (Weight, String) {
    match (&record.outcome, explained) {
        (Outcome::Hit { boat, side, zone, range_m, .. }, _) => {
            let is_neutral = *side == Some(Side::Neutral);
            let weight = if is_neutral { Weight::Alarm } else { Weight::Good };
            let whose = if is_neutral { ", a neutral boat" } else { "" };
            (weight, format!("struck the {} of {}{whose}, at {range_m:.0} m", zone.name(), one_line(boat)))
        }
        (Outcome::Miss { .. }, Some(round)) => {
            (Weight::Plain, format!("missed {}: {}", one_line(&round.boat), round.in_words))
        }
        (Outcome::Miss { boat: Some(boat), miss_m, range_m, .. }, None) => {
            (Weight::Plain, format!("missed {} by {miss_m:.1} m, at {range_m:.0} m", one_line(boat)))
        }
        (Outcome::Miss { .. }, None) => (Weight::Plain, "missed; no boat was near".to_owned()),
        (Outcome::NotScored { cause }, _) => {
            (Weight::Alarm, format!("not scored: {} ({})", cause.fault().cause(), cause.name()))
        }
    }
}

/// The boat that a round struck or came closest to.
pub fn boat_of(record: &ShotRecord) -> Option<&str> {
    match &record.outcome {
        Outcome::Hit { boat, .. } => Some(boat),
        Outcome::Miss { boat, .. } => boat.as_deref(),
        Outcome::NotScored { .. } => None,
    }
}
