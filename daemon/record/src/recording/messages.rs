//! From records to messages: chunks are checked and cut up; never more than one is held.

use std::{ops::Range, path::Path, sync::Arc};

use bowwave_core::time::Time;
use mcap::records::{ChunkHeader, Record, op};

use super::{
    RecordError,
    channels::{Channels, FileNotes, OurChannel},
    records::{PREFIX, Records, parse, u32_at, u64_at},
    schema::Topic,
};

/// Bytes of channel, sequence and two times before each message's data.
const MESSAGE_HEADER: usize = 22;

/// A message of one of our topics.
pub(crate) struct FoundMessage<'a> {
    pub(crate) topic: Topic,
    /// Arrival at the host, or the time that a pose is for.
    pub(crate) time: Time,
    /// Its place by time in the file; the same but for what was written long after it arrived.
    pub(crate) logged: Time,
    pub(crate) sequence: u32,
    pub(crate) data: &'a [u8],
    /// Where the message is, or the chunk that it is in.
    pub(crate) offset: u64,
    /// Whether its bytes are known to be those that were written.
    pub(crate) verified: bool,
}

/// A message's header.
struct MessageHead {
    topic: Topic,
    time: Time,
    logged: Time,
    sequence: u32,
}

/// The messages of a recording in the order of the file.
pub(crate) struct Messages {
    records: Records,
    pub(crate) channels: Channels,
    /// Metadata and attachments that were passed.
    pub(crate) notes: FileNotes,
    /// The record, or the inside of the chunk, that is being cut up.
    data: Vec<u8>,
    rest: Range<usize>,
    offset: u64,
    verified: bool,
    /// Told once the salvaged part of a cut chunk is used up.
    truncated: Option<RecordError>,
}

impl Messages {
    /// `channels` are those known from the file's index; those of the data are added.
    pub(crate) fn new(records: Records, channels: Channels) -> Self {
        Self {
            records,
            channels,
            notes: FileNotes::default(),
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
    pub(crate) fn next(&mut self) -> Result<Option<FoundMessage<'_>>, RecordError> {
        loop {
            if let Some((opcode, body)) = self.next_inner()? {
                match opcode {
                    op::MESSAGE => {
                        if let Some(MessageHead { topic, time, logged, sequence }) = self.message(&body)? {
                            let data =
                                self.data.get(body.start + MESSAGE_HEADER..body.end).unwrap_or_default();
                            let (offset, verified) = (self.offset, self.verified);
                            return Ok(Some(FoundMessage {
                                topic,
                                time,
                                logged,
                                sequence,
                                data,
                                offset,
                                verified,
                            }));
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

    /// Head of the message at `body`; `None` for a topic that is not ours.
    fn message(&self, body: &Range<usize>) -> Result<Option<MessageHead>, RecordError> {
        let data = self.data.get(body.clone()).unwrap_or_default();
        let (Some(prefix), Some(log_time), Some(publish_time)) =
            (u64_at(data, 0), u64_at(data, 6), u64_at(data, 14))
        else {
            return Err(self.damaged("a message shorter than its header"));
        };
        let channel = prefix as u16;
        let Some(OurChannel { topic, publishes_arrival }) = self.channels.ours(channel) else {
            if self.channels.is_declared(channel) {
                return Ok(None);
            }
            return Err(self.damaged(&format!("a message on the undeclared channel {channel}")));
        };
        let time = |name: &str, ns: u64| match i64::try_from(ns) {
            Ok(ns) => Ok(Time::from_ns(ns)),
            Err(_) => Err(self.damaged(&format!("a message with the {name} time {ns} ns"))),
        };
        let logged = time("log", log_time)?;
        let time = if publishes_arrival { time("publish", publish_time)? } else { logged };
        Ok(Some(MessageHead { topic, time, logged, sequence: (prefix >> 16) as u32 }))
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

/// Where the records of a chunk without its end are; `None` where not even they begin, or they are compressed. Zeros at the end
/// may be what a power cut left of bytes that were never written: the record that they are in counts as cut.
fn cut_chunk_inside(data: &[u8]) -> Option<Range<usize>> {
    let compression_bytes = u32_at(data, 28)?;
    let zeros = data.iter().rev().take_while(|byte| **byte == 0).count();
    let end = data.len() - zeros;
    (compression_bytes == 0 && end > 40).then_some(40..end)
}
