//! JPEG pictures out of the multipart stream that `ffmpeg -f mpjpeg` writes: each part has a header with its length.

use std::io::{self, BufRead, Read as _};

use bowwave_record::recording::JPEG_MAX_BYTES;

/// A header line longer than this is none.
const LINE_MAX_BYTES: u64 = 1024;
/// A part's header has no more lines than this.
const LINES_MAX: usize = 32;

/// The next picture; `None` where the stream ends between two of them (the last one, too, is followed by a boundary). A stream that ends within one is an
/// [`io::ErrorKind::UnexpectedEof`], anything else an [`io::ErrorKind::InvalidData`].
pub(crate) fn next_jpeg(stream: &mut impl BufRead) -> io::Result<Option<Vec<u8>>> {
    let mut length = None;
    let mut begun = false;
    for _ in 0..LINES_MAX {
        let Some(line) = read_line(stream)? else {
            return if begun { Err(io::ErrorKind::UnexpectedEof.into()) } else { Ok(None) };
        };
        let text = line.trim_ascii();
        if text.is_empty() {
            // An empty line ends a header, and stands between a picture and the next boundary.
            match length {
                Some(length) => return read_body(stream, length).map(Some),
                None if begun => return Err(invalid("a part without a length")),
                None => continue,
            }
        }
        if text.starts_with(b"--") {
            continue;
        }
        begun = true;
        if let Some(value) = header(text, b"content-length:") {
            let number = std::str::from_utf8(value).ok().and_then(|v| v.parse::<usize>().ok());
            length = Some(number.filter(|n| *n <= JPEG_MAX_BYTES).ok_or_else(|| invalid("a part's length"))?);
        }
    }
    Err(invalid("a part's header without an end"))
}

fn read_line(stream: &mut impl BufRead) -> io::Result<Option<Vec<u8>>> {
    let mut line = Vec::new();
    stream.by_ref().take(LINE_MAX_BYTES).read_until(b'\n', &mut line)?;
    match line.last() {
        None => Ok(None),
        Some(b'\n') => Ok(Some(line)),
        Some(_) if line.len() as u64 == LINE_MAX_BYTES => Err(invalid("an endless line")),
        Some(_) => Err(io::ErrorKind::UnexpectedEof.into()),
    }
}

fn header<'a>(line: &'a [u8], name: &[u8]) -> Option<&'a [u8]> {
    let (head, value) = line.split_at_checked(name.len())?;
    head.eq_ignore_ascii_case(name).then(|| value.trim_ascii())
}

fn read_body(stream: &mut impl BufRead, length: usize) -> io::Result<Vec<u8>> {
    let mut jpeg = Vec::new();
    stream.by_ref().take(length as u64).read_to_end(&mut jpeg)?;
    if jpeg.len() == length { Ok(jpeg) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
}

fn invalid(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("{what} in the stream of pictures"))
}

#[cfg(test)]
mod tests {
    use super::next_jpeg;
    use proptest::prelude::*;
    use std::io::{BufReader, ErrorKind};

    const TWO: &[u8] = b"--ffmpeg\r\nContent-type: image/jpeg\r\nContent-length: 4\r\n\r\n\r\n--\r\n--ffmpeg\r\ncontent-LENGTH:2\r\n\r\nab\r\n--ffmpeg\r\n";

    #[test]
    fn parts_come_out_whole_however_they_are_read() {
        for capacity in [1, 2, 7, 1000] {
            let mut stream = BufReader::with_capacity(capacity, TWO);
            // The first body looks like a boundary on purpose.
            assert_eq!(next_jpeg(&mut stream).unwrap().as_deref(), Some(&b"\r\n--"[..]));
            assert_eq!(next_jpeg(&mut stream).unwrap().as_deref(), Some(&b"ab"[..]));
            assert_eq!(next_jpeg(&mut stream).unwrap(), None);
        }
    }

    #[test]
    fn a_stream_cut_within_a_part_says_so() {
        let text = String::from_utf8_lossy(TWO);
        let second = text.find("content-LENGTH").unwrap();
        let parts =
            [text.find("Content-type").unwrap()..text.find("\r\n--\r\n").unwrap() + 4, second..second + 22];
        for cut in 0..=TWO.len() {
            let mut stream = &TWO[..cut];
            let mut seen = 0;
            let end = loop {
                match next_jpeg(&mut stream) {
                    Ok(Some(_)) => seen += 1,
                    Ok(None) => break None,
                    Err(e) => break Some(e.kind()),
                }
            };
            assert_eq!(seen, parts.iter().filter(|p| p.end <= cut).count(), "{cut}");
            if parts.iter().any(|p| p.start < cut && cut < p.end) {
                assert_eq!(end, Some(ErrorKind::UnexpectedEof), "{cut}");
            }
        }
    }

    #[test]
    fn lengths_that_cannot_be_are_refused() {
        for header in [
            "Content-length: 99999999999\r\n\r\n",
            "Content-length: -1\r\n\r\n",
            "Content-type: image/jpeg\r\n\r\n",
        ] {
            let text = format!("--ffmpeg\r\n{header}xx");
            assert_eq!(
                next_jpeg(&mut text.as_bytes()).unwrap_err().kind(),
                ErrorKind::InvalidData,
                "{header}"
            );
        }
    }

    proptest! {
        #[test]
        fn noise_does_no_harm(bytes in proptest::collection::vec(any::<u8>(), 0..4096)) {
            let mut stream = bytes.as_slice();
            while let Ok(Some(_)) = next_jpeg(&mut stream) {}
        }
    }
}
