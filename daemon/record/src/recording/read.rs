//! Reading a recording.

use std::{cmp::Reverse, collections::BinaryHeap, path::Path, sync::Arc};

use bowwave_core::time::Time;
use mcap::records::{Record, Statistics, op};

use super::{
    CHUNK_MAX_BYTES, CameraInfo, Counts, DISORDER_MAX_NS, Entry, Properties, RecordError,
    properties::{CALIBRATION, SCENARIO},
    ros,
    scan::{Channels, Found, Messages, Notes, Records, parse},
    schema::Topic,
};

/// A recording. Nothing of its entries is held in memory.
#[derive(Clone, Debug)]
pub struct RecordingReader {
    path: Arc<Path>,
    properties: Properties,
    counts: Counts,
    first: Time,
    last: Time,
    cut_at: Option<u64>,
}

/// What is known about a file before its entries are read.
pub(crate) struct Survey {
    pub(crate) channels: Channels,
    pub(crate) notes: Notes,
    pub(crate) camera_info: Option<CameraInfo>,
    pub(crate) counts: Counts,
    pub(crate) span: Option<(Time, Time)>,
    /// Where the file was cut short, if it was.
    pub(crate) cut_at: Option<u64>,
    /// The first thing found wrong with the data, where all of it was read.
    pub(crate) fault: Option<RecordError>,
}

impl RecordingReader {
    /// Opens a recording and reads what it says about itself. A file that was cut short opens too ([`Self::cut_at`]).
    pub fn open(path: &Path) -> Result<Self, RecordError> {
        let path: Arc<Path> = Arc::from(path);
        let survey = Survey::of(&path)?;
        if survey.counts.frames == 0 {
            return Err(survey.nothing_to_see(&path));
        }
        if let Some(foreign @ RecordError::ForeignTopic { .. }) = survey.fault {
            return Err(foreign);
        }
        let properties = survey.properties(&path)?;
        let (first, last) = survey.span.unwrap_or_default();
        Ok(Self { path, properties, counts: survey.counts, first, last, cut_at: survey.cut_at })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the recording says about itself.
    pub const fn properties(&self) -> &Properties {
        &self.properties
    }

    /// From the first entry to the last, nanoseconds.
    pub const fn duration_ns(&self) -> i64 {
        self.last.ns_since(self.first)
    }

    /// When the first entry was logged.
    pub const fn first(&self) -> Time {
        self.first
    }

    /// How many entries there are.
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// Where the file was cut short, bytes from its beginning; `None` for a whole file.
    pub const fn cut_at(&self) -> Option<u64> {
        self.cut_at
    }

    /// The entries by time, those of equal time as they were written. Reads as it goes: holds a chunk and one second of
    /// entries. Ends after the first error; of a file that was cut short, everything before the cut comes first, then
    /// [`RecordError::Truncated`].
    pub fn entries(&self) -> Result<Entries, RecordError> {
        // Channels are declared before their first message; those of an index help only a damaged file.
        Ok(Entries::new(Messages::new(Records::open(&self.path)?, Channels::default())))
    }
}

impl Survey {
    /// From the file's index where it has one, else by reading all of it.
    pub(crate) fn of(path: &Arc<Path>) -> Result<Self, RecordError> {
        match Self::from_index(path) {
            Some(survey) => Ok(survey),
            None => Self::from_data(path),
        }
    }

    /// Any doubt about the index gives `None`: the data itself then tells, and names what is wrong.
    fn from_index(path: &Arc<Path>) -> Option<Self> {
        let mut survey = Self::empty();
        let mut statistics = None;
        let mut places = Vec::new();
        let mut data = Vec::new();
        let mut records = Records::open_at(path, summary_start(path)?).ok()?;
        while let Some((opcode, offset)) = records.next(&mut data).ok()? {
            let record = parse(path, opcode, offset, &data).ok()?;
            survey.channels.note(path, &record).ok()?;
            match record {
                Record::Statistics(found) => statistics = Some(found),
                Record::MetadataIndex(index) => places.push(index.offset),
                Record::AttachmentIndex(index) => places.push(index.offset),
                _ => {}
            }
            if places.len() > 1000 {
                return None;
            }
        }
        for place in places {
            let (opcode, offset) = Records::open_at(path, place).ok()?.next(&mut data).ok()??;
            if opcode == op::METADATA || opcode == op::ATTACHMENT {
                survey.notes.note(&parse(path, opcode, offset, &data).ok()?);
            }
        }
        survey.camera_info = first_camera_info(path);
        survey.take_statistics(&statistics?)?;
        survey.notes.metadata.is_some().then_some(survey)
    }

