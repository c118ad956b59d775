//! Writing a recording.

use std::{
    borrow::Cow,
    collections::BTreeMap,
    fs::{self, File, OpenOptions},
    io::{self, BufWriter},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    thread::JoinHandle,
};

use bowwave_core::time::Time;
use crossbeam_channel::{Sender, TrySendError, bounded};
use mcap::{Attachment, McapError, WriteOptions, records::MessageHeader};

use super::{
    Counts, DISORDER_MAX_NS, Entry, Properties, RecordError,
    properties::{CALIBRATION, METADATA, SCENARIO},
    ros,
    schema::{ARRIVAL, MESSAGE_ENCODING, PROFILE, SCHEMA_ENCODING, Topic},
};
use crate::folder::sync_folder;

/// A chunk is closed once it holds this much; a little more than one large picture.
const CHUNK_TARGET_BYTES: u64 = 1 << 20;

/// A chunk spans no more than this, so that a file cut short misses less than a second.
const CHUNK_MAX_NS: i64 = 500_000_000;

/// Writes a recording. [`RecordingWriter::finish`] makes it whole; a writer that is only dropped leaves a file that can
/// still be read, but nobody is told whether its last bytes reached the disk.
///
/// Writing can take tens of milliseconds while the disk is busy: a loop that has to keep its pace writes from a thread of its
/// own.
pub struct RecordingWriter {
    path: PathBuf,
    mcap: mcap::Writer<BufWriter<File>>,
    syncer: Syncer,
    channels: [u16; Topic::ALL.len()],
    sequences: [u32; Topic::ALL.len()],
    message: Vec<u8>,
    counts: Counts,
    first: Option<Time>,
    newest: Option<Time>,
    chunk_start: Option<Time>,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WrittenSummary {
    /// The file.
    pub path: PathBuf,
    /// Its entries.
    pub counts: Counts,
    /// Its length in bytes.
    pub bytes: u64,
    /// From the first entry to the last, nanoseconds.
    pub duration_ns: i64,
}

impl RecordingWriter {
    /// Begins a recording in a new file at `path`. What is already there is never overwritten.
    pub fn create(path: &Path, properties: &Properties) -> Result<Self, RecordError> {
        let file =
            OpenOptions::new().write(true).create_new(true).open(path).map_err(|source| {
                match source.kind() {
                    io::ErrorKind::AlreadyExists => RecordError::Exists { path: path.into() },
                    _ => RecordError::Write { path: path.into(), source },
                }
            })?;
        let recording = Self::begin(path, file, properties)?;
        sync_folder(path).map_err(|source| RecordError::Write { path: path.into(), source })?;
        Ok(recording)
    }

    /// Begins a recording at `path` in place of what is there.
    pub fn replace(path: &Path, properties: &Properties) -> Result<Self, RecordError> {
        if let Err(source) = fs::remove_file(path)
            && source.kind() != io::ErrorKind::NotFound
        {
            return Err(RecordError::Write { path: path.into(), source });
        }
        Self::create(path, properties)
    }

    fn begin(path: &Path, file: File, properties: &Properties) -> Result<Self, RecordError> {
        let fail = |error| write_error(path, error);
        if properties.start.ns() < 0 {
            return Err(negative(path, properties.start));
        }
        let syncer =
            Syncer::start(&file).map_err(|source| RecordError::Write { path: path.into(), source })?;
        let mut mcap = WriteOptions::new()
            .profile(PROFILE)
            .library(concat!("bowwave ", env!("CARGO_PKG_VERSION")))
            .compression(None)
            .chunk_size(Some(CHUNK_TARGET_BYTES))
            // Chunks are built in memory and written whole: a file is at any moment valid up to its last chunk.
            .disable_seeking(true)
            .create(BufWriter::new(file))
            .map_err(fail)?;
        mcap.write_metadata(&mcap::records::Metadata {
            name: METADATA.to_owned(),
            metadata: properties.to_metadata(),
        })
        .map_err(fail)?;
        attach(&mut mcap, properties).map_err(fail)?;
        let mut channels = [0; Topic::ALL.len()];
        let arrival = BTreeMap::from([(ARRIVAL.0.to_owned(), ARRIVAL.1.to_owned())]);
        for topic in Topic::ALL {
            let definition = topic.definition();
            let schema =
                mcap.add_schema(topic.schema_name(), SCHEMA_ENCODING, definition.as_bytes()).map_err(fail)?;
            channels[topic as usize] =
                mcap.add_channel(schema, topic.name(), MESSAGE_ENCODING, &arrival).map_err(fail)?;
        }
        // A chunk of their own, so that damage among the data never takes the meaning of what follows with it.
        mcap.flush().map_err(fail)?;
        let mut writer = Self {
            path: path.into(),
            mcap,
            syncer,
            channels,
            sequences: [0; Topic::ALL.len()],
            message: Vec::new(),
            counts: Counts::default(),
            first: None,
            newest: None,
            chunk_start: None,
        };
        if let Some(info) = &properties.camera_info {
            let time = properties.start;
            ros::encode_camera_info(info, time, &mut writer.message).map_err(|what| RecordError::Entry {
                path: path.into(),
                time,
                what,
            })?;
            writer.put(Topic::CameraInfo, time, time, 0)?;
        }
        Ok(writer)
    }

