//! A camera's or a recording's JPEG: any bytes.
//!
//! Input: one byte, then the JPEG. Bit 0 of the byte says that it comes out of a recording, bit 1 that 64 x 48 pixels are
//! expected.

use bowwave_core::event::{Picture, PixelFormat};
use bowwave_devices::camera::jpeg::{Decoder, JpegError, header};

const EXPECTED: (u32, u32) = (64, 48);
/// Larger pictures are decoded in the same way, only more slowly.
const PIXELS_MAX: u64 = 1 << 20;

/// A picture is refused in words, or has its declared size and does not depend on the one before it.
pub fn run(input: &[u8]) {
    let Some((&kind, jpeg)) = input.split_first() else { return };
    let expected = (kind & 2 != 0).then_some(EXPECTED);
    let declared = super::memory::within(0, || header(jpeg).map(|header| (header.width, header.height)).ok());
    let pixels = declared.map_or(0, |(width, height)| u64::from(width) * u64::from(height));
    let decoded = expected.is_none() || expected == declared;
    if decoded && pixels > PIXELS_MAX {
        return;
    }
    let limit = memory_bytes(if decoded { pixels } else { 0 }, jpeg.len());
    let decoder = || if kind & 1 == 0 { Decoder::for_camera() } else { Decoder::for_recordings() };
    let fresh = super::memory::within(limit, || decoder().decode(jpeg, expected));
    match &fresh {
        Ok(picture) => {
            assert_eq!(Some((picture.width(), picture.height())), declared);
            assert_eq!(picture.format(), PixelFormat::Rgb);
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            let looked_into = !matches!(error, JpegError::Size { .. });
            assert!(declared.is_none() || decoded || !looked_into, "a picture of another size: {error}");
        }
    }
    if let (Ok(picture), Some(size)) = (fresh, declared) {
        check_used_again(decoder(), jpeg, size, &picture);
    }
}

/// The picture, coefficients and planes of whole blocks at 16 bits, and the decoder's tables; nothing of what a header claims
/// before its size was found to be right.
const fn memory_bytes(pixels: u64, jpeg_bytes: usize) -> usize {
    (1 << 20) + 32 * pixels as usize + 4 * jpeg_bytes
}

/// Decodes behind another picture of the same size, whose bytes are still in the buffer.
fn check_used_again(mut decoder: Decoder, jpeg: &[u8], size: (u32, u32), picture: &Picture) {
    for _ in 0..2 {
        match decoder.decode(jpeg, Some(size)) {
            Ok(again) => assert!(again == *picture, "the same bytes make another picture"),
            Err(error) => panic!("the same bytes are refused the second time: {error}"),
        }
        // What the next picture is decoded over: a damaged one that leaves its beginning behind.
        let half = jpeg.len() / 2;
        let cut = [jpeg.get(..half).unwrap_or_default(), &[0x55; 16], &[0xff, 0xd9]].concat();
        drop(decoder.decode(&cut, Some(size)));
    }
}
