//! Keeps a session's inputs as a recording, on a thread of its own: a slow disk must not delay a frame.

use std::{
    path::PathBuf,
    sync::Arc,
    thread::{self, JoinHandle},
};

use anyhow::{Context, Result, anyhow};
use bowwave_core::{
    event::{CameraFrame, Event, Picture, PixelFormat, Tick},
    session::SessionDigest,
    time::Time,
};
use bowwave_devices::nmea::{fix_lines, line_of};
use bowwave_record::{
    Entry, FaultEntry, FrameEntry, PictureEntry, PoseEntry, Properties, RecordError, RecordingWriter,
    ShipEntry, TickEntry, WrittenSummary,
};
use crossbeam_channel::{Sender, TrySendError, bounded};
use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};

/// Ticks whose inputs wait for the disk, with the poses between them: about a second. What a pause of the loop held up comes with one
/// tick and takes one place.
const QUEUE: usize = 96;

/// Pictures that come without a JPEG are coded with this quality, of 100, where pixels need not be exact.
const QUALITY: u8 = 90;
/// The same on a computer that is too busy.
const QUALITY_SPARED: u8 = 50;

/// Settings of a recorder.
#[derive(Clone, Debug)]
pub struct RecorderOptions {
    /// The file. What is there is replaced.
    pub path: PathBuf,
    /// What the recording says about itself.
    pub properties: Properties,
    /// Wait for the disk where the queue is full; else entries are lost and counted.
    pub lossless: bool,
    /// Keep the pixels of pictures that come without a JPEG, as the session saw them. Else they are coded, which takes a tenth of the
    /// room, and a replay sees slightly other pixels.
    pub exact_pixels: bool,
}

/// One job of the thread.
enum RecorderJob {
    Entry(Entry),
    /// A picture that no JPEG came with, to be coded, and its quality.
    Code(CameraFrame, u8),
    Flush,
}

/// The running thread.
#[derive(Debug)]
pub struct Recorder {
    queue: Option<Sender<Vec<RecorderJob>>>,
    thread: Option<JoinHandle<Result<WrittenSummary>>>,
    lossless: bool,
    exact_pixels: bool,
    /// Quality of pictures that are coded here.
    quality: u8,
    lost: u64,
    inputs: u64,
    /// When the newest input or tick of the recording came.
    newest: Option<Time>,
}

