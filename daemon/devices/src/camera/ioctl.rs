//! Typed calls of V4L2 on an open descriptor. The structures and numbers are the `v4l` crate's; its own wrappers wait for ever,
//! panic where a driver's text is not UTF-8, and hide what a buffer's flags say.

use std::{
    io, mem,
    os::fd::{AsRawFd, BorrowedFd},
};

use bowwave_core::time::{NS_PER_S, Time};
use v4l::{
    v4l_sys::{
        V4L2_BUF_FLAG_ERROR, V4L2_BUF_FLAG_TIMESTAMP_MASK, V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC,
        V4L2_BUF_FLAG_TSTAMP_SRC_MASK, V4L2_BUF_FLAG_TSTAMP_SRC_SOE, V4L2_CAP_TIMEPERFRAME,
        V4L2_EVENT_SOURCE_CHANGE, v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE, v4l2_buffer, v4l2_capability,
        v4l2_control, v4l2_event, v4l2_event_subscription, v4l2_field_V4L2_FIELD_NONE, v4l2_fmtdesc,
        v4l2_format, v4l2_fract, v4l2_frmivalenum, v4l2_frmivaltypes_V4L2_FRMIVAL_TYPE_DISCRETE,
        v4l2_frmsizeenum, v4l2_frmsizetypes_V4L2_FRMSIZE_TYPE_DISCRETE, v4l2_memory_V4L2_MEMORY_MMAP,
        v4l2_requestbuffers, v4l2_streamparm,
    },
    v4l2::{self, vidioc},
};

use super::{
    Coding, Rate, Size,
    driver::{FilledBuffer, SetFormat},
    negotiate::{ModeCandidate, Rates},
    timing::BufferStamp,
};

const CAPTURE: u32 = v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE;

/// More entries than any camera lists; bounds the loop against a driver that never ends its list.
const ENTRIES_MAX: u32 = 64;

/// Numbers that the `v4l` crate leaves out: `_IOR('V', 89, struct v4l2_event)`, `_IOW('V', 90, struct
/// v4l2_event_subscription)` and `_IO('U', 20)` (linux/videodev2.h, linux/usbdevice_fs.h).
const VIDIOC_DQEVENT: vidioc::_IOC_TYPE = number(2, b'V', 89, mem::size_of::<v4l2_event>());
const VIDIOC_SUBSCRIBE_EVENT: vidioc::_IOC_TYPE =
    number(1, b'V', 90, mem::size_of::<v4l2_event_subscription>());
const USBDEVFS_RESET: vidioc::_IOC_TYPE = number(0, b'U', 20, 0);

/// A request's number on the architectures that the trainer runs on (x86, Arm, RISC-V): direction, size, type, number.
const fn number(direction: u32, kind: u8, number: u8, size: usize) -> vidioc::_IOC_TYPE {
    ((direction << 30) | ((size as u32) << 16) | ((kind as u32) << 8) | number as u32) as vidioc::_IOC_TYPE
}

/// Calls `request` with `argument`, which must be the structure that the request reads and writes.
///
/// # Safety
///
/// The kernel reads and writes as many bytes as the request's number says: `T` must be that structure, and whatever it
/// points to must be valid.
unsafe fn call<T>(fd: BorrowedFd<'_>, request: vidioc::_IOC_TYPE, argument: &mut T) -> io::Result<()> {
    loop {
        // SAFETY: the descriptor is open as long as it is borrowed; `argument` is valid for reads and writes, and the
        // caller vouches for its type.
        let done = unsafe { v4l2::ioctl(fd.as_raw_fd(), request, (&raw mut *argument).cast()) };
        match done {
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            done => return done,
        }
    }
}

/// A structure of V4L2 with every byte zero.
trait Plain: Sized {
    fn zeroed() -> Self;
}

macro_rules! plain {
    ($($name:ty),*) => {
        $(impl Plain for $name {
            fn zeroed() -> Self {
                // SAFETY: the structure is integers, unions of them and plain pointers, for all of which zero is valid.
                unsafe { mem::zeroed() }
            }
        })*
    };
}

