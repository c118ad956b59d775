//! Words in the head-up display's letters without a renderer, for windows that the trainer does not draw.

use crate::{
    error::RenderError,
    passes::hud::glyphs::{Glyphs, TextSize},
};

/// Letters of one height.
pub struct Lettering(Glyphs);

impl Lettering {
    /// Letters whose lines lie `line_px` pixels apart.
    ///
    /// # Errors
    /// A font that cannot be read.
    pub fn new(line_px: f32) -> Result<Self, RenderError> {
        Glyphs::new(line_px, line_px).map(Self)
    }

    /// Width of a line of text, pixels.
    pub fn width(&self, text: &str) -> f32 {
        self.0.width_of(TextSize::Small, text)
    }

    /// Sets a line of text whose upper left corner lies at `x`, `y`, pixels: `ink` gets each pixel of it with its cover, 0 to 255. Signs that the
    /// letters do not have are question marks.
    pub fn set(&self, text: &str, (x, y): (f32, f32), mut ink: impl FnMut(i32, i32, u8)) {
        let (mut pen, base) = (x, y + self.0.ascent(TextSize::Small));
        for c in text.chars() {
            let glyph = self.0.get(TextSize::Small, c);
            let [u0, v0, u1, v1] = glyph.uv.map(|v| v as u32);
            let (left, top) = ((pen + glyph.rect[0]).round() as i32, (base + glyph.rect[1]).round() as i32);
            for v in v0..v1 {
                for u in u0..u1 {
                    let cover = self.0.coverage.get((v * self.0.width + u) as usize).copied().unwrap_or(0);
                    if cover > 0 {
                        ink(left + (u - u0) as i32, top + (v - v0) as i32, cover);
                    }
                }
            }
            pen += glyph.advance;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_have_ink_within_their_line() {
        let letters = Lettering::new(18.0).unwrap();
        let (mut ink, mut bounds) = (0, [i32::MAX, i32::MIN]);
        letters.set("Trace", (10.0, 20.0), |x, y, cover| {
            ink += u32::from(cover > 128);
            bounds = [bounds[0].min(y), bounds[1].max(y)];
            assert!((9..=11 + letters.width("Trace") as i32).contains(&x), "{x}");
        });
        assert!(ink > 50 && bounds[0] >= 20 && bounds[1] <= 40, "{ink} {bounds:?}");
    }
}
