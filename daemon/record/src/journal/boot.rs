//! Which boot this is, and how the run before this one ended.

use std::fs;

use rusqlite::{Connection, OptionalExtension, params};

use bowwave_core::time::Time;

/// The kernel's name of this boot, 36 characters; `None` where the system has none.
pub fn boot_id() -> Option<String> {
    let text = fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?;
    let id = text.trim();
    (!id.is_empty()).then(|| id.to_owned())
}

/// A run that did not end as it should: the one before, found when a journal was opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DirtyRun {
    /// Its number.
    pub run: i64,
    /// The boot it ran in, where it is known.
    pub boot_id: Option<String>,
    /// How it ended.
    pub end: DirtyEnd,
}

/// Kind of an improper end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DirtyEnd {
    /// The same boot: the program crashed or was killed.
    Crash,
    /// Another boot: the power was cut or the system went down hard.
    PowerCut,
    /// One of the two boots has no name.
    Unknown,
}

/// The last run, if it was not finished.
pub(super) fn last_dirty(
    connection: &Connection,
    boot_id: Option<&str>,
) -> rusqlite::Result<Option<DirtyRun>> {
    let sql = "SELECT id, boot_id, finished FROM runs ORDER BY id DESC LIMIT 1";
    let last: Option<(i64, Option<String>, bool)> =
        connection.query_row(sql, [], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?))).optional()?;
    let Some((run, its_boot, false)) = last else { return Ok(None) };
    let end = match (its_boot.as_deref(), boot_id) {
        (Some(its), Some(this)) if its == this => DirtyEnd::Crash,
        (Some(_), Some(_)) => DirtyEnd::PowerCut,
        _ => DirtyEnd::Unknown,
    };
    Ok(Some(DirtyRun { run, boot_id: its_boot, end }))
}

/// Reading of the wall clock at a time since boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct WallClock {
    pub(super) wall_ns: i64,
    pub(super) at: Time,
}

impl WallClock {
    /// The wall time of a time since the same boot; `None` where no such number exists.
    pub(super) fn wall_ns(self, time: Time) -> Option<i64> {
        time.ns().checked_sub(self.at.ns())?.checked_add(self.wall_ns)
    }

    /// Fills the wall time in for all runs of this boot that have none.
    pub(super) fn fill_in(self, connection: &Connection, boot_id: &str) -> rusqlite::Result<usize> {
        let Some(offset_ns) = self.wall_ns(Time::from_ns(0)) else { return Ok(0) };
        connection.execute(
            "UPDATE runs SET started_wall_ns = started_ns + ?1 \
             WHERE started_wall_ns IS NULL AND started_ns IS NOT NULL AND boot_id = ?2 \
             AND typeof(started_ns + ?1) = 'integer'",
            params![offset_ns, boot_id],
        )
    }
}
