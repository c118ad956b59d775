//! The threads of devices, once for all ports: how they start, wait, are woken and stopped, give signs of life and share their status.
//!
//! A port is a [`PortWorker`]: one thread that works on the device, perhaps others beside it that watch it, and a [`PortLink`] that they and
//! the port's owner share. What a thread finds it sends through a bounded queue ([`queue`]); how it fares it tells with a
//! [`Reporter`](report::Reporter).

mod calls;
mod life;
pub mod queue;
pub mod report;
mod wake;

use std::{
    io,
    os::fd::BorrowedFd,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
};

use rustix::{event::PollFlags, io::Errno};

pub(crate) use self::{calls::Calls, life::ThreadLife, wake::WakeEvent};
use crate::clock;
use report::Reporter;

/// How long the stop of a port waits for its threads, nanoseconds: an owner is promised 200 ms.
const STOP_NS: i64 = 180_000_000;

/// State that the threads of a port and its owner share.
#[derive(Debug)]
pub(crate) struct PortLink<S> {
    stop: AtomicBool,
    /// The working thread has ended, as asked or by a panic.
    ended: AtomicBool,
    wake: Arc<WakeEvent>,
    /// Calls into the kernel that may take long.
    pub(crate) calls: Calls,
    status: Mutex<S>,
}

impl<S> PortLink<S> {
    /// A link whose first status is `status`.
    pub(crate) fn new(status: S) -> io::Result<Arc<Self>> {
        Ok(Arc::new(Self {
            stop: AtomicBool::new(false),
            ended: AtomicBool::new(false),
            wake: Arc::new(WakeEvent::new()?),
            calls: Calls::default(),
            status: Mutex::new(status),
        }))
    }

