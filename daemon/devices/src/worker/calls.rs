//! Signs of life while the port's thread is within the kernel.

use std::{
    sync::atomic::{AtomicBool, AtomicI64, Ordering},
    thread,
    time::Duration,
};

use bowwave_core::time::Time;

use crate::{clock, worker::report::Reporter};

/// How often a sign of life is given.
const LOOK: Duration = Duration::from_millis(50);

/// The calls of one thread.
#[derive(Debug, Default)]
pub(crate) struct Calls {
    /// When the call under way began, nanoseconds; 0 where none is.
    since_ns: AtomicI64,
    ended: AtomicBool,
}

/// Ends the call also where it panics.
struct Call<'a>(&'a Calls);

impl Drop for Call<'_> {
    fn drop(&mut self) {
        self.0.since_ns.store(0, Ordering::Relaxed);
    }
}

impl Calls {
    /// Makes a call that may take long.
    pub(crate) fn during<T>(&self, call: impl FnOnce() -> T) -> T {
        self.since_ns.store(clock::now().ns(), Ordering::Relaxed);
        let _call = Call(self);
        call()
    }

    /// There are no more. The thread that gives signs of life is to be unparked.
    pub(crate) fn end(&self) {
        self.ended.store(true, Ordering::Relaxed);
    }

    /// Gives the sign of life while a call is under way, for at most `longest_ns` each, until there are no more.
    pub(crate) fn beat(&self, reporter: &Reporter, longest_ns: i64) {
        while !self.ended.load(Ordering::Relaxed) {
            let since = self.since_ns.load(Ordering::Relaxed);
            if since != 0 && clock::now().ns_since(Time::from_ns(since)) < longest_ns {
                reporter.beat();
            }
            thread::park_timeout(LOOK);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::worker::report::reporting;

    const MS: i64 = 1_000_000;

    fn pass(ms: i64) {
        clock::sleep_until(clock::now().plus_ns(ms * MS));
    }

    #[test]
    fn a_thread_in_the_kernel_lives_for_a_while_and_one_that_stands_does_not() {
        let (reporter, reports) = reporting();
        let calls = Arc::new(Calls::default());
        let beating = {
            let calls = Arc::clone(&calls);
            thread::spawn(move || calls.beat(&reporter, 400 * MS))
        };
        let before = reports.last_beat();
        pass(150);
        assert_eq!(reports.last_beat(), before, "no call is under way");
        calls.during(|| {
            pass(300);
            assert!(reports.last_beat().ns_since(before) > 150 * MS, "a call is");
            pass(300);
            let last = reports.last_beat();
            pass(200);
            assert_eq!(reports.last_beat(), last, "it takes too long");
        });
        let last = reports.last_beat();
        // Each has its own time.
        calls.during(|| pass(200));
        assert!(reports.last_beat() > last);
        calls.end();
        beating.thread().unpark();
        beating.join().expect("ends");
    }

    #[test]
    fn a_call_that_panics_is_over() {
        let calls = Calls::default();
        let call = std::panic::AssertUnwindSafe(|| calls.during(|| panic!("on purpose")));
        std::panic::catch_unwind(call).expect_err("panics");
        assert_eq!(calls.since_ns.load(Ordering::Relaxed), 0);
    }
}
