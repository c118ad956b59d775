//! The one vocabulary of what the hardware tells the trainer. Devices and simulated hardware both speak it.

use std::{any::Any, sync::Arc};

use glam::{DQuat, DVec3};

use crate::{
    act::TraineeAct,
    ephemeris::{Place, Utc},
    fault::FaultChange,
    order::InstructorOrder,
    time::Time,
};

/// One input of a session. Records and scenes follow from the inputs alone, live as replayed.
#[derive(Clone, Debug)]
pub enum Input {
    /// A frame is due.
    Tick(Tick),
    /// A device reported something, or a fault came or went.
    Event(Event),
}

/// A frame is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// When the frame was begun: how old a sensor's report is counts from here.
    pub time: Time,
    /// When the frame is expected to be seen.
    pub shown: Time,
}

impl Tick {
    /// A frame that is seen as soon as it is begun: without a display to wait for.
    pub const fn at(time: Time) -> Self {
        Self { time, shown: time }
    }
}

/// Something that a device reported.
#[derive(Clone, Debug)]
pub enum Event {
    /// One measurement of the inertial unit.
    Imu(ImuSample),
    /// One picture of the camera.
    Frame(CameraFrame),
    /// The trigger was pressed or released.
    Trigger(TriggerEdge),
    /// The ship's own instruments told its heading or attitude.
    Ship(ShipSample),
    /// The ship's own instruments told where she is, or what time it is.
    ShipFix(ShipFix),
    /// The operator says that the gun stands at something of known bearing.
    Mark(Mark),
    /// The trainee did something besides pulling the trigger, or an instructor marked a call.
    Act(TraineeAct),
    /// An instructor ordered something.
    Order(InstructorOrder),
    /// A fault came or went.
    Fault(FaultChange),
}

impl Event {
    /// When the event reached the host; the order in which a session meets events.
    pub fn arrival(&self) -> Time {
        match self {
            Self::Imu(s) => s.arrival,
            Self::Frame(f) => f.arrival,
            Self::Trigger(t) => t.time,
            Self::Ship(s) => s.arrival,
            Self::ShipFix(f) => f.arrival,
            Self::Mark(m) => m.time,
            Self::Act(a) => a.time,
            Self::Order(o) => o.time,
            Self::Fault(f) => f.time,
        }
    }
}

/// One measurement of the inertial unit, in the unit's own axes ("imu" frame).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// When the last byte of the packet reached the host.
    pub arrival: Time,
    /// The unit's own clock, nanoseconds since its start-up.
    pub device_time_ns: i64,
    /// Angular rate, rad/s.
    pub rate: DVec3,
    /// Specific force (what an accelerometer feels: +g upwards at rest), m/s^2.
    pub accel: DVec3,
    /// The unit's own estimate `world_from_imu` (world: x east, y north, z up), where it gives one.
    pub world_from_imu: Option<DQuat>,
}

impl ImuSample {
    /// Whether every number in the sample is finite.
    pub fn is_finite(&self) -> bool {
        self.rate.is_finite()
            && self.accel.is_finite()
            && self.world_from_imu.is_none_or(|q| q.is_finite() && q.length() > 0.5)
    }
}

/// One message of the ship's own instruments. Values that they call invalid are absent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShipSample {
    /// When its last byte reached the host: later than the measurement by the feed's latency.
    pub arrival: Time,
    /// True heading, radians clockwise from north, at least 0 and below a turn.
    pub heading: Option<f64>,
    /// Roll, radians, starboard down.
    pub roll: Option<f64>,
    /// Pitch, radians, bow up.
    pub pitch: Option<f64>,
    /// The instrument's own estimate of the heading's standard deviation, radians.
    pub heading_sigma: Option<f64>,
    /// The instrument says that it is not at its best: reduced quality, or not aligned yet.
    pub reduced: bool,
}

/// Place and time by the ship's own instruments; a line tells one of them or both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShipFix {
    /// When its last byte reached the host.
    pub arrival: Time,
    /// Her place.
    pub place: Option<Place>,
    /// The time at its arrival, less the feed's latency.
    pub utc: Option<Utc>,
}

/// Place of known bearing at which the operator presses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MarkKind {
    /// Its stow, or another place of known bearing on the mount.
    Stow,
    /// A landmark of known true bearing: the camera's axis lies on it.
    Landmark,
}

/// The operator pressed while the gun stood at something of known bearing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    /// When it was pressed.
    pub time: Time,
    /// The place at which it stood.
    pub kind: MarkKind,
}

/// How the bytes of a picture are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PixelFormat {
    /// 4:2:2 packed, Y0 U Y1 V, limited-range BT.601, two bytes a pixel. Even width.
    Yuyv,
    /// 4:2:0, a full plane of Y, then a half-size plane of interleaved U V; limited-range BT.601. Even width and height.
    Nv12,
    /// 8-bit sRGB, three bytes a pixel.
    Rgb,
}