impl Recorder {
    /// Begins a recording.
    pub fn start(options: &RecorderOptions) -> Result<Self> {
        let mut writer = RecordingWriter::replace(&options.path, &options.properties)?;
        let (queue, jobs) = bounded::<Vec<RecorderJob>>(QUEUE);
        let thread = thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || {
                for job in jobs.into_iter().flatten() {
                    match job {
                        RecorderJob::Entry(entry) => write(&mut writer, &entry)?,
                        RecorderJob::Code(frame, quality) => {
                            let jpeg = jpeg(&frame.picture, quality)?.into();
                            write(
                                &mut writer,
                                &Entry::Frame(FrameEntry { is_recoded: true, ..frame_entry(&frame, jpeg) }),
                            )?;
                        }
                        RecorderJob::Flush => writer.flush()?,
                    }
                }
                Ok(writer.finish()?)
            })
            .context("cannot start the recorder's thread; are too many processes running?")?;
        let (lossless, exact_pixels) = (options.lossless, options.exact_pixels);
        Ok(Self { lossless, exact_pixels, ..Self::of(queue, thread) })
    }

    const fn of(queue: Sender<Vec<RecorderJob>>, thread: JoinHandle<Result<WrittenSummary>>) -> Self {
        Self {
            queue: Some(queue),
            thread: Some(thread),
            lossless: false,
            exact_pixels: false,
            quality: QUALITY,
            lost: 0,
            inputs: 0,
            newest: None,
        }
    }

    /// Whether pictures are coded coarsely, so that a busy computer gets time.
    pub const fn spare(&mut self, spares: bool) {
        self.quality = if spares { QUALITY_SPARED } else { QUALITY };
    }

    /// Takes in the events that the session meets with `tick`, and where it is stepped by it, the tick with a digest over what the session
    /// gave before.
    pub fn inputs(&mut self, events: &[Event], tick: Tick, digest: Option<SessionDigest>) {
        let mut jobs = Vec::with_capacity(events.len() + 1);
        for event in events {
            self.inputs += 1;
            let logged = self.newest.unwrap_or(tick.time);
            let time = time_of(event).unwrap_or(logged);
            self.newest = Some(time.max(logged));
            self.add(event, logged, &mut jobs);
        }
        if let Some(digest) = digest {
            jobs.push(RecorderJob::Entry(Entry::Tick(TickEntry {
                tick,
                inputs: self.inputs,
                records: digest.records.get(),
                scenes: digest.scenes.get(),
            })));
            self.inputs += 1;
            self.newest = self.newest.max(Some(tick.time));
        }
        self.put(jobs);
    }

    /// Adds what is recorded of an event; `logged` is the time of a fault in the recording. With the tick's own time, inputs that a pause
    /// held up would come after a fault and lose their place by time.
    fn add(&mut self, event: &Event, logged: Time, jobs: &mut Vec<RecorderJob>) {
        let mut entry = |entry| jobs.push(RecorderJob::Entry(entry));
        match event {
            Event::Imu(sample) => entry(Entry::Imu(*sample)),
            Event::Trigger(edge) => entry(Entry::Trigger(*edge)),
            Event::Ship(sample) => {
                entry(Entry::Ship(ShipEntry { arrival: sample.arrival, sentence: line_of(sample) }));
                entry(Entry::ShipValues(*sample));
            }
            Event::ShipFix(fix) => {
                for line in fix_lines(fix).split_inclusive('\n') {
                    entry(Entry::Ship(ShipEntry { arrival: fix.arrival, sentence: line.to_owned() }));
                }
                entry(Entry::ShipFix(*fix));
            }
            Event::Mark(mark) => entry(Entry::Mark(*mark)),
            Event::Act(act) => entry(Entry::Act(*act)),
            Event::Order(order) => entry(Entry::Order(order.clone())),
            Event::Frame(frame) => match &frame.jpeg {
                Some(jpeg) => entry(Entry::Frame(frame_entry(frame, jpeg.clone()))),
                None if self.exact_pixels => entry(Entry::Picture(PictureEntry {
                    arrival: frame.arrival,
                    mid_exposure: frame.mid_exposure,
                    sequence: frame.sequence,
                    picture: frame.picture.clone(),
                })),
                None => jobs.push(RecorderJob::Code(frame.clone(), self.quality)),
            },
            Event::Fault(change) => entry(Entry::Fault(FaultEntry { logged, change: change.clone() })),
        }
    }

    /// What waits goes to the disk now.
    pub fn flush(&mut self) {
        self.put(vec![RecorderJob::Flush]);
    }

    /// Takes in a pose that was used.
    pub fn pose(&mut self, entry: PoseEntry) {
        self.put(vec![RecorderJob::Entry(Entry::Pose(entry))]);
    }

    /// Takes in where the camera really was.
    pub fn truth(&mut self, entry: PoseEntry) {
        self.put(vec![RecorderJob::Entry(Entry::Truth(entry))]);
    }

    fn put(&mut self, jobs: Vec<RecorderJob>) {
        let Some(queue) = self.queue.as_ref().filter(|_| !jobs.is_empty()) else { return };
        let count = jobs.len() as u64;
        // A thread that has ended took its error along: `finish` reports it.
        let lost = if self.lossless {
            queue.send(jobs).is_err()
        } else {
            matches!(queue.try_send(jobs), Err(TrySendError::Full(_) | TrySendError::Disconnected(_)))
        };
        self.lost += if lost { count } else { 0 };
    }

    /// One whose disk does not answer.
    #[cfg(test)]
    pub(super) fn hung() -> Self {
        let (queue, _) = bounded(QUEUE);
        let thread = thread::spawn(|| {
            loop {
                thread::park();
            }
        });
        Self::of(queue, thread)
    }

    /// Takes nothing more: its thread writes what waits, and ends. Never waits.
    pub fn close(&mut self) {
        self.queue = None;
    }

    /// Its thread has ended: after [`Self::close`], or because it could not write. [`Self::finish`] says why.
    pub fn has_ended(&self) -> bool {
        self.thread.as_ref().is_some_and(JoinHandle::is_finished)
    }

    /// Entries that found no place.
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    /// Writes what waits and ends the recording.
    pub fn finish(mut self) -> Result<WrittenSummary> {
        self.close();
        let thread = self.thread.take().context("the recorder has already ended")?;
        thread.join().map_err(|_| anyhow!("the recorder's thread broke down; report it with the log"))?
    }
}

/// When an input came; a fault's own time says when it began, which may be long ago.
fn time_of(event: &Event) -> Option<Time> {
    match event {
        Event::Imu(sample) => Some(sample.arrival),
        Event::Trigger(edge) => Some(edge.time),
        Event::Ship(sample) => Some(sample.arrival),
        Event::ShipFix(fix) => Some(fix.arrival),
        Event::Mark(mark) => Some(mark.time),
        Event::Act(act) => Some(act.time),
        Event::Order(order) => Some(order.time),
        Event::Frame(frame) => Some(frame.arrival),
        Event::Fault(_) => None,
    }
}

