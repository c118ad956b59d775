//! Events of exercises as rows: what the score needs besides rounds.

use std::path::Path;

use bowwave_core::{time::Time, world::exercise::ExerciseEvent};
use rusqlite::{Connection, params};

use super::{JournalError, RunSelection, open, query};

/// The table. A fact is JSON, so that kinds of facts can come with later versions without another table.
pub(super) const TABLE: &str = "
CREATE TABLE events (
    run INTEGER NOT NULL REFERENCES runs (id),
    number INTEGER NOT NULL,
    time_ns INTEGER NOT NULL,
    fact TEXT NOT NULL,
    PRIMARY KEY (run, number)
) STRICT, WITHOUT ROWID;
";
/// The version of the tables that has it first.
pub(super) const VERSION: i64 = 4;

/// An event with its number in its run.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct NumberedEvent {
    pub(super) number: u64,
    pub(super) event: ExerciseEvent,
}

impl NumberedEvent {
    /// The fact as text. Numbers that are not finite become null.
    pub(super) fn fact(&self) -> String {
        serde_json::to_string(&self.event.fact).unwrap_or_default()
    }
}

/// Adds an event unless it is there already.
pub(super) fn insert_once(connection: &Connection, run: i64, event: &NumberedEvent) -> rusqlite::Result<()> {
    let sql = "INSERT OR IGNORE INTO events (run, number, time_ns, fact) VALUES (?1, ?2, ?3, ?4)";
    let number = event.number.cast_signed();
    connection.prepare_cached(sql)?.execute(params![run, number, event.event.time.ns(), event.fact()])?;
    Ok(())
}

/// An event of a journal, or the text of a fact that this version does not know.
pub type StoredEvent = Result<ExerciseEvent, String>;

/// The events of a run in their order; none in journals of versions that kept none.
///
/// # Errors
/// Where the journal cannot be read, or has no such run.
pub fn read_events(path: &Path, runs: RunSelection) -> Result<Vec<StoredEvent>, JournalError> {
    let (connection, version) = open::for_reading(path)?;
    let run = query::selected(&connection, path, runs)?;
    if version < VERSION || run.is_none() && runs != RunSelection::All {
        return Ok(Vec::new());
    }
    let read = || -> rusqlite::Result<Vec<(i64, String)>> {
        let sql = "SELECT time_ns, fact FROM events WHERE (?1 IS NULL OR run = ?1) ORDER BY run, number";
        let mut statement = connection.prepare(sql)?;
        let rows = statement.query_map([run], |row| Ok((row.get(0)?, row.get(1)?)))?;
        rows.collect()
    };
    let rows = read().map_err(|error| JournalError::from_sql(path, &error))?;
    let event = |(time_ns, fact): (i64, String)| {
        let known = serde_json::from_str(&fact).map_err(|_| fact);
        known.map(|fact| ExerciseEvent { time: Time::from_ns(time_ns), fact })
    };
    Ok(rows.into_iter().map(event).collect())
}
