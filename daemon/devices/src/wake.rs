//! Waiting in a device's thread, and ending it.

use std::{
    io,
    os::fd::{AsFd, BorrowedFd, OwnedFd},
    thread::JoinHandle,
};

use rustix::{
    event::{EventfdFlags, PollFd, PollFlags, eventfd, poll},
    io::Errno,
    time::Timespec,
};

use crate::clock;

/// Wakes a thread that waits for files.
#[derive(Debug)]
pub(crate) struct Wake(OwnedFd);

impl Wake {
    pub(crate) fn new() -> io::Result<Self> {
        Ok(Self(eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?))
    }

    /// Ends every wait from now on.
    pub(crate) fn notify(&self) {
        // It can fail only where it was notified more often than can be counted: then the waits have ended all the same.
        let _ = rustix::io::write(&self.0, &1u64.to_ne_bytes());
    }

    /// Waits at most `ns` nanoseconds (less than a second). A poll that cannot be made is no reason to run busily.
    pub(crate) fn pause(&self, ns: i64) {
        if self.wait(&[], ns).is_err() {
            clock::sleep_until(clock::now().plus_ns(ns));
        }
    }

    /// Waits until one of `files` can be read or has hung up, for the wake, or for `ns` nanoseconds (less than a second).
    /// Gives what each of `files` is ready for.
    pub(crate) fn wait(&self, files: &[BorrowedFd<'_>], ns: i64) -> Result<Vec<PollFlags>, Errno> {
        let timeout = Timespec { tv_sec: 0, tv_nsec: ns.clamp(0, 999_999_999) };
        let all = files.iter().copied().chain([self.0.as_fd()]);
        let mut polled: Vec<_> = all.map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN)).collect();
        match poll(&mut polled, Some(&timeout)) {
            // A poll that was interrupted says nothing of its files.
            Err(Errno::INTR) => Ok(vec![PollFlags::empty(); files.len()]),
            Ok(_) => Ok(polled.iter().take(files.len()).map(PollFd::revents).collect()),
            Err(e) => Err(e),
        }
    }
}

/// How threads ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ended {
    /// As asked.
    Well,
    /// One panicked.
    BrokeDown,
    /// One did not end in time: it hangs in the kernel and is left behind.
    NotInTime,
}

/// Waits for threads that were asked to end.
pub(crate) fn join_within(threads: Vec<JoinHandle<()>>, ns: i64) -> Ended {
    let end = clock::now().plus_ns(ns);
    while threads.iter().any(|t| !t.is_finished()) {
        let now = clock::now();
        if now >= end {
            return Ended::NotInTime;
        }
        clock::sleep_until(now.plus_ns(1_000_000));
    }
    let failed = threads.into_iter().map(JoinHandle::join).filter(Result::is_err).count();
    if failed > 0 { Ended::BrokeDown } else { Ended::Well }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[test]
    fn a_wait_ends_with_the_wake_or_the_time() {
        let wake = Arc::new(Wake::new().unwrap());
        let begin = clock::now();
        wake.pause(20_000_000);
        assert!(clock::now().ns_since(begin) >= 20_000_000);
        let other = Arc::clone(&wake);
        let thread = std::thread::spawn(move || {
            let begin = clock::now();
            other.pause(900_000_000);
            assert!(clock::now().ns_since(begin) < 800_000_000);
        });
        wake.notify();
        assert_eq!(join_within(vec![thread], 800_000_000), Ended::Well);
        assert_eq!(
            join_within(vec![std::thread::spawn(|| panic!("on purpose"))], 800_000_000),
            Ended::BrokeDown
        );
    }

    #[test]
    fn a_thread_that_hangs_is_left_behind() {
        let slow = std::thread::spawn(|| clock::sleep_until(clock::now().plus_ns(300_000_000)));
        assert_eq!(join_within(vec![slow], 10_000_000), Ended::NotInTime);
    }
}
