//! From a file's bytes to messages: frames records with the MCAP crate's sans-io reader, cuts chunks into messages, and holds
//! never more than one record.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, Read, Seek, SeekFrom},
    ops::Range,
    path::Path,
    sync::Arc,
};

use bowwave_core::time::Time;
use mcap::{
    McapError,
    records::{ChunkHeader, Record, op},
    sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions},
};

use super::{
    CHUNK_MAX_BYTES, RecordError,
    schema::{MESSAGE_ENCODING, SCHEMA_ENCODING, Topic},
};

/// Largest record that is not a chunk of pictures: a chunk's own header comes on top.
const RECORD_MAX_BYTES: u64 = CHUNK_MAX_BYTES + 1024;
/// Bytes of opcode and length before each record.
const PREFIX: usize = 9;
/// Bytes of channel, sequence and two times before each message's data.
const MESSAGE_HEADER: usize = 22;

/// The records of a file from some place on, one at a time.
pub(crate) struct Records {
    path: Arc<Path>,
    file: File,
    file_bytes: u64,
    read_to: u64,
    next_at: u64,
    reader: LinearReader,
    ended: bool,
}

impl Records {
    /// From the file's beginning. Checks the magic bytes with the first record.
    pub(crate) fn open(path: &Arc<Path>) -> Result<Self, RecordError> {
        Self::open_at(path, 0)
    }

    /// From the record that begins at `offset`; 0 is the beginning of the file.
    pub(crate) fn open_at(path: &Arc<Path>, offset: u64) -> Result<Self, RecordError> {
        let open = |source| RecordError::Open { path: path.to_path_buf(), source };
        let mut file = File::open(path).map_err(open)?;
        let status = file.metadata().map_err(open)?;
        if status.is_dir() {
            return Err(open(io::Error::from(io::ErrorKind::IsADirectory)));
        }
        if status.len() == 0 {
            return Err(RecordError::Empty { path: path.to_path_buf() });
        }
        let mut magic = Vec::with_capacity(mcap::MAGIC.len());
        Read::by_ref(&mut file).take(mcap::MAGIC.len() as u64).read_to_end(&mut magic).map_err(open)?;
        if !mcap::MAGIC.starts_with(&magic) {
            return Err(RecordError::NotMcap { path: path.to_path_buf() });
        }
        file.seek(SeekFrom::Start(offset)).map_err(open)?;
        let options = LinearReaderOptions::default()
            .with_emit_chunks(true)
            .with_skip_start_magic(offset > 0)
            .with_record_length_limit(usize::try_from(RECORD_MAX_BYTES).unwrap_or(usize::MAX));
        Ok(Self {
            path: Arc::clone(path),
            file,
            file_bytes: status.len(),
            read_to: offset,
            next_at: offset.max(mcap::MAGIC.len() as u64),
            reader: LinearReader::new_with_options(options),
            ended: false,
        })
    }

    pub(crate) fn path(&self) -> &Arc<Path> {
        &self.path
    }

    /// The file's length when it was opened.
    pub(crate) const fn file_bytes(&self) -> u64 {
        self.file_bytes
    }

    /// Puts the next record's data into `data` and gives its opcode and place; `None` after the last. Nothing follows an error.
    pub(crate) fn next(&mut self, data: &mut Vec<u8>) -> Result<Option<(u8, u64)>, RecordError> {
        if self.ended {
            return Ok(None);
        }
        let result = self.advance(data);
        self.ended = !matches!(result, Ok(Some(_)));
        result
    }

    fn advance(&mut self, data: &mut Vec<u8>) -> Result<Option<(u8, u64)>, RecordError> {
        loop {
            let at = self.next_at;
            let wanted = match self.reader.next_event() {
                None => return Ok(None),
                Some(Ok(LinearReadEvent::Record { opcode, data: found })) => {
                    data.clear();
                    data.extend_from_slice(found);
                    self.next_at = at.saturating_add((PREFIX + found.len()) as u64);
                    return Ok(Some((opcode, at)));
                }
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => wanted,
                Some(Err(error)) => return Err(self.framing_error(at, error)),
            };
            // Never allocate for more than the file can still hold, whatever a length field claims.
            let rest = usize::try_from(self.file_bytes.saturating_sub(self.read_to)).unwrap_or(usize::MAX);
            let target = self.reader.insert(wanted.min(rest).max(1));
            let count = self.file.read(target).map_err(|source| RecordError::Read {
                path: self.path.to_path_buf(),
                offset: self.read_to,
                source,
            })?;
            self.reader.notify_read(count);
            self.read_to = self.read_to.saturating_add(count as u64);
        }
    }

