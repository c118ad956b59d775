//! Errors of the journal.

use std::{
    fmt, io,
    path::{Path, PathBuf},
};

use bowwave_core::fault::Fault;
use rusqlite::ErrorCode;
use rustix::fs::{StatVfsMountFlags, statvfs};

use crate::space::free_bytes;

/// Error of the journal: cause, place and remedy.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// There is no such file.
    #[error("there is no journal at {}; shoot first, or give another path", path.display())]
    Missing {
        /// The database.
        path: PathBuf,
    },
    /// Something else than a database.
    #[error("{} is no database; give another path for the journal, this file is left as it is", path.display())]
    NotADatabase {
        /// The file.
        path: PathBuf,
    },
    /// A database of something else.
    #[error("{} is a database of another program; give another path for the journal, this file is left as it is", path.display())]
    ForeignDatabase {
        /// The file.
        path: PathBuf,
    },
    /// A journal of a newer Bowwave.
    #[error("the journal {} has version {found}, this Bowwave knows up to {supported}; update Bowwave or give another path", path.display())]
    Newer {
        /// The database.
        path: PathBuf,
        /// The version it has.
        found: i64,
        /// The newest that is known.
        supported: i64,
    },
    /// Another process holds the database.
    #[error("the journal {} is locked by another process; close the program that has it open and try again", path.display())]
    Locked {
        /// The database.
        path: PathBuf,
    },
    /// Another program writes a journal in the same folder.
    #[error("another program writes a journal in the folder of {}; end it, or give another folder", path.display())]
    InUse {
        /// The database.
        path: PathBuf,
    },
    /// Deleted, moved or replaced while in use; another is begun.
    #[error("the journal {} was deleted, moved or replaced while it was written; this run's rounds go into another in its place", path.display())]
    Moved {
        /// Where it was.
        path: PathBuf,
    },
    /// The file or its folder cannot be written.
    #[error("the journal {} cannot be written: {reason}; check the permissions of the file and its folder, and that the disk is not mounted read-only", path.display())]
    ReadOnly {
        /// The database.
        path: PathBuf,
        /// SQLite's reason.
        reason: String,
    },
    /// The disk is full.
    #[error("the disk of the journal {} is full; free some space", path.display())]
    Full {
        /// The database.
        path: PathBuf,
    },
    /// The file cannot be opened.
    #[error("cannot open the journal {}: {reason}; check the path and that its folder exists", path.display())]
    Open {
        /// The database.
        path: PathBuf,
        /// SQLite's reason.
        reason: String,
    },
    /// Damaged while in use; it is put aside.
    #[error("the journal {} is damaged: {reason}; it is put aside and a fresh one begun, check the disk", path.display())]
    Corrupt {
        /// The database.
        path: PathBuf,
        /// SQLite's reason.
        reason: String,
    },
    /// The disk does not answer as it should.
    #[error("the disk of the journal {} failed: {reason}; check the disk", path.display())]
    Disk {
        /// The database.
        path: PathBuf,
        /// SQLite's reason.
        reason: String,
    },
    /// Anything else that SQLite reports.
    #[error("the journal {}: {reason}; check the file with the sqlite3 tool", path.display())]
    Sql {
        /// The database.
        path: PathBuf,
        /// SQLite's reason.
        reason: String,
    },
    /// Handling the files around the database failed.
    #[error("cannot {doing} the journal {}: {source}; check its folder", path.display())]
    File {
        /// The database.
        path: PathBuf,
        /// Operation that failed.
        doing: &'static str,
        /// The system's reason.
        source: io::Error,
    },
    /// A row that makes no sense.
    #[error("the journal {}: run {run}, shot {shot}: {what}; leave this run out or mend the row", path.display())]
    Row {
        /// The database.
        path: PathBuf,
        /// The run.
        run: i64,
        /// The round.
        shot: i64,
        /// Description of the error.
        what: String,
    },
    /// No such run.
    #[error("the journal {} has no run {run}; its runs: {}", path.display(), span(*.first, *.last))]
    NoSuchRun {
        /// The database.
        path: PathBuf,
        /// The run asked for.
        run: i64,
        /// The first run there is.
        first: Option<i64>,
        /// The last run there is.
        last: Option<i64>,
    },
    /// The queue is full; the round was not taken.
    #[error("the journal {} cannot take shot {shot}: too many wait already; free the disk it is on", path.display())]
    QueueFull {
        /// The database.
        path: PathBuf,
        /// The round's number.
        shot: u64,
    },
    /// The writing thread has ended.
    #[error("the journal {} is not being written any more; restart the program", path.display())]
    Stopped {
        /// The database.
        path: PathBuf,
    },
    /// Rounds that could not be written.
    #[error(transparent)]
    Unwritten(Box<Unwritten>),
}

