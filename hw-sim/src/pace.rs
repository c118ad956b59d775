//! Threads that do things at times of the host's clock until they are asked to end.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use bowwave_core::time::Time;
use bowwave_devices::clock;

/// Longest sleep before a thread looks at whether to stop.
const NAP_NS: i64 = 50_000_000;

/// Tells threads to end.
#[derive(Clone, Debug, Default)]
pub(crate) struct StopFlag(Arc<AtomicBool>);

impl StopFlag {
    /// Asks them to end.
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    pub fn is_stopped(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Waits for `due`; `false` where it is stopped before that.
    pub fn wait(&self, due: Time) -> bool {
        loop {
            if self.is_stopped() {
                return false;
            }
            let now = clock::now();
            if now >= due {
                return true;
            }
            clock::sleep_until(due.min(now.plus_ns(NAP_NS)));
        }
    }
}

/// Has the threads end where their owner is dropped.
#[derive(Debug, Default)]
pub(crate) struct StopOnDrop(pub StopFlag);

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        self.0.stop();
    }
}
