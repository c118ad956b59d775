//! A serial line with what reads it: two threads, a bounded queue, a status.

use std::sync::Arc;

use bowwave_core::event::Event;
use crossbeam_channel::Receiver;

use super::{
    LineSettings, SerialError, SerialStatus,
    feed::LineFeed,
    line::SerialLine,
    reader::{LineReader, LineWatcher, ReaderEnds},
};
use crate::{
    clock, queue,
    report::Reporter,
    worker::{PortLink, PortWorker, StopError, ThreadLife},
};

/// A device on a serial line.
#[derive(Debug)]
pub(super) struct LinePort<F: LineFeed> {
    events: Receiver<Event>,
    worker: PortWorker<SerialStatus<F::Report>>,
}

impl<F: LineFeed> LinePort<F> {
    /// Starts the threads, on a `line` that is open already or in search of one. At most `queue` events wait to be drained.
    pub(super) fn spawn(
        settings: LineSettings,
        feed: F,
        line: Option<SerialLine>,
        reporter: Reporter,
        queue: usize,
    ) -> Result<Self, SerialError> {
        let (queue, events) = queue::newest(queue);
        let link = PortLink::new(SerialStatus::default()).map_err(SerialError::Thread)?;
        let life = Arc::new(ThreadLife::new(clock::now()));
        let watcher = LineWatcher::new(Arc::clone(&link), Arc::clone(&life), reporter.clone(), F::KIND);
        let ends = ReaderEnds { link: Arc::clone(&link), life, reporter, queue };
        let reader = LineReader::new(settings, feed, line, ends);
        let [reading, watching] = F::KIND.threads;
        let mut worker =
            PortWorker::start(reading, link, move || reader.run()).map_err(SerialError::Thread)?;
        worker.start_beside(watching, move || watcher.run()).map_err(SerialError::Thread)?;
        Ok(Self { events, worker })
    }

    pub(super) const fn events(&self) -> &Receiver<Event> {
        &self.events
    }

    /// How the line does, and what is said on it.
    pub(super) fn status(&self) -> SerialStatus<F::Report> {
        self.worker.link().status().clone()
    }

    /// Ends the reading and closes the port, within 200 ms.
    pub(super) fn stop(self) -> Result<SerialStatus<F::Report>, SerialError> {
        let link = Arc::clone(self.worker.link());
        let stopped = self.worker.stop_in_time();
        let status = link.status().clone();
        match stopped {
            Ok(()) => Ok(status),
            Err(StopError::BrokeDown) => Err(SerialError::BrokeDown),
            Err(StopError::Blocked) => {
                let node = status.line.node;
                let node = node.map_or_else(|| "the serial port".to_owned(), |n| n.display().to_string());
                Err(SerialError::Blocked { node })
            }
        }
    }
}