    /// Appends an entry. One that is older than the newest by more than [`DISORDER_MAX_NS`] (a pause held it up) keeps its time and
    /// gets the nearest place among the others by time. [`RecordError::Entry`] means that this one cannot be recorded and the recording
    /// goes on without it; after [`RecordError::Write`] nothing more can be written.
    pub fn write(&mut self, entry: &Entry) -> Result<(), RecordError> {
        let time = entry.time();
        if time.ns() < 0 {
            return Err(negative(&self.path, time));
        }
        let logged = self.newest.map_or(time, |newest| time.max(newest.plus_ns(-DISORDER_MAX_NS)));
        let topic = ros::encode(entry, &mut self.message).map_err(|what| RecordError::Entry {
            path: self.path.clone(),
            time,
            what,
        })?;
        let sequence = match entry {
            Entry::Frame(frame) => frame.sequence,
            Entry::Picture(picture) => picture.sequence,
            _ => {
                let next = &mut self.sequences[topic as usize];
                *next = next.wrapping_add(1);
                *next
            }
        };
        if let Some(start) = self.chunk_start
            && logged.ns_since(start) >= CHUNK_MAX_NS
        {
            self.flush()?;
        }
        self.put(topic, time, logged, sequence)?;
        if let Some(count) = self.counts.of(topic) {
            *count += 1;
        }
        self.first = Some(self.first.map_or(logged, |first| first.min(logged)));
        self.newest = Some(self.newest.map_or(logged, |newest| newest.max(logged)));
        Ok(())
    }

    /// Hands everything written so far to the system and has it put onto the disk in the background.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        self.chunk_start = None;
        self.mcap.flush().map_err(|error| write_error(&self.path, error))?;
        self.syncer.request();
        // A failed sync may have dropped pages: from then on nothing is known to be on the disk.
        match self.syncer.take_error() {
            Some(source) => Err(RecordError::Write { path: self.path.clone(), source }),
            None => Ok(()),
        }
    }

    /// What was written so far.
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// Writes the index and waits until the disk has everything.
    pub fn finish(mut self) -> Result<WrittenSummary, RecordError> {
        let fail = |source| RecordError::Write { path: self.path.clone(), source };
        self.mcap.finish().map_err(|error| write_error(&self.path, error))?;
        let file = self.mcap.into_inner().into_inner().map_err(|error| fail(error.into_error()))?;
        file.sync_all().map_err(fail)?;
        if let Some(source) = self.syncer.stop() {
            return Err(fail(source));
        }
        let bytes = file.metadata().map_err(fail)?.len();
        let duration_ns = match (self.first, self.newest) {
            (Some(first), Some(newest)) => newest.ns_since(first),
            _ => 0,
        };
        Ok(WrittenSummary { path: self.path, counts: self.counts, bytes, duration_ns })
    }

    fn put(&mut self, topic: Topic, time: Time, logged: Time, sequence: u32) -> Result<(), RecordError> {
        let header = MessageHeader {
            channel_id: self.channels[topic as usize],
            sequence,
            log_time: logged.ns().unsigned_abs(),
            publish_time: time.ns().unsigned_abs(),
        };
        self.mcap
            .write_to_known_channel(&header, &self.message)
            .map_err(|error| write_error(&self.path, error))?;
        self.chunk_start = Some(self.chunk_start.map_or(logged, |start| start.min(logged)));
        Ok(())
    }
}

fn attach(mcap: &mut mcap::Writer<BufWriter<File>>, properties: &Properties) -> Result<(), McapError> {
    let start = properties.start.ns().unsigned_abs();
    let calibration = (CALIBRATION, Some(&properties.calibration_toml));
    for (name, text) in [calibration, (SCENARIO, properties.scenario_toml.as_ref())] {
        let Some(text) = text else { continue };
        mcap.attach(&Attachment {
            log_time: start,
            create_time: 0,
            name: name.to_owned(),
            media_type: "application/toml".to_owned(),
            data: Cow::Borrowed(text.as_bytes()),
        })?;
    }
    Ok(())
}

