//! From a JPEG to pixels, bounded: the header is read before anything is allocated. Shared by the camera and by replays.

use bowwave_core::event::{Picture, PixelFormat};
use zune_core::{bytestream::ZCursor, colorspace::ColorSpace, options::DecoderOptions};
use zune_jpeg::JpegDecoder;

use super::pool::Pool;

/// Most pixels a side that a picture may declare.
const SIDE_MAX: u32 = 8192;

/// Header of a JPEG.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JpegHeader {
    /// Pixels across, at least 1.
    pub width: u32,
    /// Pixels down, at least 1.
    pub height: u32,
    /// Colour components: 1 or 3.
    pub components: u8,
    /// Sent in several passes; cameras do not do so.
    pub progressive: bool,
    /// Where the coded pixels begin, bytes from the start.
    pub scan_start: usize,
}

/// Why bytes are no picture.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JpegError {
    /// It does not begin as a JPEG does, or a part of it has no sense.
    #[error("no JPEG: {0}")]
    Malformed(&'static str),
    /// It ends early.
    #[error("a JPEG of {bytes} bytes without its end: cut short on the way")]
    Truncated {
        /// Bytes that there are.
        bytes: usize,
    },
    /// A kind that cameras do not send.
    #[error("a JPEG of a kind that the trainer does not read: {0}")]
    Unsupported(&'static str),
    /// Another size than expected, or larger than any camera's.
    #[error(
        "a JPEG of {width}x{height}, expected {}",
        expected.map_or_else(|| format!("at most {SIDE_MAX} pixels a side"), |(w, h)| format!("{w}x{h}"))
    )]
    Size {
        /// Declared pixels across.
        width: u32,
        /// Declared pixels down.
        height: u32,
        /// The size that it should have.
        expected: Option<(u32, u32)>,
    },
    /// The coded pixels are damaged.
    #[error("a damaged JPEG: {0}")]
    Damaged(String),
}

/// Reads the header: everything up to the coded pixels. Allocates nothing.
pub fn header(jpeg: &[u8]) -> Result<JpegHeader, JpegError> {
    const CUT: JpegError = JpegError::Malformed("it ends within its header");
    if !jpeg.starts_with(&[0xff, 0xd8]) {
        return Err(JpegError::Malformed("it does not begin with a start marker"));
    }
    let mut at = 2;
    let mut frame: Option<(u32, u32, u8, bool)> = None;
    loop {
        if *jpeg.get(at).ok_or(CUT)? != 0xff {
            return Err(JpegError::Malformed("no marker where one must be"));
        }
        // Any number of fill bytes may stand before a marker.
        while *jpeg.get(at).ok_or(CUT)? == 0xff {
            at += 1;
        }
        let marker = *jpeg.get(at).ok_or(CUT)?;
        at += 1;
        if matches!(marker, 0x01 | 0xd0..=0xd7) {
            continue;
        }
        if matches!(marker, 0x00 | 0xd8 | 0xd9) {
            return Err(JpegError::Malformed("a marker that cannot stand in a header"));
        }
        let length = usize::from(be16(jpeg, at).ok_or(CUT)?);
        let body = jpeg.get(at + 2..at + length.max(2)).ok_or(CUT)?;
        match marker {
            0xc0..=0xc2 if frame.is_some() => return Err(JpegError::Malformed("two frame headers")),
            0xc0..=0xc2 => frame = Some(frame_header(body, marker == 0xc2)?),
            0xc3 | 0xc5..=0xc7 | 0xc9..=0xcb | 0xcd..=0xcf => {
                return Err(JpegError::Unsupported("neither baseline nor progressive"));
            }
            0xda => {
                let Some((width, height, components, progressive)) = frame else {
                    return Err(JpegError::Malformed("pixels before a frame header"));
                };
                return Ok(JpegHeader {
                    width,
                    height,
                    components,
                    progressive,
                    scan_start: at + length.max(2),
                });
            }
            _ => {}
        }
        at += length.max(2);
    }
}

