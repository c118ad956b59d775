//! Pictures side by side.

use ab_glyph::{Font, FontRef, ScaleFont, point};
use image::{Rgb, RgbImage, imageops};

use super::mask::{self, OutlineMask};

/// Height of the line with a picture's name.
const LABEL_PX: u32 = 30;
/// Width that small pictures are enlarged to at least.
const WIDTH_MIN_PX: u32 = 480;
/// Pictures in a row.
const COLUMNS: u32 = 2;

/// Left, top, width and height of what shows the boat and its reflection.
pub fn around(boat: &[Vec<[f64; 2]>], region: &OutlineMask) -> [u32; 4] {
    let [x0, y0, x1, y1] = mask::bounds(boat);
    let [left, top, right, bottom] = region.bounds().unwrap_or([0; 4]);
    let margin = 0.04 * (x1 - x0);
    let low = |v: f64, other: u32| (v.min(f64::from(other)) - margin).max(0.0) as u32;
    let (width, height) = region.size;
    let high = |v: f64, other: u32, most: u32| ((v.max(f64::from(other)) + margin) as u32).min(most);
    let (x, y) = (low(x0, left), low(y0, top));
    [x, y, high(x1, right, width) - x, high(y1, bottom, height) - y]
}

/// The same part of each picture with its name above it.
pub fn side_by_side(pictures: &[(&str, RgbImage)], [x, y, width, height]: [u32; 4]) -> RgbImage {
    let zoom = WIDTH_MIN_PX.div_ceil(width.max(1)).max(1);
    let (w, h) = (width * zoom, height * zoom);
    let rows = u32::try_from(pictures.len()).unwrap_or(1).div_ceil(COLUMNS);
    let mut sheet = RgbImage::from_pixel(COLUMNS * (w + 4), rows * (h + LABEL_PX), Rgb([24, 24, 24]));
    for (i, (name, picture)) in pictures.iter().enumerate() {
        let i = i as u32;
        let (left, top) = (i % COLUMNS * (w + 4), i / COLUMNS * (h + LABEL_PX));
        let part = imageops::crop_imm(picture, x, y, width, height).to_image();
        let part = imageops::resize(&part, w, h, imageops::FilterType::CatmullRom);
        imageops::replace(&mut sheet, &part, i64::from(left), i64::from(top + LABEL_PX));
        write(&mut sheet, name, left + 6, top + 22);
    }
    sheet
}

/// The display's own typeface.
const TYPEFACE: &[u8] = include_bytes!("../../../../daemon/render/assets/B612-Bold.otf");

fn write(sheet: &mut RgbImage, text: &str, left: u32, baseline: u32) {
    let Ok(font) = FontRef::try_from_slice(TYPEFACE) else { return };
    let font = font.as_scaled(20.0);
    let mut x = left as f32;
    for c in text.chars() {
        let glyph = font.scaled_glyph(c);
        let advance = font.h_advance(glyph.id);
        let mut glyph = glyph;
        glyph.position = point(x, baseline as f32);
        if let Some(outline) = font.outline_glyph(glyph) {
            let bounds = outline.px_bounds();
            outline.draw(|gx, gy, share| {
                let (px, py) = (bounds.min.x as u32 + gx, bounds.min.y as u32 + gy);
                if px < sheet.width() && py < sheet.height() {
                    let value = (24.0 + 220.0 * share.min(1.0)) as u8;
                    sheet.put_pixel(px, py, Rgb([value; 3]));
                }
            });
        }
        x += advance;
    }
}
