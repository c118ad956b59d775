//! The thread that reads a line, and the one that sees to it that the first has not been swallowed by a driver.

use std::{
    os::fd::{AsFd, BorrowedFd, OwnedFd},
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicI32, AtomicI64, Ordering},
    },
};

use bowwave_core::{event::Event, fault::FaultChange, time::Time};
use rustix::{
    event::{PollFd, PollFlags, poll},
    io::Errno,
    thread::gettid,
    time::Timespec,
};

use super::{
    LineReport, LineSettings, LineStatus, SerialError,
    feed::{Feed, Kind},
    find::Finder,
    health::{Action, Health},
    ioctl::LineErrors,
    line::{Line, Read},
};
use crate::{clock, queue::NewestSender, report::Reporter};

/// How often a port that is not there is looked for.
const SEARCH_NS: i64 = 100_000_000;
/// Longest wait for bytes: silence is noticed in time, and the thread is seen to live.
const WAIT_NS: i64 = 20_000_000;
/// How often the port's own counters are read.
const COUNT_NS: i64 = 100_000_000;
/// What a port that lies about bytes costs: no busy loop.
const SPURIOUS_PAUSE_NS: i64 = 5_000_000;
/// A round of the reader that takes longer hangs in the kernel.
pub(super) const BLOCKED_NS: i64 = 150_000_000;
/// How often the watcher looks.
const WATCH_NS: i64 = 25_000_000;
/// Bytes of a read: 44 ms at 921600 baud.
const READ_BYTES: usize = 4096;

/// What the port's threads and its owner share.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) stop: AtomicBool,
    /// Readable once the threads are to stop.
    pub(super) wake: OwnedFd,
    /// When the reader was last seen outside a kernel call that may hang, nanoseconds.
    pub(super) alive_ns: AtomicI64,
    /// The reader's thread as the kernel numbers it; 0 until it runs.
    pub(super) thread: AtomicI32,
    /// The reader ended, as asked or by a panic.
    pub(super) ended: AtomicBool,
    pub(super) line: Mutex<LineReport>,
}

impl Shared {
    /// Plain numbers: whole even where a holder panicked.
    pub(super) fn line(&self) -> MutexGuard<'_, LineReport> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn stopping(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn alive(&self, now: Time) {
        self.alive_ns.store(now.ns(), Ordering::Relaxed);
    }
}

/// Waits for `fd` to be readable, for the stop, or for `wait_ns`. Gives what `fd` is ready for.
fn wait_for(fd: Option<BorrowedFd<'_>>, wake: &OwnedFd, wait_ns: i64) -> Result<PollFlags, Errno> {
    let timeout = Timespec { tv_sec: 0, tv_nsec: wait_ns.clamp(0, 999_999_999) };
    let wake = PollFd::new(wake, PollFlags::IN);
    let polled = |fds: &mut [PollFd<'_>]| match poll(fds, Some(&timeout)) {
        // A poll that was interrupted says nothing of its files.
        Err(Errno::INTR) | Ok(0) => Ok(PollFlags::empty()),
        Ok(_) => Ok(fds.get(1).map_or(PollFlags::empty(), PollFd::revents)),
        Err(e) => Err(e),
    };
    match fd {
        Some(fd) => polled(&mut [wake, PollFd::from_borrowed_fd(fd, PollFlags::IN)]),
        None => polled(&mut [wake]),
    }
}

/// The reading thread.
pub(super) struct Reader<F: Feed> {
    settings: LineSettings,
    feed: F,
    line: Option<Line>,
    shared: Arc<Shared>,
    said: Arc<Mutex<F::Status>>,
    reporter: Reporter,
    queue: NewestSender<Event>,
    finder: Finder,
    /// Which of the candidates is tried.
    attempt: usize,
    /// There were several candidates.
    several: bool,
    health: Health,
    errors: Option<LineErrors>,
    counted: Time,
}

/// Sets [`Shared::ended`] however the thread ends.
struct Ended(Arc<Shared>);

impl Drop for Ended {
    fn drop(&mut self) {
        self.0.line().status = LineStatus::Stopped;
        self.0.ended.store(true, Ordering::Relaxed);
    }
}

impl<F: Feed> Reader<F> {
    pub(super) fn new(
        settings: LineSettings,
        feed: F,
        line: Option<Line>,
        shared: Arc<Shared>,
        said: Arc<Mutex<F::Status>>,
        reporter: Reporter,
        queue: NewestSender<Event>,
    ) -> Self {
        Self {
            finder: Finder::new(settings.device.clone()),
            health: Health::new(&settings.baud, F::KIND),
            settings,
            feed,
            line,
            shared,
            said,
            reporter,
            queue,
            attempt: 0,
            several: false,
            errors: None,
            counted: Time::MIN,
        }
    }

