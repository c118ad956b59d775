//! The tables and their versions.

use std::path::Path;

use bowwave_core::time::Time;
use rusqlite::{Connection, OptionalExtension as _, TransactionBehavior, params};

use bowwave_core::text::one_line;

use super::{JournalError, Run, event, row, track};

/// Marks the file as ours ("BOWW").
pub(super) const APPLICATION_ID: i64 = 0x424f_5757;
/// Version of the tables. 2: runs know the boot and the time since it at which they began. 3: hits know whose boat was struck. 4:
/// events of the exercise. 5: tracks, and details of runs.
pub(super) const VERSION: i64 = track::VERSION;

/// The tables of version 1. Numbers that are not finite become NULL, since SQLite has no NaN.
const TABLES: &str = "
CREATE TABLE runs (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    started_wall_ns INTEGER,
    scenario TEXT NOT NULL,
    recording TEXT NOT NULL,
    seed TEXT NOT NULL,
    version TEXT NOT NULL,
    finished INTEGER NOT NULL DEFAULT 0 CHECK (finished IN (0, 1))
) STRICT;
CREATE TABLE shots (
    run INTEGER NOT NULL REFERENCES runs (id),
    shot INTEGER NOT NULL,
    fired_ns INTEGER NOT NULL,
    muzzle_x_m REAL, muzzle_y_m REAL, muzzle_z_m REAL,
    bore_x REAL, bore_y REAL, bore_z REAL,
    pose_age_ns INTEGER NOT NULL,
    outcome TEXT NOT NULL CHECK (outcome IN ('hit', 'miss', 'not_scored')),
    boat TEXT CHECK (boat IS NOT NULL OR outcome <> 'hit'),
    zone TEXT CHECK ((zone IS NOT NULL) = (outcome = 'hit')),
    time_ns INTEGER CHECK ((time_ns IS NOT NULL) = (outcome <> 'not_scored')),
    range_m REAL,
    point_x_m REAL, point_y_m REAL, point_z_m REAL,
    miss_m REAL,
    cause TEXT CHECK ((cause IS NOT NULL) = (outcome = 'not_scored')),
    PRIMARY KEY (run, shot)
) STRICT, WITHOUT ROWID;
";

/// From version 1 to 2.
const BOOT_COLUMNS: &str = "
ALTER TABLE runs ADD COLUMN boot_id TEXT;
ALTER TABLE runs ADD COLUMN started_ns INTEGER;
";

/// From version 2 to 3.
const SIDE_COLUMN: &str = "
ALTER TABLE shots ADD COLUMN side TEXT CHECK (side IS NULL OR outcome = 'hit');
";

/// What a database that calls itself ours has otherwise than ours have; `None` where it has all. Triggers of a stranger would run with each
/// round.
pub(super) fn foreign_part(connection: &Connection) -> rusqlite::Result<Option<String>> {
    let (application, version) = versions(connection)?;
    if application != APPLICATION_ID {
        return Ok(None);
    }
    let columns = |table: &str| -> rusqlite::Result<Vec<String>> {
        let mut ask = connection.prepare("SELECT name FROM pragma_table_xinfo(?1)")?;
        ask.query_map([table], |row| row.get(0))?.collect()
    };
    let shots = row::columns_of(version);
    let mut wanted = vec![
        ("runs", "id, started_wall_ns, scenario, recording, seed, version, finished"),
        ("shots", &*shots),
    ];
    if version >= event::VERSION {
        wanted.push(("events", "run, number, time_ns, fact"));
    }
    if version >= track::VERSION {
        wanted.push(("tracks", "run, number, block"));
    }
    for (table, names) in wanted {
        let found = columns(table)?;
        let mut names = names.split(", ").filter(|name| *name != "NULL");
        if let Some(name) = names.find(|name| !found.iter().any(|column| column == name)) {
            return Ok(Some(format!("its table {table} has no column {name}")));
        }
    }
    let sql = "SELECT type || ' ' || name FROM sqlite_schema WHERE type IN ('trigger', 'view') LIMIT 1";
    let foreign: Option<String> = connection.query_row(sql, [], |row| row.get(0)).optional()?;
    Ok(foreign.map(|what| format!("it has a {}, which no journal has", one_line(&what))))
}

