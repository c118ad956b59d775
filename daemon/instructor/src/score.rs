//! Score and runs, from the journal that the trainer names.

use std::path::Path;

use bowwave_core::text::one_line;
use bowwave_record::{JournalError, RunSelection, StoredRun, read_runs};
use bowwave_review::{ReviewedRun, ScoredRun};
use serde::Serialize;
use serde_json::{Value, json};

/// Most runs that are listed, the newest ones.
const RUNS_MAX: usize = 200;

/// A run of a list.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct ListedRun {
    run: i64,
    scenario: String,
    /// UTC, where the clock was known to be set.
    started: Option<String>,
    finished: bool,
    shots: u64,
    hits: u64,
}

impl From<StoredRun> for ListedRun {
    fn from(stored: StoredRun) -> Self {
        let started =
            stored.run.started_wall_ns.and_then(|ns| jiff::Timestamp::from_second(ns / 1_000_000_000).ok());
        Self {
            run: stored.id,
            scenario: one_line(&stored.run.scenario),
            started: started.map(|time| time.to_string()),
            finished: stored.finished,
            shots: stored.shots,
            hits: stored.hits,
        }
    }
}

/// The score of the newest run as `bowwave score --json` prints it, or why there is none.
pub(crate) fn of_newest(journal: &Path) -> Value {
    let newest = || -> Result<_, JournalError> {
        let Some(run) = read_runs(journal)?.pop() else { return Ok(None) };
        let scored = ScoredRun::read(journal, RunSelection::Run(run.id))?;
        Ok(Some((run, scored)))
    };
    match newest() {
        Ok(Some((run, scored))) => {
            let (score, unknown) = (scored.sheet, scored.unknown);
            json!({"kind": "score", "run": run.id, "finished": run.finished, "score": score, "unknown": unknown})
        }
        Ok(None) => json!({"kind": "score", "error": "the journal has no run yet"}),
        Err(error) => json!({"kind": "score", "error": error.to_string()}),
    }
}

/// Runs of the journal, the newest first.
pub(crate) fn runs(journal: &Path) -> Result<Value, String> {
    let runs = read_runs(journal).map_err(|error| error.to_string())?;
    let newest: Vec<ListedRun> = runs.into_iter().rev().take(RUNS_MAX).map(ListedRun::from).collect();
    Ok(json!({ "runs": newest }))
}

/// The page of a run.
pub(crate) fn review(journal: &Path, run: i64) -> Result<String, String> {
    let reviewed = ReviewedRun::read(journal, Some(run)).map_err(|error| error.to_string())?;
    Ok(bowwave_review::page(&reviewed, None).into_text())
}
