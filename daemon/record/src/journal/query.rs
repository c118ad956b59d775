//! Reading the journal.

use std::path::Path;

use bowwave_core::time::Time;
use rusqlite::{Connection, params};

use super::{JournalError, Run, StoredShot, open, row, track};

/// Which runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RunSelection {
    /// All of them.
    #[default]
    All,
    /// The one that was begun last.
    Latest,
    /// The one of this number.
    Run(i64),
}

/// Which rounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShotFilter {
    /// Of which runs.
    pub runs: RunSelection,
    /// Only those that struck.
    pub hits_only: bool,
}

/// A run as it is in the journal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredRun {
    /// Its number.
    pub id: i64,
    /// Its description.
    pub run: Run,
    /// Whether it was ended properly.
    pub finished: bool,
    /// Rounds fired.
    pub shots: u64,
    /// Rounds that struck.
    pub hits: u64,
}

/// The rounds that `filter` selects, by run and number.
pub fn read_shots(path: &Path, filter: &ShotFilter) -> Result<Vec<StoredShot>, JournalError> {
    let (connection, version) = open::for_reading(path)?;
    let run = selected(&connection, path, filter.runs)?;
    if run.is_none() && filter.runs != RunSelection::All {
        return Ok(Vec::new());
    }
    let read = || -> rusqlite::Result<Vec<row::Parsed>> {
        let sql = format!(
            "SELECT {} FROM shots WHERE (?1 IS NULL OR run = ?1) AND (NOT ?2 OR outcome = 'hit') ORDER BY run, shot",
            row::columns_of(version)
        );
        let mut statement = connection.prepare(&sql)?;
        let rows = statement.query_map(params![run, filter.hits_only], row::parse)?;
        rows.collect()
    };
    read()
        .map_err(|error| JournalError::from_sql(path, &error))?
        .into_iter()
        .map(|(run, shot, record)| match record {
            Ok(record) => Ok(StoredShot { run, record }),
            Err(what) => Err(JournalError::Row { path: path.into(), run, shot, what }),
        })
        .collect()
}

/// Number of the run that is selected; `None` for all, and for the latest of none.
pub(super) fn selected(
    connection: &Connection,
    path: &Path,
    runs: RunSelection,
) -> Result<Option<i64>, JournalError> {
    match runs {
        RunSelection::All => Ok(None),
        RunSelection::Latest => Ok(span(connection, path)?.1),
        RunSelection::Run(run) => {
            check_run(connection, path, run)?;
            Ok(Some(run))
        }
    }
}

/// All runs, oldest first.
pub fn read_runs(path: &Path) -> Result<Vec<StoredRun>, JournalError> {
    let (connection, version) = open::for_reading(path)?;
    let boot = if version >= 2 { "boot_id, started_ns" } else { "NULL, NULL" };
    let details = if version >= track::VERSION { "details" } else { "NULL" };
    let read = || -> rusqlite::Result<Vec<StoredRun>> {
        let mut statement = connection.prepare(&format!(
            "SELECT id, started_wall_ns, scenario, recording, seed, version, finished, \
             (SELECT count(*) FROM shots WHERE run = id), \
             (SELECT count(*) FROM shots WHERE run = id AND outcome = 'hit'), {boot}, {details} FROM runs ORDER BY id",
        ))?;
        let rows = statement.query_map([], |row| {
            let seed: String = row.get(4)?;
            Ok(StoredRun {
                id: row.get(0)?,
                run: Run {
                    started_wall_ns: row.get(1)?,
                    scenario: row.get(2)?,
                    recording: row.get(3)?,
                    seed: seed.parse().map_err(|error| {
                        rusqlite::Error::FromSqlConversionFailure(
                            4,
                            rusqlite::types::Type::Text,
                            Box::<std::num::ParseIntError>::new(error),
                        )
                    })?,
                    version: row.get(5)?,
                    boot_id: row.get(9)?,
                    started: row.get::<_, Option<i64>>(10)?.map(Time::from_ns),
                    details: row.get(11)?,
                },
                finished: row.get(6)?,
                shots: row.get::<_, i64>(7)?.unsigned_abs(),
                hits: row.get::<_, i64>(8)?.unsigned_abs(),
            })
        })?;
        rows.collect()
    };
    read().map_err(|error| JournalError::from_sql(path, &error))
}

fn span(connection: &Connection, path: &Path) -> Result<(Option<i64>, Option<i64>), JournalError> {
    connection
        .query_row("SELECT min(id), max(id) FROM runs", [], |row| Ok((row.get(0)?, row.get(1)?)))
        .map_err(|error| JournalError::from_sql(path, &error))
}

fn check_run(connection: &Connection, path: &Path, run: i64) -> Result<(), JournalError> {
    let known: bool = connection
        .query_row("SELECT EXISTS (SELECT 1 FROM runs WHERE id = ?1)", [run], |row| row.get(0))
        .map_err(|error| JournalError::from_sql(path, &error))?;
    if known {
        return Ok(());
    }
    let (first, last) = span(connection, path)?;
    Err(JournalError::NoSuchRun { path: path.into(), run, first, last })
}
