//! V4L2 cameras: which are there and what they can deliver ([`list`], [`check`]), and their pictures ([`CameraPort`]).
//!
//! The camera's life is a state machine over a small driver trait, with time as an argument; the driver that asks the kernel
//! is a thin layer under it. Which camera, which mode, when a picture was taken and whether it is worth anything are pure
//! functions.

mod driver;
mod identity;
mod ioctl;
pub mod jpeg;
mod judge;
mod machine;
mod mapping;
mod negotiate;
mod pool;
mod port;
mod settings;
mod status;
mod timing;
mod trouble;
mod v4l2;

use std::{
    fmt, io,
    os::{
        fd::{AsFd, BorrowedFd, OwnedFd},
        unix::ffi::OsStrExt,
    },
    path::{Path, PathBuf},
};

pub use port::{CameraPort, QUEUE_FRAMES};
pub use settings::{CameraSettings, Controls, Exposure, Focus, Rate, WantedMode, WhiteBalance};
pub use status::{CameraCounters, CameraLife, CameraStatus, InUse};

use crate::nodes;

/// How a camera's pictures are coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Coding {
    /// Packed 4:2:2.
    Yuyv,
    /// Planar 4:2:0.
    Nv12,
    /// A JPEG for each picture.
    Mjpeg,
    /// Another, by its four-character code; the trainer cannot use it.
    Other([u8; 4]),
}

impl Coding {
    /// By V4L2's four-character code.
    pub const fn from_fourcc(code: [u8; 4]) -> Self {
        match &code {
            b"YUYV" => Self::Yuyv,
            b"NV12" => Self::Nv12,
            // Drivers use either name for the same bytes.
            b"MJPG" | b"JPEG" => Self::Mjpeg,
            _ => Self::Other(code),
        }
    }

    /// Whether the trainer can show it.
    pub const fn usable(self) -> bool {
        !matches!(self, Self::Other(_))
    }
}

impl fmt::Display for Coding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Yuyv => f.write_str("YUYV"),
            Self::Nv12 => f.write_str("NV12"),
            Self::Mjpeg => f.write_str("MJPEG"),
            Self::Other(code) => write!(f, "{}", code.escape_ascii()),
        }
    }
}

/// A picture size that a camera offers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// This one, pixels.
    Fixed {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// Anything between two sizes, both included.
    Range {
        /// Least width and height, pixels.
        least: (u32, u32),
        /// Greatest width and height, pixels.
        most: (u32, u32),
    },
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed { width, height } => write!(f, "{width}x{height}"),
            Self::Range { least, most } => write!(f, "{}x{} to {}x{}", least.0, least.1, most.0, most.1),
        }
    }
}

/// One coding with its sizes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraMode {
    /// The coding.
    pub coding: Coding,
    /// The sizes that the camera offers in it; empty where the driver does not list them.
    pub sizes: Vec<Size>,
}

/// A camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraInfo {
    /// Its node, such as `/dev/video0`.
    pub node: PathBuf,
    /// A name that survives replugging, where udev gives one.
    pub by_id: Option<PathBuf>,
    /// Its name by the maker.
    pub card: String,
    /// The kernel's driver.
    pub driver: String,
    /// Where it is plugged in.
    pub bus: String,
    /// The modes that it can deliver.
    pub modes: Vec<CameraMode>,
}

