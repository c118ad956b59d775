//! One open serial line: raw bytes at a given rate, never waiting.

use std::{
    fs,
    io::{self, ErrorKind},
    os::fd::{AsFd, AsRawFd, BorrowedFd},
    path::{Path, PathBuf},
};

use rustix::{
    fs::{Mode, OFlags, fcntl_getfl, fcntl_setfl},
    io::Errno,
    termios::{InputModes, OptionalActions, tcgetattr, tcsetattr},
};
use serialport::{ClearBuffer, SerialPort as _, TTYPort};

use super::{
    LowLatency, SerialError,
    ioctl::{self, LineErrors},
    list,
};
use crate::nodes;

/// Deviation of the rate that an asynchronous receiver bears, as a divisor: 3 %.
const RATE_TOLERANCE_DIVISOR: u32 = 33;

/// Result of a read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LineRead {
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
pub(super) struct SerialLine {
    port: TTYPort,
    /// The name it was opened by.
    path: PathBuf,
    /// The node behind that name.
    node: PathBuf,
    low_latency: LowLatency,
}

impl SerialLine {
    /// Opens the port at `path`. Bytes from before are discarded. Never waits for a carrier.
    pub(super) fn open(path: &Path, baud: u32, low_latency: bool) -> Result<Self, SerialError> {
        if baud == 0 {
            return Err(SerialError::Baud { baud });
        }
        // A raw line with 8 data bits, no parity, one stop bit and no flow control is what the crate sets where nothing else is asked for.
        let port =
            TTYPort::open(&serialport::new(path.to_string_lossy(), baud)).map_err(|e| open_error(path, e))?;
        let mut line = Self {
            port,
            path: path.to_owned(),
            node: fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()),
            low_latency: LowLatency::NotAsked,
        };
        line.check_rate(baud)?;
        line.adjust().map_err(|e| SerialError::Open { node: path.to_owned(), source: e.into() })?;
        if low_latency {
            line.low_latency = line.ask_low_latency();
        }
        // What came in at another rate, or long ago.
        line.flush();
        Ok(line)
    }

    /// Sets the rate.
    pub(super) fn configure(&mut self, baud: u32) -> Result<(), SerialError> {
        let failed = |e: serialport::Error| SerialError::Open { node: self.path.clone(), source: e.into() };
        self.port.set_baud_rate(baud).map_err(failed)?;
        self.check_rate(baud)
    }

    /// Makes sure that the port took the rate: a UART quietly keeps to what it can.
    fn check_rate(&self, baud: u32) -> Result<(), SerialError> {
        let failed = |e: serialport::Error| SerialError::Open { node: self.path.clone(), source: e.into() };
        let got = self.port.baud_rate().map_err(failed)?;
        if got.abs_diff(baud) > baud / RATE_TOLERANCE_DIVISOR {
            return Err(SerialError::BaudNotTaken { node: self.path.clone(), baud, got });
        }
        Ok(())
    }

    /// Two settings of the crate's that are not ours. Its reads wait and cannot be woken: here a read of nothing says EAGAIN, and 0 bytes
    /// mean that the line hung up. It has the kernel drop broken bytes (IGNPAR): here they are a sign of a wrong rate.
    fn adjust(&self) -> Result<(), Errno> {
        fcntl_setfl(self, fcntl_getfl(self)? | OFlags::NONBLOCK)?;
        let mut settings = tcgetattr(self)?;
        settings.input_modes -= InputModes::IGNPAR;
        tcsetattr(self, OptionalActions::Now, &settings)
    }

    /// Discards what has come in.
    pub(super) fn flush(&self) {
        // Bytes that stay are skipped by the parser.
        let _ = self.port.clear(ClearBuffer::Input);
    }

    fn ask_low_latency(&self) -> LowLatency {
        let flag = ioctl::set_low_latency(self);
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

    /// Reads the bytes that are there now, at most `bytes.len()`.
    pub(super) fn read(&self, bytes: &mut [u8]) -> LineRead {
        match rustix::io::read(self, bytes) {
            Ok(0) | Err(Errno::IO | Errno::NODEV | Errno::NXIO) => LineRead::HungUp,
            Ok(count) => LineRead::Bytes(count),
            Err(Errno::AGAIN | Errno::INTR) => LineRead::Empty,
            Err(e) => LineRead::Failed(e),
        }
    }

    /// The port's own counts, where it keeps some.
    pub(super) fn errors(&self) -> Option<LineErrors> {
        ioctl::line_errors(self).ok()
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

impl AsFd for SerialLine {
    fn as_fd(&self) -> BorrowedFd<'_> {
        // SAFETY: the port owns the descriptor and is borrowed for as long as this: it stays open.
        unsafe { BorrowedFd::borrow_raw(self.port.as_raw_fd()) }
    }
}

/// Why the port could not be opened. The crate tells neither a busy port from one that is locked nor a file of another kind from a
/// failing port: the kernel is asked once more.
fn open_error(path: &Path, error: serialport::Error) -> SerialError {
    let node = path.to_owned();
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let kind = match rustix::fs::open(path, flags, Mode::empty()) {
        Err(errno) => io::Error::from(errno).kind(),
        Ok(_) if error.kind() == serialport::ErrorKind::NoDevice => ErrorKind::ResourceBusy,
        Ok(_) => ErrorKind::Other,
    };
    match kind {
        ErrorKind::NotFound => {
            let present = list().unwrap_or_default();
            let present = nodes::listed(present.iter().map(|p| p.node.display().to_string()));
            SerialError::NotFound { node, present }
        }
        ErrorKind::PermissionDenied => SerialError::Permission { node },
        ErrorKind::ResourceBusy => SerialError::Busy { node },
        _ => SerialError::Open { node, source: error.into() },
    }
}
