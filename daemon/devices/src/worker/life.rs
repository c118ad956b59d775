//! Whether a thread still runs between its calls into the kernel, as another one sees it.

use std::{
    fs,
    sync::atomic::{AtomicI32, AtomicI64, Ordering},
};

use bowwave_core::time::Time;
use rustix::thread::gettid;

/// Signs of life of a thread. It is in no call that hangs when it gives one.
#[derive(Debug)]
pub(crate) struct ThreadLife {
    /// Time of the last sign, nanoseconds.
    alive_ns: AtomicI64,
    /// The thread as the kernel numbers it; 0 until it runs.
    thread: AtomicI32,
}

impl ThreadLife {
    /// The life of a thread that is about to be started.
    pub(crate) const fn new(now: Time) -> Self {
        Self { alive_ns: AtomicI64::new(now.ns()), thread: AtomicI32::new(0) }
    }

    /// The calling thread is the one.
    pub(crate) fn begin(&self) {
        self.thread.store(gettid().as_raw_nonzero().get(), Ordering::Relaxed);
    }

    /// It lives.
    pub(crate) fn alive(&self, now: Time) {
        self.alive_ns.store(now.ns(), Ordering::Relaxed);
    }

    /// Time of its last sign of life.
    pub(crate) fn last(&self) -> Time {
        Time::from_ns(self.alive_ns.load(Ordering::Relaxed))
    }

    /// Whether the thread waits for a processor, and for nothing else (proc(5), the state in `stat`). Where that cannot be read, it
    /// does not.
    pub(crate) fn is_runnable(&self) -> bool {
        let thread = self.thread.load(Ordering::Relaxed);
        let stat = fs::read_to_string(format!("/proc/self/task/{thread}/stat")).unwrap_or_default();
        // The name before the state is in parentheses and may hold anything, parentheses too.
        stat.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with('R'))
    }
}