/// Why a camera cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CameraError {
    /// No such node.
    #[error(
        "no device {}: cameras here: {present}; plug the camera in, or name one that is there (best by its \
         /dev/v4l/by-id link)",
        node.display()
    )]
    NotFound {
        /// The name asked for.
        node: PathBuf,
        /// Nodes that are there.
        present: String,
    },
    /// The daemon's user may not open it.
    #[error("may not open {}: add the user to group video (usermod -aG video USER), then log in again", node.display())]
    Permission {
        /// The name asked for.
        node: PathBuf,
    },
    /// Something else holds it.
    #[error("{} is in use by another program: close it (fuser {} shows which)", node.display(), node.display())]
    Busy {
        /// The name asked for.
        node: PathBuf,
    },
    /// It is no device that captures video.
    #[error("{} is no video capture device: name the camera's capture node (bowwave doctor lists them)", node.display())]
    NotACamera {
        /// The name asked for.
        node: PathBuf,
    },
    /// It delivers nothing that the trainer can show.
    #[error("{} ({card}) delivers {offered}; the trainer needs YUYV, NV12 or MJPEG: use another camera", node.display())]
    NoUsableFormat {
        /// The name asked for.
        node: PathBuf,
        /// Its name by the maker.
        card: String,
        /// The codings that it offers.
        offered: String,
    },
    /// The settings cannot be right.
    #[error("camera settings: {what}")]
    Settings {
        /// The setting that is wrong, and what to give instead.
        what: String,
    },
    /// The camera's thread could not be started.
    #[error("cannot start the camera's thread: {source}; are too many processes running?")]
    Thread {
        /// The kernel's answer.
        source: io::Error,
    },
    /// A call into the kernel does not return.
    #[error("the camera's driver does not return: replug the camera, then look at the kernel's log (dmesg)")]
    Blocked,
    /// The camera's thread panicked: a defect of this program.
    #[error("the camera's thread broke down: report it with the log")]
    BrokeDown,
    /// The kernel reports something else.
    #[error("{}: cannot {what}: {source}; replug the camera, then look at the kernel's log (dmesg)", node.display())]
    Io {
        /// The name asked for.
        node: PathBuf,
        /// The attempt that failed.
        what: &'static str,
        /// The kernel's answer.
        source: io::Error,
    },
}

crate::worker::tells_of_threads!(CameraError);

/// Every camera of this computer: its description, or why it cannot be opened. Nodes that capture no video (metadata,
/// outputs, codecs) are left out.
pub fn list() -> Vec<Result<CameraInfo, CameraError>> {
    list_in(Path::new("/dev"))
}

fn list_in(dev: &Path) -> Vec<Result<CameraInfo, CameraError>> {
    let nodes = match nodes::numbered(dev, "video") {
        Ok(nodes) => nodes,
        Err(source) => {
            return vec![Err(CameraError::Io { node: dev.to_owned(), what: "list devices", source })];
        }
    };
    nodes
        .iter()
        .map(|node| describe(dev, node))
        .filter(|found| !matches!(found, Err(CameraError::NotACamera { .. })))
        .collect()
}

/// Opens the camera at `node` (a node or a link to one) and describes it; an error where it is not there, cannot be
/// opened, captures nothing or has none of the codings that the trainer can show.
pub fn check(node: &Path) -> Result<CameraInfo, CameraError> {
    check_in(Path::new("/dev"), node)
}

fn check_in(dev: &Path, node: &Path) -> Result<CameraInfo, CameraError> {
    let info = describe(dev, node)?;
    if info.modes.iter().any(|mode| mode.coding.usable()) {
        return Ok(info);
    }
    let offered = nodes::listed(info.modes.iter().map(|mode| mode.coding.to_string()));
    Err(CameraError::NoUsableFormat { node: info.node, card: info.card, offered })
}

fn describe(dev: &Path, node: &Path) -> Result<CameraInfo, CameraError> {
    let device = open(dev, node)?;
    let not_a_camera = || CameraError::NotACamera { node: node.to_owned() };
    let io = |what| move |source| CameraError::Io { node: node.to_owned(), what, source };
    let device = device.as_fd();
    let capability = match ioctl::query_capability(device) {
        Ok(capability) if capability.captures => capability,
        Ok(_) => return Err(not_a_camera()),
        // ENOTTY: a file or a device of another kind.
        Err(e) if e.raw_os_error() == Some(rustix::io::Errno::NOTTY.raw_os_error()) => {
            return Err(not_a_camera());
        }
        Err(e) => return Err(io("ask what it is")(e)),
    };
    let codes = ioctl::capture_formats(device).map_err(io("list its formats"))?;
    let modes = codes.into_iter().map(|code| mode(device, code)).collect();
    Ok(CameraInfo {
        node: node.to_owned(),
        by_id: nodes::link_to(&dev.join("v4l/by-id"), node),
        card: capability.card,
        driver: capability.driver,
        bus: capability.bus,
        modes,
    })
}

