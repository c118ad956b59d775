//! Waiting in a device's thread.

use std::{
    io,
    os::fd::{AsFd, BorrowedFd, OwnedFd},
};

use rustix::{
    event::{EventfdFlags, PollFd, PollFlags, eventfd, poll},
    io::Errno,
    time::Timespec,
};

use bowwave_core::time::NS_PER_S;

/// Wakes a thread that waits for files, from any thread.
#[derive(Debug)]
pub(crate) struct WakeEvent(OwnedFd);

impl WakeEvent {
    pub(crate) fn new() -> io::Result<Self> {
        Ok(Self(eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?))
    }

    /// Ends every wait from now on, until [`Self::clear`].
    pub(crate) fn notify(&self) {
        // It can fail only where it was notified more often than can be counted: then the waits have ended all the same.
        let _ = rustix::io::write(&self.0, &1u64.to_ne_bytes());
    }

    /// Takes the notifications back; whether there was one.
    pub(crate) fn clear(&self) -> bool {
        rustix::io::read(&self.0, &mut [0u8; 8]).is_ok()
    }

    /// Waits until one of `files` is ready for one of `wanted` or has hung up, for a notification, or for `ns` nanoseconds. Gives what
    /// each of `files` is ready for.
    pub(crate) fn wait(
        &self,
        files: &[BorrowedFd<'_>],
        wanted: PollFlags,
        ns: i64,
    ) -> Result<Vec<PollFlags>, Errno> {
        let ns = ns.max(0);
        let timeout = Timespec { tv_sec: ns / NS_PER_S, tv_nsec: ns % NS_PER_S };
        let all = files.iter().map(|fd| PollFd::from_borrowed_fd(*fd, wanted));
        let mut polled: Vec<_> =
            all.chain([PollFd::from_borrowed_fd(self.0.as_fd(), PollFlags::IN)]).collect();
        match poll(&mut polled, Some(&timeout)) {
            // A poll that was interrupted says nothing of its files.
            Err(Errno::INTR) => Ok(vec![PollFlags::empty(); files.len()]),
            Ok(_) => Ok(polled.iter().take(files.len()).map(PollFd::revents).collect()),
            Err(e) => Err(e),
        }
    }
}