/// Writes one entry. One that cannot be represented is left out with a line in the log, and a replay notices that it is missing.
fn write(writer: &mut RecordingWriter, entry: &Entry) -> Result<()> {
    match writer.write(entry) {
        Err(e @ RecordError::Entry { .. }) => {
            log::warn!("{e}");
            Ok(())
        }
        other => Ok(other?),
    }
}

fn frame_entry(frame: &CameraFrame, jpeg: Arc<[u8]>) -> FrameEntry {
    FrameEntry {
        arrival: frame.arrival,
        mid_exposure: frame.mid_exposure,
        sequence: frame.sequence,
        jpeg,
        is_recoded: false,
    }
}

fn jpeg(picture: &Picture, quality: u8) -> Result<Vec<u8>> {
    let (width, height) = (picture.width(), picture.height());
    let mut rgb = Vec::with_capacity(PixelFormat::Rgb.byte_len(width, height));
    for y in 0..height {
        for x in 0..width {
            rgb.extend(picture.srgb_at(x, y).map(|c| (c * 255.0).round() as u8));
        }
    }
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality)
        .encode(&rgb, width, height, ExtendedColorType::Rgb8)
        .context("cannot code a picture for the recording")?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use bowwave_core::{
        event::{Mark, MarkKind},
        fault::{Fault, FaultChange},
    };
    use bowwave_record::RecordingReader;

    use super::*;

    /// A pause of the loop holds up a second of inputs; a fault that is told before them must not make them too old.
    #[test]
    fn inputs_that_a_pause_held_up_are_kept_beside_a_fault() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("recording.mcap");
        let options = RecorderOptions {
            path: path.clone(),
            properties: Properties { picture: (2, 2), ..Properties::default() },
            lossless: false,
            exact_pixels: true,
        };
        let mut recorder = Recorder::start(&options).unwrap();
        let at = |seconds| Time::from_ns(0).plus_secs(seconds);
        let tick = |seconds| Tick::at(at(seconds));
        let none = Some(SessionDigest::default());
        let mark = |seconds| Event::Mark(Mark { time: at(seconds), kind: MarkKind::Stow });
        let picture = Picture::new(PixelFormat::Rgb, 2, 2, vec![0; 12].into()).unwrap();
        let frame = CameraFrame { arrival: at(0.9), mid_exposure: at(0.9), sequence: 0, picture, jpeg: None };
        recorder.inputs(&[Event::Frame(frame)], tick(1.0), none);
        let fault = FaultChange::raised(at(2.4), Fault::GpuLost, "lost");
        // More than ever wait in the queue come with one tick.
        let held_up: Vec<_> = (0..3000).map(|n| mark(1.1 + f64::from(n) * 4e-4)).collect();
        recorder.inputs(&[vec![Event::Fault(fault)], held_up].concat(), tick(2.6), none);
        recorder.finish().unwrap();

        let reader = RecordingReader::open(&path).unwrap();
        let kept: Vec<_> = reader.entries_as_written().unwrap().map(Result::unwrap).collect();
        let marks = kept.iter().filter(|entry| matches!(entry, Entry::Mark(_))).count();
        assert_eq!((kept.len(), marks), (3004, 3000));
        assert!(matches!(kept[2], Entry::Fault(_)), "the fault keeps its place");
    }

    #[test]
    fn a_busy_computer_codes_pictures_coarsely_and_keeps_each() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("recording.mcap");
        let properties = Properties { picture: (16, 16), ..Properties::default() };
        let options = RecorderOptions { path: path.clone(), properties, lossless: true, exact_pixels: false };
        let mut recorder = Recorder::start(&options).unwrap();
        for n in 0..8 {
            recorder.spare(n >= 4);
            let time = Time::from_ns(0).plus_secs(f64::from(n) / 30.0);
            let picture = Picture::new(
                PixelFormat::Rgb,
                16,
                16,
                (0..768_u32).map(|i| (i * i * 7 + n as u32 * 30) as u8).collect::<Vec<_>>().into(),
            )
            .unwrap();
            let frame =
                CameraFrame { arrival: time, mid_exposure: time, sequence: n as u32, picture, jpeg: None };
            recorder.inputs(&[Event::Frame(frame)], Tick::at(time), None);
        }
        recorder.finish().unwrap();
        let reader = RecordingReader::open(&path).unwrap();
        let kept: Vec<_> = reader
            .entries_as_written()
            .unwrap()
            .filter_map(|entry| match entry.unwrap() {
                Entry::Frame(frame) => Some(frame),
                _ => None,
            })
            .collect();
        let sizes: Vec<usize> = kept.iter().map(|frame| frame.jpeg.len()).collect();
        assert_eq!(kept.len(), 8);
        assert!(sizes[..4].iter().min() > sizes[4..].iter().max(), "{sizes:?}");
        assert!(kept.windows(2).all(|pair| pair[0].jpeg != pair[1].jpeg), "each is of its own time");
    }
}