    fn framing_error(&self, offset: u64, error: McapError) -> RecordError {
        let path = self.path.to_path_buf();
        match error {
            McapError::UnexpectedEof => RecordError::Truncated { path, offset, bytes: self.file_bytes },
            McapError::RecordTooLarge { opcode, len } => RecordError::TooLarge {
                path,
                offset,
                what: format!("a record of kind {opcode:#04x}"),
                bytes: len,
                limit: RECORD_MAX_BYTES,
            },
            other => RecordError::Damaged { path, offset, what: other.to_string() },
        }
    }

    /// The bytes of the chunk that begins at `offset` and was cut off by the file's end, without opcode and length.
    fn cut_chunk(&mut self, offset: u64, data: &mut Vec<u8>) -> Result<bool, RecordError> {
        let read = |source| RecordError::Read { path: self.path.to_path_buf(), offset, source };
        self.file.seek(SeekFrom::Start(offset)).map_err(read)?;
        data.clear();
        Read::by_ref(&mut self.file)
            .take(RECORD_MAX_BYTES + PREFIX as u64)
            .read_to_end(data)
            .map_err(read)?;
        let is_chunk = data.first() == Some(&op::CHUNK) && data.len() > PREFIX;
        if is_chunk {
            data.drain(..PREFIX);
        }
        Ok(is_chunk)
    }
}

/// Parses a record. The crate's own parser panics on attachments that are too short for their checksum.
pub(crate) fn parse<'a>(
    path: &Path,
    opcode: u8,
    offset: u64,
    data: &'a [u8],
) -> Result<Record<'a>, RecordError> {
    let damaged = |what: String| RecordError::Damaged { path: path.into(), offset, what };
    if opcode == op::ATTACHMENT && !attachment_fits(data) {
        return Err(damaged("an attachment that is shorter than its header says".to_owned()));
    }
    mcap::parse_record(opcode, data).map_err(|error| damaged(error.to_string()))
}

/// Whether an attachment's two times, two strings, length and checksum fit into its record.
fn attachment_fits(data: &[u8]) -> bool {
    let mut at = 16_usize;
    for _ in 0..2 {
        let Some(length) = u32_at(data, at) else { return false };
        at = at.saturating_add(4).saturating_add(length as usize);
    }
    data.len() >= at.saturating_add(8 + 4)
}

fn u32_at(data: &[u8], at: usize) -> Option<u32> {
    let bytes = data.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(bytes.try_into().ok()?))
}

fn u64_at(data: &[u8], at: usize) -> Option<u64> {
    let bytes = data.get(at..at.checked_add(8)?)?;
    Some(u64::from_le_bytes(bytes.try_into().ok()?))
}

/// A message of one of our topics.
pub(crate) struct Found<'a> {
    pub(crate) topic: Topic,
    pub(crate) time: Time,
    pub(crate) sequence: u32,
    pub(crate) data: &'a [u8],
    /// Where the message is, or the chunk that it is in.
    pub(crate) offset: u64,
    /// Whether its bytes are known to be those that were written.
    pub(crate) verified: bool,
}

/// A message's header.
struct Head {
    topic: Topic,
    time: Time,
    sequence: u32,
}

/// What channels and schemas mean.
#[derive(Clone, Default)]
pub(crate) struct Channels {
    schemas: BTreeMap<u16, (String, String)>,
    channels: BTreeMap<u16, Option<Topic>>,
    /// All topics, ours or not.
    pub(crate) names: Vec<String>,
}

impl Channels {
    pub(crate) fn topic(&self, channel: u16) -> Option<Topic> {
        self.channels.get(&channel).copied().flatten()
    }

