//! Reading a recording.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use bowwave_core::time::Time;
use bowwave_files::ends_as_jpeg;

use super::{
    CHUNK_MAX_BYTES, Counts, DISORDER_MAX_NS, Entry, Properties, RecordError,
    channels::Channels,
    messages::{FoundMessage, Messages},
    records::Records,
    ros,
    survey::Survey,
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

    /// The entries in the order of the file, which is that in which a session met its inputs. Reads as it goes; ends after the first
    /// error.
    pub fn entries_as_written(
        &self,
    ) -> Result<impl Iterator<Item = Result<Entry, RecordError>> + use<>, RecordError> {
        let mut messages = Messages::new(Records::open(&self.path)?, Channels::default());
        let path = Arc::clone(&self.path);
        let mut ended = false;
        Ok(std::iter::from_fn(move || {
            while !ended {
                let given = match messages.next() {
                    Ok(None) => {
                        ended = true;
                        return None;
                    }
                    Ok(Some(found)) => match entry(&path, &found) {
                        Ok(None) => continue,
                        Ok(Some(entry)) => Ok(entry),
                        // What a power cut left of a chunk's end need not be what was written.
                        Err(error) => Err(messages.end_cut_chunk().unwrap_or(error)),
                    },
                    Err(error) => Err(error),
                };
                ended = given.is_err();
                return Some(given);
            }
            None
        }))
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

/// Decodes a message; `None` for what is no entry.
pub(crate) fn entry(path: &Path, found: &FoundMessage<'_>) -> Result<Option<Entry>, RecordError> {
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

/// The entries of a recording by time.
pub struct Entries {
    path: Arc<Path>,
    messages: Messages,
    /// Entries that wait for older ones that may follow, by time and order in the file.
    waiting: BTreeMap<(Time, u64), Entry>,
    waiting_bytes: u64,
    count: u64,
    newest: Time,
    given: Time,
    ended: bool,
    error: Option<RecordError>,
}

impl Entries {
    pub(crate) fn new(messages: Messages) -> Self {
        Self {
            path: Arc::clone(messages.path()),
            messages,
            waiting: BTreeMap::new(),
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
        let Some(((oldest, _), _)) = self.waiting.first_key_value() else { return false };
        self.ended
            || self.waiting_bytes > CHUNK_MAX_BYTES
            // Twice what writers may leave: one entry that is late and one that is early.
            || self.newest.ns_since(*oldest) > 2 * DISORDER_MAX_NS
    }

    fn pull(&mut self) -> Result<(), RecordError> {
        let Some(found) = self.messages.next()? else {
            self.ended = true;
            return Ok(());
        };
        let offset = found.offset;
        let time = found.logged;
        let entry = match entry(&self.path, &found) {
            Ok(Some(entry)) => entry,
            Ok(None) => return Ok(()),
            // What a power cut left of a chunk's end need not be what was written.
            Err(error) => return Err(self.messages.end_cut_chunk().unwrap_or(error)),
        };
        if time < self.given {
            let late_ns = self.given.ns_since(time);
            return Err(RecordError::OutOfOrder { path: self.path.to_path_buf(), offset, late_ns });
        }
        self.newest = self.newest.max(time);
        self.waiting_bytes += held_bytes(&entry);
        self.waiting.insert((time, self.count), entry);
        self.count += 1;
        Ok(())
    }
}

fn held_bytes(entry: &Entry) -> u64 {
    let picture = match entry {
        Entry::Frame(frame) => frame.jpeg.len(),
        Entry::Picture(picture) => picture.picture.bytes().len(),
        _ => 0,
    };
    (picture + size_of::<((Time, u64), Entry)>()) as u64
}

impl Iterator for Entries {
    type Item = Result<Entry, RecordError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if self.ready()
                && let Some(((time, _), oldest)) = self.waiting.pop_first()
            {
                self.waiting_bytes = self.waiting_bytes.saturating_sub(held_bytes(&oldest));
                self.given = time;
                return Some(Ok(oldest));
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