plain!(
    v4l2_capability,
    v4l2_fmtdesc,
    v4l2_frmsizeenum,
    v4l2_frmivalenum,
    v4l2_format,
    v4l2_streamparm,
    v4l2_requestbuffers,
    v4l2_buffer,
    v4l2_event,
    v4l2_event_subscription
);

/// Answer of `VIDIOC_QUERYCAP`.
pub(super) struct Capability {
    pub driver: String,
    pub card: String,
    pub bus: String,
    /// Can deliver pictures through the single-planar API.
    pub captures: bool,
}

/// Asks the device what it is.
pub(super) fn query_capability(fd: BorrowedFd<'_>) -> io::Result<Capability> {
    const VIDEO_CAPTURE: u32 = 0x0000_0001;
    const STREAMING: u32 = 0x0400_0000;
    const HAS_DEVICE_CAPS: u32 = 0x8000_0000;
    let mut raw = v4l2_capability::zeroed();
    // SAFETY: VIDIOC_QUERYCAP writes one v4l2_capability.
    unsafe { call(fd, vidioc::VIDIOC_QUERYCAP, &mut raw)? };
    let flags = if raw.capabilities & HAS_DEVICE_CAPS != 0 { raw.device_caps } else { raw.capabilities };
    Ok(Capability {
        driver: text(&raw.driver),
        card: text(&raw.card),
        bus: text(&raw.bus_info),
        captures: flags & VIDEO_CAPTURE != 0 && flags & STREAMING != 0,
    })
}

/// Every entry of a list that ends with EINVAL.
fn enumerate<T>(mut entry: impl FnMut(u32) -> io::Result<T>) -> io::Result<Vec<T>> {
    let mut entries = Vec::new();
    for index in 0..ENTRIES_MAX {
        match entry(index) {
            Ok(found) => entries.push(found),
            Err(e) if e.kind() == io::ErrorKind::InvalidInput => break,
            Err(e) => return Err(e),
        }
    }
    Ok(entries)
}

/// The four-character codes that the device can deliver.
pub(super) fn capture_formats(fd: BorrowedFd<'_>) -> io::Result<Vec<[u8; 4]>> {
    enumerate(|index| {
        let mut raw = v4l2_fmtdesc { index, type_: CAPTURE, ..v4l2_fmtdesc::zeroed() };
        // SAFETY: VIDIOC_ENUM_FMT reads and writes one v4l2_fmtdesc.
        unsafe { call(fd, vidioc::VIDIOC_ENUM_FMT, &mut raw)? };
        Ok(raw.pixelformat.to_le_bytes())
    })
}

/// The sizes in which the device delivers `fourcc`. Some drivers list none: then they are unknown.
pub(super) fn frame_sizes(fd: BorrowedFd<'_>, fourcc: [u8; 4]) -> io::Result<Vec<Size>> {
    enumerate(|index| {
        let pixel_format = u32::from_le_bytes(fourcc);
        let mut raw = v4l2_frmsizeenum { index, pixel_format, ..v4l2_frmsizeenum::zeroed() };
        // SAFETY: VIDIOC_ENUM_FRAMESIZES reads and writes one v4l2_frmsizeenum.
        unsafe { call(fd, vidioc::VIDIOC_ENUM_FRAMESIZES, &mut raw)? };
        if raw.type_ == v4l2_frmsizetypes_V4L2_FRMSIZE_TYPE_DISCRETE {
            // SAFETY: both variants are integers, for which any bytes are valid.
            let size = unsafe { raw.__bindgen_anon_1.discrete };
            return Ok(Size::Fixed { width: size.width, height: size.height });
        }
        // SAFETY: both variants are integers, for which any bytes are valid.
        let range = unsafe { raw.__bindgen_anon_1.stepwise };
        Ok(Size::Range {
            least: (range.min_width, range.min_height),
            most: (range.max_width, range.max_height),
        })
    })
}