    pub(super) fn run(mut self) {
        self.shared.thread.store(gettid().as_raw_nonzero().get(), Ordering::Relaxed);
        let ended = Ended(Arc::clone(&self.shared));
        if self.line.is_some() {
            self.opened(clock::now());
        }
        let mut bytes = vec![0; READ_BYTES];
        while !self.shared.stopping() {
            self.shared.alive(clock::now());
            match self.line.take() {
                None => self.search(),
                Some(line) => self.line = self.serve(line, &mut bytes),
            }
            self.publish();
        }
        drop(ended);
    }

    /// Tries to open a port once, and waits a little where there is none. Every step gives a sign of life of its own: on a
    /// loaded computer they and the wait together may take longer than a call that hangs.
    pub(super) fn search(&mut self) {
        let found = self.finder.candidates();
        self.shared.alive(clock::now());
        let opened = found.and_then(|found| {
            self.several = found.len() > 1;
            let path = found.get(self.attempt % found.len().max(1)).cloned().unwrap_or_default();
            Line::open(&path, self.health.baud(), self.settings.low_latency)
        });
        let now = clock::now();
        self.shared.alive(now);
        match opened {
            Ok(line) => {
                self.line = Some(line);
                self.opened(now);
                return;
            }
            Err(e @ SerialError::BaudNotTaken { .. }) => {
                self.health.refused(now, &e.to_string());
                // Another adapter may know the rate.
                self.attempt = self.attempt.wrapping_add(usize::from(self.several));
            }
            Err(e) => {
                self.attempt = self.attempt.wrapping_add(1);
                self.health.absent(now, &e.to_string());
            }
        }
        self.pause(SEARCH_NS);
    }

    /// Waits, unless the stop comes.
    fn pause(&self, ns: i64) {
        // A poll that fails would make the search a busy loop.
        if wait_for(None, &self.shared.wake, ns).is_err() {
            clock::sleep_until(clock::now().plus_ns(ns));
        }
    }

    fn opened(&mut self, now: Time) {
        self.health.opened(now);
        self.feed.restart();
        self.feed.forget();
        self.errors = self.line.as_ref().and_then(Line::errors);
        self.counted = now;
        let Some(line) = &self.line else { return };
        log::debug!(
            "{} opened at {} baud, low latency: {:?}",
            line.path().display(),
            self.health.baud(),
            line.low_latency()
        );
        let mut status = self.shared.line();
        status.node = Some(line.node().to_owned());
        status.low_latency = line.low_latency();
        status.opened += 1;
    }

    /// One wait and one read. Gives the line back while it is good.
    fn serve(&mut self, line: Line, bytes: &mut [u8]) -> Option<Line> {
        let ready = match wait_for(Some(line.as_fd()), &self.shared.wake, WAIT_NS) {
            Ok(ready) => ready,
            Err(e) => return self.lost(&line, &format!("waiting for bytes failed: {e}")),
        };
        self.shared.alive(clock::now());
        let mut spurious = false;
        if !ready.is_empty() {
            match line.read(bytes) {
                Read::Bytes(count) => self.take(&line, bytes.get(..count).unwrap_or_default()),
                Read::Empty if ready.contains(PollFlags::HUP) => {
                    return self.lost(&line, "the line hung up: the adapter was unplugged");
                }
                Read::Empty => {
                    self.health.spurious(clock::now());
                    spurious = true;
                }
                Read::HungUp => return self.lost(&line, "the line hung up: the adapter was unplugged"),
                Read::Failed(e) => return self.lost(&line, &format!("reading failed: {e}")),
            }
        }
        if spurious {
            self.shared.line().spurious += 1;
            self.pause(SPURIOUS_PAUSE_NS);
        }
        let now = clock::now();
        self.count(&line, now);
        self.feed.judge(line.path(), now, &self.reporter);
        // Where no port is configured another one may come: an adapter that is there at first may be any device's.
        let roam = self.several || self.settings.device.is_none();
        match self.health.tick(now, roam) {
            Action::Keep => Some(line),
            Action::SetBaud(baud) => {
                match line.configure(baud) {
                    // What came at the old rate is garbage, and what it was taken for was chance.
                    Ok(()) => {
                        line.flush();
                        self.feed.restart();
                    }
                    Err(e) => log::debug!("{e}"),
                }
                Some(line)
            }
            Action::Reopen => {
                self.interrupted();
                None
            }
            Action::NextPort => self.next_port(line),
        }
    }

    /// Leaves the port for the next one. Where there is no other it is kept: to open it anew would only lose bytes.
    fn next_port(&mut self, line: Line) -> Option<Line> {
        let found = self.finder.candidates();
        let now = clock::now();
        self.shared.alive(now);
        if !found.is_ok_and(|found| others(&found, line.path())) {
            return Some(line);
        }
        self.attempt = self.attempt.wrapping_add(1);
        self.health.leave(now);
        self.interrupted();
        None
    }

