//! How files that somebody named are opened: by this and by nothing else.

#![forbid(unsafe_code)]

use std::{
    fs::{File, OpenOptions},
    io::{self, Read as _},
    os::unix::fs::OpenOptionsExt as _,
    path::Path,
};

use rustix::fs::OFlags;

/// Opens a plain file for reading. Never waits: a pipe without a writer would hold the caller for ever, and a device could answer without
/// end. Whoever reads bounds what is read.
///
/// # Errors
/// Those of the system; and where it is not a plain file.
pub fn plain_file(path: &Path) -> io::Result<File> {
    // The open mode's bits are a C int.
    let file =
        OpenOptions::new().read(true).custom_flags(OFlags::NONBLOCK.bits().cast_signed()).open(path)?;
    if !file.metadata()?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a plain file"));
    }
    Ok(file)
}

/// The text of a plain file of at most `bytes_max` bytes.
///
/// # Errors
/// Those of [`plain_file`] and of reading; and where it is longer, or no UTF-8.
pub fn plain_text(path: &Path, bytes_max: usize) -> io::Result<String> {
    let bytes = plain_bytes(path, bytes_max)?;
    String::from_utf8(bytes).map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))
}

/// The largest file of a picture that is read: one of the largest size, hardly compressed.
const PICTURE_BYTES_MAX: usize = 256 << 20;

/// The bytes of a file with a picture.
///
/// # Errors
/// Those of [`plain_file`] and of reading; where it is longer than any picture, or a JPEG that ends in the middle.
pub fn picture_bytes(path: &Path) -> io::Result<Vec<u8>> {
    let bytes = plain_bytes(path, PICTURE_BYTES_MAX)?;
    if bytes.starts_with(&[0xff, 0xd8, 0xff]) && !ends_as_jpeg(&bytes) {
        return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "it ends in the middle; copy it again"));
    }
    Ok(bytes)
}

/// The bytes of a plain file of at most `bytes_max`.
///
/// # Errors
/// Those of [`plain_file`] and of reading; and where it is longer.
pub fn plain_bytes(path: &Path, bytes_max: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    plain_file(path)?.take(bytes_max as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > bytes_max {
        let why = format!("it is longer than {bytes_max} bytes, the most that are read");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, why));
    }
    Ok(bytes)
}

/// Tests whether a JPEG has its end marker: a decoder fills a truncated picture with grey. Some cameras pad with zeros behind it, others
/// add data of their own there.
pub fn ends_as_jpeg(jpeg: &[u8]) -> bool {
    let padding = jpeg.iter().rev().take_while(|byte| **byte == 0).count();
    jpeg.get(..jpeg.len() - padding).is_some_and(|used| used.ends_with(&[0xff, 0xd9])) || has_end(jpeg)
}

/// Walks the segments (ITU T.81, annex B) to the end marker behind the last scan.
fn has_end(jpeg: &[u8]) -> bool {
    let mut at = 2;
    let mut in_scan = false;
    while let Some(rest) = jpeg.get(at..) {
        let Some(skip) = rest.iter().position(|byte| *byte == 0xff) else { return false };
        let Some(&marker) = rest.get(skip + 1) else { return false };
        if !in_scan && skip > 0 {
            return false;
        }
        at += skip + 2;
        match marker {
            0xd9 => return in_scan,
            // Fill, a stuffed zero, restarts.
            0xff => at -= 1,
            0x00 | 0x01 | 0xd0..=0xd8 => {}
            _ => {
                let Some(&[high, low]) = jpeg.get(at..at + 2) else { return false };
                at += usize::from(u16::from_be_bytes([high, low])).max(2);
                in_scan |= marker == 0xda;
            }
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use rustix::fs::{CWD, FileType, Mode, mknodat};

    use super::*;

    #[test]
    fn what_is_not_a_plain_file_is_refused_without_waiting() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        mknodat(CWD, &pipe, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
        let begun = Instant::now();
        for path in [&pipe, Path::new("/dev/zero"), folder.path()] {
            let error = plain_file(path).unwrap_err();
            assert!(error.to_string().contains("not a plain file"), "{error}");
        }
        assert!(begun.elapsed() < Duration::from_secs(5));
        let file = folder.path().join("file");
        std::fs::write(&file, "text").unwrap();
        assert_eq!(io::read_to_string(plain_file(&file).unwrap()).unwrap(), "text");
    }

    #[test]
    fn a_text_beyond_its_limit_is_refused_and_one_at_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "12345").unwrap();
        assert_eq!(plain_text(&file, 5).unwrap(), "12345");
        let error = plain_text(&file, 4).unwrap_err();
        assert!(error.to_string().contains("longer than 4 bytes"), "{error}");
        std::fs::write(&file, b"\xff").unwrap();
        assert_eq!(plain_text(&file, 5).unwrap_err().kind(), io::ErrorKind::InvalidData);
    }

    #[test]
    fn a_jpeg_ends_at_its_marker_whatever_stands_behind_it() {
        // A thumbnail with an end of its own in a segment, a table, a scan with a stuffed zero and a restart.
        let mut whole = vec![0xff, 0xd8, 0xff, 0xe1, 0, 6, 0xff, 0xd8, 0xff, 0xd9, 0xff, 0xdb, 0, 3, 1];
        whole.extend([0xff, 0xda, 0, 3, 1, 9, 9, 0xff, 0, 9, 0xff, 0xd0, 9]);
        assert!(!ends_as_jpeg(&whole));
        let cut = whole.clone();
        whole.extend([0xff, 0xd9]);
        assert!(ends_as_jpeg(&whole));
        for behind in [&[0, 0, 0][..], b"SEFT", &[0xff, 0xd8, 0xff]] {
            assert!(ends_as_jpeg(&[&whole[..], behind].concat()), "{behind:?}");
        }
        for length in 0..=cut.len() {
            // The thumbnail's end is the last that a cut behind it shows.
            assert!(!ends_as_jpeg(&cut[..length]) || length == 10, "{length}");
        }
    }
}