/// The rates at which the device delivers `fourcc` in that size.
pub(super) fn frame_rates(fd: BorrowedFd<'_>, fourcc: [u8; 4], width: u32, height: u32) -> Rates {
    let mut range = None;
    let listed = enumerate(|index| {
        let pixel_format = u32::from_le_bytes(fourcc);
        let mut raw = v4l2_frmivalenum { index, pixel_format, width, height, ..v4l2_frmivalenum::zeroed() };
        // SAFETY: VIDIOC_ENUM_FRAMEINTERVALS reads and writes one v4l2_frmivalenum.
        unsafe { call(fd, vidioc::VIDIOC_ENUM_FRAMEINTERVALS, &mut raw)? };
        if raw.type_ == v4l2_frmivaltypes_V4L2_FRMIVAL_TYPE_DISCRETE {
            // SAFETY: both variants are integers, for which any bytes are valid.
            return Ok(rate(unsafe { raw.__bindgen_anon_1.discrete }));
        }
        // SAFETY: both variants are integers, for which any bytes are valid.
        let steps = unsafe { raw.__bindgen_anon_1.stepwise };
        // The longest interval is the slowest rate.
        range = rate(steps.max).zip(rate(steps.min));
        // A range is the only entry there is.
        Err(io::ErrorKind::InvalidInput.into())
    });
    if let Some((least, most)) = range {
        return Rates::Range { least, most };
    }
    let listed: Vec<_> = listed.unwrap_or_default().into_iter().flatten().collect();
    if listed.is_empty() { Rates::Unknown } else { Rates::Listed(listed) }
}

/// The rate of an interval.
const fn rate(interval: v4l2_fract) -> Option<Rate> {
    Rate::new(interval.denominator, interval.numerator)
}

/// The format that is set.
pub(super) fn format(fd: BorrowedFd<'_>) -> io::Result<SetFormat> {
    let mut raw = v4l2_format { type_: CAPTURE, ..v4l2_format::zeroed() };
    // SAFETY: VIDIOC_G_FMT reads and writes one v4l2_format.
    unsafe { call(fd, vidioc::VIDIOC_G_FMT, &mut raw)? };
    Ok(checked(&raw))
}

/// Asks for a format; answers the one that the driver set instead.
pub(super) fn set_format(fd: BorrowedFd<'_>, wanted: &ModeCandidate) -> io::Result<SetFormat> {
    let mut raw = v4l2_format { type_: CAPTURE, ..v4l2_format::zeroed() };
    // SAFETY: `pix` is the variant of this type of buffer; its integers are valid whatever the bytes are.
    let pix = unsafe { &mut raw.fmt.pix };
    pix.width = wanted.mode.width;
    pix.height = wanted.mode.height;
    pix.pixelformat = u32::from_le_bytes(wanted.fourcc);
    pix.field = v4l2_field_V4L2_FIELD_NONE;
    // SAFETY: VIDIOC_S_FMT reads and writes one v4l2_format.
    unsafe { call(fd, vidioc::VIDIOC_S_FMT, &mut raw)? };
    Ok(checked(&raw))
}

fn checked(raw: &v4l2_format) -> SetFormat {
    // SAFETY: `pix` is the variant of this type of buffer; its integers are valid whatever the bytes are.
    let pix = unsafe { raw.fmt.pix };
    SetFormat {
        coding: Coding::from_fourcc(pix.pixelformat.to_le_bytes()),
        width: pix.width,
        height: pix.height,
        bytes_per_line: pix.bytesperline,
        size_image: pix.sizeimage,
    }
}

