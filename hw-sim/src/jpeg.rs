//! JPEGs of what was drawn.

use image::{ExtendedColorType, ImageError, codecs::jpeg::JpegEncoder};

/// The JPEG of a picture of three bytes a pixel, rows from the top.
pub(crate) fn encode(rgb: &[u8], (width, height): (u32, u32), quality: u8) -> Result<Vec<u8>, ImageError> {
    let mut jpeg = Vec::with_capacity(rgb.len() / 8);
    JpegEncoder::new_with_quality(&mut jpeg, quality).encode(rgb, width, height, ExtendedColorType::Rgb8)?;
    Ok(jpeg)
}
