//! The sheet that a run's score is.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::engagement::Engagement;

/// Version of what the points mean. 1: as [`ScoreSheet::points`] says.
pub const SCORE_VERSION: u32 = 1;

/// How a boat's part in the exercise ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// It was struck and has lost its way.
    Stopped,
    /// It went away or gave up.
    TurnedAway,
}

/// The score of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScoreSheet {
    /// Version of the points' meaning.
    pub version: u32,
    /// Points, 0 to 100; `None` for runs of versions that kept no events.
    ///
    /// 50 for hostile boats that were stopped or turned away (half for one within the range to be kept), 15 for how little of 20 seconds
    /// any was within that range, 15 for a fifth of the rounds having struck, 20 for calls (half for late ones); what a scenario does not ask
    /// for is left out and the rest taken for the whole. 20 are taken off for each neutral boat that was struck and 10 for each burst that
    /// broke the rules of engagement.
    pub points: Option<f64>,
    /// What the points are made of, before faults are taken off: as parts of those that the scenario asks for.
    pub items: Vec<PointsItem>,
    /// How long it took, seconds.
    pub duration_s: f64,
    /// Hostile boats.
    pub hostile: u32,
    /// Those of them that were stopped.
    pub stopped: u32,
    /// Those that turned away or gave up.
    pub turned_away: u32,
    /// Seconds during which a hostile boat was within the range to be kept.
    pub under_threat_s: f64,
    /// The nearest that a hostile boat came, metres.
    pub nearest_m: Option<f64>,
    /// Rounds.
    pub rounds: RoundsSheet,
    /// Calls that were asked for.
    pub calls: CallsSheet,
    /// Bursts that broke the rules of engagement.
    pub breaches: Vec<Breach>,
    /// Boats, by name.
    pub boats: Vec<BoatSheet>,
    /// Misses by their largest cause; rounds that passed every boat by more than 50 m were fired at none.
    pub misses: Vec<CauseSheet>,
}

/// Points for one thing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PointsItem {
    /// What they are for.
    pub item: &'static str,
    /// Most that it can give.
    pub of: f64,
    /// Points that it gave.
    pub points: f64,
}

/// Rounds of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RoundsSheet {
    /// Rounds fired.
    pub fired: u32,
    /// Rounds that struck a hostile boat.
    pub hits: u32,
    /// Strikes on neutral boats: a round that bursts may strike several.
    pub neutral_hits: u32,
    /// Rounds fired while it was not known where the barrel pointed.
    pub not_scored: u32,
    /// Bursts at a boat.
    pub bursts: u32,
    /// Bursts whose first round struck a hostile boat.
    pub first_round_hits: u32,
    /// Rounds for each hostile boat that was stopped; `None` where none was.
    pub per_stop: Option<f64>,
    /// Rounds that were left; `None` for runs that kept no events.
    pub left: Option<u32>,
    /// Stoppages of the virtual weapon.
    pub stoppages: u32,
    /// Times that its barrel got hot.
    pub barrel_hot: u32,
    /// Hits on hostile boats by part.
    pub by_part: BTreeMap<&'static str, u32>,
}

/// Calls of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CallsSheet {
    /// Calls that were asked for.
    pub asked: u32,
    /// Those made in time.
    pub in_time: u32,
    /// Those made late.
    pub late: u32,
    /// Those never made.
    pub missing: u32,
    /// Boats called hostile that are neutral, or the reverse.
    pub wrong: u32,
}

/// A burst that broke the rules of engagement.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Breach {
    /// Seconds since the exercise began.
    pub at_s: f64,
    /// The rules.
    pub rules: Engagement,
    /// The boat fired at.
    pub boat: Option<String>,
    /// Rounds.
    pub rounds: u32,
}

/// One boat. Times are seconds from when it could be seen.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BoatSheet {
    /// Its name.
    pub name: String,
    /// Whom it belongs to.
    pub side: Option<&'static str>,
    /// Range at which it could be seen, metres.
    pub in_view_m: Option<f64>,
    /// When it was detected: the gun pointed at it, or it was reported, whichever came first.
    pub detected_s: Option<f64>,
    /// When the gun pointed at it.
    pub pointed_s: Option<f64>,
    /// When it was reported.
    pub reported_s: Option<f64>,
    /// When it was identified.
    pub identified_s: Option<f64>,
    /// What it was called.
    pub identified_as: Option<&'static str>,
    /// When it was warned.
    pub warned_s: Option<f64>,
    /// Rounds that struck it.
    pub hits: u32,
    /// How it ended.
    pub ending: Option<Ending>,
    /// Where that was, metres.
    pub ended_m: Option<f64>,
    /// The nearest that it came, metres.
    pub nearest_m: Option<f64>,
    /// It sank.
    pub sank: bool,
    /// It caught fire.
    pub burns: bool,
}

/// Misses with one cause.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CauseSheet {
    /// The cause.
    pub cause: &'static str,
    /// Misses of which it is the largest part.
    pub rounds: u32,
    /// The mean of that part in these, to the right and over, mrad.
    pub mean_mrad: [f64; 2],
}
