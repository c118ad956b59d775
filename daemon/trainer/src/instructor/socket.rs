//! The socket that the trainer listens on.

use std::{
    fs,
    io::{self, ErrorKind},
    os::{
        fd::AsFd,
        unix::{
            fs::{FileTypeExt, PermissionsExt},
            net::{UnixListener, UnixStream},
        },
    },
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
    time::Duration,
};

use anyhow::{Context, Result, bail};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::{Serving, connection::Connection};

/// How often the thread looks whether it is to end.
const PATIENCE: Duration = Duration::from_millis(100);
/// Owner and group may connect: the group is that of the instructor's process.
const MODE: u32 = 0o660;

/// A socket that is listened on. Its file goes with it.
pub(super) struct Socket {
    listener: UnixListener,
    path: PathBuf,
}

impl Socket {
    /// Makes the socket. One that a trainer which has ended left behind is replaced.
    pub(super) fn bind(path: &Path) -> Result<Self> {
        let at = || format!("cannot make the instructor's socket {}", path.display());
        if let Ok(there) = fs::symlink_metadata(path) {
            if !there.file_type().is_socket() {
                bail!("{}: something that is no socket is there; give another path", at());
            }
            match UnixStream::connect(path) {
                Ok(_) => bail!("{}: another trainer listens there; end it, or give another path", at()),
                Err(_) => fs::remove_file(path).with_context(at)?,
            }
        }
        let made = UnixListener::bind(path).and_then(|listener| {
            listener.set_nonblocking(true)?;
            fs::set_permissions(path, fs::Permissions::from_mode(MODE))?;
            Ok(listener)
        });
        let listener = made.with_context(|| format!("{}; is its folder there, and yours to write?", at()))?;
        Ok(Self { listener, path: path.to_owned() })
    }

    /// Serves one connection at a time, the newest, until `stop`.
    pub(super) fn serve(self, serving: &Serving, stop: &AtomicBool) {
        let mut current: Option<Connection> = None;
        while !stop.load(Ordering::Relaxed) {
            if let Some(stream) = self.next() {
                // One that hangs must not keep out the process that replaces it.
                drop(current.take());
                current = Connection::start(stream, serving.clone())
                    .inspect_err(|e| log::warn!("the instructor's connection could not be served: {e}"))
                    .ok();
            }
            if current.as_ref().is_some_and(Connection::has_ended) {
                current = None;
            }
        }
    }

    /// A connection, if one comes within a moment.
    fn next(&self) -> Option<UnixStream> {
        let timeout = Timespec { tv_sec: 0, tv_nsec: PATIENCE.as_nanos() as i64 };
        let mut polled = [PollFd::from_borrowed_fd(self.listener.as_fd(), PollFlags::IN)];
        match poll(&mut polled, Some(&timeout)) {
            Ok(0) => return None,
            Ok(_) => {}
            Err(_) => std::thread::sleep(PATIENCE),
        }
        match self.listener.accept() {
            Ok((stream, _)) => stream.set_nonblocking(false).map(|()| stream).ok(),
            Err(e) if e.kind() == ErrorKind::WouldBlock => None,
            Err(e) => {
                log::debug!("the instructor's socket: {e}");
                // As where there are too many files open: not at once again.
                std::thread::sleep(PATIENCE);
                None
            }
        }
    }
}

impl Drop for Socket {
    fn drop(&mut self) {
        let removed: io::Result<()> = fs::remove_file(&self.path);
        if let Err(e) = removed {
            log::debug!("{} stays: {e}", self.path.display());
        }
    }
}
