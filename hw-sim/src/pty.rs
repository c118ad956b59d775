//! A pseudo-terminal in place of the inertial unit's serial adapter.

use std::{ffi::OsString, io, os::fd::OwnedFd, os::unix::ffi::OsStringExt, path::PathBuf};

use rustix::{
    fs::{OFlags, fcntl_setfl},
    io::Errno,
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
};

/// The unit's end of a pseudo-terminal. Dropping it hangs up.
#[derive(Debug)]
pub struct Terminal {
    master: OwnedFd,
    slave: PathBuf,
}

impl Terminal {
    /// A new pseudo-terminal. Open its slave as a serial port before anything is sent: until then the terminal echoes.
    pub fn open() -> io::Result<Self> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let slave = ptsname(&master, Vec::new())?;
        // A serial adapter does not wait for its reader.
        fcntl_setfl(&master, OFlags::RDWR | OFlags::NONBLOCK)?;
        Ok(Self { master, slave: PathBuf::from(OsString::from_vec(slave.into_bytes())) })
    }

    /// The path that a serial port is opened by.
    pub fn slave(&self) -> &std::path::Path {
        &self.slave
    }

    /// Sends what the line takes without waiting; the number of bytes that it did not take, which are lost as on a line
    /// whose reader is too slow.
    pub fn send(&self, bytes: &[u8]) -> io::Result<usize> {
        let mut rest = bytes;
        while !rest.is_empty() {
            match rustix::io::write(&self.master, rest) {
                Ok(count) => rest = rest.get(count..).unwrap_or_default(),
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => break,
                Err(e) => return Err(e.into()),
            }
        }
        Ok(rest.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_nobody_reads_loses_bytes_but_never_blocks() {
        let terminal = Terminal::open().expect("a pseudo-terminal");
        assert!(terminal.slave().starts_with("/dev"));
        // Raw, so that the terminal neither echoes nor translates.
        let reader = bowwave_devices::serial::ImuPort::open(terminal.slave(), 115_200).expect("opens");
        reader.stop().expect("stops");
        let slave = std::fs::File::open(terminal.slave()).expect("opens");
        let lost = terminal.send(&vec![0x55; 1 << 20]).expect("sent");
        assert!(lost > 0 && lost < 1 << 20, "{lost}");
        drop(slave);
    }
}
