//! Storage that outlives a session: the journal of hits ([`journal`]) and MCAP recordings ([`recording`]).

#![forbid(unsafe_code)]

mod folder;
pub mod journal;
pub mod recording;
pub mod space;

pub use journal::{
    BoatDetails, CameraDetails, DirtyEnd, DirtyRun, Journal, JournalError, JournalFault, JournalOptions,
    JournalSummary, Quarantine, Run, RunDetails, RunSelection, ShotFilter, StoredEvent, StoredRun,
    StoredShot, StoredTracks, Unwritten, boot_id, put_aside, read_events, read_runs, read_shots, read_tracks,
    side_files,
};
pub use recording::{
    CameraInfo, Counts, Entries, Entry, FaultEntry, FrameEntry, PictureEntry, PoseEntry, Properties,
    RecordError, RecordingReader, RecordingWriter, RecoverReport, SENTENCE_MAX_BYTES, ShipEntry, TickEntry,
    WrittenSummary, recover,
};
pub use space::{Room, SpaceWatch};
