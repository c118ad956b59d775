//! A run as its journal has it.

use std::path::Path;

use bowwave_core::ephemeris::Place;
use bowwave_record::{
    JournalError, RunDetails, RunSelection, StoredRun, StoredTracks, read_runs, read_tracks,
};

use crate::scored::ScoredRun;

/// Everything that a journal has of a run.
#[derive(Clone, Debug)]
pub struct ReviewedRun {
    /// Number, scenario and times.
    pub stored: StoredRun,
    /// Boats, camera and ranges to be kept; defaults where the journal has none that can be read.
    pub details: RunDetails,
    /// The journal has details, but not such as this version can read.
    pub has_unreadable_details: bool,
    /// Tracks of boats, rounds and gun.
    pub tracks: StoredTracks,
    /// Score, rounds and events.
    pub scored: ScoredRun,
    /// Place of the gun on the Earth, where it is known: the scenario's.
    pub place: Option<Place>,
}

impl ReviewedRun {
    /// Reads a run from the journal at `path`: the newest, or the one of that number.
    ///
    /// # Errors
    /// Where the journal cannot be read, has no run at all, or none of that number.
    pub fn read(path: &Path, number: Option<i64>) -> Result<Self, JournalError> {
        let mut all = read_runs(path)?;
        // One number for all that is read: another run may begin meanwhile.
        let id = number.or_else(|| all.last().map(|stored| stored.id)).unwrap_or(0);
        let runs = RunSelection::Run(id);
        // Names the runs that there are where this one is not.
        let tracks = read_tracks(path, runs)?;
        let scored = ScoredRun::read(path, runs)?;
        let (first, last) = (all.first().map(|stored| stored.id), all.last().map(|stored| stored.id));
        let found = all.iter().position(|stored| stored.id == id).map(|at| all.swap_remove(at));
        let no_such = || JournalError::NoSuchRun { path: path.into(), run: id, first, last };
        let stored = found.ok_or_else(no_such)?;
        let kept = stored.run.details.as_deref();
        let details = kept.and_then(RunDetails::from_json);
        let has_unreadable_details = kept.is_some() && details.is_none();
        let details = details.unwrap_or_default();
        let place = details.place_deg.and_then(|[latitude, longitude]| Place::new(latitude, longitude));
        Ok(Self { stored, details, has_unreadable_details, tracks, scored, place })
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
