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

fn plain_bytes(path: &Path, bytes_max: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    plain_file(path)?.take(bytes_max as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > bytes_max {
        let why = format!("it is longer than {bytes_max} bytes, the most that are read");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, why));
    }
    Ok(bytes)
}

/// Tests for a JPEG's end marker: a decoder fills a truncated picture with grey. Zeros behind it are padding of some cameras.
pub fn ends_as_jpeg(jpeg: &[u8]) -> bool {
    let padding = jpeg.iter().rev().take_while(|byte| **byte == 0).count();
    jpeg.get(..jpeg.len() - padding).is_some_and(|used| used.ends_with(&[0xff, 0xd9]))
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
}