impl PixelFormat {
    /// Bytes of a pixel in the first plane; luma comes first in each but [`Self::Rgb`].
    pub const fn pixel_bytes(self) -> usize {
        match self {
            Self::Nv12 => 1,
            Self::Yuyv => 2,
            Self::Rgb => 3,
        }
    }

    /// How many times a pixel's luma the sum is that stands for it: that of RGB is summed as R + 2 G + B.
    pub(crate) const fn luma_weight(self) -> u8 {
        match self {
            Self::Yuyv | Self::Nv12 => 1,
            Self::Rgb => 4,
        }
    }

    /// Bytes of a row without padding; rows of a second plane have as many.
    pub const fn row_bytes(self, width: u32) -> usize {
        width as usize * self.pixel_bytes()
    }

    /// Rows of all planes together.
    pub const fn rows(self, height: u32) -> usize {
        let height = height as usize;
        if matches!(self, Self::Nv12) { height + height / 2 } else { height }
    }

    /// Byte at which the second plane begins, without padding; `None` where there is none.
    pub const fn chroma_offset(self, width: u32, height: u32) -> Option<usize> {
        if matches!(self, Self::Nv12) { Some(self.row_bytes(width) * height as usize) } else { None }
    }

    /// Bytes of a `width` x `height` picture without padding.
    pub const fn byte_len(self, width: u32, height: u32) -> usize {
        self.row_bytes(width) * self.rows(height)
    }
}

/// Memory that a driver fills and lends for as long as somebody holds it. Its `Drop` gives it back.
pub trait Lent: Send + Sync {
    /// The whole mapping: whole pages, the picture's bytes first. The same address each time the buffer is lent.
    fn mapping(&self) -> &[u8];

    /// What keeps the mapping in place without keeping the buffer from the driver: while it is held, the pages stay mapped at
    /// this address. The same one (`Arc::ptr_eq`) each time the buffer is lent, another after the memory was mapped anew.
    /// `None`: the mapping may go with `self`, and nobody may remember its address.
    fn hold(&self) -> Option<Arc<dyn Any + Send + Sync>> {
        None
    }
}

#[derive(Clone)]
enum Bytes {
    Owned(Arc<[u8]>),
    Lent(Arc<dyn Lent>),
}

/// A picture as the camera delivered it, rows from the top, no padding.
#[derive(Clone)]
pub struct Picture {
    format: PixelFormat,
    width: u32,
    height: u32,
    bytes: Bytes,
}

/// Why bytes are no picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PictureError {
    /// The byte count does not belong to the size.
    #[error("a {width}x{height} {format:?} picture has {expected} bytes, got {actual}")]
    Length {
        /// Stated format.
        format: PixelFormat,
        /// Stated width in pixels.
        width: u32,
        /// Stated height in pixels.
        height: u32,
        /// Bytes such a picture has.
        expected: usize,
        /// Bytes given.
        actual: usize,
    },
    /// Zero, odd where the format needs even, or beyond 8192 pixels.
    #[error(
        "{width}x{height} is no usable size for {format:?} (1 to 8192 pixels; even where chroma is shared)"
    )]
    Size {
        /// Stated format.
        format: PixelFormat,
        /// Stated width in pixels.
        width: u32,
        /// Stated height in pixels.
        height: u32,
    },
}

impl Picture {
    /// Wraps `bytes` after checking that they are a `width` x `height` picture of that format.
    pub fn new(format: PixelFormat, width: u32, height: u32, bytes: Arc<[u8]>) -> Result<Self, PictureError> {
        let expected = Self::checked_len(format, width, height)?;
        if bytes.len() != expected {
            return Err(PictureError::Length { format, width, height, expected, actual: bytes.len() });
        }
        Ok(Self { format, width, height, bytes: Bytes::Owned(bytes) })
    }

    /// Wraps a driver's buffer, which may be longer than the picture in it. It goes back to the driver with the last clone.
    pub fn lent(
        format: PixelFormat,
        width: u32,
        height: u32,
        memory: Arc<dyn Lent>,
    ) -> Result<Self, PictureError> {
        let expected = Self::checked_len(format, width, height)?;
        let actual = memory.mapping().len();
        if actual < expected {
            return Err(PictureError::Length { format, width, height, expected, actual });
        }
        Ok(Self { format, width, height, bytes: Bytes::Lent(memory) })
    }

    /// A black picture.
    pub fn black(format: PixelFormat, width: u32, height: u32) -> Result<Self, PictureError> {
        let mut bytes = vec![0; Self::checked_len(format, width, height)?];
        let luma = format.chroma_offset(width, height).unwrap_or(0);
        match format {
            PixelFormat::Rgb => {}
            PixelFormat::Yuyv => bytes.chunks_exact_mut(2).for_each(|p| p.copy_from_slice(&[16, 128])),
            PixelFormat::Nv12 => {
                bytes[..luma].fill(16);
                bytes[luma..].fill(128);
            }
        }
        Self::new(format, width, height, bytes.into())
    }

