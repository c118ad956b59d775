//! From a file's bytes to records: framed by the MCAP crate's sans-io reader, one at a time, sizes checked before anything is
//! allocated.

use std::{
    fs::File,
    io::{Read, Seek, SeekFrom},
    path::Path,
    sync::Arc,
};

use bowwave_files::plain_file;
use mcap::{
    McapError,
    records::{Record, op},
    sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions},
};

use super::{CHUNK_MAX_BYTES, RecordError};

/// Largest record: a chunk and its header.
const RECORD_MAX_BYTES: u64 = CHUNK_MAX_BYTES + 1024;
/// Bytes of opcode and length before each record.
pub(crate) const PREFIX: usize = 9;

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
        let mut file = plain_file(path).map_err(open)?;
        let status = file.metadata().map_err(open)?;
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
    pub(crate) fn cut_chunk(&mut self, offset: u64, data: &mut Vec<u8>) -> Result<bool, RecordError> {
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

/// Parses a record. The crate's own parser makes room for whatever a string's length claims, up to 4 GiB, before it looks
/// whether there is as much, and panics on attachments that are too short for their checksum.
pub(crate) fn parse<'a>(
    path: &Path,
    opcode: u8,
    offset: u64,
    data: &'a [u8],
) -> Result<Record<'a>, RecordError> {
    let damaged = |what: String| RecordError::Damaged { path: path.into(), offset, what };
    if !fits(opcode, data) {
        return Err(damaged(format!(
            "a record of kind {opcode:#04x} with a part that reaches beyond its end"
        )));
    }
    mcap::parse_record(opcode, data).map_err(|error| damaged(error.to_string()))
}

/// A part of a record.
enum RecordPart {
    /// So many bytes.
    Bytes(usize),
    /// A string: its length, its bytes.
    Text,
    /// A map of strings: its bytes, then keys and values.
    Texts,
    /// A map of numbers: its bytes, then entries of so many each.
    Numbers(usize),
}

/// The parts of a record as far as its last string (MCAP specification, "Records").
const fn parts(opcode: u8) -> &'static [RecordPart] {
    use RecordPart::{Bytes, Numbers, Text, Texts};
    match opcode {
        op::HEADER => &[Text, Text],
        op::SCHEMA => &[Bytes(2), Text, Text],
        op::CHANNEL => &[Bytes(4), Text, Text, Texts],
        op::CHUNK => &[Bytes(28), Text],
        op::CHUNK_INDEX => &[Bytes(32), Numbers(10), Bytes(8), Text],
        op::ATTACHMENT => &[Bytes(16), Text, Text, Bytes(8 + 4)],
        op::ATTACHMENT_INDEX => &[Bytes(40), Text, Text],
        op::METADATA => &[Text, Texts],
        op::METADATA_INDEX => &[Bytes(16), Text],
        _ => &[],
    }
}

/// Whether a record's parts, as they are parsed, end within it.
fn fits(opcode: u8, data: &[u8]) -> bool {
    parts(opcode).iter().try_fold(0, |at, part| part.end(data, at)).is_some()
}

impl RecordPart {
    /// Where the part that begins at `at` ends; `None` where that is beyond the record.
    fn end(&self, data: &[u8], at: usize) -> Option<usize> {
        let end = match self {
            Self::Bytes(bytes) => at.checked_add(*bytes)?,
            Self::Text => text_end(data, at)?,
            Self::Texts => {
                // Whole entries are parsed, whatever the length says of the last one.
                let (mut place, end) = (at.checked_add(4)?, text_end(data, at)?);
                while place < end {
                    place = text_end(data, text_end(data, place)?)?;
                }
                place
            }
            Self::Numbers(entry) => {
                let bytes = u32_at(data, at)? as usize;
                at.checked_add(4)?.checked_add(bytes.checked_next_multiple_of(*entry)?)?
            }
        };
        (end <= data.len()).then_some(end)
    }
}

/// The end of the string at `at`, if it lies within `data`.
fn text_end(data: &[u8], at: usize) -> Option<usize> {
    let length = u32_at(data, at)? as usize;
    at.checked_add(4)?.checked_add(length).filter(|end| *end <= data.len())
}

pub(crate) fn u32_at(data: &[u8], at: usize) -> Option<u32> {
    let bytes = data.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(bytes.try_into().ok()?))
}

pub(crate) fn u64_at(data: &[u8], at: usize) -> Option<u64> {
    let bytes = data.get(at..at.checked_add(8)?)?;
    Some(u64::from_le_bytes(bytes.try_into().ok()?))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use mcap::records::op;

    use super::{RecordPart, parse, parts};

    /// A record whose parts are all as short as can be, and where its strings and maps begin.
    fn shortest(opcode: u8) -> (Vec<u8>, Vec<usize>) {
        let (mut data, mut places) = (Vec::new(), Vec::new());
        for part in parts(opcode) {
            match part {
                RecordPart::Bytes(bytes) => data.resize(data.len() + bytes, 0),
                RecordPart::Text | RecordPart::Texts | RecordPart::Numbers(_) => {
                    places.push(data.len());
                    data.extend([0; 4]);
                }
            }
        }
        // What stands behind the last string: sizes, times and a schema's length.
        data.extend([0; 32]);
        (data, places)
    }

    #[test]
    fn a_length_beyond_its_record_is_refused_before_there_is_room_made_for_it() {
        let mut refused = 0;
        for opcode in op::HEADER..=op::DATA_END {
            let (whole, places) = shortest(opcode);
            if places.is_empty() {
                continue;
            }
            parse(Path::new("x.mcap"), opcode, 8, &whole).expect("a record of empty parts");
            for place in places {
                for claimed in [whole.len() as u32, 0x7fff_ffff, u32::MAX] {
                    let mut data = whole.clone();
                    data[place..place + 4].copy_from_slice(&claimed.to_le_bytes());
                    let error =
                        parse(Path::new("x.mcap"), opcode, 8, &data).expect_err("too long").to_string();
                    assert!(error.contains("byte 8") && error.contains("reaches beyond its end"), "{error}");
                    refused += 1;
                }
            }
        }
        assert_eq!(refused, 3 * 17);
    }

    #[test]
    fn a_map_that_ends_within_an_entry_is_followed_as_it_is_parsed() {
        // The map claims one byte, its entry has ten; the string's length lies behind all ten.
        let mut index = vec![0; 32];
        index.extend(1_u32.to_le_bytes());
        index.extend([0; 10 + 8]);
        index.extend(u32::MAX.to_le_bytes());
        index.extend([0; 16]);
        let error = parse(Path::new("x.mcap"), op::CHUNK_INDEX, 8, &index).expect_err("too long").to_string();
        assert!(error.contains("reaches beyond its end"), "{error}");
    }
}
