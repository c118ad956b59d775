//! Finished frames for the instructor's live picture.

use std::sync::{
    Condvar, Mutex, MutexGuard, PoisonError, TryLockError,
    atomic::{AtomicBool, Ordering},
};
use std::time::Duration;

use bowwave_core::time::Time;
use bowwave_link::Picture;

/// Takes the next finished frame where somebody asked for one. Nobody who offers a frame waits.
#[derive(Debug, Default)]
pub struct PictureTap {
    is_wanted: AtomicBool,
    slot: Mutex<Slot>,
    there: Condvar,
}

#[derive(Debug, Default)]
struct Slot {
    picture: Option<Picture>,
    /// Memory of the picture before.
    spare: Vec<u8>,
}

impl PictureTap {
    /// Asks for the next frame that is finished.
    pub(super) fn want(&self) {
        self.is_wanted.store(true, Ordering::Release);
    }

    /// Tests whether somebody waits for a frame.
    #[cfg(test)]
    pub(super) fn is_wanted(&self) -> bool {
        self.is_wanted.load(Ordering::Acquire)
    }

    /// Nobody wants a frame any more.
    pub(super) fn forget(&self) {
        self.is_wanted.store(false, Ordering::Release);
        self.slot().picture = None;
    }

    /// Offers a frame: `rgba` has `size` pixels. It is copied where one is wanted, which takes half a millisecond at 1280x720.
    pub fn offer(&self, frame: u64, complete: Time, rgba: &[u8], size: (u32, u32)) {
        if !self.is_wanted.load(Ordering::Acquire) || rgba.len() != size.0 as usize * size.1 as usize * 4 {
            return;
        }
        let mut slot = match self.slot.try_lock() {
            Ok(slot) => slot,
            // It is being taken: the next frame will do.
            Err(TryLockError::WouldBlock) => return,
            Err(TryLockError::Poisoned(slot)) => slot.into_inner(),
        };
        let mut pixels = std::mem::take(&mut slot.spare);
        pixels.clear();
        pixels.extend_from_slice(rgba);
        slot.picture =
            Some(Picture { frame, complete_ns: complete.ns(), width: size.0, height: size.1, rgba: pixels });
        self.is_wanted.store(false, Ordering::Release);
        self.there.notify_one();
    }

    /// The frame that was asked for; waits for it no longer than `timeout`.
    pub(super) fn take(&self, timeout: Duration) -> Option<Picture> {
        let slot = self.slot();
        let waited = self.there.wait_timeout_while(slot, timeout, |slot| slot.picture.is_none());
        waited.unwrap_or_else(PoisonError::into_inner).0.picture.take()
    }

    /// Gives a picture's memory back.
    pub(super) fn give_back(&self, picture: Picture) {
        self.slot().spare = picture.rgba;
    }

    fn slot(&self) -> MutexGuard<'_, Slot> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