    fn checked_len(format: PixelFormat, width: u32, height: u32) -> Result<usize, PictureError> {
        let even = |v: u32| v.is_multiple_of(2);
        let in_range = (1..=8192).contains(&width) && (1..=8192).contains(&height);
        let parity = match format {
            PixelFormat::Yuyv => even(width),
            PixelFormat::Nv12 => even(width) && even(height),
            PixelFormat::Rgb => true,
        };
        if !in_range || !parity {
            return Err(PictureError::Size { format, width, height });
        }
        Ok(format.byte_len(width, height))
    }

    /// Byte layout.
    pub const fn format(&self) -> PixelFormat {
        self.format
    }

    /// Width in pixels.
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// The bytes of a row of the first plane; none beyond the last.
    pub fn row(&self, y: usize) -> &[u8] {
        let row_bytes = self.format.row_bytes(self.width);
        if y >= self.height as usize {
            return &[];
        }
        self.bytes().get(y * row_bytes..(y + 1) * row_bytes).unwrap_or(&[])
    }

    /// The bytes, rows from the top.
    pub fn bytes(&self) -> &[u8] {
        match &self.bytes {
            Bytes::Owned(bytes) => bytes,
            Bytes::Lent(memory) => &memory.mapping()[..self.format.byte_len(self.width, self.height)],
        }
    }

    /// The driver's mapping that the bytes lie in, where they are lent.
    pub fn mapping(&self) -> Option<&[u8]> {
        match &self.bytes {
            Bytes::Owned(_) => None,
            Bytes::Lent(memory) => Some(memory.mapping()),
        }
    }

    /// What keeps [`Picture::mapping`] in place; see [`Lent::hold`].
    pub fn hold(&self) -> Option<Arc<dyn Any + Send + Sync>> {
        match &self.bytes {
            Bytes::Owned(_) => None,
            Bytes::Lent(memory) => memory.hold(),
        }
    }

    /// sRGB-coded colour of the pixel nearest to (`x`, `y`), clamped to the picture, each channel 0 to 1.
    pub fn srgb_at(&self, x: u32, y: u32) -> [f32; 3] {
        let (x, y) = (x.min(self.width - 1) as usize, y.min(self.height - 1) as usize);
        let row_bytes = self.format.row_bytes(self.width);
        let at = |x: usize| y * row_bytes + x * self.format.pixel_bytes();
        let b = self.bytes();
        match self.format {
            PixelFormat::Rgb => {
                let i = at(x);
                [b[i], b[i + 1], b[i + 2]].map(|v| f32::from(v) / 255.0)
            }
            PixelFormat::Yuyv => {
                let pair = at(x / 2 * 2);
                bt601_to_srgb(b[at(x)], b[pair + 1], b[pair + 3])
            }
            PixelFormat::Nv12 => {
                let chroma = self.format.chroma_offset(self.width, self.height).unwrap_or(0);
                let uv = chroma + y / 2 * row_bytes + x / 2 * 2;
                bt601_to_srgb(b[at(x)], b[uv], b[uv + 1])
            }
        }
    }
}

impl PartialEq for Picture {
    fn eq(&self, other: &Self) -> bool {
        (self.format, self.width, self.height) == (other.format, other.width, other.height)
            && self.bytes() == other.bytes()
    }
}

impl Eq for Picture {}

impl std::fmt::Debug for Picture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Picture({:?} {}x{})", self.format, self.width, self.height)
    }
}

/// Limited-range BT.601 to sRGB-coded RGB (ITU-R BT.601-7, 2.5), clamped to 0 to 1.
pub fn bt601_to_srgb(y: u8, u: u8, v: u8) -> [f32; 3] {
    let y = (f32::from(y) - 16.0) / 219.0;
    let u = (f32::from(u) - 128.0) / 224.0;
    let v = (f32::from(v) - 128.0) / 224.0;
    [y + 1.402 * v, y - 0.344_136 * u - 0.714_136 * v, y + 1.772 * u].map(|c| c.clamp(0.0, 1.0))
}

/// One picture of the camera with its time.
#[derive(Clone, Debug)]
pub struct CameraFrame {
    /// When the picture reached the host.
    pub arrival: Time,
    /// Middle of the exposure by the camera's time stamp; the calibrated offset to the inertial unit is not yet applied.
    pub mid_exposure: Time,
    /// The camera's frame counter.
    pub sequence: u32,
    /// The pixels.
    pub picture: Picture,
    /// The JPEG that the pixels were decoded from, kept so that a recording need not encode again.
    pub jpeg: Option<Arc<[u8]>>,
}

/// The trigger was pressed or released.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TriggerEdge {
    /// The kernel's time of the edge.
    pub time: Time,
    /// `true` for pressed.
    pub pressed: bool,
}
