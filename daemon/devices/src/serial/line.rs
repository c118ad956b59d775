//! One open serial line: raw bytes at a given rate, never waiting.

use std::{
    fs,
    io::{self, ErrorKind},
    os::fd::{AsFd, BorrowedFd, OwnedFd},
    path::{Path, PathBuf},
};

use rustix::{
    fs::{Mode, OFlags},
    io::Errno,
    termios::{
        ControlModes, InputModes, OptionalActions, QueueSelector, SpecialCodeIndex, ioctl_tiocexcl, isatty,
        tcflush, tcgetattr, tcsetattr,
    },
};

use super::{
    LowLatency, SerialError,
    ioctl::{self, LineErrors},
    list,
};
use crate::nodes;

/// Deviation of the rate that an asynchronous receiver bears, as a divisor: 3 %.
const RATE_TOLERANCE_DIVISOR: u32 = 33;

/// What a read gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Read {
    /// So many bytes.
    Bytes(usize),
    /// Nothing is there now.
    Empty,
    /// The port is gone or its far end closed.
    HungUp,
    /// The kernel refuses.
    Failed(Errno),
}

/// A serial port opened for this program alone: 8 data bits, no parity, one stop bit, no flow control.
#[derive(Debug)]
pub(super) struct Line {
    fd: OwnedFd,
    /// The name it was opened by.
    path: PathBuf,
    /// The node behind that name.
    node: PathBuf,
    low_latency: LowLatency,
}

impl Line {
    /// Opens the port at `path`. Bytes from before are discarded. Never waits for a carrier.
    pub(super) fn open(path: &Path, baud: u32, low_latency: bool) -> Result<Self, SerialError> {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let fd = rustix::fs::open(path, flags, Mode::empty()).map_err(|e| open_error(path, e))?;
        if !isatty(&fd) {
            return Err(open_error(path, Errno::NOTTY));
        }
        ioctl_tiocexcl(&fd).map_err(|e| open_error(path, e))?;
        let mut line = Self {
            fd,
            path: path.to_owned(),
            node: fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()),
            low_latency: LowLatency::NotAsked,
        };
        line.configure(baud)?;
        if low_latency {
            line.low_latency = line.ask_low_latency();
        }
        // What came in at another rate, or long ago.
        tcflush(&line.fd, QueueSelector::IFlush).map_err(|e| open_error(path, e))?;
        Ok(line)
    }

    /// Sets the rate and raw mode, and makes sure that the port took the rate: a UART quietly keeps to what it can.
    pub(super) fn configure(&self, baud: u32) -> Result<(), SerialError> {
        let failed = |e| open_error(&self.path, e);
        let mut settings = tcgetattr(&self.fd).map_err(failed)?;
        settings.make_raw();
        settings.control_modes |= ControlModes::CREAD | ControlModes::CLOCAL;
        settings.control_modes -= ControlModes::CSTOPB | ControlModes::CRTSCTS;
        settings.input_modes -= InputModes::IXOFF;
        // A read of nothing then says EAGAIN, and 0 bytes mean that the line hung up.
        settings.special_codes[SpecialCodeIndex::VMIN] = 1;
        settings.special_codes[SpecialCodeIndex::VTIME] = 0;
        settings.set_speed(baud).map_err(|_| SerialError::Baud { baud })?;
        tcsetattr(&self.fd, OptionalActions::Now, &settings).map_err(failed)?;
        let got = tcgetattr(&self.fd).map_err(failed)?.input_speed();
        if got.abs_diff(baud) > baud / RATE_TOLERANCE_DIVISOR {
            return Err(SerialError::BaudNotTaken { node: self.path.clone(), baud, got });
        }
        Ok(())
    }

    /// Discards what has come in.
    pub(super) fn flush(&self) {
        // Bytes that stay are skipped by the parser.
        let _ = tcflush(&self.fd, QueueSelector::IFlush);
    }

    fn ask_low_latency(&self) -> LowLatency {
        let flag = ioctl::set_low_latency(&self.fd);
        // FTDI adapters hold bytes back for this many milliseconds; the flag sets 1 ms where the driver heeds it.
        if let Some(name) = self.node.file_name() {
            let timer = Path::new("/sys/class/tty").join(name).join("device/latency_timer");
            if fs::write(&timer, "1").is_ok() {
                return LowLatency::Set;
            }
            if fs::read_to_string(&timer).is_ok_and(|text| text.trim() == "1") {
                return LowLatency::Set;
            }
        }
        match flag {
            Ok(true) => LowLatency::Set,
            Ok(false) | Err(Errno::NOTTY | Errno::INVAL | Errno::OPNOTSUPP) => LowLatency::NotOffered,
            Err(_) => LowLatency::Refused,
        }
    }

    /// What is there now, at most `bytes.len()` bytes.
    pub(super) fn read(&self, bytes: &mut [u8]) -> Read {
        match rustix::io::read(&self.fd, bytes) {
            Ok(0) | Err(Errno::IO | Errno::NODEV | Errno::NXIO) => Read::HungUp,
            Ok(count) => Read::Bytes(count),
            Err(Errno::AGAIN | Errno::INTR) => Read::Empty,
            Err(e) => Read::Failed(e),
        }
    }

    /// The port's own counts, where it keeps some.
    pub(super) fn errors(&self) -> Option<LineErrors> {
        ioctl::line_errors(&self.fd).ok()
    }

    /// The name that it was opened by.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The node behind that name.
    pub(super) fn node(&self) -> &Path {
        &self.node
    }

    /// Whether the adapter was asked to hand bytes on at once.
    pub(super) const fn low_latency(&self) -> LowLatency {
        self.low_latency
    }
}

impl AsFd for Line {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}

fn open_error(path: &Path, errno: Errno) -> SerialError {
    let source = io::Error::from(errno);
    let node = path.to_owned();
    match source.kind() {
        ErrorKind::NotFound => {
            let present = list().unwrap_or_default();
            let present = nodes::listed(present.iter().map(|p| p.node.display().to_string()));
            SerialError::NotFound { node, present }
        }
        ErrorKind::PermissionDenied => SerialError::Permission { node },
        ErrorKind::ResourceBusy => SerialError::Busy { node },
        _ => SerialError::Open { node, source },
    }
}
