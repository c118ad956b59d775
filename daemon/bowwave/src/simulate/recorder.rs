//! Keeps what went in as a recording, on a thread of its own: a slow disk must not delay a frame.

use std::{
    path::Path,
    thread::{self, JoinHandle},
};

use anyhow::{Context, Result, anyhow};
use bowwave_core::event::Event;
use bowwave_record::{Entry, FrameEntry, PoseEntry, Properties, RecordingWriter, WrittenSummary};
use crossbeam_channel::{Sender, TrySendError, bounded};

/// Entries that wait for the disk: about a second.
const QUEUE: usize = 256;

/// The running thread.
#[derive(Debug)]
pub struct Recorder {
    queue: Option<Sender<Entry>>,
    thread: Option<JoinHandle<Result<WrittenSummary>>>,
    lossless: bool,
    dropped: u64,
}

impl Recorder {
    /// Begins a recording at `path`. `lossless` waits for the disk where the queue is full; else entries are dropped and
    /// counted.
    pub fn start(path: &Path, properties: &Properties, lossless: bool) -> Result<Self> {
        let mut writer = RecordingWriter::replace(path, properties)?;
        let (queue, entries) = bounded::<Entry>(QUEUE);
        let thread = thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || {
                for entry in entries {
                    writer.write(&entry)?;
                }
                Ok(writer.finish()?)
            })
            .context("cannot start the recorder's thread; are too many processes running?")?;
        Ok(Self { queue: Some(queue), thread: Some(thread), lossless, dropped: 0 })
    }

    /// Takes in what a device reported.
    pub fn event(&mut self, event: &Event) {
        let entry = match event {
            Event::Imu(sample) => Entry::Imu(*sample),
            Event::Trigger(edge) => Entry::Trigger(*edge),
            Event::Frame(frame) => {
                let Some(jpeg) = &frame.jpeg else { return };
                Entry::Frame(FrameEntry {
                    arrival: frame.arrival,
                    mid_exposure: frame.mid_exposure,
                    sequence: frame.sequence,
                    jpeg: jpeg.clone(),
                })
            }
            // Faults are in the log.
            Event::Fault(_) => return,
        };
        self.put(entry);
    }

    /// Takes in a pose that was used.
    pub fn pose(&mut self, entry: PoseEntry) {
        self.put(Entry::Pose(entry));
    }

    /// Takes in where the camera really was.
    pub fn truth(&mut self, entry: PoseEntry) {
        self.put(Entry::Truth(entry));
    }

    fn put(&mut self, entry: Entry) {
        let Some(queue) = &self.queue else { return };
        // A thread that has ended took its error along: `finish` reports it.
        let lost = if self.lossless {
            queue.send(entry).is_err()
        } else {
            matches!(queue.try_send(entry), Err(TrySendError::Full(_) | TrySendError::Disconnected(_)))
        };
        self.dropped += u64::from(lost);
    }

    /// Entries that found no place.
    pub const fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Writes what waits and ends the recording.
    pub fn finish(mut self) -> Result<WrittenSummary> {
        drop(self.queue.take());
        let thread = self.thread.take().context("the recorder has already ended")?;
        thread.join().map_err(|_| anyhow!("the recorder's thread broke down; report it with the log"))?
    }
}