    /// Whether the threads are to end.
    pub(crate) fn is_stopping(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// Whether the working thread has ended.
    pub(crate) fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Acquire)
    }

    /// Has the threads end soon.
    pub(crate) fn ask_to_stop(&self) {
        self.stop.store(true, Ordering::Release);
        self.wake.notify();
    }

    /// The wake of the working thread.
    pub(crate) const fn waker(&self) -> &Arc<WakeEvent> {
        &self.wake
    }

    /// Waits until one of `files` can be read or has hung up, for a wake or the stop, or for `ns` nanoseconds. Gives what each of
    /// `files` is ready for.
    pub(crate) fn wait(&self, files: &[BorrowedFd<'_>], ns: i64) -> Result<Vec<PollFlags>, Errno> {
        let ready = self.wake.wait(files, PollFlags::IN, ns);
        // The stop is for all threads: it stays until the last has seen it.
        if !self.is_stopping() {
            self.wake.clear();
        }
        ready
    }

    /// Waits for a wake or the stop, at most `ns` nanoseconds. A poll that cannot be made is no reason to run busily.
    pub(crate) fn pause(&self, ns: i64) {
        if self.wait(&[], ns).is_err() {
            clock::sleep_until(clock::now().plus_ns(ns));
        }
    }

    /// The status. Whoever died holding it left whole values behind: nothing under it can fail half-way.
    pub(crate) fn status(&self) -> MutexGuard<'_, S> {
        self.status.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Reasons why threads did not end well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StopError {
    /// One panicked: a defect of this program.
    BrokeDown,
    /// One did not end in time: it hangs in the kernel and is left behind.
    Blocked,
}

/// A port's own error says the same of its threads.
macro_rules! tells_of_threads {
    ($error:ty) => {
        impl From<crate::worker::StopError> for $error {
            fn from(error: crate::worker::StopError) -> Self {
                match error {
                    crate::worker::StopError::BrokeDown => Self::BrokeDown,
                    crate::worker::StopError::Blocked => Self::Blocked,
                }
            }
        }
    };
}
pub(crate) use tells_of_threads;

/// Notes the end of the working thread, also by a panic.
struct EndMark<S>(Arc<PortLink<S>>);

impl<S> Drop for EndMark<S> {
    fn drop(&mut self) {
        self.0.ended.store(true, Ordering::Release);
    }
}

/// The threads of a port, as their owner holds them.
#[derive(Debug)]
pub(crate) struct PortWorker<S, T = ()> {
    name: &'static str,
    link: Arc<PortLink<S>>,
    thread: Option<JoinHandle<T>>,
    /// Threads that watch the first one.
    beside: Vec<JoinHandle<()>>,
}

impl<S: Send + 'static, T: Send + 'static> PortWorker<S, T> {
    /// Starts the working thread.
    pub(crate) fn start(
        name: &'static str,
        link: Arc<PortLink<S>>,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> io::Result<Self> {
        let mark = EndMark(Arc::clone(&link));
        let thread = thread::Builder::new().name(name.to_owned()).spawn(move || {
            let _mark = mark;
            work()
        })?;
        Ok(Self { name, link, thread: Some(thread), beside: Vec::new() })
    }

    /// Starts a thread beside it, which ends when [`PortLink::is_stopping`] or [`PortLink::has_ended`]; it may be parked.
    pub(crate) fn start_beside(
        &mut self,
        name: &'static str,
        work: impl FnOnce() + Send + 'static,
    ) -> io::Result<()> {
        self.beside.push(thread::Builder::new().name(name.to_owned()).spawn(work)?);
        Ok(())
    }

    /// Starts a thread that gives the sign of life while one of [`PortLink::calls`] is under way, for at most `longest_ns` each.
    pub(crate) fn beat_during_calls(
        &mut self,
        name: &'static str,
        reporter: Reporter,
        longest_ns: i64,
    ) -> io::Result<()> {
        let link = Arc::clone(&self.link);
        self.start_beside(name, move || link.calls.beat(&reporter, longest_ns))
    }

    pub(crate) const fn link(&self) -> &Arc<PortLink<S>> {
        &self.link
    }

    /// Ends the threads; waits for them as long as an owner may be made to wait. Gives what the work gave.
    pub(crate) fn stop_in_time(self) -> Result<T, StopError> {
        self.stop_within(STOP_NS)
    }

    fn stop_within(mut self, ns: i64) -> Result<T, StopError> {
        self.stop_until(Some(clock::now().plus_ns(ns)))
    }

    /// Ends the threads and waits for them, however long that takes.
    pub(crate) fn stop(mut self) -> Result<T, StopError> {
        self.stop_until(None)
    }

    fn stop_until(&mut self, end: Option<bowwave_core::time::Time>) -> Result<T, StopError> {
        self.link.ask_to_stop();
        let Some(thread) = self.thread.take() else { return Err(StopError::BrokeDown) };
        let is_late = || end.is_some_and(|end| clock::now() >= end);
        let wait = |is_finished: &dyn Fn() -> bool| {
            while !is_finished() {
                if is_late() {
                    return Err(StopError::Blocked);
                }
                clock::sleep_until(clock::now().plus_ns(1_000_000));
            }
            Ok(())
        };
        let ended = if end.is_some() { wait(&|| thread.is_finished()) } else { Ok(()) };
        let result = ended.and_then(|()| thread.join().map_err(|_| StopError::BrokeDown));
        // Only now: a thread in the kernel lives until it is given up.
        self.end_beside();
        ended?;
        for thread in self.beside.drain(..) {
            wait(&|| thread.is_finished())?;
            thread.join().map_err(|_| StopError::BrokeDown)?;
        }
        result
    }
}

impl<S, T> PortWorker<S, T> {
    fn end_beside(&self) {
        self.link.calls.end();
        self.beside.iter().for_each(|t| t.thread().unpark());
    }
}

impl<S, T> Drop for PortWorker<S, T> {
    fn drop(&mut self) {
        if self.thread.is_some() {
            log::warn!("the {} thread was dropped without stop()", self.name);
            self.link.ask_to_stop();
            self.end_beside();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn worker(work: impl FnOnce() -> u32 + Send + 'static) -> PortWorker<(), u32> {
        PortWorker::start("test", PortLink::new(()).expect("a link"), work).expect("starts")
    }

    #[test]
    fn work_ends_when_asked_and_gives_its_result() {
        let link = PortLink::new(0).expect("a link");
        let mut worker = PortWorker::start("test", Arc::clone(&link), {
            let link = Arc::clone(&link);
            move || {
                while !link.is_stopping() {
                    *link.status() += 1;
                    link.pause(900_000_000);
                }
                7
            }
        })
        .expect("starts");
        let seen = Arc::clone(&link);
        worker
            .start_beside("beside", move || {
                while !seen.is_stopping() {
                    seen.pause(900_000_000);
                }
            })
            .expect("starts");
        while *link.status() == 0 {
            clock::sleep_until(clock::now().plus_ns(1_000_000));
        }
        let begin = clock::now();
        assert_eq!(worker.stop_within(800_000_000), Ok(7));
        assert!(clock::now().ns_since(begin) < 800_000_000, "nobody waits to the end of his pause");
        assert!(link.has_ended());
    }

    #[test]
    fn a_thread_that_panics_has_broken_down_and_one_that_hangs_is_left_behind() {
        let panicking = worker(|| panic!("on purpose"));
        let link = Arc::clone(panicking.link());
        assert_eq!(panicking.stop_within(800_000_000), Err(StopError::BrokeDown));
        assert!(link.has_ended());
        let slow = worker(|| {
            clock::sleep_until(clock::now().plus_ns(300_000_000));
            1
        });
        assert_eq!(slow.stop_within(10_000_000), Err(StopError::Blocked));
        let slow = worker(|| {
            clock::sleep_until(clock::now().plus_ns(30_000_000));
            1
        });
        assert_eq!(slow.stop(), Ok(1));
    }

    #[test]
    fn a_wake_is_for_one_wait_and_the_stop_for_all() {
        let link = PortLink::new(()).expect("a link");
        let waited_ns = |ns| {
            let begin = clock::now();
            link.pause(ns);
            clock::now().ns_since(begin)
        };
        link.waker().notify();
        assert!(waited_ns(900_000_000) < 800_000_000);
        assert!(waited_ns(20_000_000) >= 20_000_000);
        link.ask_to_stop();
        assert!(waited_ns(900_000_000) < 800_000_000);
        assert!(waited_ns(900_000_000) < 800_000_000);
    }
}