/// Number of the run that is described so, if the database has it; the newest of several.
pub(super) fn find_run(connection: &Connection, run: &Run) -> rusqlite::Result<Option<i64>> {
    // By the wall time only where it was known at the start: it may have been filled in since. A replay begins at its recording's time, so
    // that nothing else tells two of them apart.
    let sql = "SELECT id FROM runs WHERE scenario = ?1 AND recording = ?2 AND seed = ?3 AND version = ?4 \
               AND boot_id IS ?5 AND started_ns IS ?6 AND (?7 IS NULL OR started_wall_ns IS ?7) ORDER BY id DESC LIMIT 1";
    let started = run.started.map(Time::ns);
    let key = params![
        run.scenario,
        run.recording,
        run.seed.to_string(),
        run.version,
        run.boot_id,
        started,
        run.started_wall_ns
    ];
    connection.query_row(sql, key, |row| row.get(0)).optional()
}

/// Whether the database has a run of that number.
pub(super) fn has_run(connection: &Connection, id: i64) -> rusqlite::Result<bool> {
    connection.query_row("SELECT EXISTS (SELECT 1 FROM runs WHERE id = ?1)", [id], |row| row.get(0))
}

/// Refuses databases of other programs and of newer versions.
pub(super) fn claim(connection: &Connection, path: &Path) -> Result<(), JournalError> {
    let fail = |error: rusqlite::Error| JournalError::from_sql(path, &error);
    let (application, version) = versions(connection).map_err(fail)?;
    if application == APPLICATION_ID {
        if version > VERSION {
            return Err(JournalError::Newer { path: path.into(), found: version, supported: VERSION });
        }
        return Ok(());
    }
    let tables: i64 =
        connection.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0)).map_err(fail)?;
    if application != 0 || version != 0 || tables != 0 {
        return Err(JournalError::ForeignDatabase { path: path.into() });
    }
    Ok(())
}

/// Application and schema version.
pub(super) fn versions(connection: &Connection) -> rusqlite::Result<(i64, i64)> {
    let application = connection.query_row("PRAGMA application_id", [], |row| row.get(0))?;
    let version = connection.query_row("PRAGMA user_version", [], |row| row.get(0))?;
    Ok((application, version))
}

/// Makes the tables where there are none, and brings older ones up to date. One transaction, so that nobody ever finds half
/// of them.
pub(super) fn make_tables(connection: &mut Connection) -> rusqlite::Result<()> {
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
    // Asked within the transaction: another process may have been faster.
    let (_, found) = versions(&transaction)?;
    if found >= VERSION {
        return Ok(());
    }
    if found == 0 {
        transaction.execute_batch(TABLES)?;
    }
    if found < 2 {
        transaction.execute_batch(BOOT_COLUMNS)?;
    }
    if found < 3 {
        transaction.execute_batch(SIDE_COLUMN)?;
    }
    if found < event::VERSION {
        transaction.execute_batch(event::TABLE)?;
    }
    transaction.execute_batch(track::TABLE)?;
    transaction.execute_batch(&format!(
        "PRAGMA application_id = {APPLICATION_ID}; PRAGMA user_version = {VERSION};"
    ))?;
    transaction.commit()
}

/// Begins a run, with a number of its own unless `id` says which, and gives its number.
pub(super) fn begin_run(connection: &Connection, id: Option<i64>, run: &Run) -> rusqlite::Result<i64> {
    connection.execute(
        "INSERT INTO runs (id, started_wall_ns, scenario, recording, seed, version, boot_id, started_ns, details) \
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)",
        params![
            id,
            run.started_wall_ns,
            run.scenario,
            run.recording,
            run.seed.to_string(),
            run.version,
            run.boot_id,
            run.started.map(|time| time.ns()),
            run.details,
        ],
    )?;
    Ok(connection.last_insert_rowid())
}
