//! A serial line with what reads it: two threads, a bounded queue, a status.

use std::{path::Path, sync::Arc};

use bowwave_core::event::Event;
use crossbeam_channel::Receiver;

use super::{
    Baud, LineSettings, SerialError, SerialStatus,
    feed::LineFeed,
    line::SerialLine,
    reader::{LineReader, LineWatcher, ReaderEnds},
};
use crate::{
    clock, queue,
    report::{Reporter, reporting},
    worker::{PortLink, PortWorker, StopError, ThreadLife},
};

/// A device on a serial line.
#[derive(Debug)]
pub(super) struct LinePort<F: LineFeed> {
    events: Receiver<Event>,
    worker: PortWorker<SerialStatus<F::Report>>,
}

impl<F: LineFeed> LinePort<F> {
    /// Starts the threads in search of the line. At most `queue` events wait to be drained.
    pub(super) fn start(
        settings: LineSettings,
        feed: F,
        reporter: Reporter,
        queue: usize,
    ) -> Result<Self, SerialError> {
        settings.baud.check()?;
        Self::spawn(settings, feed, None, reporter, queue)
    }

    /// The same on a port that must be there, without reports.
    pub(super) fn open(node: &Path, baud: u32, feed: F, queue: usize) -> Result<Self, SerialError> {
        let device = Some(node.to_owned());
        let settings = LineSettings { device, baud: Baud::Fixed(baud), ..LineSettings::default() };
        settings.baud.check()?;
        let line = SerialLine::open(node, baud, settings.low_latency)?;
        Self::spawn(settings, feed, Some(line), reporting().0, queue)
    }

    fn spawn(
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
            Err(StopError::Blocked) => Err(SerialError::Blocked { node: status.line.node() }),
        }
    }
}