/// Rounds that could not be written to the database.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct Unwritten {
    /// The database.
    pub path: PathBuf,
    /// The run.
    pub run: i64,
    /// Rounds that were committed.
    pub committed: u64,
    /// Why the others were not: one line with what to do.
    pub cause: String,
    /// How many of them were reported as committed before the disk failed, so that it may have them or not.
    pub in_doubt: usize,
    /// The rounds, each a line of JSON.
    pub rows: Vec<String>,
    /// The file that they were put into instead; `None` where that failed too and `rows` is all there is of them.
    pub side_file: Option<PathBuf>,
}

impl fmt::Display for Unwritten {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { committed, cause, in_doubt, rows, side_file, .. } = self;
        let count = rows.len() - in_doubt;
        write!(f, "{count} shots could not be written to the journal ({committed} were): {cause}; ")?;
        if *in_doubt > 0 {
            write!(f, "the disk may have lost {in_doubt} that were; ")?;
        }
        match side_file {
            Some(file) => write!(f, "they are in {} instead, which the next run takes in", file.display()),
            None => write!(f, "keep the lines of the log instead"),
        }
    }
}

impl Unwritten {
    /// Puts each round into the log, which may be on another disk, where no file has them.
    pub(super) fn log_rows(&self) {
        for line in self.rows.iter().filter(|_| self.side_file.is_none()) {
            log::error!("not in the journal: {line}");
        }
    }
}

impl JournalError {
    /// The code for log and display.
    pub const fn fault(&self) -> Fault {
        match self {
            Self::Full { .. } => Fault::DiskFull,
            Self::ReadOnly { .. } => Fault::DiskReadOnly,
            Self::Locked { .. } | Self::InUse { .. } => Fault::DbLocked,
            _ => Fault::DiskFsync,
        }
    }

    /// Whether what was committed before may have been lost with it.
    pub(crate) const fn casts_doubt(&self) -> bool {
        !matches!(self, Self::Locked { .. } | Self::Full { .. })
    }

    /// Whether the database itself is damaged.
    pub(crate) const fn is_damage(&self) -> bool {
        matches!(self, Self::Corrupt { .. } | Self::NotADatabase { .. })
    }

    /// Journal error for an error of the system at `path`.
    pub(crate) fn from_io(path: &Path, doing: &'static str, source: io::Error) -> Self {
        let path = path.to_path_buf();
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::Full { path },
            io::ErrorKind::ReadOnlyFilesystem => Self::ReadOnly { path, reason: source.to_string() },
            _ => Self::File { path, doing, source },
        }
    }

    /// Journal error for an error of SQLite at `path`.
    pub(crate) fn from_sql(path: &Path, error: &rusqlite::Error) -> Self {
        let path = path.to_path_buf();
        let reason = error.to_string();
        match error.sqlite_error_code() {
            Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => Self::Locked { path },
            Some(ErrorCode::ReadOnly | ErrorCode::PermissionDenied) => Self::ReadOnly { path, reason },
            Some(ErrorCode::DiskFull) => Self::Full { path },
            // There, but its log beside it cannot be made.
            Some(ErrorCode::CannotOpen) if path.is_file() => Self::ReadOnly { path, reason },
            Some(ErrorCode::CannotOpen) => Self::Open { path, reason },
            Some(ErrorCode::NotADatabase) => Self::NotADatabase { path },
            Some(ErrorCode::DatabaseCorrupt) => Self::Corrupt { path, reason },
            // SQLite does not tell a file system that turned read-only from a broken one, nor one that is full where it
            // maps memory or syncs.
            Some(ErrorCode::SystemIoFailure) if is_read_only(&path) => Self::ReadOnly { path, reason },
            Some(ErrorCode::SystemIoFailure) if free_bytes(&path).is_ok_and(|free| free == 0) => {
                Self::Full { path }
            }
            Some(ErrorCode::SystemIoFailure) => Self::Disk { path, reason },
            _ => Self::Sql { path, reason },
        }
    }
}

fn is_read_only(path: &Path) -> bool {
    statvfs(path).is_ok_and(|status| status.f_flag.contains(StatVfsMountFlags::RDONLY))
}

fn span(first: Option<i64>, last: Option<i64>) -> String {
    match (first, last) {
        (Some(first), Some(last)) => format!("{first} to {last}"),
        _ => "none".to_owned(),
    }
}
