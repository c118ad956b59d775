//! Buffers of the driver, mapped: lent to the pipeline, and given back by themselves.

use std::{
    any::Any,
    io,
    os::fd::{AsRawFd, BorrowedFd},
    ptr::{self, NonNull},
    sync::{Arc, Mutex, PoisonError},
};

use bowwave_core::event::Lent;
use rustix::param::page_size;
use v4l::v4l2;

use crate::worker::WakeEvent;

/// Linux's values (asm-generic/mman-common.h): readable and writable, because importing it into a GPU asks for both; shared.
const READ_WRITE: i32 = 0x1 | 0x2;
const MAP_SHARED: i32 = 0x01;

/// One buffer's memory. It stays valid after the device is closed or gone: the kernel keeps it as long as it is mapped.
#[derive(Debug)]
pub(super) struct Mapping {
    start: NonNull<u8>,
    /// Whole pages.
    len: usize,
}

// SAFETY: the memory belongs to the process, not to a thread; it is only read through `&self`.
unsafe impl Send for Mapping {}
// SAFETY: as above.
unsafe impl Sync for Mapping {}

impl Mapping {
    /// Maps the buffer that `VIDIOC_QUERYBUF` says is at `offset`, `len` bytes long.
    pub fn new(fd: BorrowedFd<'_>, offset: u32, len: u32) -> io::Result<Self> {
        // Whole pages: the kernel maps no less, and imports into a GPU need them.
        let len = (len as usize).next_multiple_of(page_size());
        if len == 0 {
            return Err(io::Error::other("the driver has a buffer of no bytes"));
        }
        // SAFETY: a new mapping at a place of the kernel's choosing touches no memory that is in use; the descriptor is
        // open as long as it is borrowed.
        let start = unsafe {
            v4l2::mmap(ptr::null_mut(), len, READ_WRITE, MAP_SHARED, fd.as_raw_fd(), i64::from(offset))?
        };
        let start = NonNull::new(start.cast()).ok_or_else(|| io::Error::other("mapped at address zero"))?;
        Ok(Self { start, len })
    }

    /// The bytes.
    ///
    /// # Safety
    /// The driver must not have the buffer for as long as the bytes are looked at: it would write to them meanwhile.
    pub unsafe fn bytes(&self) -> &[u8] {
        // SAFETY: `start` is mapped for `len` readable bytes until `self` is dropped, and nobody writes to them.
        unsafe { std::slice::from_raw_parts(self.start.as_ptr(), self.len) }
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: the mapping was made by `new` with this length, and nobody refers to it any more.
        let done = unsafe { v4l2::munmap(self.start.as_ptr().cast(), self.len) };
        if let Err(e) = done {
            log::debug!("a buffer cannot be unmapped: {e}");
        }
    }
}

/// Where lent buffers come back to, from any thread.
#[derive(Debug)]
pub(super) struct Returns {
    back: Mutex<Vec<u32>>,
    wake: Arc<WakeEvent>,
}

impl Returns {
    pub fn new(wake: Arc<WakeEvent>) -> Arc<Self> {
        Arc::new(Self { back: Mutex::new(Vec::new()), wake })
    }

    /// The buffers that came back since the last call.
    pub fn take(&self) -> Vec<u32> {
        std::mem::take(&mut *self.back.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// A buffer in somebody's hands.
pub(super) struct LentBuffer {
    pub mapping: Arc<Mapping>,
    pub index: u32,
    pub returns: Arc<Returns>,
}

impl Lent for LentBuffer {
    fn mapping(&self) -> &[u8] {
        // SAFETY: a buffer is lent by whoever dequeued it, and goes back to the driver only after this was dropped.
        unsafe { self.mapping.bytes() }
    }

    fn hold(&self) -> Option<Arc<dyn Any + Send + Sync>> {
        Some(self.mapping.clone())
    }
}

impl Drop for LentBuffer {
    fn drop(&mut self) {
        // If its stream is over, nobody looks there any more, and that is right: the memory goes with the last handle.
        self.returns.back.lock().unwrap_or_else(PoisonError::into_inner).push(self.index);
        self.returns.wake.notify();
    }
}

#[cfg(test)]
mod tests {
    use std::{fs::File, io::Write, os::fd::AsFd};

    use bowwave_core::event::{Picture, PixelFormat};

    use super::*;

    fn mapped(bytes: &[u8]) -> Mapping {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(bytes).unwrap();
        file.set_len(page_size() as u64).unwrap();
        let file: File = file;
        Mapping::new(file.as_fd(), 0, bytes.len() as u32).unwrap()
    }

    #[test]
    fn a_lent_picture_outlives_its_device_and_comes_back_with_its_last_clone() {
        let returns = Returns::new(Arc::new(WakeEvent::new().unwrap()));
        let mapping = Arc::new(mapped(&[7; 64]));
        let lent = LentBuffer { mapping: Arc::clone(&mapping), index: 3, returns: Arc::clone(&returns) };
        let picture = Picture::lent(PixelFormat::Yuyv, 8, 4, Arc::new(lent)).unwrap();
        drop(mapping);
        let clone = picture.clone();
        drop(picture);
        assert!(returns.take().is_empty());
        assert_eq!(clone.bytes(), [7; 64]);
        assert_eq!(clone.mapping().map(<[u8]>::len), Some(page_size()));
        drop(clone);
        assert_eq!((returns.take(), returns.take()), (vec![3], vec![]));
        assert!(returns.wake.clear(), "the thread was woken");
    }

    #[test]
    fn a_buffer_of_no_bytes_is_an_error() {
        let file = tempfile::tempfile().unwrap();
        assert!(Mapping::new(file.as_fd(), 0, 0).is_err());
    }
}
