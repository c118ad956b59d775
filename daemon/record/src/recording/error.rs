//! Errors of a recording.

use std::{io, path::PathBuf};

use bowwave_core::time::Time;

/// Error of a recording: cause, place and remedy.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be opened.
    #[error("cannot open the recording {}: {source}; check the path and its permissions", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The file has no bytes.
    #[error("the recording {} is empty; give another one or record again", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The file does not begin as MCAP files do.
    #[error("{} is no recording: its first bytes are not those of an MCAP file; give a .mcap file or import this one", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
    },
    /// An MCAP file of somebody else's.
    #[error(
        "{} is an MCAP file without Bowwave's properties (topics: {}); give a recording that Bowwave made, or import the pictures",
        path.display(), list(topics)
    )]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The topics it has, at most 16.
        topics: Vec<String>,
    },
    /// A topic of ours that carries something else.
    #[error(
        "{}: topic {topic} carries {found} where {expected} belongs; record again or convert the file",
        path.display()
    )]
    ForeignTopic {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// Schema and encodings found.
        found: String,
        /// Schema and encodings that belong there.
        expected: String,
    },
    /// A recording without a picture.
    #[error("the recording {} has no pictures{}; record again or import one with pictures", path.display(), cut_note(*cut_at))]
    NoFrames {
        /// The file.
        path: PathBuf,
        /// Where the file was cut short, if it was.
        cut_at: Option<u64>,
    },
    /// The file ends too early. Everything before is readable.
    #[error(
        "the recording {} was cut short: it ends within the record at byte {offset} of {bytes}; everything before that is \
         readable, recover it to get a whole file",
        path.display()
    )]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Where the incomplete record begins.
        offset: u64,
        /// The file's length.
        bytes: u64,
    },
    /// Bytes that make no sense.
    #[error("the recording {} is damaged at byte {offset}: {what}; recover it to save what is readable", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: u64,
        /// Description of the error.
        what: String,
    },
    /// A record claims a size beyond what is read.
    #[error(
        "the recording {} claims {bytes} bytes for {what} at byte {offset}, more than the limit of {limit}; it is damaged or \
         was not made by Bowwave",
        path.display()
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: u64,
        /// The part that is too large.
        what: String,
        /// Claimed bytes.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// A compressed chunk.
    #[error(
        "the recording {} is compressed with {compression:?} at byte {offset}; store it again without compression \
         (mcap compress --compression none)",
        path.display()
    )]
    Compressed {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: u64,
        /// The method's name.
        compression: String,
    },
    /// A message that cannot be decoded or makes no sense.
    #[error(
        "the recording {}: message on {topic} at byte {offset}, {time}: {what}; recover the file to leave it out",
        path.display()
    )]
    Message {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: u64,
        /// Its topic.
        topic: &'static str,
        /// Its log time.
        time: Time,
        /// Description of the error.
        what: String,
    },
    /// Messages are farther out of order than writers may leave them.
    #[error(
        "the recording {}: the message at byte {offset} is {late_ns} ns older than one before it; sort the file by log time",
        path.display()
    )]
    OutOfOrder {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: u64,
        /// How far it is out of order.
        late_ns: i64,
    },
    /// Properties that are missing or make no sense.
    #[error("the recording {}: property {name}: {what}; record again", path.display())]
    Property {
        /// The file.
        path: PathBuf,
        /// Which one.
        name: String,
        /// Description of the error.
        what: String,
    },
    /// A recording of a newer Bowwave.
    #[error("the recording {} has format {found}, this Bowwave reads up to {supported}; update Bowwave", path.display())]
    Newer {
        /// The file.
        path: PathBuf,
        /// The format it has.
        found: u32,
        /// The newest that is read.
        supported: u32,
    },
    /// Reading failed.
    #[error("reading the recording {} at byte {offset}: {source}; check the disk", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: u64,
        /// The system's reason.
        source: io::Error,
    },
    /// The file is already there.
    #[error("{} is already there; choose another name or remove it", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// Writing failed; what was written before can be read.
    #[error("writing the recording {}: {source}; {}", path.display(), write_advice(source))]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// An entry that cannot be recorded. The recording goes on without it.
    #[error("cannot record the entry of {time} to {}: {what}", path.display())]
    Entry {
        /// The file.
        path: PathBuf,
        /// The entry's time.
        time: Time,
        /// Why not, and what to do.
        what: String,
    },
}

fn list(topics: &[String]) -> String {
    if topics.is_empty() { "none".to_owned() } else { topics.join(", ") }
}

fn cut_note(cut_at: Option<u64>) -> String {
    cut_at.map_or_else(String::new, |offset| format!(" (it was cut short at byte {offset})"))
}

fn write_advice(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "the disk is full: free space and record again; what was written before can be recovered"
        }
        io::ErrorKind::ReadOnlyFilesystem | io::ErrorKind::PermissionDenied => {
            "choose a place that can be written"
        }
        io::ErrorKind::NotFound => "make the folder first",
        _ => "check the disk; what was written before can be recovered",
    }
}
