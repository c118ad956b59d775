//! The glyphs of the head-up display, rasterised once: printable ASCII and two signs more in two sizes in one atlas of coverage bytes.

use ab_glyph::{Font, FontRef, PxScale, ScaleFont};

use crate::error::RenderError;

/// B612 (Airbus and Intactile Design), drawn for cockpit displays.
const FONT: &[u8] = include_bytes!("../../../assets/B612-Bold.otf");

const FIRST: u8 = b' ';
const ASCII: usize = (b'~' - b' ') as usize + 1;
/// What an uncertainty in degrees is written with.
const SIGNS: [char; 2] = ['±', '°'];
const COUNT: usize = ASCII + SIGNS.len();

/// One of the two sizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TextSize {
    /// Words that must be read at a glance.
    Large,
    /// Causes, actions and counts.
    Small,
}

/// Where a glyph lies in the atlas and how it is set.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Glyph {
    /// x0, y0, x1, y1 in the atlas, texels.
    pub(crate) uv: [f32; 4],
    /// The same rectangle relative to the pen on the base line, pixels.
    pub(crate) rect: [f32; 4],
    /// How far the pen moves, pixels.
    pub(crate) advance: f32,
}

/// Metrics and atlas.
pub(crate) struct Glyphs {
    glyphs: [[Glyph; COUNT]; 2],
    /// Height of a line, pixels, by size.
    line: [f32; 2],
    /// Base line below the line's top, pixels, by size.
    ascent: [f32; 2],
    /// Height of a capital without serifs, pixels, by size.
    #[cfg(test)]
    cap: [f32; 2],
    /// Width of the atlas, pixels.
    pub(crate) width: u32,
    /// Height of the atlas, pixels.
    pub(crate) height: u32,
    /// Coverage, one byte a pixel, rows from the top.
    pub(crate) coverage: Vec<u8>,
}

impl Glyphs {
    /// Rasterises both sizes, given in pixels from one line to the next.
    pub(crate) fn new(large_px: f32, small_px: f32) -> Result<Self, RenderError> {
        let font = FontRef::try_from_slice(FONT).map_err(|e| RenderError::Font(e.to_string()))?;
        let width = 512_u32.max((large_px * 12.0) as u32);
        let mut glyphs = Self {
            glyphs: [[Glyph::default(); COUNT]; 2],
            line: [0.0; 2],
            ascent: [0.0; 2],
            #[cfg(test)]
            cap: [0.0; 2],
            width,
            height: 0,
            coverage: Vec::new(),
        };
        // The pen of the shelf that is being filled, and that shelf's height.
        let (mut x, mut y, mut shelf) = (1_u32, 1_u32, 0_u32);
        for (size, px) in [large_px, small_px].into_iter().enumerate() {
            let scaled = font.as_scaled(PxScale::from(px));
            glyphs.line[size] = scaled.height();
            glyphs.ascent[size] = scaled.ascent();
            #[cfg(test)]
            {
                let capital = font.outline(font.glyph_id('H')).map_or(0.0, |o| o.bounds.height().abs());
                glyphs.cap[size] = capital * scaled.v_scale_factor();
            }
            for index in 0..COUNT {
                let sign = index.checked_sub(ASCII).and_then(|at| SIGNS.get(at).copied());
                let id = scaled.glyph_id(sign.unwrap_or_else(|| char::from(FIRST + index as u8)));
                let advance = scaled.h_advance(id);
                let Some(outline) = scaled.outline_glyph(id.with_scale(px)) else {
                    glyphs.glyphs[size][index].advance = advance;
                    continue;
                };
                let bounds = outline.px_bounds();
                let (w, h) = (bounds.width().ceil() as u32, bounds.height().ceil() as u32);
                if x + w + 1 > width {
                    (x, y, shelf) = (1, y + shelf + 1, 0);
                }
                shelf = shelf.max(h);
                let needed = (y + h + 1) * width;
                glyphs.coverage.resize(glyphs.coverage.len().max(needed as usize), 0);
                outline.draw(|dx, dy, cover| {
                    if let Some(byte) = glyphs.coverage.get_mut(((y + dy) * width + x + dx) as usize) {
                        *byte = (cover.clamp(0.0, 1.0) * 255.0).round() as u8;
                    }
                });
                glyphs.glyphs[size][index] = Glyph {
                    uv: [x, y, x + w, y + h].map(|v| v as f32),
                    rect: [bounds.min.x, bounds.min.y, bounds.min.x + w as f32, bounds.min.y + h as f32],
                    advance,
                };
                x += w + 1;
            }
        }
        glyphs.height = (y + shelf + 1).next_power_of_two();
        glyphs.coverage.resize((glyphs.width * glyphs.height) as usize, 0);
        Ok(glyphs)
    }

    /// The glyph of `c`; that of "?" for what is not in the atlas.
    pub(crate) fn get(&self, size: TextSize, c: char) -> &Glyph {
        let ascii = u8::try_from(c).ok().and_then(|c| c.checked_sub(FIRST)).map(usize::from);
        let sign = || SIGNS.iter().position(|sign| *sign == c).map(|at| ASCII + at);
        let index = ascii.filter(|index| *index < ASCII).or_else(sign);
        let row = &self.glyphs[size as usize];
        index.and_then(|index| row.get(index)).unwrap_or(&row[usize::from(b'?' - FIRST)])
    }

    /// Height of a line, pixels.
    pub(crate) fn line(&self, size: TextSize) -> f32 {
        self.line[size as usize]
    }

    /// Base line below the line's top, pixels.
    pub(crate) fn ascent(&self, size: TextSize) -> f32 {
        self.ascent[size as usize]
    }

    /// Height of a capital, pixels.
    #[cfg(test)]
    pub(crate) fn cap(&self, size: TextSize) -> f32 {
        self.cap[size as usize]
    }

    /// Width of a run of text, pixels.
    pub(crate) fn width_of(&self, size: TextSize, text: &str) -> f32 {
        text.chars().map(|c| self.get(size, c).advance).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_printable_glyph_has_ink_within_the_atlas_and_apart_from_the_others() {
        let glyphs = Glyphs::new(28.0, 19.0).unwrap();
        let mut taken = vec![false; glyphs.coverage.len()];
        for size in [TextSize::Large, TextSize::Small] {
            for c in ('!'..='~').chain(['?']) {
                let glyph = glyphs.get(size, c);
                let [x0, y0, x1, y1] = glyph.uv.map(|v| v as usize);
                let w = glyphs.width;
                let mut ink = 0;
                for y in y0..y1 {
                    for x in x0..x1 {
                        let i = y * w as usize + x;
                        ink += usize::from(glyphs.coverage[i] > 128);
                        assert!(c == '?' || !std::mem::replace(&mut taken[i], true), "{c} overlaps another");
                    }
                }
                assert!(ink > 0 && glyph.advance > 0.0, "{c} has no ink");
            }
        }
        assert!(glyphs.get(TextSize::Small, ' ').advance > 0.0);
        assert_eq!(glyphs.get(TextSize::Small, '\u{e9}'), glyphs.get(TextSize::Small, '?'));
        let digits: Vec<f32> = ('0'..='9').map(|c| glyphs.get(TextSize::Large, c).advance).collect();
        assert!(digits.iter().all(|d| (d - digits[0]).abs() < 0.01), "counts would jitter: {digits:?}");
    }
}
