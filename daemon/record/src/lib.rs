//! What outlives a session: the journal of hits ([`journal`]) and MCAP recordings ([`recording`]).

#![forbid(unsafe_code)]

pub mod journal;
pub mod recording;

pub use journal::{
    Journal, JournalError, JournalFault, JournalSummary, Run, RunSelection, ShotFilter, StoredRun,
    StoredShot, Unwritten, read_runs, read_shots,
};
pub use recording::{
    CameraInfo, Counts, Entries, Entry, FrameEntry, PoseEntry, Properties, RecordError, RecordingReader,
    RecordingWriter, RecoverReport, WrittenSummary, recover,
};
