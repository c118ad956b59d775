//! From a recording's coded pictures to pixels: what is left out is counted, and logged once a kind.

use bowwave_core::event::{CameraFrame, Picture};
use bowwave_devices::camera::jpeg::{Decoder, JpegError};

use super::wire::RecordedPicture;

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
pub(super) struct FrameDecoder {
    size: Option<(u32, u32)>,
    decoder: Decoder,
    counters: FrameCounters,
}

impl Default for FrameDecoder {
    fn default() -> Self {
        Self { size: None, decoder: Decoder::for_recordings(), counters: FrameCounters::default() }
    }
}

impl FrameDecoder {
    pub(super) const fn counters(&self) -> FrameCounters {
        self.counters
    }

    /// The picture as a camera delivers it; `None`, counted and logged once a kind, where there is none or it has another size than the
    /// first. It keeps the recorded time of arrival.
    pub(super) fn frame(&mut self, recorded: RecordedPicture) -> Option<CameraFrame> {
        match recorded {
            RecordedPicture::Coded(frame) => Some(CameraFrame {
                arrival: frame.arrival,
                mid_exposure: frame.mid_exposure,
                sequence: frame.sequence,
                picture: self.decode(&frame.jpeg)?,
                jpeg: Some(frame.jpeg),
            }),
            RecordedPicture::Raw(raw) => {
                self.counters.decoded += 1;
                Some(raw.into())
            }
        }
    }

    /// The picture in `jpeg`; `None`, counted and logged once a kind, where there is none or it has another size than the
    /// first.
    pub(super) fn decode(&mut self, jpeg: &[u8]) -> Option<Picture> {
        match self.try_decode(jpeg) {
            Ok(picture) => {
                self.counters.decoded += 1;
                Some(picture)
            }
            Err(JpegError::Size { width: w, height: h, .. }) => {
                if self.counters.other_size == 0 {
                    let (width, height) = self.size.unwrap_or_default();
                    log::warn!(
                        "a picture of {w}x{h} in mid-stream, the first was {width}x{height}: left out; was the camera's mode \
                         changed?",
                    );
                }
                self.counters.other_size += 1;
                None
            }
            Err(why) => {
                if self.counters.undecodable == 0 {
                    log::warn!("a picture that is no whole JPEG ({why}): left out");
                }
                self.counters.undecodable += 1;
                None
            }
        }
    }

    fn try_decode(&mut self, jpeg: &[u8]) -> Result<Picture, JpegError> {
        let picture = self.decoder.decode(jpeg, self.size)?;
        self.size = Some((picture.width(), picture.height()));
        Ok(picture)
    }
}

#[cfg(test)]
mod tests {
    use bowwave_core::event::PixelFormat;
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
}
