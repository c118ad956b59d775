//! Whether the journal's files are still where they were opened, and whose the folder is.

use std::{
    fs::{self, File},
    io,
    os::unix::fs::MetadataExt as _,
    path::Path,
};

use rustix::{
    fs::{FlockOperation, flock},
    io::Errno,
};

use super::{
    JournalError,
    open::{folder_of, with_suffix},
};

/// Which files a connection has open: device and number of the database and of its log. A file that was deleted, moved or replaced is
/// written all the same, and nobody finds it any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FilePlace([(u64, u64); 2]);

impl FilePlace {
    /// Of the files that are at `path` now.
    pub(super) fn of(path: &Path) -> io::Result<Self> {
        let one = |part| fs::metadata(with_suffix(path, part)).map(|status| (status.dev(), status.ino()));
        Ok(Self([one("")?, one("-wal")?]))
    }
}

/// The folder of a journal, held against other programs that would write one there, for as long as this lives.
#[derive(Debug)]
pub(super) struct FolderHold {
    _folder: Option<File>,
}

impl FolderHold {
    /// Holds the folder of `path`. A file system without such locks is used without; one that cannot be opened will be told by the database.
    pub(super) fn take(path: &Path) -> Result<Self, JournalError> {
        let Ok(folder) = File::open(folder_of(path)) else { return Ok(Self { _folder: None }) };
        match flock(&folder, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => Ok(Self { _folder: Some(folder) }),
            Err(Errno::WOULDBLOCK) => Err(JournalError::InUse { path: path.into() }),
            Err(error) => {
                log::debug!("the folder of the journal {} cannot be locked: {error}", path.display());
                Ok(Self { _folder: None })
            }
        }
    }
}
