//! From the renderer's pixels to the display's: byte order, and where a picture of another size goes.

use super::LcdFit;

/// Bytes of a pixel, in pictures and on the display.
pub(super) const PIXEL: usize = 4;

/// Which part of the picture goes to which part of the screen: pixel for pixel, both centred.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Placement {
    from: (usize, usize),
    to: (usize, usize),
    size: (usize, usize),
    picture_width: usize,
}

impl Placement {
    /// Where a `picture` goes on a `screen` (width and height in pixels).
    pub(super) fn new(picture: (u32, u32), screen: (u32, u32)) -> Self {
        let along = |picture: u32, screen: u32| {
            let (picture, screen) = (picture as usize, screen as usize);
            (picture.saturating_sub(screen) / 2, screen.saturating_sub(picture) / 2, picture.min(screen))
        };
        let (from_x, to_x, width) = along(picture.0, screen.0);
        let (from_y, to_y, height) = along(picture.1, screen.1);
        Self {
            from: (from_x, from_y),
            to: (to_x, to_y),
            size: (width, height),
            picture_width: picture.0 as usize,
        }
    }

    /// Copies the placed part of `rgba` into `screen`, whose lines are `pitch` bytes apart. Front to back and without a
    /// read of `screen`, which may be uncached memory. Lines that either side lacks are left out.
    pub(super) fn copy(&self, rgba: &[u8], screen: &mut [u8], pitch: usize) {
        let bytes = self.size.0 * PIXEL;
        if bytes == 0 || pitch == 0 {
            return;
        }
        let lines = rgba.chunks_exact(self.picture_width * PIXEL).skip(self.from.1).take(self.size.1);
        for (line, out) in lines.zip(screen.chunks_mut(pitch).skip(self.to.1)) {
            let line = line.get(self.from.0 * PIXEL..self.from.0 * PIXEL + bytes);
            let out = out.get_mut(self.to.0 * PIXEL..self.to.0 * PIXEL + bytes);
            if let (Some(line), Some(out)) = (line, out) {
                to_xrgb(line, out);
            }
        }
    }
}

/// How a `picture` lies on a `screen`.
pub(super) fn fit(picture: (u32, u32), screen: (u32, u32)) -> LcdFit {
    let cropped = picture.0 > screen.0 || picture.1 > screen.1;
    if picture == screen {
        LcdFit::Exact
    } else if cropped {
        LcdFit::Cropped { picture, screen }
    } else {
        LcdFit::Bordered { picture, screen }
    }
}

/// R G B A bytes into B G R X bytes (the kernel's XRGB8888). Four bytes at a time, so that the compiler makes whole vectors
/// of it and every store is to the next address: what write-combining memory wants.
fn to_xrgb(rgba: &[u8], xrgb: &mut [u8]) {
    for (pixel, out) in rgba.as_chunks::<PIXEL>().0.iter().zip(xrgb.as_chunks_mut::<PIXEL>().0) {
        let abgr = u32::from_le_bytes(*pixel);
        let xrgb = 0xff00_0000 | (abgr & 0xff00) | (abgr & 0xff) << 16 | (abgr >> 16 & 0xff);
        *out = xrgb.to_le_bytes();
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A picture in which every pixel tells its place.
    fn picture(width: u32, height: u32) -> Vec<u8> {
        (0..height)
            .flat_map(|y| (0..width).flat_map(move |x| [x as u8, y as u8, (x ^ y) as u8 | 1, 9]))
            .collect()
    }

    proptest! {
        #[test]
        fn every_pixel_swaps_red_and_blue(rgba in prop::collection::vec(any::<[u8; PIXEL]>(), 0..100)) {
            let mut out = vec![7; rgba.len() * PIXEL];
            to_xrgb(rgba.as_flattened(), &mut out);
            for ([r, g, b, _], got) in rgba.iter().zip(out.chunks(PIXEL)) {
                prop_assert_eq!(got, [*b, *g, *r, 255]);
            }
        }

        /// Against the definition: screen pixel (x, y) is the picture's pixel (x, y) + (picture - screen) / 2, or black.
        #[test]
        fn a_picture_is_centred_and_never_scaled(
            pw in 1u32..40, ph in 1u32..40, sw in 1u32..40, sh in 1u32..40, padding in 0usize..9,
        ) {
            let pitch = sw as usize * PIXEL + padding;
            let mut screen = vec![0; pitch * sh as usize];
            let rgba = picture(pw, ph);
            Placement::new((pw, ph), (sw, sh)).copy(&rgba, &mut screen, pitch);
            let shift = |p: u32, s: u32| {
                if p > s { i64::from((p - s) / 2) } else { -i64::from((s - p) / 2) }
            };
            for y in 0..sh {
                for x in 0..sw {
                    let (px, py) = (i64::from(x) + shift(pw, sw), i64::from(y) + shift(ph, sh));
                    let inside = (0..i64::from(pw)).contains(&px) && (0..i64::from(ph)).contains(&py);
                    let expected = if inside {
                        let at = (py as usize * pw as usize + px as usize) * PIXEL;
                        [rgba[at + 2], rgba[at + 1], rgba[at], 255]
                    } else {
                        [0; PIXEL]
                    };
                    let at = y as usize * pitch + x as usize * PIXEL;
                    prop_assert_eq!(&screen[at..at + PIXEL], expected);
                }
            }
            for line in screen.chunks(pitch) {
                prop_assert!(line[sw as usize * PIXEL..].iter().all(|b| *b == 0), "the padding is not ours");
            }
        }
    }

    #[test]
    fn short_memory_is_left_alone_rather_than_overrun() {
        let mut screen = vec![0; 10];
        Placement::new((4, 4), (4, 4)).copy(&picture(4, 4), &mut screen, 16);
        assert_eq!(screen, [0; 10]);
        Placement::new((4, 4), (4, 4)).copy(&[1; 5], &mut screen, 16);
        assert_eq!(screen, [0; 10]);
        Placement::new((0, 4), (4, 4)).copy(&[], &mut screen, 0);
        assert_eq!(screen, [0; 10]);
    }

    #[test]
    fn the_fit_tells_what_the_sailor_sees() {
        assert_eq!(fit((800, 480), (800, 480)), LcdFit::Exact);
        assert!(matches!(fit((800, 480), (1024, 600)), LcdFit::Bordered { .. }));
        assert!(matches!(fit((800, 480), (1024, 400)), LcdFit::Cropped { .. }));
    }
}
