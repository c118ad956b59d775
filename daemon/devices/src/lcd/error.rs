//! Why nothing is shown, and what to do about it.

use std::{io, path::PathBuf};

use rustix::io::Errno;

/// Why a display cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LcdError {
    /// The daemon's user may not open it.
    #[error("may not open {}: add the user to group video (usermod -aG video USER), then log in again", node.display())]
    Permission {
        /// The card.
        node: PathBuf,
    },
    /// The kernel has no display driver for anything in this computer.
    #[error(
        "no display card in /dev/dri: load its kernel driver (dmesg | grep drm), or enable it in the firmware"
    )]
    NoCard,
    /// The configured card is not there.
    #[error("no display card {}: cards here: {present}; name one that is there", node.display())]
    NotFound {
        /// The name asked for.
        node: PathBuf,
        /// Cards that are there.
        present: String,
    },
    /// It drives no display: a GPU that only computes, or no DRM node at all.
    #[error("{} drives no display ({source}): name another card in [screen] (bowwave doctor lists them)", node.display())]
    NoDisplays {
        /// The card.
        node: PathBuf,
        /// The kernel's answer.
        source: io::Error,
    },
    /// The driver offers no buffers that a processor can draw in, or the kernel is older than 4.12.
    #[error("the driver of {} has no {what}: use another display card or a kernel not older than 4.12", node.display())]
    Unsupported {
        /// The card.
        node: PathBuf,
        /// The thing that is missing.
        what: &'static str,
    },
    /// Another program is master of the card.
    #[error("{} is in use by another program: stop the desktop or boot screen on it (systemctl stop display-manager plymouth)", node.display())]
    InUse {
        /// The card.
        node: PathBuf,
    },
    /// The configured connector does not exist.
    #[error("{} has no connector {name}: it has {present}; name one of them", node.display())]
    NoConnector {
        /// The card.
        node: PathBuf,
        /// The name asked for.
        name: String,
        /// Connectors that are there.
        present: String,
    },
    /// No display is plugged in.
    #[error("no display on {names} of {}: check its cable and its power", node.display())]
    NotConnected {
        /// The card.
        node: PathBuf,
        /// The connectors looked at.
        names: String,
    },
    /// The display or its driver offers no usable mode.
    #[error("the display on {name} of {} offers no mode: check its cable, or give the kernel one (video={name}:800x480@60)", node.display())]
    NoMode {
        /// The card.
        node: PathBuf,
        /// The connector.
        name: String,
    },
    /// No scan-out engine of the card is free for the connector.
    #[error("no {what} of {} can serve {name}: unplug another display, or use another connector", node.display())]
    NoPath {
        /// The card.
        node: PathBuf,
        /// The connector.
        name: String,
        /// The thing that is missing.
        what: &'static str,
    },
    /// The card is gone.
    #[error("{} is gone: check the card's seat or its driver (dmesg)", node.display())]
    Gone {
        /// The card.
        node: PathBuf,
    },
    /// The kernel reports something else.
    #[error("cannot {what} on {}: {source}; look at the kernel's log (dmesg | grep drm)", node.display())]
    Io {
        /// The card.
        node: PathBuf,
        /// The attempt that failed.
        what: &'static str,
        /// The kernel's answer.
        source: io::Error,
    },
    /// A flip was accepted and never happened.
    #[error("{} swallowed a picture: no flip within 3 s; look at the kernel's log (dmesg | grep flip_done)", node.display())]
    FlipOverdue {
        /// The card.
        node: PathBuf,
    },
    /// The port's thread cannot be made.
    #[error("cannot start the display's thread: {0}; close other programs")]
    Thread(io::Error),
    /// The port's thread ended by a defect.
    #[error("the display's thread ended by itself: restart the program and report the log")]
    ThreadDied,
}

impl LcdError {
    /// The kernel's answer to an attempt at `what` on `node`, in words.
    pub(super) fn of(node: &std::path::Path, what: &'static str, source: io::Error) -> Self {
        let node = node.to_owned();
        match Errno::from_io_error(&source) {
            Some(Errno::NODEV | Errno::NXIO) => Self::Gone { node },
            Some(Errno::ACCESS | Errno::PERM) => Self::InUse { node },
            _ => Self::Io { node, what, source },
        }
    }
}
