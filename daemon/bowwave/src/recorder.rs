//! Keeps what went in as a recording, on a thread of its own: a slow disk must not delay a frame.

use std::{
    path::Path,
    thread::{self, JoinHandle},
};

use anyhow::{Context, Result, anyhow};
use bowwave_core::event::{CameraFrame, Event, Picture};
use bowwave_devices::nmea::line_of;
use bowwave_record::{Entry, FrameEntry, PoseEntry, Properties, RecordingWriter, ShipEntry, WrittenSummary};
use crossbeam_channel::{Sender, TrySendError, bounded};
use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};

/// Entries that wait for the disk: about a second.
const QUEUE: usize = 256;

/// Pictures that come without a JPEG are coded with this quality, of 100.
const QUALITY: u8 = 90;

/// What the thread is handed.
enum Item {
    Entry(Entry),
    /// A picture that no JPEG came with.
    Raw(CameraFrame),
    Flush,
}

/// The running thread.
#[derive(Debug)]
pub struct Recorder {
    queue: Option<Sender<Item>>,
    thread: Option<JoinHandle<Result<WrittenSummary>>>,
    lossless: bool,
    dropped: u64,
}

impl Recorder {
    /// Begins a recording at `path`. `lossless` waits for the disk where the queue is full; else entries are dropped and
    /// counted.
    pub fn start(path: &Path, properties: &Properties, lossless: bool) -> Result<Self> {
        let mut writer = RecordingWriter::replace(path, properties)?;
        let (queue, items) = bounded::<Item>(QUEUE);
        let thread = thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || {
                for item in items {
                    match item {
                        Item::Entry(entry) => writer.write(&entry)?,
                        Item::Raw(frame) => {
                            let jpeg = jpeg(&frame.picture)?.into();
                            writer.write(&Entry::Frame(frame_entry(&frame, jpeg)))?;
                        }
                        Item::Flush => writer.flush()?,
                    }
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
            Event::Ship(sample) => {
                Entry::Ship(ShipEntry { arrival: sample.arrival, sentence: line_of(sample) })
            }
            Event::Mark(mark) => Entry::Mark(*mark),
            Event::Frame(frame) => match &frame.jpeg {
                Some(jpeg) => Entry::Frame(frame_entry(frame, jpeg.clone())),
                None => return self.put(Item::Raw(frame.clone())),
            },
            // Faults are in the log.
            Event::Fault(_) => return,
        };
        self.put(Item::Entry(entry));
    }

    /// What waits goes to the disk now.
    pub fn flush(&mut self) {
        self.put(Item::Flush);
    }

    /// Takes in a pose that was used.
    pub fn pose(&mut self, entry: PoseEntry) {
        self.put(Item::Entry(Entry::Pose(entry)));
    }

    /// Takes in where the camera really was.
    pub fn truth(&mut self, entry: PoseEntry) {
        self.put(Item::Entry(Entry::Truth(entry)));
    }

    fn put(&mut self, item: Item) {
        let Some(queue) = &self.queue else { return };
        // A thread that has ended took its error along: `finish` reports it.
        let lost = if self.lossless {
            queue.send(item).is_err()
        } else {
            matches!(queue.try_send(item), Err(TrySendError::Full(_) | TrySendError::Disconnected(_)))
        };
        self.dropped += u64::from(lost);
    }

    /// Whether its thread has ended before it was asked to: it could not write. [`Self::finish`] says why.
    pub fn has_ended(&self) -> bool {
        self.thread.as_ref().is_some_and(JoinHandle::is_finished)
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

fn frame_entry(frame: &CameraFrame, jpeg: std::sync::Arc<[u8]>) -> FrameEntry {
    FrameEntry { arrival: frame.arrival, mid_exposure: frame.mid_exposure, sequence: frame.sequence, jpeg }
}

fn jpeg(picture: &Picture) -> Result<Vec<u8>> {
    let (width, height) = (picture.width(), picture.height());
    let mut rgb = Vec::with_capacity(width as usize * height as usize * 3);
    for y in 0..height {
        for x in 0..width {
            rgb.extend(picture.srgb_at(x, y).map(|c| (c * 255.0).round() as u8));
        }
    }
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .encode(&rgb, width, height, ExtendedColorType::Rgb8)
        .context("cannot code a picture for the recording")?;
    Ok(bytes)
}
