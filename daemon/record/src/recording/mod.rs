//! Recordings: MCAP files with ROS 2 messages in CDR, as Foxglove and Rerun open them unchanged.
//!
//! | Topic | Message | Times |
//! |---|---|---|
//! | `/camera/image` | `sensor_msgs/msg/CompressedImage` (JPEG) | log: arrival; header: mid-exposure |
//! | `/camera/info` | `sensor_msgs/msg/CameraInfo`, once | start |
//! | `/imu` | `sensor_msgs/msg/Imu` | log: arrival; header: the unit's own clock |
//! | `/trigger` | `std_msgs/msg/Bool` | log: the kernel's time of the edge |
//! | `/ship` | `nmea_msgs/msg/Sentence` | both: arrival |
//! | `/mark` | `std_msgs/msg/String`: `stow` or `landmark` | log: when the operator pressed |
//! | `/truth/pose`, `/pose` | `geometry_msgs/msg/PoseStamped` | both: the pose's time |
//!
//! Calibration and scenario are attachments (`calibration.toml`, `scenario.toml`), everything else of [`Properties`] is one
//! metadata record called `bowwave`. Chunks are not compressed, since pictures already are, and none spans more than half
//! a second: a file that was cut short misses less than a second.

mod channels;
mod error;
mod messages;
mod properties;
mod read;
mod records;
mod recover;
mod ros;
mod schema;
mod survey;
mod write;

use std::sync::Arc;

use bowwave_core::{
    event::{ImuSample, Mark, TriggerEdge},
    geometry::CameraPose,
    time::Time,
};

pub use error::RecordError;
pub use properties::{CameraInfo, Properties};
pub use read::{Entries, RecordingReader};
pub use recover::{RecoverReport, recover};
pub use write::{RecordingWriter, WrittenSummary};

/// The largest chunk that is read, bytes: what a reader may have to hold at once.
pub const CHUNK_MAX_BYTES: u64 = 64 << 20;

/// The longest line of the ship's instruments that is written or read, bytes.
pub const SENTENCE_MAX_BYTES: usize = 256;

/// The largest JPEG that is written or read, bytes.
pub const JPEG_MAX_BYTES: usize = 32 << 20;

/// How far entries may be out of order when written, nanoseconds; readers put them into order again.
pub const DISORDER_MAX_NS: i64 = 500_000_000;

/// One thing that a recording holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A measurement of the inertial unit.
    Imu(ImuSample),
    /// A picture of the camera.
    Frame(FrameEntry),
    /// The trigger.
    Trigger(TriggerEdge),
    /// A line of the ship's instruments.
    Ship(ShipEntry),
    /// The operator's press.
    Mark(Mark),
    /// Where the camera really was (recordings with known truth).
    Truth(PoseEntry),
    /// The pose that a session used.
    Pose(PoseEntry),
}

impl Entry {
    /// The time that orders a recording: arrival at the host, or the time that a pose is for.
    pub fn time(&self) -> Time {
        match self {
            Self::Imu(sample) => sample.arrival,
            Self::Frame(frame) => frame.arrival,
            Self::Trigger(edge) => edge.time,
            Self::Ship(line) => line.arrival,
            Self::Mark(mark) => mark.time,
            Self::Truth(pose) | Self::Pose(pose) => pose.time,
        }
    }
}

/// A picture as JPEG; its size is in the JPEG.
#[derive(Clone, PartialEq, Eq)]
pub struct FrameEntry {
    /// When the picture reached the host.
    pub arrival: Time,
    /// Middle of the exposure by the camera's time stamp.
    pub mid_exposure: Time,
    /// The camera's frame counter.
    pub sequence: u32,
    /// The JPEG file's bytes, at most [`JPEG_MAX_BYTES`].
    pub jpeg: Arc<[u8]>,
}

impl std::fmt::Debug for FrameEntry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FrameEntry")
            .field("arrival", &self.arrival)
            .field("mid_exposure", &self.mid_exposure)
            .field("sequence", &self.sequence)
            .field("jpeg_bytes", &self.jpeg.len())
            .finish()
    }
}

/// A line of the ship's instruments as it came over the wire.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShipEntry {
    /// When its last byte reached the host.
    pub arrival: Time,
    /// The line with its check sum, at most [`SENTENCE_MAX_BYTES`].
    pub sentence: String,
}

/// A pose of the camera at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseEntry {
    /// The time that the pose is for.
    pub time: Time,
    /// Where the camera is and looks.
    pub pose: CameraPose,
}

/// How many entries of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Measurements of the inertial unit.
    pub imu: u64,
    /// Pictures.
    pub frames: u64,
    /// Trigger edges.
    pub triggers: u64,
    /// Lines of the ship's instruments.
    pub ship: u64,
    /// The operator's presses.
    pub marks: u64,
    /// True poses.
    pub truths: u64,
    /// Poses that were used.
    pub poses: u64,
}

impl Counts {
    /// All entries together.
    pub const fn total(&self) -> u64 {
        self.imu + self.frames + self.triggers + self.ship + self.marks + self.truths + self.poses
    }

    pub(crate) fn add(&mut self, entry: &Entry) {
        match entry {
            Entry::Imu(_) => self.imu += 1,
            Entry::Frame(_) => self.frames += 1,
            Entry::Trigger(_) => self.triggers += 1,
            Entry::Ship(_) => self.ship += 1,
            Entry::Mark(_) => self.marks += 1,
            Entry::Truth(_) => self.truths += 1,
            Entry::Pose(_) => self.poses += 1,
        }
    }
}
