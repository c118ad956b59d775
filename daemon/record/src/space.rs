//! Space on the disk: pictures stop before hits do.

use std::{
    convert::Infallible,
    io,
    path::Path,
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

use crossbeam_channel::{RecvTimeoutError, Sender, bounded};
use rustix::fs::{StatVfs, StatVfsMountFlags, statvfs};

/// Bytes that an unprivileged program may still write to the file system of `path`, a file or its folder.
pub fn free_bytes(path: &Path) -> io::Result<u64> {
    let status = status(path)?;
    Ok(status.f_bavail.saturating_mul(status.f_frsize))
}

fn status(path: &Path) -> io::Result<StatVfs> {
    let status = statvfs(path).or_else(|error| match path.parent() {
        Some(parent) if error == rustix::io::Errno::NOENT => {
            statvfs(if parent.as_os_str().is_empty() { Path::new(".") } else { parent })
        }
        _ => Err(error),
    })?;
    Ok(status)
}

/// How often the file system is asked.
const EVERY: Duration = Duration::from_secs(1);

/// How long the first answer is waited for.
const FIRST_WITHIN: Duration = Duration::from_millis(500);

/// Whether there is room for more than hits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Room {
    /// Pictures may be recorded.
    Enough,
    /// Too little for a recording: the rest is kept for hits.
    Low {
        /// Bytes that are free.
        free_bytes: u64,
    },
    /// Nothing can be written: the kernel does that to a file system whose disk fails.
    ReadOnly,
}

/// Says when the space gets low, with hysteresis: low below the limit, enough again from twice the limit on.
///
/// A thread asks the file system: one behind a network or a failing disk may not answer, and nobody waits for it.
#[derive(Debug)]
pub struct SpaceWatch {
    room: Arc<Mutex<Room>>,
    /// Never carries anything; its end tells the thread to finish.
    _open: Sender<Infallible>,
}

impl SpaceWatch {
    /// Bytes below which recording pictures stops, unless told otherwise.
    pub const LIMIT_BYTES: u64 = 256 << 20;

    /// Watches the file system of `path`, a file or its folder. The space is low below `limit_bytes`, but never above one `part`-th of the
    /// file system. The first answer is waited for, half a second at most.
    pub fn new(path: &Path, limit_bytes: u64, part: u64) -> Self {
        let path = path.to_path_buf();
        Self::start(limit_bytes, part, move || {
            status(&path).inspect_err(|error| log::debug!("free space at {}: {error}", path.display()))
        })
    }

    fn start(limit_bytes: u64, part: u64, ask: impl Fn() -> io::Result<StatVfs> + Send + 'static) -> Self {
        let told = Arc::new(Mutex::new(Room::Enough));
        let room = Arc::clone(&told);
        let (open, closing) = bounded::<Infallible>(0);
        let (answered, first) = bounded(1);
        let watch = move || {
            loop {
                if let Ok(status) = ask() {
                    let mut room = room.lock().unwrap_or_else(PoisonError::into_inner);
                    *room = next(*room, &status, limit(&status, limit_bytes, part));
                }
                // Nobody but the start listens.
                let _ = answered.try_send(());
                if closing.recv_timeout(EVERY).is_err_and(|error| error == RecvTimeoutError::Disconnected) {
                    return;
                }
            }
        };
        match std::thread::Builder::new().name("space".to_owned()).spawn(watch) {
            Ok(_) => {
                if first.recv_timeout(FIRST_WITHIN).is_err() {
                    log::warn!("the file system does not say how much is free; check the disk");
                }
            }
            Err(error) => log::warn!("nobody watches the free space: no thread for it: {error}"),
        }
        Self { room: told, _open: open }
    }

    /// The room as the file system said last, at most a second ago if it answers. One that does not answer changes nothing: writing will
    /// say what is wrong with it.
    pub fn room(&self) -> Room {
        *self.room.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Free bytes below which the space is low.
fn limit(status: &StatVfs, limit_bytes: u64, part: u64) -> u64 {
    limit_bytes.min(status.f_blocks.saturating_mul(status.f_frsize) / part.max(1))
}

fn next(room: Room, status: &StatVfs, limit_bytes: u64) -> Room {
    if status.f_flag.contains(StatVfsMountFlags::RDONLY) {
        return Room::ReadOnly;
    }
    after(room, status.f_bavail.saturating_mul(status.f_frsize), limit_bytes)
}

fn after(room: Room, free_bytes: u64, limit_bytes: u64) -> Room {
    let limit = match room {
        Room::Enough | Room::ReadOnly => limit_bytes,
        Room::Low { .. } => limit_bytes.saturating_mul(2),
    };
    if free_bytes < limit { Room::Low { free_bytes } } else { Room::Enough }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn low_space_is_over_only_once_there_is_plenty() {
        let mut room = Room::Enough;
        let steps =
            [(100, false), (99, true), (100, true), (199, true), (200, false), (100, false), (0, true)];
        for (free, low) in steps {
            room = after(room, free, 100);
            assert_eq!(room, if low { Room::Low { free_bytes: free } } else { Room::Enough }, "{free}");
        }
    }

    #[test]
    fn a_read_only_file_system_is_seen_without_writing() {
        assert_eq!(SpaceWatch::new(Path::new("/proc/sys/kernel"), 0, 1).room(), Room::Enough);
        // Mounted read-only on every Linux, where there is one at all.
        let Some(path) = ["/sys/fs/cgroup", "/sys/firmware", "/proc/sys"]
            .into_iter()
            .find(|p| statvfs(*p).is_ok_and(|s| s.f_flag.contains(StatVfsMountFlags::RDONLY)))
        else {
            eprintln!("not tested: nothing is mounted read-only here");
            return;
        };
        assert_eq!(SpaceWatch::new(Path::new(path), 0, 1).room(), Room::ReadOnly);
    }

    #[test]
    fn the_space_is_low_below_a_part_of_the_file_system_also_for_a_file_that_is_not_there() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("none.mcap");
        // All of it is never free.
        let Room::Low { free_bytes } = SpaceWatch::new(&file, u64::MAX, 1).room() else {
            panic!("more than all is free")
        };
        assert!(free_bytes > 0);
        assert_eq!(SpaceWatch::new(&file, u64::MAX, u64::MAX).room(), Room::Enough);
        let status = status(&file).unwrap();
        let bytes = status.f_blocks * status.f_frsize;
        assert_eq!(limit(&status, u64::MAX, 8), bytes / 8);
        assert_eq!(limit(&status, bytes / 100, 8), bytes / 100);
    }

    #[test]
    fn a_file_system_that_does_not_answer_holds_nobody_up() {
        let (_asked, never) = bounded::<Infallible>(0);
        let watch = SpaceWatch::start(u64::MAX, 1, move || {
            never.recv().map_err(|_| io::ErrorKind::Other.into()).map(|never| match never {})
        });
        assert_eq!(watch.room(), Room::Enough);
    }
}
