//! Whether the journal's files are still where they were opened, and whose the folder is.

use std::{
    fs::{self, File, OpenOptions},
    io,
    os::unix::fs::MetadataExt as _,
    path::Path,
};

use rustix::{
    fs::{FlockOperation, flock},
    io::Errno,
};

use super::{JournalError, open::with_suffix};
use crate::folder::folder_of;

/// Which files a connection has open: device and number of the database and of its log. A file that was deleted, moved or replaced is
/// written all the same, and nobody finds it any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FilePlace([(u64, u64); 2]);

impl FilePlace {
    /// Of the files that are at `path` now.
    pub(super) fn of(path: &Path) -> io::Result<Self> {
        Ok(Self([file_at(path)?, file_at(&with_suffix(path, "-wal"))?]))
    }

    /// Tests whether the database, if not its log, is at `path` still.
    pub(super) fn has_database(self, path: &Path) -> bool {
        file_at(path).is_ok_and(|file| file == self.0[0])
    }
}

fn file_at(path: &Path) -> io::Result<(u64, u64)> {
    fs::metadata(path).map(|status| (status.dev(), status.ino()))
}

/// The database that is about to be opened: an empty one is made where there is none.
#[derive(Clone, Copy, Debug)]
pub(super) struct AboutToOpen((u64, u64));

impl AboutToOpen {
    pub(super) fn at(path: &Path) -> Result<Self, JournalError> {
        let fail = |source| JournalError::from_io(path, "make", source);
        match OpenOptions::new().write(true).create_new(true).open(path) {
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(fail(error)),
            // Closed before SQLite opens it: closing gives up a process's locks.
            made => drop(made),
        }
        file_at(path).map(Self).map_err(fail)
    }

    /// The files that were opened; an error where they are not the ones that whoever looks finds.
    pub(super) fn opened(self, path: &Path) -> Result<FilePlace, JournalError> {
        let moved = || JournalError::Moved { path: path.into() };
        let place = FilePlace::of(path).map_err(|_| moved())?;
        if place.0[0] == self.0 { Ok(place) } else { Err(moved()) }
    }
}

/// The folder of a journal, held against other programs that would write one there, for as long as this lives.
#[derive(Debug)]
pub(super) struct FolderHold {
    folder: Option<File>,
}

impl Drop for FolderHold {
    /// A program that is started just then has the open folder until it runs, and would hold it for as long.
    fn drop(&mut self) {
        if let Some(folder) = &self.folder
            && let Err(error) = flock(folder, FlockOperation::Unlock)
        {
            log::debug!("the folder of a journal cannot be unlocked: {error}");
        }
    }
}

impl FolderHold {
    /// Holds the folder of `path`. A file system without such locks is used without; one that cannot be opened will be told by the database.
    pub(super) fn take(path: &Path) -> Result<Self, JournalError> {
        let Ok(folder) = File::open(folder_of(path)) else { return Ok(Self { folder: None }) };
        match flock(&folder, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => Ok(Self { folder: Some(folder) }),
            Err(Errno::WOULDBLOCK) => Err(JournalError::InUse { path: path.into() }),
            Err(error) => {
                log::debug!("the folder of the journal {} cannot be locked: {error}", path.display());
                Ok(Self { folder: None })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_free_once_its_hold_ends_even_if_a_child_has_it_open() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hits.db");
        let hold = FolderHold::take(&path).unwrap();
        let in_child = hold.folder.as_ref().unwrap().try_clone().unwrap();
        assert!(matches!(FolderHold::take(&path), Err(JournalError::InUse { .. })));
        drop(hold);
        FolderHold::take(&path).unwrap();
        drop(in_child);
    }
}
