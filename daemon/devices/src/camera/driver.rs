//! The camera as the state machine needs it: the real one is [`super::v4l2`], the tests have a scripted one.

use std::{io, path::Path, sync::Arc};

use bowwave_core::event::Lent;

use super::{
    Coding, Rate,
    identity::FoundCamera,
    negotiate::{ModeCandidate, Offer},
    settings::{CameraSettings, Controls},
    timing::BufferStamp,
};

/// Description of an opened node.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct OpenedCamera {
    /// Its name by the maker.
    pub card: String,
    /// Whether it delivers pictures: a camera has other nodes too.
    pub captures: bool,
    /// The modes that it can deliver.
    pub offers: Vec<Offer>,
}

/// The format that a driver really set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SetFormat {
    /// How pictures are coded.
    pub coding: Coding,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Bytes from row to row; of no meaning for JPEG.
    pub bytes_per_line: u32,
    /// Most bytes of a picture.
    pub size_image: u32,
}

/// A buffer that the driver gave back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FilledBuffer {
    /// Which.
    pub index: u32,
    /// Bytes in it, as the driver says.
    pub bytes_used: usize,
    /// The driver says that its contents are damaged.
    pub damaged: bool,
    /// The driver's frame counter.
    pub sequence: u32,
    /// When.
    pub stamp: BufferStamp,
}

/// Reasons for which the thread woke.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Ready {
    /// A buffer is filled.
    pub filled: bool,
    /// An event waits.
    pub event: bool,
    /// The queue failed or the device is gone.
    pub failed: bool,
}

/// One camera at a time. Errors are the kernel's; their numbers decide what is done. The device is closed by [`CameraDriver::close`]
/// or by opening another.
pub(super) trait CameraDriver {
    /// The video nodes of this computer, by number.
    fn find(&mut self, settings: &CameraSettings) -> Vec<FoundCamera>;
    /// Opens a node and asks what it can deliver, also at the sizes of `settings` where it gives only ranges.
    fn open(&mut self, node: &Path, settings: &CameraSettings) -> io::Result<OpenedCamera>;
    /// Asks for a mode; answers what was set, and the rate where the driver tells it.
    fn set_mode(&mut self, wanted: &ModeCandidate) -> io::Result<(SetFormat, Option<Rate>)>;
    /// The format that is set.
    fn format(&mut self) -> io::Result<SetFormat>;
    /// Locks what is to be locked; answers what the camera refused.
    fn set_controls(&mut self, controls: &Controls) -> Vec<&'static str>;
    /// Exposure time, nanoseconds, where the camera tells it.
    fn exposure_ns(&mut self) -> Option<i64>;
    /// Gets buffers, gives them to the driver and starts; answers how many there are.
    fn start(&mut self, buffers: u32) -> io::Result<u32>;
    /// Stops, gives the driver every buffer that nobody holds, and starts again.
    fn restart(&mut self) -> io::Result<()>;
    /// Stops and gives up the buffers, so that another mode can be set. Pictures that are lent stay as they are.
    fn stop(&mut self);
    /// The next filled buffer, oldest first; `None` where none waits.
    fn dequeue(&mut self) -> io::Result<Option<FilledBuffer>>;
    /// The memory of a buffer that was dequeued and not yet queued; empty for any other.
    fn bytes(&self, index: u32) -> &[u8];
    /// Gives a dequeued buffer back to the driver.
    fn queue(&mut self, index: u32) -> io::Result<()>;
    /// Lends a dequeued buffer; it comes back with [`CameraDriver::reclaim`] after the last handle is gone.
    fn lend(&mut self, index: u32) -> Option<Arc<dyn Lent>>;
    /// Gives the driver the buffers that came back.
    fn reclaim(&mut self) -> io::Result<()>;
    /// How many buffers the driver has.
    fn queued(&self) -> usize;
    /// Takes out the waiting events; whether one says that the picture's source changed.
    fn source_changed(&mut self) -> bool;
    /// Stops and closes.
    fn close(&mut self);
    /// Resets the camera's USB device, as replugging would.
    fn reset(&mut self, camera: &FoundCamera) -> io::Result<()>;
}
