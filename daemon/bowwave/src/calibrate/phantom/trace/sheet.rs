//! What the window shows: the picture with the outlines, a loupe at the cursor, and below it what the keys do.

use anyhow::{Context, Result};
use bowwave_render::Lettering;
use glam::{DVec2, IVec2};

use super::editor::{Editor, Origin, Part};

/// Height of a line of text, pixels.
const LINE_PX: usize = 22;
/// Lines below the picture: the keys, the part in hand, and what was said last.
const KEYS: [&str; 2] = [
    "Click or Space: corner   Right click or Backspace: take back   Enter: close the part   R: recoils   Arrows (Shift: ten): move the cursor",
    "Tab: next part   Delete: leave the part out or keep it   S: save and end   Esc: end without saving",
];
const LINES: usize = KEYS.len() + 2;
/// Half the side of what the loupe shows, pixels, how much larger it shows it, and how far from the picture's corner it lies.
const LOUPE_PX: i32 = 20;
const LOUPE_SCALE: i32 = 6;
const LOUPE_EDGE: i32 = 12;

const PAPER: u32 = 0x18_18_18;
const INK: u32 = 0xe8_e8_e8;
const FRAME: u32 = 0x80_80_80;
const REFUSED: u32 = 0xff_b0_40;
const CALIBRATED: u32 = 0xff_50_50;
const FOUND: u32 = 0x50_a0_ff;
const TRACED: u32 = 0x50_e0_70;
const OPEN: u32 = 0xff_e0_40;

/// Draws the window's content.
pub struct Sheet {
    picture: Vec<u32>,
    picture_size: IVec2,
    letters: Lettering,
    /// 0RGB words, row by row.
    words: Vec<u32>,
}

impl Sheet {
    /// Over a grey picture of `size` pixels.
    pub fn new(codes: &[u8], size: (u32, u32)) -> Result<Self> {
        let letters = Lettering::new(LINE_PX as f32 * 0.8).context("cannot write in the window")?;
        let mut sheet = Self {
            picture: vec![0; size.0 as usize * size.1 as usize],
            picture_size: IVec2::new(size.0 as i32, size.1 as i32),
            letters,
            words: vec![PAPER; size.0 as usize * Self::height(size)],
        };
        sheet.show(codes);
        Ok(sheet)
    }

    /// Takes another picture of the same size; what codes do not reach is black.
    pub fn show(&mut self, codes: &[u8]) {
        let codes = codes.iter().copied().chain(std::iter::repeat(0));
        for (word, code) in self.picture.iter_mut().zip(codes) {
            *word = u32::from_be_bytes([0, code, code, code]);
        }
    }

    /// Height with the lines below the picture, pixels.
    pub fn height(size: (u32, u32)) -> usize {
        size.1 as usize + LINES * LINE_PX + LINE_PX / 2
    }

    /// Draws it all; 0RGB words.
    pub fn draw(&mut self, editor: &Editor) -> &[u32] {
        self.words[..self.picture.len()].copy_from_slice(&self.picture);
        self.words[self.picture.len()..].fill(PAPER);
        let in_hand = editor.in_hand();
        for (i, part) in editor.parts().iter().enumerate() {
            self.part(part, in_hand == Some(i));
        }
        let (open, _) = editor.open();
        for (a, b) in open.iter().zip(open.iter().skip(1)) {
            self.line(*a, *b, OPEN, false);
        }
        if let (Some(first), Some(last)) = (open.first(), open.last()) {
            self.line(*last, editor.cursor(), OPEN, true);
            if open.len() > 1 {
                self.line(editor.cursor(), *first, OPEN, true);
            }
        }
        for corner in open {
            self.dot(*corner, OPEN);
        }
        self.loupe(editor.cursor());
        self.text(editor);
        &self.words
    }

    fn part(&mut self, part: &Part, is_in_hand: bool) {
        let colour = match part.origin {
            Origin::Calibrated => CALIBRATED,
            Origin::Found => FOUND,
            Origin::Traced => TRACED,
        };
        let outline = part.phantom.outline().to_vec();
        for (a, b) in outline.iter().zip(outline.iter().cycle().skip(1)) {
            self.line(*a, *b, colour, !part.is_kept);
        }
        if is_in_hand {
            outline.iter().for_each(|corner| self.dot(*corner, colour));
        }
    }

    fn put(&mut self, at: IVec2, colour: u32) {
        let is_inside = at.cmpge(IVec2::ZERO).all() && at.cmplt(self.picture_size).all();
        if let Some(word) =
            self.words.get_mut((at.y * self.picture_size.x + at.x) as usize).filter(|_| is_inside)
        {
            *word = colour;
        }
    }

    /// A line of a pixel; a broken one where something is not yet so, or no more.
    fn line(&mut self, from: DVec2, to: DVec2, colour: u32, is_broken: bool) {
        let steps = (to - from).abs().max_element().ceil().max(1.0);
        for i in 0..=steps as u32 {
            if !is_broken || i / 5 % 2 == 0 {
                self.put(from.lerp(to, f64::from(i) / steps).floor().as_ivec2(), colour);
            }
        }
    }

    fn dot(&mut self, at: DVec2, colour: u32) {
        let at = at.floor().as_ivec2();
        for y in -2..=2 {
            (-2..=2).for_each(|x| self.put(at + IVec2::new(x, y), colour));
        }
    }