/// Asks for a rate; answers the one that the driver set, where it tells.
pub(super) fn set_rate(fd: BorrowedFd<'_>, wanted: Rate) -> io::Result<Option<Rate>> {
    let mut raw = v4l2_streamparm { type_: CAPTURE, ..v4l2_streamparm::zeroed() };
    // SAFETY: VIDIOC_G_PARM reads and writes one v4l2_streamparm.
    unsafe { call(fd, vidioc::VIDIOC_G_PARM, &mut raw)? };
    // SAFETY: `capture` is the variant of this type of buffer; its integers are valid whatever the bytes are.
    let capture = unsafe { &mut raw.parm.capture };
    if capture.capability & V4L2_CAP_TIMEPERFRAME == 0 {
        return Ok(rate(capture.timeperframe));
    }
    capture.timeperframe = v4l2_fract { numerator: wanted.seconds(), denominator: wanted.frames() };
    // SAFETY: VIDIOC_S_PARM reads and writes one v4l2_streamparm.
    unsafe { call(fd, vidioc::VIDIOC_S_PARM, &mut raw)? };
    // SAFETY: as above.
    Ok(rate(unsafe { raw.parm.capture.timeperframe }))
}

/// Sets a control.
pub(super) fn set_control(fd: BorrowedFd<'_>, id: u32, value: i32) -> io::Result<()> {
    // SAFETY: VIDIOC_S_CTRL reads and writes one v4l2_control.
    unsafe { call(fd, vidioc::VIDIOC_S_CTRL, &mut v4l2_control { id, value }) }
}

/// Reads a control.
pub(super) fn control(fd: BorrowedFd<'_>, id: u32) -> io::Result<i32> {
    let mut raw = v4l2_control { id, value: 0 };
    // SAFETY: VIDIOC_G_CTRL reads and writes one v4l2_control.
    unsafe { call(fd, vidioc::VIDIOC_G_CTRL, &mut raw)? };
    Ok(raw.value)
}

/// Asks for `count` buffers in the driver's memory, or gives them up (0); answers how many there are.
pub(super) fn request_buffers(fd: BorrowedFd<'_>, count: u32) -> io::Result<u32> {
    let mut raw = v4l2_requestbuffers {
        count,
        type_: CAPTURE,
        memory: v4l2_memory_V4L2_MEMORY_MMAP,
        ..v4l2_requestbuffers::zeroed()
    };
    // SAFETY: VIDIOC_REQBUFS reads and writes one v4l2_requestbuffers.
    unsafe { call(fd, vidioc::VIDIOC_REQBUFS, &mut raw)? };
    Ok(raw.count)
}

fn buffer(index: u32) -> v4l2_buffer {
    v4l2_buffer { index, type_: CAPTURE, memory: v4l2_memory_V4L2_MEMORY_MMAP, ..v4l2_buffer::zeroed() }
}

/// Where a buffer can be mapped: its offset and its length in bytes.
pub(super) fn query_buffer(fd: BorrowedFd<'_>, index: u32) -> io::Result<(u32, u32)> {
    let mut raw = buffer(index);
    // SAFETY: VIDIOC_QUERYBUF reads and writes one v4l2_buffer, which points to nothing.
    unsafe { call(fd, vidioc::VIDIOC_QUERYBUF, &mut raw)? };
    // SAFETY: `offset` is the variant of memory of this kind; an integer is valid whatever the bytes are.
    Ok((unsafe { raw.m.offset }, raw.length))
}

/// Gives a buffer to the driver.
pub(super) fn queue_buffer(fd: BorrowedFd<'_>, index: u32) -> io::Result<()> {
    // SAFETY: VIDIOC_QBUF reads and writes one v4l2_buffer, which points to nothing.
    unsafe { call(fd, vidioc::VIDIOC_QBUF, &mut buffer(index)) }
}

