//! Pictures to look at: what was found drawn over what was seen.

use std::{fs, path::Path};

use anyhow::{Context as _, Result};
use glam::DVec3;
use image::{
    Rgb, RgbImage,
    imageops::{FilterType, replace, resize},
};

use super::frames::SeaFrame;

/// Pictures on a sheet.
pub const SHEET: usize = 16;

/// Writes the frame into `folder`: the mark in green, the line of `found` in red, or a red frame around it where nothing was
/// found.
pub fn write(folder: &Path, frame: &SeaFrame, found: Option<DVec3>) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    save(&drawn(frame, found), &folder.join(format!("{}.png", frame.name.replace(' ', "_"))))
}

/// Writes up to [`SHEET`] frames as one picture, four beside each other.
pub fn sheet(path: &Path, pictures: &[(&SeaFrame, Option<DVec3>)]) -> Result<()> {
    const FIELD: (u32, u32) = (480, 360);
    const ACROSS: u32 = 4;
    let down = (pictures.len() as u32).div_ceil(ACROSS);
    let mut sheet = RgbImage::new(FIELD.0 * ACROSS, FIELD.1 * down);
    for (i, (frame, found)) in (0..).zip(pictures) {
        let picture = drawn(frame, *found);
        let scale = f64::min(
            f64::from(FIELD.0) / f64::from(picture.width()),
            f64::from(FIELD.1) / f64::from(picture.height()),
        );
        let size = |px: u32| (f64::from(px) * scale) as u32;
        let small = resize(&picture, size(picture.width()), size(picture.height()), FilterType::Triangle);
        let (x, y) = (i % ACROSS * FIELD.0, i / ACROSS * FIELD.1);
        replace(&mut sheet, &small, i64::from(x), i64::from(y));
    }
    save(&sheet, path)
}

fn save(picture: &RgbImage, path: &Path) -> Result<()> {
    picture.save(path).with_context(|| format!("cannot write {}", path.display()))
}

fn drawn(frame: &SeaFrame, found: Option<DVec3>) -> RgbImage {
    let (w, h) = (frame.size.0 as u32, frame.size.1 as u32);
    let grey = |x: u32, y: u32| frame.luma.get((y * w + x) as usize).copied().unwrap_or(0);
    let mut picture = RgbImage::from_fn(w, h, |x, y| Rgb([grey(x, y); 3]));
    let mut dot = |x: u32, y: f64, colour: [u8; 3]| {
        if y >= 0.0 && y < f64::from(h) {
            picture.put_pixel(x, y as u32, Rgb(colour));
        }
    };
    for x in 0..w {
        let middle = f64::from(x) + 0.5;
        if let Some([a, b]) = frame.mark
            && middle >= a.x
            && middle <= b.x
        {
            dot(x, a.y + (b.y - a.y) * (middle - a.x) / (b.x - a.x), [0, 255, 0]);
        }
        // Every other pixel, so that the edge below stays visible.
        match found {
            Some(up) if x % 2 == 0 => dot(x, frame.horizon_row(up, middle), [255, 0, 0]),
            Some(_) => {}
            None => (0..4).for_each(|edge| dot(x, f64::from(edge), [255, 0, 0])),
        }
    }
    picture
}
