//! A run as its journal has it.

use std::path::{Path, PathBuf};

use bowwave_record::{
    JournalError, RunDetails, RunSelection, StoredRun, StoredTracks, read_runs, read_tracks,
};

use crate::scored::ScoredRun;

/// Everything that a journal has of a run.
#[derive(Clone, Debug)]
pub struct ReviewedRun {
    /// The journal.
    pub journal: PathBuf,
    /// Number, scenario and times.
    pub stored: StoredRun,
    /// Boats, camera and ranges to be kept; defaults for runs of versions that kept none.
    pub details: RunDetails,
    /// Where boats, rounds and gun were.
    pub tracks: StoredTracks,
    /// Score, rounds and events.
    pub scored: ScoredRun,
}

impl ReviewedRun {
    /// Reads a run from the journal at `path`: the newest, or the one of that number.
    ///
    /// # Errors
    /// Where the journal cannot be read, has no run at all, or none of that number.
    pub fn read(path: &Path, number: Option<i64>) -> Result<Self, JournalError> {
        let runs = number.map_or(RunSelection::Latest, RunSelection::Run);
        // Names the runs that there are where this one is not.
        let tracks = read_tracks(path, runs)?;
        let scored = ScoredRun::read(path, runs)?;
        let all = read_runs(path)?;
        let found = match number {
            Some(number) => all.into_iter().find(|stored| stored.id == number),
            None => all.into_iter().next_back(),
        };
        let no_such = || JournalError::NoSuchRun {
            path: path.into(),
            run: number.unwrap_or_default(),
            first: None,
            last: None,
        };
        let stored = found.ok_or_else(no_such)?;
        let details = RunDetails::from_json(stored.run.details.as_deref());
        Ok(Self { journal: path.into(), stored, details, tracks, scored })
    }

    /// The run's beginning on the session's clock, nanoseconds: its first sample, else its first event or round.
    pub fn begin_ns(&self) -> i64 {
        let sample = self.tracks.tracks.samples.first().map(|sample| sample.time_ns);
        let event = self.scored.events.first().map(|event| event.time.ns());
        let shot = self.scored.shots.first().map(|shot| shot.record.fired.ns());
        sample.into_iter().chain(event).chain(shot).min().unwrap_or_default()
    }

    /// The run's end likewise.
    pub fn end_ns(&self) -> i64 {
        let sample = self.tracks.tracks.samples.last().map(|sample| sample.time_ns);
        let event = self.scored.events.iter().map(|event| event.time.ns()).max();
        let shot = self.scored.shots.iter().map(|shot| shot.record.fired.ns()).max();
        sample.into_iter().chain(event).chain(shot).max().unwrap_or_default()
    }

    /// Seconds from the run's beginning to a time of the session's clock.
    pub fn seconds(&self, time_ns: i64) -> f64 {
        time_ns.saturating_sub(self.begin_ns()) as f64 * 1e-9
    }

    /// A boat's number in the scenario, by its name.
    pub fn boat(&self, name: &str) -> Option<usize> {
        self.details.boats.iter().position(|boat| boat.name == name)
    }
}