fn frame_header(body: &[u8], progressive: bool) -> Result<(u32, u32, u8, bool), JpegError> {
    let (Some(8), Some(height), Some(width), Some(&components)) =
        (body.first().copied(), be16(body, 1), be16(body, 3), body.get(5))
    else {
        return Err(JpegError::Unsupported("its samples are not of 8 bits"));
    };
    if !matches!(components, 1 | 3) {
        return Err(JpegError::Unsupported("neither grey nor three colours"));
    }
    if width == 0 || height == 0 {
        return Err(JpegError::Malformed("it declares no pixels"));
    }
    Ok((width.into(), height.into(), components, progressive))
}

fn be16(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_be_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]))
}

/// How much a decoder takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Manner {
    /// Whole baseline pictures only.
    Camera,
    /// JPEGs of other programs, too.
    Recording,
}

/// Decodes the pictures of one stream into buffers that are used again.
#[derive(Debug)]
pub struct Decoder {
    manner: Manner,
    pool: Pool,
}

impl Decoder {
    /// For what a camera sends: baseline only, and damage within a picture is an error.
    pub fn for_camera() -> Self {
        Self { manner: Manner::Camera, pool: Pool::default() }
    }

    /// For recordings, which other programs may have written: progressive pictures too, and slight damage is shown.
    pub fn for_recordings() -> Self {
        Self { manner: Manner::Recording, pool: Pool::default() }
    }

    /// The picture in `jpeg`, as RGB. Its declared size must be `expected`, where that is given, or nothing is allocated.
    /// Padding of zeros or anything else after its end is left out.
    pub fn decode(&mut self, jpeg: &[u8], expected: Option<(u32, u32)>) -> Result<Picture, JpegError> {
        let header = header(jpeg)?;
        let (width, height) = (header.width, header.height);
        let size_wrong = expected.is_some_and(|size| size != (width, height));
        if size_wrong || width > SIDE_MAX || height > SIDE_MAX {
            return Err(JpegError::Size { width, height, expected });
        }
        if header.progressive && self.manner == Manner::Camera {
            return Err(JpegError::Unsupported("progressive"));
        }
        // The decoder fills what is missing with grey; a picture without its end is not shown. Coded pixels cannot hold
        // an end marker, so that the last one is the end.
        let coded = jpeg.get(header.scan_start..).unwrap_or_default();
        let end = coded.windows(2).rposition(|pair| pair == [0xff, 0xd9]);
        let end = end.ok_or(JpegError::Truncated { bytes: jpeg.len() })? + header.scan_start + 2;
        let grey = header.components == 1;
        let options = DecoderOptions::default()
            .set_strict_mode(self.manner == Manner::Camera)
            .set_max_width(width as usize)
            .set_max_height(height as usize)
            .jpeg_set_out_colorspace(if grey { ColorSpace::Luma } else { ColorSpace::RGB });
        let mut decoder = JpegDecoder::new_with_options(ZCursor::new(&jpeg[..end]), options);
        let pixels = width as usize * height as usize;
        let damaged = |e: zune_jpeg::errors::DecodeErrors| JpegError::Damaged(format!("{e:?}"));
        let bytes = self.pool.filled(PixelFormat::Rgb.byte_len(width, height), |target| {
            // The decoder may take a damaged picture for a whole one and leave rows as they are: another picture's rows.
            target.fill(0);
            if !grey {
                return decoder.decode_into(target).map_err(damaged);
            }
            let mut luma = vec![0; pixels];
            decoder.decode_into(&mut luma).map_err(damaged)?;
            target.chunks_exact_mut(3).zip(luma).for_each(|(rgb, y)| rgb.fill(y));
            Ok(())
        })?;
        Picture::new(PixelFormat::Rgb, width, height, bytes).map_err(|e| JpegError::Damaged(e.to_string()))
    }
}

#[cfg(test)]
#[path = "jpeg_tests.rs"]
mod tests;
