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
//! | `/camera/image_raw` | `sensor_msgs/msg/Image`: a picture without JPEG, where the session saw one | log: arrival; header: mid-exposure |
//! | `/ship/values` | `bowwave_msgs/msg/ShipValues`: the numbers of the line before it, exact | both: arrival |
//! | `/ship/fix` | `bowwave_msgs/msg/ShipFix`: place and time of the line before it, exact | both: arrival |
//! | `/fault` | `diagnostic_msgs/msg/DiagnosticArray` of one status: a fault came, went or happened | log: the next tick's; header: the fault's own |
//! | `/tick` | `bowwave_msgs/msg/Tick`: a frame was due, after all messages before it in the file | log: when it was begun; header: when it is seen |
//! | `/truth/pose`, `/pose` | `geometry_msgs/msg/PoseStamped` | both: the pose's time |
//!
//! Calibration and scenario are attachments (`calibration.toml`, `scenario.toml`), everything else of [`Properties`] is one
//! metadata record called `bowwave`. A session's inputs stand in the file in the order in which it met them
//! ([`RecordingReader::entries_as_written`]); [`RecordingReader::entries`] gives all entries by time. Where the table says `log`, the
//! publish time is the same, and it alone is right for what a pause of the computer held up: its log time is half a second before the
//! newest then ([`DISORDER_MAX_NS`]), so that readers that put messages into order need not look back further. Chunks are not compressed,
//! since pictures already are, and none spans more than half a second: a file that was cut short misses less than a second.

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
    act::TraineeAct,
    event::{CameraFrame, ImuSample, Mark, Picture, ShipFix, ShipSample, Tick, TriggerEdge},
    fault::FaultChange,
    geometry::CameraPose,
    order::InstructorOrder,
    time::Time,
};

pub use error::RecordError;
pub use properties::{CameraInfo, Properties};
use schema::Topic;

pub use read::{Entries, RecordingReader};
pub use recover::{RecoverReport, recover};
pub use write::{RecordingWriter, WrittenSummary};

/// The largest chunk that is read, bytes: what a reader may have to hold at once.
pub const CHUNK_MAX_BYTES: u64 = 64 << 20;

/// The longest line of the ship's instruments that is written or read, bytes.
pub const SENTENCE_MAX_BYTES: usize = 256;

/// The largest JPEG that is written or read, bytes.
pub const JPEG_MAX_BYTES: usize = 32 << 20;

/// Greatest disorder of log times in a file, nanoseconds; readers put them into order again.
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
    /// An act of the trainee.
    Act(TraineeAct),
    /// An order of the instructor.
    Order(InstructorOrder),
    /// Where the camera really was (recordings with known truth).
    Truth(PoseEntry),
    /// The pose that a session used.
    Pose(PoseEntry),
    /// A picture as the session saw it, without JPEG.
    Picture(PictureEntry),
    /// The exact numbers of the ship's line written just before.
    ShipValues(ShipSample),
    /// Place and time of the ship's line written just before, exact.
    ShipFix(ShipFix),
    /// A fault came, went or happened.
    Fault(FaultEntry),
    /// A frame was due.
    Tick(TickEntry),
}

impl Entry {
    /// Arrival at the host, or the time that a pose is for.
    pub fn time(&self) -> Time {
        match self {
            Self::Imu(sample) => sample.arrival,
            Self::Frame(frame) => frame.arrival,
            Self::Trigger(edge) => edge.time,
            Self::Ship(line) => line.arrival,
            Self::Mark(mark) => mark.time,
            Self::Act(act) => act.time,
            Self::Order(order) => order.time,
            Self::Truth(pose) | Self::Pose(pose) => pose.time,
            Self::Picture(picture) => picture.arrival,
            Self::ShipValues(sample) => sample.arrival,
            Self::ShipFix(fix) => fix.arrival,
            Self::Fault(fault) => fault.logged,
            Self::Tick(entry) => entry.tick.time,
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
    /// The camera sent no JPEG: the picture was coded for the recording, and its pixels differ a little from those that were seen.
    pub is_recoded: bool,
}

impl std::fmt::Debug for FrameEntry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FrameEntry")
            .field("arrival", &self.arrival)
            .field("mid_exposure", &self.mid_exposure)
            .field("sequence", &self.sequence)
            .field("jpeg_bytes", &self.jpeg.len())
            .field("is_recoded", &self.is_recoded)
            .finish()
    }
}

/// A picture without JPEG.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PictureEntry {
    /// When the picture reached the host.
    pub arrival: Time,
    /// Middle of the exposure by the camera's time stamp.
    pub mid_exposure: Time,
    /// The camera's frame counter.
    pub sequence: u32,
    /// The pixels.
    pub picture: Picture,
}

impl From<PictureEntry> for CameraFrame {
    fn from(entry: PictureEntry) -> Self {
        let PictureEntry { arrival, mid_exposure, sequence, picture } = entry;
        Self { arrival, mid_exposure, sequence, picture, jpeg: None }
    }
}

/// A change of a fault as the session met it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FaultEntry {
    /// Time that orders the entry: that of the tick which the change belongs to. The change's own may be older.
    pub logged: Time,
    /// The change.
    pub change: FaultChange,
}

/// A frame that was due, with what the session had given up to then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TickEntry {
    /// The tick.
    pub tick: Tick,
    /// Inputs of the session before this tick, ticks included: where fewer are read, some are lost.
    pub inputs: u64,
    /// Hash over the records of rounds before this tick.
    pub records: u64,
    /// Hash over the scenes before this tick.
    pub scenes: u64,
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
    /// Acts of the trainee.
    pub acts: u64,
    /// Orders of the instructor.
    pub orders: u64,
    /// True poses.
    pub truths: u64,
    /// Poses that were used.
    pub poses: u64,
    /// Exact numbers of the ship's lines.
    pub ship_values: u64,
    /// Exact places and times of the ship's lines.
    pub ship_fixes: u64,
    /// Changes of faults.
    pub faults: u64,
    /// Ticks.
    pub ticks: u64,
}

impl Counts {
    /// All entries together.
    pub const fn total(&self) -> u64 {
        self.imu
            + self.frames
            + self.triggers
            + self.ship
            + self.marks
            + self.acts
            + self.orders
            + self.truths
            + self.poses
            + self.ship_values
            + self.ship_fixes
            + self.faults
            + self.ticks
    }

    /// The counter of a topic; `None` for what is no entry.
    pub(crate) const fn of(&mut self, topic: Topic) -> Option<&mut u64> {
        Some(match topic {
            Topic::Image | Topic::ImageRaw => &mut self.frames,
            Topic::Imu => &mut self.imu,
            Topic::Trigger => &mut self.triggers,
            Topic::Ship => &mut self.ship,
            Topic::Mark => &mut self.marks,
            Topic::Act => &mut self.acts,
            Topic::Order => &mut self.orders,
            Topic::Truth => &mut self.truths,
            Topic::Pose => &mut self.poses,
            Topic::ShipValues => &mut self.ship_values,
            Topic::ShipFix => &mut self.ship_fixes,
            Topic::Fault => &mut self.faults,
            Topic::Tick => &mut self.ticks,
            Topic::CameraInfo => return None,
        })
    }
}