    fn take_statistics(&mut self, statistics: &Statistics) -> Option<()> {
        for (channel, count) in &statistics.channel_message_counts {
            let slot = match self.channels.topic(*channel) {
                Some(Topic::Image) => &mut self.counts.frames,
                Some(Topic::Imu) => &mut self.counts.imu,
                Some(Topic::Trigger) => &mut self.counts.triggers,
                Some(Topic::Truth) => &mut self.counts.truths,
                Some(Topic::Pose) => &mut self.counts.poses,
                Some(Topic::CameraInfo) | None => continue,
            };
            *slot = slot.checked_add(*count)?;
        }
        let start = i64::try_from(statistics.message_start_time).ok()?;
        let end = i64::try_from(statistics.message_end_time).ok()?;
        self.span = Some((Time::from_ns(start), Time::from_ns(end.max(start))));
        Some(())
    }

    /// Reads the whole file once. A file that was cut short, or damaged further on, is surveyed up to there.
    fn from_data(path: &Arc<Path>) -> Result<Self, RecordError> {
        let mut survey = Self::empty();
        let mut messages = Messages::new(Records::open(path)?, Channels::default());
        loop {
            match messages.next() {
                Ok(Some(found)) => survey.take_message(&found),
                Ok(None) => break,
                Err(RecordError::Truncated { offset, .. }) => survey.cut_at = Some(offset),
                // Entries meet it again in its place.
                Err(error) => survey.fault = survey.fault.or(Some(error)),
            }
        }
        survey.channels = std::mem::take(&mut messages.channels);
        survey.notes = std::mem::take(&mut messages.notes);
        Ok(survey)
    }

    fn take_message(&mut self, found: &Found<'_>) {
        match found.topic {
            Topic::Image => self.counts.frames += 1,
            Topic::Imu => self.counts.imu += 1,
            Topic::Trigger => self.counts.triggers += 1,
            Topic::Truth => self.counts.truths += 1,
            Topic::Pose => self.counts.poses += 1,
            Topic::CameraInfo => {
                if self.camera_info.is_none() {
                    self.camera_info = ros::decode_camera_info(found.data).ok();
                }
            }
        }
        let (first, last) = self.span.unwrap_or((found.time, found.time));
        self.span = Some((first.min(found.time), last.max(found.time)));
    }

    fn empty() -> Self {
        Self {
            channels: Channels::default(),
            notes: Notes::default(),
            camera_info: None,
            counts: Counts::default(),
            span: None,
            cut_at: None,
            fault: None,
        }
    }

    /// Why there are no pictures.
    fn nothing_to_see(self, path: &Path) -> RecordError {
        let ours = self.notes.metadata.is_some();
        match (self.fault, self.cut_at) {
            (Some(RecordError::Compressed { .. } | RecordError::ForeignTopic { .. }) | None, None)
                if !ours =>
            {
                RecordError::Foreign { path: path.into(), topics: self.channels.names }
            }
            (Some(fault), _) => fault,
            (None, cut_at) => RecordError::NoFrames { path: path.into(), cut_at },
        }
    }

