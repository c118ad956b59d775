//! Still pictures of what was shown: single frames and a contact sheet.

use std::path::Path;

use anyhow::{Context, Result};
use image::{RgbImage, RgbaImage, imageops};

/// Columns and rows of a contact sheet.
const SHEET: (u32, u32) = (3, 4);

/// Width of one of its pictures in pixels.
const THUMB_WIDTH: u32 = 426;

/// Twelve moments of a run in one picture.
#[derive(Debug)]
pub struct ContactSheet {
    every: u64,
    thumb: (u32, u32),
    sheet: RgbImage,
}

impl ContactSheet {
    /// A sheet for a run of about `frames` frames of that size.
    pub fn new(frames: u64, (width, height): (u32, u32)) -> Self {
        let thumb = (THUMB_WIDTH, (THUMB_WIDTH * height).div_ceil(width).max(1));
        let every = (frames / u64::from(SHEET.0 * SHEET.1)).max(1);
        Self { every, thumb, sheet: RgbImage::new(SHEET.0 * thumb.0, SHEET.1 * thumb.1) }
    }

    /// Takes in a frame, where the sheet has a place for it.
    pub fn frame(&mut self, index: u64, picture: &RgbaImage) {
        let place = index / self.every;
        if !index.is_multiple_of(self.every) || place >= u64::from(SHEET.0 * SHEET.1) {
            return;
        }
        let place = place as u32;
        let small = imageops::thumbnail(picture, self.thumb.0, self.thumb.1);
        let small = image::DynamicImage::ImageRgba8(small).into_rgb8();
        let (x, y) = (place % SHEET.0 * self.thumb.0, place / SHEET.0 * self.thumb.1);
        imageops::replace(&mut self.sheet, &small, i64::from(x), i64::from(y));
    }

    /// Whether a frame has a place on the sheet.
    pub fn wants(&self, index: u64) -> bool {
        index.is_multiple_of(self.every) && index / self.every < u64::from(SHEET.0 * SHEET.1)
    }

    /// Writes the sheet as PNG.
    pub fn write(&self, path: &Path) -> Result<()> {
        self.sheet
            .save(path)
            .with_context(|| format!("cannot write the contact sheet {}; check the disk", path.display()))
    }
}

/// Copies a finished frame.
pub fn copy_frame(rgba: &[u8], (width, height): (u32, u32)) -> Option<RgbaImage> {
    RgbaImage::from_raw(width, height, rgba.to_vec())
}

/// Writes a frame as PNG without its alpha.
pub fn write_still(path: &Path, picture: RgbaImage) -> Result<()> {
    image::DynamicImage::ImageRgba8(picture)
        .into_rgb8()
        .save(path)
        .with_context(|| format!("cannot write the frame {}; check the disk", path.display()))
}
