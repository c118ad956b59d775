//! The thread that reads a line, and the one that sees to it that the first has not been swallowed by a driver.

use std::{
    os::fd::AsFd,
    path::{Path, PathBuf},
    sync::Arc,
};

use bowwave_core::{event::Event, fault::FaultChange, time::Time};
use rustix::event::PollFlags;

use super::{
    LineSettings, LineStatus, OpenLine, SerialError, SerialStatus,
    feed::{LineFeed, LineKind},
    find::Finder,
    health::{LineAction, LineHealth},
    ioctl::LineErrors,
    line::{LineRead, SerialLine},
};
use crate::{
    clock,
    queue::NewestSender,
    report::Reporter,
    worker::{PortLink, ThreadLife},
};

/// How often a port that is not there is looked for.
const SEARCH_NS: i64 = 100_000_000;
/// Longest wait for bytes: silence is noticed in time, and the thread is seen to live.
const WAIT_NS: i64 = 20_000_000;
/// How often the port's own counters are read.
const COUNT_NS: i64 = 100_000_000;
/// Pause after a port that lies about bytes, so that it causes no busy loop.
const SPURIOUS_PAUSE_NS: i64 = 5_000_000;
/// A round of the reader that takes longer hangs in the kernel.
pub(super) const BLOCKED_NS: i64 = 150_000_000;
/// How often the watcher looks.
const WATCH_NS: i64 = 25_000_000;
/// Bytes of a read: 44 ms at 921600 baud.
const READ_BYTES: usize = 4096;

/// The ends on which the reading thread tells what it finds.
pub(super) struct ReaderEnds<R> {
    pub(super) link: Arc<PortLink<SerialStatus<R>>>,
    pub(super) life: Arc<ThreadLife>,
    pub(super) reporter: Reporter,
    pub(super) queue: NewestSender<Event>,
}

/// The reading thread.
pub(super) struct LineReader<F: LineFeed> {
    settings: LineSettings,
    feed: F,
    line: Option<SerialLine>,
    ends: ReaderEnds<F::Report>,
    finder: Finder,
    /// Which of the candidates is tried.
    attempt: usize,
    /// There were several candidates.
    several: bool,
    health: LineHealth,
    errors: Option<LineErrors>,
    counted: Time,
}

/// Says that the line is stopped, however the thread ends.
struct StoppedMark<R>(Arc<PortLink<SerialStatus<R>>>);

impl<R> Drop for StoppedMark<R> {
    fn drop(&mut self) {
        self.0.status().line.status = LineStatus::Stopped;
    }
}

impl<F: LineFeed> LineReader<F> {
    pub(super) fn new(
        settings: LineSettings,
        feed: F,
        line: Option<SerialLine>,
        ends: ReaderEnds<F::Report>,
    ) -> Self {
        Self {
            finder: Finder::new(settings.device.clone()),
            health: LineHealth::new(&settings.baud, F::KIND),
            settings,
            feed,
            line,
            ends,
            attempt: 0,
            several: false,
            errors: None,
            counted: Time::MIN,
        }
    }

    pub(super) fn run(mut self) {
        self.ends.life.begin();
        let _mark = StoppedMark(Arc::clone(&self.ends.link));
        if self.line.is_some() {
            self.opened(clock::now());
        }
        let mut bytes = vec![0; READ_BYTES];
        while !self.ends.link.is_stopping() {
            self.ends.life.alive(clock::now());
            match self.line.take() {
                None => self.search(),
                Some(line) => self.line = self.serve(line, &mut bytes),
            }
            self.publish();
        }
    }

    /// Tries to open a port once, and waits a little where there is none. Every step gives a sign of life of its own: on a
    /// loaded computer they and the wait together may take longer than a call that hangs.
    pub(super) fn search(&mut self) {
        let found = self.finder.candidates();
        self.ends.life.alive(clock::now());
        let opened = found.and_then(|found| {
            self.several = found.len() > 1;
            let path = found.get(self.attempt % found.len().max(1)).cloned().unwrap_or_default();
            SerialLine::open(&path, self.health.baud(), self.settings.low_latency)
        });
        let now = clock::now();
        self.ends.life.alive(now);
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
        self.ends.link.pause(SEARCH_NS);
    }

    fn opened(&mut self, now: Time) {
        self.health.opened(now);
        self.feed.restart();
        self.feed.forget();
        self.errors = self.line.as_ref().and_then(SerialLine::errors);
        self.counted = now;
        let Some(line) = &self.line else { return };
        log::debug!(
            "{} opened at {} baud, low latency: {:?}",
            line.path().display(),
            self.health.baud(),
            line.low_latency()
        );
        let report = &mut self.ends.link.status().line;
        report.open = Some(OpenLine {
            node: line.node().to_owned(),
            baud: self.health.baud(),
            low_latency: line.low_latency(),
        });
        report.opened += 1;
    }

