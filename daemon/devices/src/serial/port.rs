//! A serial line with what reads it: two threads, a bounded queue, a status.

use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicI32, AtomicI64, Ordering},
    },
    thread::{self, JoinHandle},
};

use bowwave_core::event::Event;
use crossbeam_channel::Receiver;
use rustix::event::{EventfdFlags, eventfd};

use super::{
    LineReport, LineSettings, SerialError,
    feed::Feed,
    line::Line,
    reader::{Reader, Shared, Watcher},
};
use crate::{clock, queue, report::Reporter};

/// How long [`Port::stop`] waits for the threads.
const STOP_NS: i64 = 180_000_000;

/// A device on a serial line.
pub(super) struct Port<F: Feed> {
    events: Receiver<Event>,
    shared: Arc<Shared>,
    said: Arc<Mutex<F::Status>>,
    threads: Vec<JoinHandle<()>>,
}

impl<F: Feed> std::fmt::Debug for Port<F> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Port").field(&self.status()).finish()
    }
}

impl<F: Feed> Port<F> {
    /// Starts the threads, on a `line` that is open already or in search of one. At most `queue` events wait to be drained.
    pub(super) fn spawn(
        settings: LineSettings,
        feed: F,
        line: Option<Line>,
        reporter: Reporter,
        queue: usize,
    ) -> Result<Self, SerialError> {
        let (queue, events) = queue::newest(queue);
        let wake = eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)
            .map_err(|e| SerialError::Thread(e.into()))?;
        let shared = Arc::new(Shared {
            stop: AtomicBool::new(false),
            wake,
            alive_ns: AtomicI64::new(clock::now().ns()),
            thread: AtomicI32::new(0),
            ended: AtomicBool::new(false),
            line: Mutex::new(LineReport::default()),
        });
        let said = Arc::new(Mutex::new(F::Status::default()));
        let mut port = Self {
            events,
            shared: Arc::clone(&shared),
            said: Arc::clone(&said),
            threads: Vec::with_capacity(2),
        };
        let mut start = |name: &str, run: Box<dyn FnOnce() + Send>| {
            let thread =
                thread::Builder::new().name(name.to_owned()).spawn(run).map_err(SerialError::Thread)?;
            port.threads.push(thread);
            Ok::<_, SerialError>(())
        };
        let reader = Reader::new(settings, feed, line, Arc::clone(&shared), said, reporter.clone(), queue);
        let watcher = Watcher::new(shared, reporter, F::KIND);
        let [reading, watching] = F::KIND.threads;
        start(reading, Box::new(move || reader.run()))?;
        start(watching, Box::new(move || watcher.run()))?;
        Ok(port)
    }

    pub(super) fn events(&self) -> &Receiver<Event> {
        &self.events
    }

    /// How the line does, and what is said on it. Plain numbers are whole even where a holder panicked.
    pub(super) fn status(&self) -> (LineReport, F::Status) {
        let said = self.said.lock().unwrap_or_else(PoisonError::into_inner).clone();
        (self.shared.line().clone(), said)
    }

    /// Ends the reading and closes the port, within 200 ms.
    pub(super) fn stop(mut self) -> Result<(LineReport, F::Status), SerialError> {
        self.ask_to_stop();
        let threads = std::mem::take(&mut self.threads);
        let end = clock::now().plus_ns(STOP_NS);
        while threads.iter().any(|t| !t.is_finished()) {
            let now = clock::now();
            if now >= end {
                let node = self.shared.line().node.clone();
                let node = node.map_or_else(|| "the serial port".to_owned(), |n| n.display().to_string());
                return Err(SerialError::Blocked { node });
            }
            clock::sleep_until(now.plus_ns(1_000_000));
        }
        let broke_down = threads.into_iter().map(JoinHandle::join).filter(Result::is_err).count() > 0;
        if broke_down { Err(SerialError::BrokeDown) } else { Ok(self.status()) }
    }

    fn ask_to_stop(&self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        // The threads look at the flag every 100 ms anyway.
        let _ = rustix::io::write(&self.shared.wake, &1u64.to_ne_bytes());
    }
}

impl<F: Feed> Drop for Port<F> {
    fn drop(&mut self) {
        if !self.threads.is_empty() {
            log::warn!("the {}'s port was dropped without stop()", F::KIND.name);
            self.ask_to_stop();
        }
    }
}
