//! The index of an MP4 file, and from it where a GPMF track's payloads lie.

use std::io::{self, Cursor, Read, Seek, SeekFrom};

/// An index larger than this is none (an hour at 240 pictures a second has 14 MB).
const INDEX_MAX_BYTES: u64 = 64 << 20;
/// A file with more boxes than this at its top is damaged.
const BOXES_MAX: usize = 100_000;
/// One payload holds about a second: tens of kilobytes.
pub(crate) const PAYLOAD_MAX_BYTES: u64 = 512 << 10;
/// Sample entry of GoPro's metadata track.
const GPMF_FORMAT: &[u8] = b"gpmd";

/// A payload's place in the file and its time on the container's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PayloadPlace {
    /// First byte.
    pub offset: u64,
    /// Length in bytes.
    pub bytes: u64,
    /// When it begins, milliseconds.
    pub start_ms: f64,
    /// How long it lasts, milliseconds.
    pub duration_ms: f64,
}

/// The boxes `ftyp` and `moov`, head to tail; `None` where this is no MP4 file with an index.
pub(crate) fn read_index(file: &mut (impl Read + Seek)) -> io::Result<Option<Vec<u8>>> {
    let end = file.seek(SeekFrom::End(0))?;
    let mut at = 0;
    let mut kind_box = Vec::new();
    for _ in 0..BOXES_MAX {
        if end.saturating_sub(at) < 8 {
            return Ok(None);
        }
        file.seek(SeekFrom::Start(at))?;
        let mut head = [0; 8];
        file.read_exact(&mut head)?;
        let [s0, s1, s2, s3, kind @ ..] = head;
        let mut size = u64::from(u32::from_be_bytes([s0, s1, s2, s3]));
        match size {
            0 => size = end - at,
            1 if end - at >= 16 => {
                let mut large = [0; 8];
                file.read_exact(&mut large)?;
                size = u64::from_be_bytes(large);
            }
            _ => {}
        }
        if size < 8 || size > end - at {
            return Ok(None);
        }
        let wanted = [b"ftyp", b"moov"].contains(&&kind);
        if wanted {
            if size > INDEX_MAX_BYTES {
                return Err(io::Error::new(io::ErrorKind::InvalidData, format!("an index of {size} bytes")));
            }
            file.seek(SeekFrom::Start(at))?;
            file.by_ref().take(size).read_to_end(&mut kind_box)?;
            if &kind == b"moov" {
                return Ok(Some(kind_box));
            }
        }
        at += size;
    }
    Ok(None)
}

/// Whether an index speaks of a GPMF track at all.
pub(crate) fn mentions_gpmf(index: &[u8]) -> bool {
    index.windows(GPMF_FORMAT.len()).any(|w| w == GPMF_FORMAT)
}

/// The payloads of the first metadata track, checked to lie inside a file of `file_bytes` and to be of a size that payloads
/// have. May panic on a hostile index, as the library below may: call it where that is caught.
pub(crate) fn payload_places(index: &[u8], file_bytes: u64) -> Result<Vec<PayloadPlace>, String> {
    let context = mp4parse::read_mp4(&mut Cursor::new(index))
        .map_err(|e| format!("the file's index is damaged ({e:?})"))?;
    let table = context
        .tracks
        .iter()
        .filter(|t| t.track_type == mp4parse::TrackType::Metadata)
        .find_map(|t| mp4parse::unstable::create_sample_table(t, 0.into()))
        .ok_or("the file's index lists no payloads")?;
    table
        .iter()
        .map(|s| {
            let (offset, end) = (s.start_offset.0, s.end_offset.0);
            let place = PayloadPlace {
                offset,
                bytes: end.saturating_sub(offset),
                start_ms: s.start_composition.0 as f64 / 1000.0,
                duration_ms: (s.end_composition.0 - s.start_composition.0) as f64 / 1000.0,
            };
            if end > file_bytes || end < offset {
                Err(format!("a payload of it lies behind the file's end (byte {end} of {file_bytes})"))
            } else if place.bytes > PAYLOAD_MAX_BYTES {
                Err(format!("a payload of it has {} bytes, more than any camera writes", place.bytes))
            } else {
                Ok(place)
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{mentions_gpmf, read_index};
    use proptest::prelude::*;
    use std::io::Cursor;

    fn boxed(kind: &[u8; 4], body: &[u8]) -> Vec<u8> {
        let mut out = (body.len() as u32 + 8).to_be_bytes().to_vec();
        out.extend(kind);
        out.extend(body);
        out
    }

    #[test]
    fn the_index_is_found_behind_the_data() {
        let large: Vec<u8> = [&1u32.to_be_bytes()[..], b"mdat", &19u64.to_be_bytes(), b"abc"].concat();
        let file =
            [boxed(b"ftyp", b"mp41"), boxed(b"free", b""), large, boxed(b"moov", b"..gpmd..")].concat();
        let index = read_index(&mut Cursor::new(&file)).unwrap().unwrap();
        assert_eq!(index, [boxed(b"ftyp", b"mp41"), boxed(b"moov", b"..gpmd..")].concat());
        assert!(mentions_gpmf(&index));
        for cut in 0..file.len() {
            assert_eq!(read_index(&mut Cursor::new(&file[..cut])).unwrap(), None, "{cut}");
        }
    }

    #[test]
    fn what_is_no_mp4_has_no_index() {
        for bytes in [&b""[..], b"RIFF....AVI LIST", &[0xff; 100], &[0; 7]] {
            assert_eq!(read_index(&mut Cursor::new(bytes)).unwrap(), None);
        }
    }

    proptest! {
        #[test]
        fn noise_does_no_harm(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = read_index(&mut Cursor::new(&bytes));
        }
    }
}
