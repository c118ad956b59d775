//! How the camera stands.

use std::{path::PathBuf, sync::Arc};

use super::WantedMode;

/// Where the camera is in its life.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CameraLife {
    /// None that is meant is there; looked for ten times a second.
    #[default]
    Searching,
    /// Another camera than the calibrated one is there. It is not opened.
    Mismatched,
    /// Another program holds it; tried again each second.
    Busy,
    /// It is being opened, or has not yet delivered its first picture.
    Opening,
    /// Pictures come.
    Streaming,
    /// Pictures have stopped coming; the stream is being started again.
    Stalled,
    /// Its USB device was reset; it will appear anew.
    Resetting,
    /// The thread has ended.
    Stopped,
}

/// Counts since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CameraCounters {
    /// Pictures handed on.
    pub frames: u64,
    /// Of these, in the driver's own memory.
    pub lent: u64,
    /// Of these, copied because rows were padded or the driver had too few buffers left.
    pub copied: u64,
    /// Pictures that gave way in the queue to newer ones.
    pub dropped: u64,
    /// Buffers taken from the driver.
    pub buffers: u64,
    /// Buffers left out because a newer one waited.
    pub skipped: u64,
    /// Buffers that the driver marked as damaged.
    pub damaged_buffers: u64,
    /// Pictures that were cut short, corrupt or of another size.
    pub damaged_pictures: u64,
    /// Pictures missing in the driver's count.
    pub sequence_gaps: u64,
    /// Pictures left out because their time was not after the last one's.
    pub out_of_order: u64,
    /// Pictures whose time stamp was of another clock or far off; their arrival was used.
    pub stamps_not_believed: u64,
    /// Times that pictures stopped coming.
    pub stalls: u64,
    /// Times that the stream was started again.
    pub restarts: u64,
    /// Times that the camera was opened and started.
    pub opened: u64,
    /// Times that its USB device was reset.
    pub resets: u64,
}

/// The camera that runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InUse {
    /// Its node, such as `/dev/video0`.
    pub node: PathBuf,
    /// A name that survives replugging, where udev gives one.
    pub by_id: Option<PathBuf>,
    /// USB serial number, where it has one.
    pub serial: Option<String>,
    /// Its name by the maker.
    pub card: String,
    /// The mode that the driver set.
    pub mode: WantedMode,
    /// Controls that the camera refused to have locked, such as "exposure time".
    pub refused_controls: Vec<&'static str>,
}

/// A snapshot.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CameraStatus {
    /// Where it is in its life.
    pub life: CameraLife,
    /// The camera that runs, where one does.
    pub in_use: Option<Arc<InUse>>,
    /// Counts since the start.
    pub counters: CameraCounters,
}
