//! Space on the disk: pictures stop before hits do.

use std::{
    io,
    path::{Path, PathBuf},
};

use bowwave_core::time::{NS_PER_S, Time};
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

/// How often the disk is asked, nanoseconds.
const EVERY_NS: i64 = NS_PER_S;

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
#[derive(Clone, Debug)]
pub struct SpaceWatch {
    path: PathBuf,
    limit_bytes: u64,
    asked: Option<Time>,
    room: Room,
}

impl SpaceWatch {
    /// Bytes below which recording pictures stops, unless told otherwise.
    pub const LIMIT_BYTES: u64 = 256 << 20;

    /// Watches the file system of `path`.
    pub fn new(path: &Path, limit_bytes: u64) -> Self {
        Self { path: path.into(), limit_bytes, asked: None, room: Room::Enough }
    }

    /// Whether there is room at `now`; asks the file system at most once a second. A file system that does not answer
    /// changes nothing: writing will say what is wrong with it.
    pub fn room(&mut self, now: Time) -> Room {
        if self.asked.is_none_or(|asked| now.ns_since(asked) >= EVERY_NS || now < asked) {
            self.asked = Some(now);
            match status(&self.path) {
                Ok(status) if status.f_flag.contains(StatVfsMountFlags::RDONLY) => self.room = Room::ReadOnly,
                Ok(status) => {
                    let free = status.f_bavail.saturating_mul(status.f_frsize);
                    self.room = next(self.room, free, self.limit_bytes);
                }
                Err(error) => log::debug!("free space at {}: {error}", self.path.display()),
            }
        }
        self.room
    }
}

fn next(room: Room, free_bytes: u64, limit_bytes: u64) -> Room {
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
            room = next(room, free, 100);
            assert_eq!(room, if low { Room::Low { free_bytes: free } } else { Room::Enough }, "{free}");
        }
    }

    #[test]
    fn a_read_only_file_system_is_seen_without_writing() {
        let mut watch = SpaceWatch::new(Path::new("/proc/sys/kernel"), 0);
        assert_eq!(watch.room(Time::from_ns(0)), Room::Enough);
        // Mounted read-only on every Linux, where there is one at all.
        let Some(path) = ["/sys/fs/cgroup", "/sys/firmware", "/proc/sys"]
            .into_iter()
            .find(|p| statvfs(*p).is_ok_and(|s| s.f_flag.contains(StatVfsMountFlags::RDONLY)))
        else {
            eprintln!("not tested: nothing is mounted read-only here");
            return;
        };
        assert_eq!(SpaceWatch::new(Path::new(path), 0).room(Time::from_ns(0)), Room::ReadOnly);
    }

    #[test]
    fn the_file_system_is_asked_once_a_second_also_for_a_file_that_is_not_there() {
        let folder = tempfile::tempdir().unwrap();
        let mut watch = SpaceWatch::new(&folder.path().join("none.mcap"), u64::MAX);
        let at = |ms: i64| Time::from_ns(ms * 1_000_000);
        let Room::Low { free_bytes } = watch.room(at(0)) else { panic!("more than all is free") };
        assert!(free_bytes > 0);
        watch.limit_bytes = 0;
        assert_eq!(watch.room(at(999)), Room::Low { free_bytes });
        assert_eq!(watch.room(at(1000)), Room::Enough);
    }
}
