//! The score of a run with the misses that it explains.

use std::path::Path;

use bowwave_core::world::{
    exercise::{ExerciseEvent, ExerciseFact},
    score::{ScoreFold, ScoreSheet},
};
use bowwave_record::{JournalError, RunSelection, ShotFilter, StoredShot, read_events, read_shots};
use serde::Serialize;

/// A score with the misses that it explains.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScoredRun {
    /// The score.
    #[serde(flatten)]
    pub sheet: ScoreSheet,
    /// Rounds that missed, by number.
    pub explained: Vec<ExplainedRound>,
    /// Events of the run in their order.
    #[serde(skip)]
    pub events: Vec<ExerciseEvent>,
    /// Events of a newer version, which do not count.
    #[serde(skip)]
    pub unknown: usize,
    /// Rounds, by number.
    #[serde(skip)]
    pub shots: Vec<StoredShot>,
}

/// A round that missed, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExplainedRound {
    /// Its number.
    pub shot: u64,
    /// The boat that it came closest to.
    pub boat: String,
    /// By how much it passed, to the right and over, metres at the boat's distance.
    pub error_m: [f64; 2],
    /// The same as angles, mrad.
    pub error_mrad: [f64; 2],
    /// The cause with the largest part.
    pub largest_cause: &'static str,
    /// It passed the boat by no more than 50 m.
    pub was_aimed: bool,
    /// As a coach says it.
    pub in_words: String,
}

impl ScoredRun {
    /// Reads rounds and events of a run from the journal at `path` and scores them.
    ///
    /// # Errors
    /// Where the journal cannot be read, or has no such run.
    pub fn read(path: &Path, runs: RunSelection) -> Result<Self, JournalError> {
        let mut fold = ScoreFold::default();
        let (mut explained, mut events, mut unknown) = (Vec::new(), Vec::new(), 0);
        for event in read_events(path, runs)? {
            match event {
                Ok(event) => {
                    explained.extend(explained_round(&event));
                    fold.event(&event);
                    events.push(event);
                }
                Err(_) => unknown += 1,
            }
        }
        let shots = read_shots(path, &ShotFilter { runs, hits_only: false })?;
        shots.iter().for_each(|stored| fold.shot(&stored.record));
        explained.sort_by_key(|round: &ExplainedRound| round.shot);
        Ok(Self { sheet: fold.sheet(), explained, events, unknown, shots })
    }
}

impl ScoredRun {
    /// The explanation of a round that missed, with its index in [`Self::explained`].
    pub fn explanation(&self, shot: u64) -> Option<(usize, &ExplainedRound)> {
        let at = self.explained.binary_search_by_key(&shot, |round| round.shot).ok()?;
        Some((at, &self.explained[at]))
    }
}

fn explained_round(event: &ExerciseEvent) -> Option<ExplainedRound> {
    let ExerciseFact::Missed { shot, boat, why } = &event.fact else { return None };
    Some(ExplainedRound {
        shot: *shot,
        boat: boat.clone(),
        error_m: why.error_m(),
        error_mrad: why.error_mrad,
        largest_cause: why.largest().name(),
        was_aimed: why.was_aimed(),
        in_words: if why.was_aimed() {
            why.to_string()
        } else {
            let [right, over] = why.error_m();
            format!("{:.0} m off at {:.0} m; fired at no boat", right.hypot(over), why.range_m)
        },
    })
}