    /// The properties, checked.
    pub(crate) fn properties(&self, path: &Path) -> Result<Properties, RecordError> {
        let metadata = self
            .notes
            .metadata
            .as_ref()
            .ok_or_else(|| RecordError::Foreign { path: path.into(), topics: self.channels.names.clone() })?;
        let text = |name: &str| -> Result<Option<String>, RecordError> {
            let Some(bytes) = self.notes.attachments.get(name) else { return Ok(None) };
            String::from_utf8(bytes.clone()).map(Some).map_err(|_| RecordError::Property {
                path: path.into(),
                name: name.into(),
                what: "is not UTF-8".to_owned(),
            })
        };
        let calibration_toml = text(CALIBRATION)?.ok_or_else(|| RecordError::Property {
            path: path.into(),
            name: CALIBRATION.into(),
            what: "is missing".to_owned(),
        })?;
        Ok(Properties {
            calibration_toml,
            scenario_toml: text(SCENARIO)?,
            camera_info: self.camera_info.clone(),
            ..Properties::from_metadata(path, metadata)?
        })
    }
}

/// Where the index begins; `None` where the file does not end as a whole file does.
fn summary_start(path: &Path) -> Option<u64> {
    use std::io::{Read, Seek, SeekFrom};
    const TAIL: usize = 9 + 20 + 8;
    let mut file = std::fs::File::open(path).ok()?;
    let end = file.seek(SeekFrom::End(-(TAIL as i64))).ok()?;
    let mut tail = [0; TAIL];
    file.read_exact(&mut tail).ok()?;
    let start = u64::from_le_bytes(tail.get(9..17)?.try_into().ok()?);
    let whole = tail[0] == op::FOOTER && tail.ends_with(mcap::MAGIC);
    (whole && (mcap::MAGIC.len() as u64..=end).contains(&start)).then_some(start)
}

/// The camera's numbers where they are the first message, as our writer leaves them.
fn first_camera_info(path: &Arc<Path>) -> Option<CameraInfo> {
    let mut messages = Messages::new(Records::open(path).ok()?, Channels::default());
    let found = messages.next().ok()??;
    (found.topic == Topic::CameraInfo).then(|| ros::decode_camera_info(found.data).ok()).flatten()
}

/// Decodes a message; `None` for what is no entry.
pub(crate) fn entry(path: &Path, found: &Found<'_>) -> Result<Option<Entry>, RecordError> {
    let fail = |what| RecordError::Message {
        path: path.into(),
        offset: found.offset,
        topic: found.topic.name(),
        time: found.time,
        what,
    };
    let entry = ros::decode(found.topic, found.time, found.sequence, found.data).map_err(fail)?;
    if let (Some(Entry::Frame(frame)), false) = (&entry, found.verified)
        && !ends_as_jpeg(&frame.jpeg)
    {
        return Err(fail("a picture without its end, in a chunk without its checksum".to_owned()));
    }
    Ok(entry)
}

/// Whether the picture's last marker is there; some cameras pad with zeros behind it.
fn ends_as_jpeg(jpeg: &[u8]) -> bool {
    let padding = jpeg.iter().rev().take_while(|byte| **byte == 0).count();
    jpeg.get(..jpeg.len() - padding).is_some_and(|used| used.ends_with(&[0xff, 0xd9]))
}

/// The entries of a recording by time.
pub struct Entries {
    path: Arc<Path>,
    messages: Messages,
    waiting: BinaryHeap<Reverse<Waiting>>,
    waiting_bytes: u64,
    count: u64,
    newest: Time,
    given: Time,
    ended: bool,
    error: Option<RecordError>,
}

/// An entry that waits for older ones that may follow.
struct Waiting {
    key: (Time, u64),
    entry: Entry,
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

impl Eq for Waiting {}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.key.cmp(&other.key)
    }
}

impl Entries {
    pub(crate) fn new(messages: Messages) -> Self {
        Self {
            path: Arc::clone(messages.path()),
            messages,
            waiting: BinaryHeap::new(),
            waiting_bytes: 0,
            count: 0,
            newest: Time::MIN,
            given: Time::MIN,
            ended: false,
            error: None,
        }
    }

    /// Whether the oldest entry that waits can be given: nothing older can follow, or too much waits.
    fn ready(&self) -> bool {
        let Some(Reverse(oldest)) = self.waiting.peek() else { return false };
        self.ended
            || self.waiting_bytes > CHUNK_MAX_BYTES
            // Twice what writers may leave: one entry that is late and one that is early.
            || self.newest.ns_since(oldest.key.0) > 2 * DISORDER_MAX_NS
    }

    fn pull(&mut self) -> Result<(), RecordError> {
        let Some(found) = self.messages.next()? else {
            self.ended = true;
            return Ok(());
        };
        let offset = found.offset;
        let entry = match entry(&self.path, &found) {
            Ok(Some(entry)) => entry,
            Ok(None) => return Ok(()),
            // What a power cut left of a chunk's end need not be what was written.
            Err(error) => return Err(self.messages.end_cut_chunk().unwrap_or(error)),
        };
        let time = entry.time();
        if time < self.given {
            let late_ns = self.given.ns_since(time);
            return Err(RecordError::OutOfOrder { path: self.path.to_path_buf(), offset, late_ns });
        }
        self.newest = self.newest.max(time);
        self.waiting_bytes += held_bytes(&entry);
        self.waiting.push(Reverse(Waiting { key: (time, self.count), entry }));
        self.count += 1;
        Ok(())
    }
}

fn held_bytes(entry: &Entry) -> u64 {
    let picture = if let Entry::Frame(frame) = entry { frame.jpeg.len() } else { 0 };
    (picture + size_of::<Waiting>()) as u64
}

impl Iterator for Entries {
    type Item = Result<Entry, RecordError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if self.ready()
                && let Some(Reverse(oldest)) = self.waiting.pop()
            {
                self.waiting_bytes = self.waiting_bytes.saturating_sub(held_bytes(&oldest.entry));
                self.given = oldest.key.0;
                return Some(Ok(oldest.entry));
            }
            if self.ended {
                return self.error.take().map(Err);
            }
            if let Err(error) = self.pull() {
                self.error = Some(error);
                self.ended = true;
            }
        }
    }
}
