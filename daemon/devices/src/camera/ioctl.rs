//! Typed calls of V4L2. The `v4l` crate's own wrappers of these two panic where a driver's text is not UTF-8.

use std::{io, mem};

use v4l::{
    Device,
    v4l_sys::{v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE, v4l2_capability, v4l2_fmtdesc},
    v4l2::{self, vidioc},
};

/// More formats than any camera has; bounds the loop against a driver that never ends its list.
const FORMATS_MAX: u32 = 64;

/// What `VIDIOC_QUERYCAP` says.
pub(super) struct Capability {
    pub driver: String,
    pub card: String,
    pub bus: String,
    /// Can deliver pictures through the single-planar API.
    pub captures: bool,
}

/// Asks the device what it is.
pub(super) fn query_capability(device: &Device) -> io::Result<Capability> {
    const VIDEO_CAPTURE: u32 = 0x0000_0001;
    const STREAMING: u32 = 0x0400_0000;
    const HAS_DEVICE_CAPS: u32 = 0x8000_0000;
    // SAFETY: v4l2_capability is plain bytes and integers, for which zero is valid.
    let mut raw: v4l2_capability = unsafe { mem::zeroed() };
    // SAFETY: the descriptor is open as long as `device`; VIDIOC_QUERYCAP writes one v4l2_capability to the pointer, which
    // is valid for that.
    unsafe { v4l2::ioctl(device.handle().fd(), vidioc::VIDIOC_QUERYCAP, (&raw mut raw).cast())? };
    let flags = if raw.capabilities & HAS_DEVICE_CAPS != 0 { raw.device_caps } else { raw.capabilities };
    Ok(Capability {
        driver: text(&raw.driver),
        card: text(&raw.card),
        bus: text(&raw.bus_info),
        captures: flags & VIDEO_CAPTURE != 0 && flags & STREAMING != 0,
    })
}

/// The four-character codes that the device can deliver.
pub(super) fn capture_formats(device: &Device) -> io::Result<Vec<[u8; 4]>> {
    let mut formats = Vec::new();
    for index in 0..FORMATS_MAX {
        // SAFETY: v4l2_fmtdesc is plain bytes and integers, for which zero is valid.
        let mut raw: v4l2_fmtdesc = unsafe { mem::zeroed() };
        raw.index = index;
        raw.type_ = v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE;
        // SAFETY: the descriptor is open as long as `device`; VIDIOC_ENUM_FMT reads and writes one v4l2_fmtdesc at the
        // pointer, which is valid for both.
        match unsafe { v4l2::ioctl(device.handle().fd(), vidioc::VIDIOC_ENUM_FMT, (&raw mut raw).cast()) } {
            Ok(()) => formats.push(raw.pixelformat.to_le_bytes()),
            // EINVAL ends the list.
            Err(e) if e.kind() == io::ErrorKind::InvalidInput => break,
            Err(e) => return Err(e),
        }
    }
    Ok(formats)
}

/// Text of a driver: up to the first zero, whatever its coding.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

#[cfg(test)]
mod tests {
    #[test]
    fn text_of_a_driver_need_not_be_ended_or_utf8() {
        assert_eq!(super::text(b"uvcvideo\0\0junk"), "uvcvideo");
        assert_eq!(super::text(b"full"), "full");
        assert_eq!(super::text(&[b'A', 0xff, 0]), "A\u{fffd}");
    }
}