    /// One wait and one read. Gives the line back while it is good.
    fn serve(&mut self, mut line: SerialLine, bytes: &mut [u8]) -> Option<SerialLine> {
        let ready = match self.ends.link.wait(&[line.as_fd()], WAIT_NS) {
            Ok(ready) => ready.first().copied().unwrap_or(PollFlags::empty()),
            Err(e) => return self.lost(&line, &format!("waiting for bytes failed: {e}")),
        };
        self.ends.life.alive(clock::now());
        let mut spurious = false;
        if !ready.is_empty() {
            match line.read(bytes) {
                LineRead::Bytes(count) => self.take(&line, bytes.get(..count).unwrap_or_default()),
                LineRead::Empty if ready.contains(PollFlags::HUP) => {
                    return self.lost(&line, "the line hung up: the adapter was unplugged");
                }
                LineRead::Empty => {
                    self.health.spurious(clock::now());
                    spurious = true;
                }
                LineRead::HungUp => return self.lost(&line, "the line hung up: the adapter was unplugged"),
                LineRead::Failed(e) => return self.lost(&line, &format!("reading failed: {e}")),
            }
        }
        if spurious {
            self.ends.link.status().line.spurious += 1;
            self.ends.link.pause(SPURIOUS_PAUSE_NS);
        }
        let now = clock::now();
        self.count(&line, now);
        self.feed.judge(line.path(), now, &self.ends.reporter);
        // Where no port is configured another one may come: an adapter that is there at first may be any device's.
        let roam = self.several || self.settings.device.is_none();
        match self.health.tick(now, roam) {
            LineAction::Keep => Some(line),
            LineAction::SetBaud(baud) => {
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
            LineAction::Reopen => {
                self.interrupted();
                None
            }
            LineAction::NextPort => self.next_port(line),
        }
    }

    /// Leaves the port for the next one. Where there is no other it is kept: to open it anew would only lose bytes.
    fn next_port(&mut self, line: SerialLine) -> Option<SerialLine> {
        let found = self.finder.candidates();
        let now = clock::now();
        self.ends.life.alive(now);
        if !found.is_ok_and(|found| others(&found, line.path())) {
            return Some(line);
        }
        self.attempt = self.attempt.wrapping_add(1);
        self.health.leave(now);
        self.interrupted();
        None
    }

    fn lost(&mut self, line: &SerialLine, why: &str) -> Option<SerialLine> {
        self.health.lost(clock::now(), &format!("{}: {why}", line.path().display()));
        self.interrupted();
        None
    }

    fn interrupted(&mut self) {
        self.feed.forget();
        self.errors = None;
    }

    /// Bytes arrived.
    fn take(&mut self, line: &SerialLine, bytes: &[u8]) {
        let arrival = clock::now();
        let packets = self.feed.take(bytes, arrival, &mut self.ends.queue);
        let was = self.health.status();
        self.health.received(arrival, bytes.len(), packets);
        if was != LineStatus::Streaming && self.health.status() == LineStatus::Streaming {
            self.found(line, arrival);
        }
    }

    /// The device is known to be on this line.
    fn found(&mut self, line: &SerialLine, now: Time) {
        if let Some(before) = self.finder.found(line.node()) {
            let cause =
                format!("the {} was {} and now is {}", F::KIND.name, before.display(), line.node().display());
            self.ends.reporter.send(FaultChange::noted(now, F::KIND.renumbered, cause));
        }
    }

    /// Looks at the port's own counters now and then.
    fn count(&mut self, line: &SerialLine, now: Time) {
        if now.ns_since(self.counted) < COUNT_NS {
            return;
        }
        self.counted = now;
        let Some(errors) = line.errors() else { return };
        if let Some(before) = self.errors.replace(errors) {
            let framing = errors.framing.wrapping_sub(before.framing);
            self.health.framing(framing);
            let report = &mut self.ends.link.status().line;
            report.framing_errors += u64::from(framing);
            report.overruns += u64::from(errors.overrun.wrapping_sub(before.overrun));
        }
    }

    /// Tells the supervisor and the owner.
    fn publish(&mut self) {
        for change in self.health.changes() {
            self.ends.reporter.send(change);
        }
        let mut status = self.ends.link.status();
        status.said = self.feed.report();
        let report = &mut status.line;
        report.status = self.health.status();
        report.open = report.open.take().filter(|_| self.line.is_some());
        if let Some(open) = &mut report.open {
            open.baud = self.health.baud();
        }
        report.overflow = self.ends.queue.dropped();
    }
}

/// Whether there is another candidate than the one that is open.
fn others(found: &[PathBuf], open: &Path) -> bool {
    found.iter().any(|candidate| candidate != open)
}

/// Gives the port's sign of life, and tells when a kernel call of the reader does not return. The reader's file is
/// non-blocking: its reads cannot wait by design, so one that does is a driver's defect, and opening, setting and closing
/// have no such promise at all. A thread in such a call cannot be ended from outside: it is waited for.
pub(super) struct LineWatcher<R> {
    link: Arc<PortLink<SerialStatus<R>>>,
    life: Arc<ThreadLife>,
    reporter: Reporter,
    kind: &'static LineKind,
    blocked: bool,
}

impl<R> LineWatcher<R> {
    pub(super) const fn new(
        link: Arc<PortLink<SerialStatus<R>>>,
        life: Arc<ThreadLife>,
        reporter: Reporter,
        kind: &'static LineKind,
    ) -> Self {
        Self { link, life, reporter, kind, blocked: false }
    }

    pub(super) fn run(mut self) {
        while !self.link.is_stopping() && !self.link.has_ended() {
            self.reporter.beat();
            self.look(clock::now());
            self.link.pause(WATCH_NS);
        }
    }

    fn look(&mut self, now: Time) {
        let still = now.ns_since(self.life.last()) >= BLOCKED_NS;
        // A thread that could run and is not let is no matter of the port: the device's silence is told by its own fault.
        let blocked = still && (self.blocked || !self.life.is_runnable());
        if blocked && !self.blocked {
            let node = self.link.status().line.node();
            let cause = format!("a kernel call on {node} does not return; unplug the adapter");
            self.reporter.send(FaultChange::raised(now, self.kind.blocked, cause));
        } else if self.blocked && !blocked {
            self.reporter.send(FaultChange::cleared(now, self.kind.blocked));
        }
        self.blocked = blocked;
    }
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
