//! Space that is kept for hits: a file beside the database that is given up when the disk is full.

use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

use rustix::fs::{FallocateFlags, fallocate};

use super::open::with_suffix;
use crate::space::free_bytes;

/// The reserve is made only where so many times its size is free: else it would itself be what fills the disk.
const ROOM: u64 = 4;

/// The file that keeps the space.
pub(super) struct Reserve {
    path: PathBuf,
    bytes: u64,
}

impl Reserve {
    /// A reserve of `bytes` for the database at `path`; 0 for none.
    pub(super) fn new(path: &Path, bytes: u64) -> Self {
        Self { path: with_suffix(path, ".reserve"), bytes }
    }

    /// Makes it unless it is there. [`io::ErrorKind::StorageFull`] where there is no room.
    pub(super) fn make(&self) -> io::Result<()> {
        if self.bytes == 0 || fs::metadata(&self.path).is_ok_and(|status| status.len() >= self.bytes) {
            return Ok(());
        }
        if free_bytes(&self.path)? < self.bytes.saturating_mul(ROOM) {
            return Err(io::ErrorKind::StorageFull.into());
        }
        let file = File::create(&self.path)?;
        // Blocks and all: a file with a hole keeps no space.
        let kept = fallocate(&file, FallocateFlags::empty(), 0, self.bytes);
        kept.map_err(|errno| {
            let _ = fs::remove_file(&self.path);
            errno.into()
        })
    }

    /// Gives the space up; whether there was any.
    pub(super) fn release(&self) -> bool {
        self.bytes > 0 && fs::remove_file(&self.path).is_ok()
    }
}
