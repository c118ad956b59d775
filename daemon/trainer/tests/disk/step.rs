//! What happened to the journal's folder, step by step.

use std::fmt;

/// Something that happened to the journal's folder, or was reported.
#[derive(Clone, Debug)]
pub enum Step {
    /// A new empty file.
    Create { name: String },
    /// Bytes of a file; files are named by the number of their creation.
    Write { file: usize, offset: usize, bytes: Vec<u8> },
    /// A file's length.
    Resize { file: usize, length: usize },
    /// A file is on the disk.
    Sync { file: usize },
    /// A sync was refused, or said to be done and was not: what was to be written is nowhere but in the system's memory, and not
    /// marked to be written.
    SyncFailed { file: usize },
    /// The names in the folder are on the disk.
    SyncFolder,
    /// A name is gone.
    Remove { name: String },
    /// A file has another name.
    Rename { from: String, to: String },
    /// A round was fired.
    Fired(u64),
    /// A round was reported as committed.
    Committed(u64),
    /// The database is damaged on purpose from here on.
    Damage,
    /// What is to go wrong begins.
    Trouble,
    /// The disk refuses something for the first time.
    Refused,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Write { file, offset, bytes } => {
                write!(f, "{} bytes at {offset} of file {file}", bytes.len())
            }
            other => write!(f, "{other:?}"),
        }
    }
}