fn mode(device: BorrowedFd<'_>, code: [u8; 4]) -> CameraMode {
    // Some drivers list no sizes: then they are unknown, not none.
    CameraMode {
        coding: Coding::from_fourcc(code),
        sizes: ioctl::frame_sizes(device, code).unwrap_or_default(),
    }
}

fn open(dev: &Path, node: &Path) -> Result<OwnedFd, CameraError> {
    let not_found = || {
        let present = nodes::numbered(dev, "video").unwrap_or_default();
        CameraError::NotFound {
            node: node.to_owned(),
            present: nodes::listed(present.iter().map(|p| p.display().to_string())),
        }
    };
    if node.as_os_str().as_bytes().contains(&0) {
        return Err(not_found());
    }
    v4l2::open_node(node).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => not_found(),
        io::ErrorKind::PermissionDenied => CameraError::Permission { node: node.to_owned() },
        io::ErrorKind::ResourceBusy => CameraError::Busy { node: node.to_owned() },
        io::ErrorKind::IsADirectory => CameraError::NotACamera { node: node.to_owned() },
        _ => CameraError::Io { node: node.to_owned(), what: "open it", source },
    })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_camera_that_is_not_there_is_named_with_those_that_are() {
        let dev = tempfile::tempdir().expect("temporary folder");
        fs::write(dev.path().join("video2"), []).expect("file");
        let node = dev.path().join("video7");
        let message = check_in(dev.path(), &node).expect_err("not there").to_string();
        assert!(message.starts_with(&format!("no device {}: cameras here: ", node.display())), "{message}");
        assert!(message.contains("video2") && message.contains("plug the camera in"), "{message}");
        assert!(matches!(check(Path::new("/dev/video\0")), Err(CameraError::NotFound { .. })));
    }

    #[test]
    fn what_is_no_camera_is_said_to_be_none_and_not_listed() {
        let dev = tempfile::tempdir().expect("temporary folder");
        let node = dev.path().join("video0");
        fs::write(&node, []).expect("file");
        assert!(matches!(check_in(dev.path(), &node), Err(CameraError::NotACamera { .. })));
        assert!(matches!(check_in(dev.path(), dev.path()), Err(CameraError::NotACamera { .. })));
        assert!(matches!(check(Path::new("/dev/null")), Err(CameraError::NotACamera { .. })));
        assert!(list_in(dev.path()).is_empty());
        let absent = dev.path().join("absent");
        assert!(matches!(list_in(&absent)[..], [Err(CameraError::Io { what: "list devices", .. })]));
    }

    #[test]
    fn codings_by_their_codes() {
        let codes = [*b"YUYV", *b"NV12", *b"MJPG", *b"JPEG", *b"H264"];
        let names: Vec<_> = codes.map(|c| Coding::from_fourcc(c).to_string()).into();
        assert_eq!(names, ["YUYV", "NV12", "MJPEG", "MJPEG", "H264"]);
        assert!(!Coding::from_fourcc(*b"H264").usable());
    }

    /// Whatever cameras the machine under test has, each must be described or refused in words.
    #[test]
    fn the_cameras_of_this_machine_are_listed() {
        for found in list() {
            match found {
                Ok(camera) => assert!(!camera.card.is_empty(), "{camera:?}"),
                Err(e) => assert!(e.to_string().contains("/dev"), "{e}"),
            }
        }
    }
}
