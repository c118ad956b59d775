//! From a coded picture to pixels, in buffers that are used again.

use std::{io::Cursor, sync::Arc};

use bowwave_core::event::{Picture, PixelFormat};
use image::{ColorType, ImageDecoder, codecs::jpeg::JpegDecoder};

/// What became of the pictures of a replay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameCounters {
    /// Decoded.
    pub decoded: u64,
    /// Left out because their size was not the first one's.
    pub other_size: u64,
    /// Left out because they were empty, cut short or no JPEG.
    pub undecodable: u64,
}

/// Decodes the pictures of one camera.
#[derive(Default)]
pub(super) struct FrameDecoder {
    size: Option<(u32, u32)>,
    /// Buffers that were given away; free again when nobody else holds them.
    pool: Vec<Arc<[u8]>>,
    counters: FrameCounters,
}

/// Buffers kept for use again: the queue, the one in decoding, and those that session and renderer hold.
const POOL_MAX: usize = 8;

impl FrameDecoder {
    pub(super) const fn counters(&self) -> FrameCounters {
        self.counters
    }

    /// The picture in `jpeg`; `None`, counted and logged once a kind, where there is none or it has another size than the
    /// first.
    pub(super) fn decode(&mut self, jpeg: &[u8]) -> Option<Picture> {
        match self.try_decode(jpeg) {
            Ok(picture) => {
                self.counters.decoded += 1;
                Some(picture)
            }
            Err(Refused::Size(found)) => {
                if self.counters.other_size == 0 {
                    let (width, height) = self.size.unwrap_or_default();
                    log::warn!(
                        "a picture of {}x{} in mid-stream, the first was {width}x{height}: left out; was the camera's mode \
                         changed?",
                        found.0,
                        found.1
                    );
                }
                self.counters.other_size += 1;
                None
            }
            Err(Refused::Undecodable(why)) => {
                if self.counters.undecodable == 0 {
                    log::warn!("a picture that is no whole JPEG ({why}): left out");
                }
                self.counters.undecodable += 1;
                None
            }
        }
    }

    fn try_decode(&mut self, jpeg: &[u8]) -> Result<Picture, Refused> {
        // The decoder fills what is missing with grey; a picture without its end is not shown.
        let padding = jpeg.iter().rev().take_while(|b| **b == 0).count();
        if !jpeg[..jpeg.len() - padding].ends_with(&[0xff, 0xd9]) {
            return Err(Refused::Undecodable(format!("{} bytes without an end", jpeg.len())));
        }
        let decoder = JpegDecoder::new(Cursor::new(jpeg)).map_err(undecodable)?;
        let size = decoder.dimensions();
        if self.size.is_some_and(|first| first != size) {
            return Err(Refused::Size(size));
        }
        if size.0 > 8192 || size.1 > 8192 {
            return Err(Refused::Undecodable(format!("{}x{} pixels, more than 8192", size.0, size.1)));
        }
        let bytes = match decoder.color_type() {
            ColorType::Rgb8 => {
                let mut bytes = self.buffer(PixelFormat::Rgb.byte_len(size.0, size.1));
                // A buffer out of the pool is ours alone, or it would not have been taken.
                let target = Arc::get_mut(&mut bytes)
                    .ok_or_else(|| Refused::Undecodable("no buffer of its own".to_owned()))?;
                decoder.read_image(target).map_err(undecodable)?;
                self.keep(&bytes);
                bytes
            }
            ColorType::L8 => {
                let mut grey = vec![0; size.0 as usize * size.1 as usize];
                decoder.read_image(&mut grey).map_err(undecodable)?;
                grey.into_iter().flat_map(|v| [v; 3]).collect()
            }
            other => return Err(Refused::Undecodable(format!("colours {other:?}"))),
        };
        let picture = Picture::new(PixelFormat::Rgb, size.0, size.1, bytes).map_err(undecodable)?;
        self.size = Some(size);
        Ok(picture)
    }

    /// A buffer that nobody else holds.
    fn buffer(&mut self, bytes: usize) -> Arc<[u8]> {
        let free = self.pool.iter_mut().position(|slot| slot.len() == bytes && Arc::get_mut(slot).is_some());
        match free {
            Some(slot) => self.pool.swap_remove(slot),
            None => std::iter::repeat_n(0, bytes).collect(),
        }
    }

    fn keep(&mut self, bytes: &Arc<[u8]>) {
        if self.pool.len() < POOL_MAX {
            self.pool.push(Arc::clone(bytes));
        }
    }
}

enum Refused {
    Size((u32, u32)),
    Undecodable(String),
}

fn undecodable(error: impl std::fmt::Display) -> Refused {
    Refused::Undecodable(error.to_string())
}

#[cfg(test)]
mod tests {
    use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};

    use super::*;

    fn jpeg(width: u32, height: u32, kind: ExtendedColorType, value: u8) -> Vec<u8> {
        let channels = if kind == ExtendedColorType::L8 { 1 } else { 3 };
        let pixels = vec![value; (width * height * channels) as usize];
        let mut bytes = Vec::new();
        JpegEncoder::new_with_quality(&mut bytes, 90).encode(&pixels, width, height, kind).expect("encoded");
        bytes
    }

    #[test]
    fn colour_and_grey_become_rgb() {
        let mut decoder = FrameDecoder::default();
        for kind in [ExtendedColorType::Rgb8, ExtendedColorType::L8] {
            let picture = decoder.decode(&jpeg(32, 16, kind, 200)).expect("decoded");
            assert_eq!((picture.format(), picture.width(), picture.height()), (PixelFormat::Rgb, 32, 16));
            assert!(picture.bytes().iter().all(|v| v.abs_diff(200) <= 2));
        }
    }

    #[test]
    fn what_is_no_picture_of_the_first_size_is_left_out_and_counted() {
        let whole = jpeg(32, 16, ExtendedColorType::Rgb8, 90);
        let mut decoder = FrameDecoder::default();
        assert!(decoder.decode(&[]).is_none());
        assert!(decoder.decode(b"no picture \xff\xd9").is_none());
        assert!(decoder.decode(&whole).is_some());
        assert!(decoder.decode(&whole[..whole.len() / 2]).is_none());
        assert!(decoder.decode(&jpeg(16, 16, ExtendedColorType::Rgb8, 90)).is_none());
        let padded = [&whole[..], &[0; 100]].concat();
        assert!(decoder.decode(&padded).is_some());
        assert_eq!(decoder.counters(), FrameCounters { decoded: 2, other_size: 1, undecodable: 3 });
    }

    #[test]
    fn buffers_are_used_again_but_never_while_held() {
        let mut decoder = FrameDecoder::default();
        let (dark, light) =
            (jpeg(32, 16, ExtendedColorType::Rgb8, 10), jpeg(32, 16, ExtendedColorType::Rgb8, 240));
        let held = decoder.decode(&dark).expect("decoded");
        let mut places = std::collections::HashSet::new();
        for _ in 0..20 {
            let picture = decoder.decode(&light).expect("decoded");
            places.insert(picture.bytes().as_ptr());
        }
        assert_eq!(places.len(), 1);
        assert!(held.bytes().iter().all(|v| *v < 20));
        let many: Vec<_> = (0..3 * POOL_MAX).filter_map(|_| decoder.decode(&light)).collect();
        assert_eq!(many.len(), 3 * POOL_MAX);
        assert!(decoder.pool.len() <= POOL_MAX);
        assert!(held.bytes().iter().all(|v| *v < 20));
    }
}
