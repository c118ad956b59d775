//! Meaning of the kernel's error numbers for the camera.

use std::io;

use bowwave_core::fault::Fault;
use rustix::io::Errno;

/// Trouble with the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Trouble {
    /// The device is gone.
    Gone,
    /// Somebody else holds it.
    Busy,
    /// The link to it fails.
    Protocol,
    /// The bus has no room for the mode.
    Bandwidth,
    /// The daemon may not open it (or udev has not yet said so).
    Denied,
    /// The queue failed, or anything else that a fresh start may cure.
    Queue,
}

impl Trouble {
    pub(super) fn of(error: &io::Error) -> Self {
        match error.raw_os_error().map(Errno::from_raw_os_error) {
            Some(
                Errno::NODEV | Errno::NXIO | Errno::NOENT | Errno::SHUTDOWN | Errno::NOTTY | Errno::NOTCONN,
            ) => Self::Gone,
            Some(Errno::BUSY) => Self::Busy,
            // What xhci and ehci answer when cable or connector shake: wrong or missing handshakes, stalls, babble.
            Some(
                Errno::PROTO
                | Errno::PIPE
                | Errno::TIMEDOUT
                | Errno::TIME
                | Errno::ILSEQ
                | Errno::OVERFLOW
                | Errno::COMM,
            ) => Self::Protocol,
            Some(Errno::NOSPC) => Self::Bandwidth,
            Some(Errno::ACCESS | Errno::PERM) => Self::Denied,
            _ => Self::Queue,
        }
    }

    /// The fault that it is reported as.
    pub(super) const fn fault(self) -> Fault {
        match self {
            Self::Gone | Self::Denied => Fault::CamLost,
            Self::Busy => Fault::CamBusy,
            Self::Protocol => Fault::CamProtocol,
            Self::Bandwidth => Fault::CamBandwidth,
            Self::Queue => Fault::CamQueue,
        }
    }

    /// Advice on it, for the log.
    pub(super) const fn advice(self) -> &'static str {
        match self {
            Self::Gone => "plug it in again",
            Self::Busy => "close the program that uses it (fuser shows which)",
            Self::Protocol => "check its cable and connector",
            Self::Bandwidth => "give it a USB port of its own, or a smaller or compressed mode",
            Self::Denied => "add the daemon's user to group video",
            Self::Queue => "if it stays so, replug the camera and look at the kernel's log (dmesg)",
        }
    }
}