    /// Notes a schema or channel record; other records are no concern of it.
    pub(crate) fn note(&mut self, path: &Path, record: &Record<'_>) -> Result<(), RecordError> {
        match record {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, (header.name.clone(), header.encoding.clone()));
            }
            Record::Channel(channel) => {
                if self.names.len() < 16 && !self.names.contains(&channel.topic) {
                    self.names.push(channel.topic.clone());
                }
                // Known from here on, if only as none of ours.
                self.channels.insert(channel.id, None);
                if let Some(topic) = Topic::from_name(&channel.topic) {
                    self.check(path, topic, channel)?;
                    self.channels.insert(channel.id, Some(topic));
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn check(&self, path: &Path, topic: Topic, channel: &mcap::records::Channel) -> Result<(), RecordError> {
        let (name, encoding) =
            self.schemas.get(&channel.schema_id).map_or(("no schema", ""), |(n, e)| (n.as_str(), e.as_str()));
        if name == topic.schema_name()
            && encoding == SCHEMA_ENCODING
            && channel.message_encoding == MESSAGE_ENCODING
        {
            return Ok(());
        }
        Err(RecordError::ForeignTopic {
            path: path.into(),
            topic: channel.topic.clone(),
            found: format!("{name} ({encoding}, {})", channel.message_encoding),
            expected: format!("{} ({SCHEMA_ENCODING}, {MESSAGE_ENCODING})", topic.schema_name()),
        })
    }
}

/// The messages of a recording in the order of the file.
pub(crate) struct Messages {
    records: Records,
    pub(crate) channels: Channels,
    /// Metadata and attachments that were passed.
    pub(crate) notes: Notes,
    /// The record, or the inside of the chunk, that is being cut up.
    data: Vec<u8>,
    rest: Range<usize>,
    offset: u64,
    verified: bool,
    /// Told once the salvaged part of a cut chunk is used up.
    truncated: Option<RecordError>,
}

/// Metadata and attachments of ours, as they are in the file.
#[derive(Default)]
pub(crate) struct Notes {
    pub(crate) metadata: Option<BTreeMap<String, String>>,
    pub(crate) attachments: BTreeMap<String, Vec<u8>>,
}

impl Notes {
    pub(crate) fn note(&mut self, record: &Record<'_>) {
        use super::properties::{CALIBRATION, METADATA, SCENARIO};
        match record {
            Record::Metadata(metadata) if metadata.name == METADATA => {
                self.metadata = Some(metadata.metadata.clone());
            }
            Record::Attachment { header, data, .. }
                if [CALIBRATION, SCENARIO].contains(&header.name.as_str()) =>
            {
                self.attachments.insert(header.name.clone(), data.to_vec());
            }
            _ => {}
        }
    }
}

impl Messages {
    /// `channels` are those known from the file's index; those of the data are added.
    pub(crate) fn new(records: Records, channels: Channels) -> Self {
        Self {
            records,
            channels,
            notes: Notes::default(),
            data: Vec::new(),
            rest: 0..0,
            offset: 0,
            verified: true,
            truncated: None,
        }
    }

    pub(crate) fn path(&self) -> &Arc<Path> {
        self.records.path()
    }

    /// The next message of a topic of ours; `None` after the last. After an error the next call goes on behind the chunk or
    /// message that it was about, if anything behind it can be found.
    pub(crate) fn next(&mut self) -> Result<Option<Found<'_>>, RecordError> {
        loop {
            if let Some((opcode, body)) = self.next_inner()? {
                match opcode {
                    op::MESSAGE => {
                        if let Some(Head { topic, time, sequence }) = self.message(&body)? {
                            let data =
                                self.data.get(body.start + MESSAGE_HEADER..body.end).unwrap_or_default();
                            let (offset, verified) = (self.offset, self.verified);
                            return Ok(Some(Found { topic, time, sequence, data, offset, verified }));
                        }
                    }
                    op::SCHEMA | op::CHANNEL => {
                        let data = self.data.get(body).unwrap_or_default();
                        let record = parse(self.records.path(), opcode, self.offset, data)?;
                        self.channels.note(self.records.path(), &record)?;
                    }
                    _ => {}
                }
                continue;
            }
            if let Some(truncated) = self.truncated.take() {
                return Err(truncated);
            }
            if !self.next_record()? {
                return Ok(None);
            }
        }
    }

    /// Ends a chunk that was cut off and gives the error that says so.
    pub(crate) fn end_cut_chunk(&mut self) -> Option<RecordError> {
        let truncated = self.truncated.take()?;
        self.rest = 0..0;
        Some(truncated)
    }

    /// Opcode and place in `data` of the next record of the open chunk.
    fn next_inner(&mut self) -> Result<Option<(u8, Range<usize>)>, RecordError> {
        if self.rest.is_empty() {
            return Ok(None);
        }
        let start = self.rest.start;
        let body = start + PREFIX;
        let opcode = self.data.get(start).copied();
        let length = u64_at(&self.data, start + 1).and_then(|length| usize::try_from(length).ok());
        let end = length.and_then(|length| body.checked_add(length)).filter(|end| *end <= self.rest.end);
        let (Some(opcode), Some(end)) = (opcode, end) else {
            self.rest = 0..0;
            // The last record of a cut chunk is cut too: the truncation is reported, not this.
            if self.truncated.is_some() {
                return Ok(None);
            }
            return Err(self.damaged("a record that reaches beyond its chunk"));
        };
        self.rest.start = end;
        Ok(Some((opcode, body..end)))
    }

    /// What the message at `body` is; `None` for a topic that is not ours.
    fn message(&self, body: &Range<usize>) -> Result<Option<Head>, RecordError> {
        let data = self.data.get(body.clone()).unwrap_or_default();
        let (Some(prefix), Some(log_time)) = (u64_at(data, 0), u64_at(data, 6)) else {
            return Err(self.damaged("a message shorter than its header"));
        };
        if data.len() < MESSAGE_HEADER {
            return Err(self.damaged("a message shorter than its header"));
        }
        let channel = prefix as u16;
        let Some(topic) = self.channels.topic(channel) else {
            if self.channels.channels.contains_key(&channel) {
                return Ok(None);
            }
            return Err(self.damaged(&format!("a message on the undeclared channel {channel}")));
        };
        let Ok(ns) = i64::try_from(log_time) else {
            return Err(self.damaged(&format!("a message with the log time {log_time} ns")));
        };
        Ok(Some(Head { topic, time: Time::from_ns(ns), sequence: (prefix >> 16) as u32 }))
    }

    /// Loads the file's next record; `false` after the last.
    fn next_record(&mut self) -> Result<bool, RecordError> {
        self.rest = 0..0;
        self.verified = true;
        let (opcode, offset) = match self.records.next(&mut self.data) {
            Ok(Some(found)) => found,
            Ok(None) => return Ok(false),
            Err(error) => {
                if let RecordError::Truncated { offset, .. } = error
                    && self.records.cut_chunk(offset, &mut self.data)?
                    && let Some(inside) = cut_chunk_inside(&self.data)
                {
                    self.rest = inside;
                    self.offset = offset;
                    self.verified = false;
                    self.truncated = Some(error);
                    return Ok(true);
                }
                return Err(error);
            }
        };
        self.offset = offset;
        match opcode {
            op::CHUNK => self.open_chunk()?,
            op::MESSAGE | op::SCHEMA | op::CHANNEL => {
                // Outside of chunks: handled as a chunk of one.
                let length = (self.data.len() as u64).to_le_bytes();
                self.data.splice(0..0, std::iter::once(opcode).chain(length));
                self.rest = 0..self.data.len();
            }
            op::METADATA | op::ATTACHMENT => {
                let record = parse(self.records.path(), opcode, offset, &self.data)?;
                self.notes.note(&record);
            }
            _ => {}
        }
        Ok(true)
    }

    fn open_chunk(&mut self) -> Result<(), RecordError> {
        let path = self.records.path();
        let header = match parse(path, op::CHUNK, self.offset, &self.data)? {
            Record::Chunk { header, .. } => header,
            _ => return Err(self.damaged("no chunk")),
        };
        let Some(inside) = chunk_inside(&header, self.data.len()) else {
            return Err(self.damaged("a chunk that is shorter than its header says"));
        };
        if !header.compression.is_empty() {
            return Err(RecordError::Compressed {
                path: path.to_path_buf(),
                offset: self.offset,
                compression: header.compression,
            });
        }
        let bytes = self.data.get(inside.clone()).unwrap_or_default();
        if header.uncompressed_size != bytes.len() as u64 {
            return Err(self.damaged("a chunk whose two sizes differ"));
        }
        if header.uncompressed_crc != 0 && crc32fast::hash(bytes) != header.uncompressed_crc {
            return Err(self.damaged("a chunk whose checksum is wrong"));
        }
        self.rest = inside;
        Ok(())
    }

    fn damaged(&self, what: &str) -> RecordError {
        RecordError::Damaged {
            path: self.records.path().to_path_buf(),
            offset: self.offset,
            what: what.to_owned(),
        }
    }
}

/// Where a chunk's records are in its data.
fn chunk_inside(header: &ChunkHeader, data_bytes: usize) -> Option<Range<usize>> {
    let start = 40_usize.checked_add(header.compression.len())?;
    let end = start.checked_add(usize::try_from(header.compressed_size).ok()?)?;
    (end <= data_bytes).then_some(start..end)
}

/// Where the records of a chunk without its end are; `None` where not even they begin, or they are compressed.
fn cut_chunk_inside(data: &[u8]) -> Option<Range<usize>> {
    let compression_bytes = u32_at(data, 28)?;
    (compression_bytes == 0 && data.len() > 40).then_some(40..data.len())
}