    /// Pixels about the cursor, enlarged, in the corner that is farther from it; a cross marks the cursor.
    fn loupe(&mut self, cursor: DVec2) {
        let middle = cursor.floor().as_ivec2();
        let side = (2 * LOUPE_PX + 1) * LOUPE_SCALE;
        if self.picture_size.min_element() < side + 2 * LOUPE_EDGE {
            return;
        }
        let is_left = middle.x > self.picture_size.x / 2;
        let left = if is_left { LOUPE_EDGE } else { self.picture_size.x - LOUPE_EDGE - side };
        let corner = IVec2::new(left, LOUPE_EDGE);
        let seen = self.words.clone();
        for y in 0..side {
            for x in 0..side {
                let from = middle + IVec2::new(x, y) / LOUPE_SCALE - LOUPE_PX;
                let is_inside = from.cmpge(IVec2::ZERO).all() && from.cmplt(self.picture_size).all();
                let word = seen.get((from.y * self.picture_size.x + from.x) as usize).filter(|_| is_inside);
                let is_frame = x == 0 || y == 0 || x == side - 1 || y == side - 1;
                self.put(corner + IVec2::new(x, y), if is_frame { FRAME } else { *word.unwrap_or(&PAPER) });
            }
        }
        // To a part of a pixel, as the corner will be set.
        let at =
            corner + ((cursor - middle.as_dvec2() + f64::from(LOUPE_PX)) * f64::from(LOUPE_SCALE)).as_ivec2();
        for i in 4..16 {
            for off in [IVec2::new(i, 0), IVec2::new(-i, 0), IVec2::new(0, i), IVec2::new(0, -i)] {
                self.put(at + off, OPEN);
            }
        }
    }

    fn text(&mut self, editor: &Editor) {
        let cursor = editor.cursor();
        let recoils = |recoils: bool| if recoils { ", recoils" } else { "" };
        let (open, open_recoils) = editor.open();
        let in_hand = editor.in_hand().and_then(|i| Some((i, editor.parts().get(i)?)));
        let state = match in_hand {
            _ if !open.is_empty() => format!("open part: {} corners{}", open.len(), recoils(open_recoils)),
            Some((i, part)) => format!(
                "part {} of {}: {}, {}, {}{}",
                i + 1,
                editor.parts().len(),
                part.phantom.name,
                match part.origin {
                    Origin::Calibrated => "of the calibration",
                    Origin::Found => "told by the pictures",
                    Origin::Traced => "traced",
                },
                if part.is_kept { "kept" } else { "left out" },
                recoils(part.phantom.recoils)
            ),
            None => "no part yet".to_owned(),
        };
        let state = format!("{:.1},{:.1}   {state}", cursor.x, cursor.y);
        let lines = [(KEYS[0], INK), (KEYS[1], INK), (&*state, OPEN), (editor.message(), REFUSED)];
        let width = self.picture_size.x as usize;
        let top = self.picture_size.y as usize + LINE_PX / 4;
        for (i, (line, colour)) in lines.into_iter().enumerate() {
            let at = (LINE_PX as f32 / 2.0, (top + i * LINE_PX) as f32);
            let words = &mut self.words;
            self.letters.set(line, at, |x, y, cover| {
                let place = usize::try_from(x).ok().zip(usize::try_from(y).ok()).filter(|(x, _)| *x < width);
                if let Some(word) = place.and_then(|(x, y)| words.get_mut(y * width + x)) {
                    *word = mixed(*word, colour, cover);
                }
            });
        }
    }
}

/// One colour laid over another by a cover of 0 to 255.
fn mixed(below: u32, above: u32, cover: u8) -> u32 {
    let (below, above, cover) = (below.to_be_bytes(), above.to_be_bytes(), u32::from(cover));
    let mut out = [0; 4];
    for (out, (b, a)) in out.iter_mut().zip(below.into_iter().zip(above)) {
        *out = ((u32::from(b) * (255 - cover) + u32::from(a) * cover) / 255) as u8;
    }
    u32::from_be_bytes(out)
}

#[cfg(test)]
mod tests {
    use super::{super::editor::Gesture, *};

    #[test]
    fn the_sheet_shows_corners_the_loupe_and_words() {
        let size = (640, 360);
        let mut sheet = Sheet::new(&vec![90; 640 * 360], size).unwrap();
        let mut editor = Editor::new(size, &[], &[]);
        for place in [[100.0, 300.0], [200.0, 300.0], [150.0, 340.0]] {
            editor.take(Gesture::Point(DVec2::from_array(place)));
            editor.take(Gesture::Corner);
        }
        let words = sheet.draw(&editor).to_vec();
        assert_eq!(words.len(), 640 * Sheet::height(size));
        let at = |x: usize, y: usize| words[y * 640 + x];
        assert_eq!((at(100, 300), at(150, 300), at(20, 200)), (OPEN, OPEN, 0x5a_5a_5a));
        // The loupe is in the corner away from the cursor and shows the last corner's dot enlarged.
        let side = ((2 * LOUPE_PX + 1) * LOUPE_SCALE) as usize;
        let (x, y) = (640 - LOUPE_EDGE as usize - side / 2, LOUPE_EDGE as usize + side / 2);
        assert_eq!(at(x, y), OPEN);
        sheet.show(&vec![120; 640 * 360]);
        assert_eq!(sheet.draw(&editor)[200 * 640 + 20], 0x78_78_78);
        let ink = words[640 * 360..].iter().filter(|word| **word == INK).count();
        assert!(ink > 500, "{ink}");
        // Small pictures have no loupe, and any cursor is drawn.
        let mut small = Sheet::new(&[], (64, 36)).unwrap();
        assert_eq!(small.draw(&Editor::new((64, 36), &[], &[])).len(), 64 * Sheet::height((64, 36)));
    }
}
