//! Results of virtual rounds: the records that outlive a session, the swept test that decides them, and the score that they make.

mod closest;
mod fold;
mod hit;
mod miss;
mod record;
mod round;
mod sheet;

pub use closest::{Closest, closest_to_box, closest_to_surface};
pub use fold::ScoreFold;
pub use hit::{Moving, Strike, strike};
pub use miss::{AIM_TREND_S, BoreSample, MissCause, MissExplanation, MissedRound};
pub use record::{Outcome, ShotRecord};
pub use round::{Approach, End, Round};
pub use sheet::{
    BoatSheet, Breach, CallsSheet, CauseSheet, Ending, PointsItem, RoundsSheet, SCORE_VERSION, ScoreSheet,
};

pub use crate::fault::NotScored;

#[cfg(test)]
pub(crate) use hit::tests::boxed as boxed_model;