/// Takes a filled buffer; `None` where none is filled.
pub(super) fn dequeue_buffer(fd: BorrowedFd<'_>) -> io::Result<Option<FilledBuffer>> {
    let mut raw = buffer(0);
    // SAFETY: VIDIOC_DQBUF reads and writes one v4l2_buffer, which points to nothing.
    match unsafe { call(fd, vidioc::VIDIOC_DQBUF, &mut raw) } {
        Err(e) if e.kind() == io::ErrorKind::WouldBlock => return Ok(None),
        done => done?,
    }
    let ns =
        i128::from(raw.timestamp.tv_sec) * i128::from(NS_PER_S) + i128::from(raw.timestamp.tv_usec) * 1000;
    let source = raw.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK;
    Ok(Some(FilledBuffer {
        index: raw.index,
        bytes_used: raw.bytesused as usize,
        damaged: raw.flags & V4L2_BUF_FLAG_ERROR != 0,
        sequence: raw.sequence,
        stamp: BufferStamp {
            time: Time::from_ns(i64::try_from(ns).unwrap_or(i64::MAX)),
            monotonic: raw.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC,
            start_of_exposure: source == V4L2_BUF_FLAG_TSTAMP_SRC_SOE,
        },
    }))
}

/// Starts or stops the stream.
pub(super) fn stream(fd: BorrowedFd<'_>, on: bool) -> io::Result<()> {
    let request = if on { vidioc::VIDIOC_STREAMON } else { vidioc::VIDIOC_STREAMOFF };
    // SAFETY: both read one int, the type of buffer.
    unsafe { call(fd, request, &mut CAPTURE.cast_signed()) }
}

/// Asks to be told when the source of the pictures changes. Most cameras have no such event.
pub(super) fn subscribe_source_change(fd: BorrowedFd<'_>) -> io::Result<()> {
    let mut raw =
        v4l2_event_subscription { type_: V4L2_EVENT_SOURCE_CHANGE, ..v4l2_event_subscription::zeroed() };
    // SAFETY: VIDIOC_SUBSCRIBE_EVENT reads one v4l2_event_subscription.
    unsafe { call(fd, VIDIOC_SUBSCRIBE_EVENT, &mut raw) }
}

/// Takes the waiting events; whether one says that the source changed.
pub(super) fn source_changed(fd: BorrowedFd<'_>) -> bool {
    let mut changed = false;
    for _ in 0..ENTRIES_MAX {
        let mut raw = v4l2_event::zeroed();
        // SAFETY: VIDIOC_DQEVENT writes one v4l2_event.
        if unsafe { call(fd, VIDIOC_DQEVENT, &mut raw) }.is_err() {
            break;
        }
        changed |= raw.type_ == V4L2_EVENT_SOURCE_CHANGE;
    }
    changed
}

/// Resets the USB device whose node (in `/dev/bus/usb`) is open.
pub(super) fn reset_usb(fd: BorrowedFd<'_>) -> io::Result<()> {
    // SAFETY: USBDEVFS_RESET takes no argument; what is passed is not looked at.
    unsafe { call(fd, USBDEVFS_RESET, &mut 0i32) }
}

/// Text of a driver: up to the first zero, whatever its coding.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_of_a_driver_need_not_be_ended_or_utf8() {
        assert_eq!(text(b"uvcvideo\0\0junk"), "uvcvideo");
        assert_eq!(text(b"full"), "full");
        assert_eq!(text(&[b'A', 0xff, 0]), "A\u{fffd}");
    }

    #[test]
    fn numbers_of_requests_are_the_kernels() {
        assert_eq!(number(0, b'U', 20, 0), 0x5514);
        let querycap = number(2, b'V', 0, mem::size_of::<v4l2_capability>());
        assert_eq!(querycap, vidioc::VIDIOC_QUERYCAP);
        // 64-bit layouts of linux/videodev2.h.
        assert_eq!(VIDIOC_DQEVENT, 0x8088_5659);
        assert_eq!(VIDIOC_SUBSCRIBE_EVENT, 0x4020_565a);
    }

    #[test]
    fn what_is_no_video_device_answers_with_an_error() {
        let null = std::fs::File::open("/dev/null").unwrap();
        let fd = std::os::fd::AsFd::as_fd(&null);
        assert!(query_capability(fd).is_err() && format(fd).is_err() && dequeue_buffer(fd).is_err());
        assert!(!source_changed(fd) && reset_usb(fd).is_err());
        assert_eq!(frame_rates(fd, *b"YUYV", 640, 480), Rates::Unknown);
    }
}
