//! Tracks of boats, rounds and gun as rows: a block of MessagePack for about each second of a run.

use std::path::Path;

use bowwave_core::world::track::TrackBlock;
use rusqlite::{Connection, params};

use super::{JournalError, RunSelection, open, query};

/// The table.
pub(super) const TABLE: &str = "
CREATE TABLE tracks (
    run INTEGER NOT NULL REFERENCES runs (id),
    number INTEGER NOT NULL,
    block BLOB NOT NULL,
    PRIMARY KEY (run, number)
) STRICT, WITHOUT ROWID;
ALTER TABLE runs ADD COLUMN details TEXT;
";
/// The version of the tables that has it first.
pub(super) const VERSION: i64 = 5;
/// Largest block that is read, bytes: that of a second has ten kilobytes for a dozen boats.
const BYTES_MAX: usize = 4 << 20;

/// A block with its number in its run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct NumberedBlock {
    number: u64,
    bytes: Vec<u8>,
}

impl NumberedBlock {
    /// Codes a block.
    pub(super) fn new(number: u64, block: &TrackBlock) -> Self {
        // Only a writer that fails, or a map without a length, is an error here: there is neither.
        Self { number, bytes: rmp_serde::to_vec(block).unwrap_or_default() }
    }
}

/// Adds a block unless it is there already.
pub(super) fn insert_once(connection: &Connection, run: i64, block: &NumberedBlock) -> rusqlite::Result<()> {
    let sql = "INSERT OR IGNORE INTO tracks (run, number, block) VALUES (?1, ?2, ?3)";
    connection.prepare_cached(sql)?.execute(params![run, block.number.cast_signed(), block.bytes])?;
    Ok(())
}

/// Tracks of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StoredTracks {
    /// All that could be read, oldest first.
    pub tracks: TrackBlock,
    /// Blocks of about a second that are missing before the last one, or that cannot be read.
    pub missing: u64,
}

/// The tracks of one run; none in journals of versions that kept none. Of several runs those of the last one are given.
///
/// # Errors
/// Where the journal cannot be read, or has no such run.
pub fn read_tracks(path: &Path, runs: RunSelection) -> Result<StoredTracks, JournalError> {
    let (connection, version) = open::for_reading(path)?;
    let one = if runs == RunSelection::All { RunSelection::Latest } else { runs };
    let run = query::selected(&connection, path, one)?;
    let mut stored = StoredTracks::default();
    if version < VERSION || run.is_none() {
        return Ok(stored);
    }
    let mut next = 1;
    let mut read = || -> rusqlite::Result<()> {
        let sql = "SELECT number, block FROM tracks WHERE run = ?1 ORDER BY number";
        let mut statement = connection.prepare(sql)?;
        let mut rows = statement.query([run])?;
        while let Some(row) = rows.next()? {
            let number = row.get::<_, i64>(0)?.cast_unsigned();
            stored.missing += number.saturating_sub(next);
            next = number.saturating_add(1);
            let bytes = row.get_ref(1)?.as_blob().unwrap_or_default();
            match (bytes.len() <= BYTES_MAX).then(|| rmp_serde::from_slice::<TrackBlock>(bytes)) {
                Some(Ok(block)) => stored.tracks.append(&block),
                _ => stored.missing += 1,
            }
        }
        Ok(())
    };
    read().map_err(|error| JournalError::from_sql(path, &error))?;
    Ok(stored)
}
