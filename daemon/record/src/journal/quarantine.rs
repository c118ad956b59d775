//! Putting a damaged database aside without a moment in which a power cut could lose what is known.
//!
//! The fresh database is made under another name first, with all that is to be in it; its final such name (`.fresh`) says
//! that it is whole. Then the damaged one's log and itself are moved away, then the fresh one takes its place. Each step is
//! on the disk before the next one, and [`resume`] goes on from wherever a cut left it.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use rusqlite::Connection;

use super::{
    JournalError, JournalSettings, Quarantine,
    open::{absent_is_fine, connect, empty_log_at_end, sync_folder, with_suffix},
};

/// The files that SQLite keeps beside a database.
const PARTS: [&str; 2] = ["-wal", "-shm"];

/// Puts the database at `path` aside and a fresh one, filled by `fill`, in its place. Gives where the damaged one is.
/// Nobody may have either open.
pub(super) fn replace(
    path: &Path,
    settings: &JournalSettings,
    fill: impl FnOnce(&mut Connection) -> rusqlite::Result<()>,
) -> Result<PathBuf, JournalError> {
    let making = with_suffix(path, ".making");
    let fresh = with_suffix(path, ".fresh");
    for leftover in [making.clone(), with_suffix(&making, "-wal"), with_suffix(&making, "-shm")] {
        absent_is_fine(fs::remove_file(leftover)).map_err(|e| failed(path, e))?;
    }
    let (mut connection, _) = connect(&making, settings)?;
    fill(&mut connection).map_err(|error| JournalError::from_sql(path, &error))?;
    // Moved into the database here, where a failure is told; the end of the connection only removes the empty log.
    let busy: i64 = connection
        .query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |row| row.get(0))
        .map_err(|error| JournalError::from_sql(path, &error))?;
    if busy != 0 {
        return Err(JournalError::Locked { path: making });
    }
    empty_log_at_end(&connection);
    drop(connection);
    fs::rename(&making, &fresh).map_err(|e| failed(path, e))?;
    sync_folder(path)?;
    put_in_place(path, &fresh)
}

/// Ends a quarantine that was interrupted, if there is one.
pub(super) fn resume(path: &Path) -> Result<Option<Quarantine>, JournalError> {
    let fresh = with_suffix(path, ".fresh");
    if !fresh.exists() {
        return Ok(None);
    }
    let kept_as = put_in_place(path, &fresh)?;
    let reason = "it was being put aside when the last run was interrupted".to_owned();
    Ok(Some(Quarantine { kept_as: Some(kept_as), reason, rounds_left_there: 0 }))
}

fn put_in_place(path: &Path, fresh: &Path) -> Result<PathBuf, JournalError> {
    let aside = name_aside(path).map_err(|e| failed(path, e))?;
    // The log first: it would be taken for the fresh database's.
    for part in PARTS {
        absent_is_fine(fs::rename(with_suffix(path, part), with_suffix(&aside, part)))
            .map_err(|e| failed(path, e))?;
    }
    sync_folder(path)?;
    absent_is_fine(fs::rename(path, &aside)).map_err(|e| failed(path, e))?;
    sync_folder(path)?;
    fs::rename(fresh, path).map_err(|e| failed(path, e))?;
    sync_folder(path)?;
    Ok(aside)
}

/// The first name that is not taken, for the database to be put aside. Where it has been moved away already, the last name
/// that is.
fn name_aside(path: &Path) -> io::Result<PathBuf> {
    let name = |number: u32| with_suffix(path, &format!(".corrupt-{number}"));
    // A log alone takes no name: its database follows it.
    let free = (1..u32::MAX)
        .find(|number| !name(*number).exists())
        .ok_or_else(|| io::Error::from(io::ErrorKind::AlreadyExists))?;
    let moved = !path.exists() && free > 1;
    Ok(name(if moved { free - 1 } else { free }))
}

fn failed(path: &Path, source: io::Error) -> JournalError {
    JournalError::from_io(path, "put aside", source)
}