fn negative(path: &Path, time: Time) -> RecordError {
    let what = "times before the clock's zero cannot be recorded; let the recording begin later".to_owned();
    RecordError::Entry { path: path.into(), time, what }
}

fn write_error(path: &Path, error: McapError) -> RecordError {
    let source = match error {
        McapError::Io(source) => source,
        other => io::Error::other(other),
    };
    RecordError::Write { path: path.into(), source }
}

/// Has the file put onto the disk from a thread of its own, since that can take longer than a frame.
struct Syncer {
    requests: Option<Sender<()>>,
    error: Arc<Mutex<Option<io::Error>>>,
    thread: Option<JoinHandle<()>>,
}

impl Syncer {
    fn start(file: &File) -> io::Result<Self> {
        let file = file.try_clone()?;
        let (requests, incoming) = bounded::<()>(1);
        let error = Arc::new(Mutex::new(None));
        let shared = Arc::clone(&error);
        let thread = std::thread::Builder::new().name("record-sync".to_owned()).spawn(move || {
            for () in incoming {
                if let Err(failure) = file.sync_data() {
                    *shared.lock().unwrap_or_else(PoisonError::into_inner) = Some(failure);
                }
            }
        })?;
        Ok(Self { requests: Some(requests), error, thread: Some(thread) })
    }

    /// Asks for a sync after everything written by now; one that is already asked for covers it.
    fn request(&self) {
        if let Some(requests) = &self.requests {
            match requests.try_send(()) {
                Ok(()) | Err(TrySendError::Full(()) | TrySendError::Disconnected(())) => {}
            }
        }
    }

    fn take_error(&self) -> Option<io::Error> {
        self.error.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Waits for the thread and gives its last error.
    fn stop(mut self) -> Option<io::Error> {
        self.join();
        self.take_error()
    }

    fn join(&mut self) {
        self.requests = None;
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            *self.error.lock().unwrap_or_else(PoisonError::into_inner) =
                Some(io::Error::other("the sync thread panicked"));
        }
    }
}

impl Drop for Syncer {
    fn drop(&mut self) {
        self.join();
        if let Some(error) = self.take_error() {
            log::error!("a recording that was not finished may be incomplete on the disk: {error}");
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::recording::FrameEntry;

    #[test]
    fn a_full_disk_is_named_with_what_to_do_and_stays_an_error() {
        let path = Path::new("/dev/full");
        let file = OpenOptions::new().write(true).open(path).unwrap();
        let properties = Properties { picture: (640, 480), ..Properties::default() };
        // The device takes nothing, so the very first flush fails.
        let error = RecordingWriter::begin(path, file, &properties).err().unwrap();
        assert!(
            matches!(&error, RecordError::Write { source, .. } if source.kind() == io::ErrorKind::StorageFull)
        );
        assert!(
            error.to_string().contains("/dev/full") && error.to_string().contains("free space"),
            "{error}"
        );
    }

    #[test]
    fn a_disk_that_fills_up_leaves_a_readable_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let properties = Properties { picture: (640, 480), ..Properties::default() };
        let mut writer = RecordingWriter::create(&path, &properties).unwrap();
        let frame = |ms: i64| {
            let time = Time::from_ns(ms * 1_000_000);
            let jpeg = Arc::from([[0xff_u8, 0xd8].as_slice(), &[7; 4000], &[0xff, 0xd9]].concat());
            Entry::Frame(FrameEntry {
                arrival: time,
                mid_exposure: time,
                sequence: ms as u32,
                jpeg,
                is_recoded: false,
            })
        };
        for ms in (0..3000).step_by(100) {
            writer.write(&frame(ms)).unwrap();
        }
        // As the system reports a sync that failed: what was written may not be there.
        *writer.syncer.error.lock().unwrap() = Some(io::Error::from(io::ErrorKind::StorageFull));
        let error = (3000..6000).step_by(100).find_map(|ms| writer.write(&frame(ms)).err()).unwrap();
        assert!(
            matches!(&error, RecordError::Write { source, .. } if source.kind() == io::ErrorKind::StorageFull)
        );
        drop(writer);
        let reader = crate::RecordingReader::open(&path).unwrap();
        assert!(reader.entries().unwrap().all(|entry| entry.is_ok()));
        assert!(reader.counts().frames >= 30);
    }
}
