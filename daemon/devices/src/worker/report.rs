//! How the threads of devices tell the rest of the trainer how they fare.

use std::sync::{
    Arc,
    atomic::{AtomicI64, AtomicU64, Ordering},
};

use bowwave_core::{
    fault::{Change, Fault, FaultBoard, FaultChange},
    time::Time,
};
use crossbeam_channel::{Receiver, Sender, bounded};

use crate::clock;

/// Changes that may wait for the main loop: it looks thirty times a second.
const CHANGES: usize = 1024;

/// A sign of life that a thread gives and a supervisor looks at. Clones are of the same thread.
#[derive(Clone, Debug)]
pub struct Heartbeat {
    last_ns: Arc<AtomicI64>,
}

impl Heartbeat {
    fn new() -> Self {
        Self { last_ns: Arc::new(AtomicI64::new(clock::now().ns())) }
    }

    /// "I live": to be given at least every 250 ms, in whatever state the device is.
    pub fn beat(&self) {
        self.last_ns.store(clock::now().ns(), Ordering::Relaxed);
    }

    /// When the thread last lived.
    pub fn last(&self) -> Time {
        Time::from_ns(self.last_ns.load(Ordering::Relaxed))
    }
}

/// The end that a device's thread reports with. Never blocks.
#[derive(Clone, Debug)]
pub struct Reporter {
    changes: Sender<FaultChange>,
    dropped: Arc<AtomicU64>,
    heartbeat: Heartbeat,
}

/// The supervisor's end of a [`Reporter`].
#[derive(Debug)]
pub struct Reports {
    changes: Receiver<FaultChange>,
    dropped: Arc<AtomicU64>,
    heartbeat: Heartbeat,
}

/// Both ends for a thread that is about to be started.
pub fn reporting() -> (Reporter, Reports) {
    let (sender, changes) = bounded(CHANGES);
    let dropped = Arc::new(AtomicU64::new(0));
    let heartbeat = Heartbeat::new();
    let reporter = Reporter { changes: sender, dropped: Arc::clone(&dropped), heartbeat: heartbeat.clone() };
    (reporter, Reports { changes, dropped, heartbeat })
}

impl Reporter {
    /// The thread lives.
    pub fn beat(&self) {
        self.heartbeat.beat();
    }

    /// `fault` is there from now on.
    pub fn raised(&self, fault: Fault, cause: impl Into<String>) {
        self.send(FaultChange::raised(clock::now(), fault, cause));
    }

    /// `fault` is gone. Harmless where it was not there.
    pub fn cleared(&self, fault: Fault) {
        self.send(FaultChange::cleared(clock::now(), fault));
    }

    /// `fault` is there where `is` says so, with `cause`; tells changes only, from what was told `before`.
    pub fn follow(
        &self,
        now: Time,
        fault: Fault,
        before: &mut bool,
        is: bool,
        cause: impl FnOnce() -> String,
    ) {
        match (*before, is) {
            (false, true) => self.send(FaultChange::raised(now, fault, cause())),
            (true, false) => self.send(FaultChange::cleared(now, fault)),
            _ => {}
        }
        *before = is;
    }

    /// `fault` happened and is over.
    pub fn noted(&self, fault: Fault, cause: impl Into<String>) {
        self.send(FaultChange::noted(clock::now(), fault, cause));
    }

    /// A change with a time of its own.
    pub fn send(&self, change: FaultChange) {
        if self.changes.try_send(change).is_err() {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl Reports {
    /// The changes since the last call, in their order.
    pub fn changes(&self) -> impl Iterator<Item = FaultChange> + '_ {
        self.changes.try_iter()
    }

    /// The faults that are there after all changes since the last call, with their newest causes.
    pub fn left(&self) -> Vec<(Fault, String)> {
        let mut board = FaultBoard::new();
        let mut causes: Vec<(Fault, String)> = Vec::new();
        for change in self.changes() {
            if let Change::Raised { cause } = &change.change {
                causes.retain(|(fault, _)| *fault != change.fault);
                causes.push((change.fault, cause.clone()));
            }
            board.take(&change);
        }
        causes.retain(|(fault, _)| board.is_active(*fault));
        causes
    }

    /// Changes lost because nobody looked.
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// When the thread last gave a sign of life.
    pub fn last_beat(&self) -> Time {
        self.heartbeat.last()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_come_through_in_order_and_never_block() {
        let (reporter, reports) = reporting();
        reporter.raised(Fault::ImuLost, "gone");
        reporter.cleared(Fault::ImuLost);
        let seen: Vec<_> = reports.changes().map(|c| (c.fault, c.change)).collect();
        assert_eq!(seen.len(), 2);
        (0..CHANGES + 5).for_each(|_| reporter.noted(Fault::CamTimestamp, ""));
        assert_eq!((reports.changes().count(), reports.dropped()), (CHANGES, 5));
    }

    #[test]
    fn a_beat_is_seen_from_outside() {
        let (reporter, reports) = reporting();
        let before = reports.last_beat();
        clock::sleep_until(before.plus_ns(2_000_000));
        reporter.beat();
        assert!(reports.last_beat() > before);
    }
}