    fn lost(&mut self, line: &Line, why: &str) -> Option<Line> {
        self.health.lost(clock::now(), &format!("{}: {why}", line.path().display()));
        self.interrupted();
        None
    }

    fn interrupted(&mut self) {
        self.feed.forget();
        self.errors = None;
    }

    /// Bytes arrived.
    fn take(&mut self, line: &Line, bytes: &[u8]) {
        let arrival = clock::now();
        let packets = self.feed.take(bytes, arrival, &mut self.queue);
        let was = self.health.status();
        self.health.received(arrival, bytes.len(), packets);
        if was != LineStatus::Streaming && self.health.status() == LineStatus::Streaming {
            self.found(line, arrival);
        }
    }

    /// The device is known to be on this line.
    fn found(&mut self, line: &Line, now: Time) {
        if let Some(before) = self.finder.found(line.node()) {
            let cause =
                format!("the {} was {} and now is {}", F::KIND.name, before.display(), line.node().display());
            self.reporter.send(FaultChange::noted(now, F::KIND.renumbered, cause));
        }
    }

    /// Looks at the port's own counters now and then.
    fn count(&mut self, line: &Line, now: Time) {
        if now.ns_since(self.counted) < COUNT_NS {
            return;
        }
        self.counted = now;
        let Some(errors) = line.errors() else { return };
        if let Some(before) = self.errors.replace(errors) {
            let framing = errors.framing.wrapping_sub(before.framing);
            self.health.framing(framing);
            let mut status = self.shared.line();
            status.framing_errors += u64::from(framing);
            status.overruns += u64::from(errors.overrun.wrapping_sub(before.overrun));
        }
    }

    /// Tells the supervisor and the owner.
    fn publish(&mut self) {
        for change in self.health.changes() {
            self.reporter.send(change);
        }
        *self.said.lock().unwrap_or_else(PoisonError::into_inner) = self.feed.status();
        let mut status = self.shared.line();
        status.status = self.health.status();
        status.baud = self.line.is_some().then(|| self.health.baud());
        if self.line.is_none() {
            status.node = None;
        }
        status.overflow = self.queue.dropped();
    }
}

/// Whether there is another candidate than the one that is open.
fn others(found: &[PathBuf], open: &Path) -> bool {
    found.iter().any(|candidate| candidate != open)
}

/// Gives the port's sign of life, and tells when a kernel call of the reader does not return. The reader's file is
/// non-blocking: its reads cannot wait by design, so one that does is a driver's defect, and opening, setting and closing
/// have no such promise at all. A thread in such a call cannot be ended from outside: it is waited for.
pub(super) struct Watcher {
    shared: Arc<Shared>,
    reporter: Reporter,
    kind: &'static Kind,
    blocked: bool,
}

impl Watcher {
    pub(super) const fn new(shared: Arc<Shared>, reporter: Reporter, kind: &'static Kind) -> Self {
        Self { shared, reporter, kind, blocked: false }
    }

    pub(super) fn run(mut self) {
        while !self.shared.stopping() && !self.shared.ended.load(Ordering::Relaxed) {
            self.reporter.beat();
            self.look(clock::now());
            if wait_for(None, &self.shared.wake, WATCH_NS).is_err() {
                clock::sleep_until(clock::now().plus_ns(WATCH_NS));
            }
        }
    }

    fn look(&mut self, now: Time) {
        let still = now.ns_since(Time::from_ns(self.shared.alive_ns.load(Ordering::Relaxed))) >= BLOCKED_NS;
        // A thread that could run and is not let is no matter of the port: the device's silence is told by its own fault.
        let blocked = still && (self.blocked || !runnable(self.shared.thread.load(Ordering::Relaxed)));
        if blocked && !self.blocked {
            let node = self.shared.line().node.clone().unwrap_or_else(|| PathBuf::from("the serial port"));
            let cause = format!("a kernel call on {} does not return; unplug the adapter", node.display());
            self.reporter.send(FaultChange::raised(now, self.kind.blocked, cause));
        } else if self.blocked && !blocked {
            self.reporter.send(FaultChange::cleared(now, self.kind.blocked));
        }
        self.blocked = blocked;
    }
}

/// Whether the thread waits for a processor, and for nothing else (proc(5), the state in `stat`). Where that cannot be read,
/// it does not.
fn runnable(thread: i32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/self/task/{thread}/stat")).unwrap_or_default();
    // The name before the state is in parentheses and may hold anything, parentheses too.
    stat.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with('R'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_left_only_for_another_one() {
        let found =
            |nodes: &[&str]| others(&nodes.iter().map(PathBuf::from).collect::<Vec<_>>(), Path::new("a"));
        for (nodes, is_left) in
            [(&[][..], false), (&["a"], false), (&["b"], true), (&["a", "b"], true), (&["b", "a"], true)]
        {
            assert_eq!(found(nodes), is_left, "{nodes:?}");
        }
    }
}
