//! Where everything of the head-up display goes. The middle of the picture stays free: TRAINING stands at the top, the state at
//! the lower left, counts at the lower right. Colour is never alone: each state has its own shape and word as well.

use std::fmt::Write;

use bowwave_core::scene::{Hud, PixelRect, Status};
use shaders_spirv::interface::{
    HudQuad, SHAPE_CROSS, SHAPE_DISC, SHAPE_GLYPH, SHAPE_PLATE, SHAPE_RING, SHAPE_SQUARE, SHAPE_TRIANGLE,
};

use crate::{
    frame_data::QUADS_MAX,
    glyphs::{Glyphs, TextSize},
};

/// Linear light of the texts and shapes.
const WHITE: [f32; 3] = [0.9, 0.9, 0.9];
const GREEN: [f32; 3] = [0.10, 0.75, 0.16];
const AMBER: [f32; 3] = [1.0, 0.45, 0.02];
const RED: [f32; 3] = [0.95, 0.08, 0.06];
const CYAN: [f32; 3] = [0.12, 0.65, 0.85];
/// Plates behind the texts.
const PLATE: [f32; 4] = [0.004, 0.006, 0.010, 0.72];

/// How a state looks.
struct Look<'a> {
    shape: u32,
    colour: [f32; 3],
    word: &'static str,
    cause: &'a str,
    action: &'a str,
}

fn look(status: &Status) -> Look<'_> {
    let plain = |shape, colour, word| Look { shape, colour, word, cause: "", action: "" };
    match *status {
        Status::Ready => plain(SHAPE_DISC, GREEN, "READY"),
        Status::Hit => plain(SHAPE_RING, CYAN, "HIT"),
        Status::Miss => plain(SHAPE_CROSS, WHITE, "MISS"),
        Status::NotScored { cause, action } => {
            Look { shape: SHAPE_TRIANGLE, colour: AMBER, word: "NOT SCORED", cause, action }
        }
        Status::Fault { cause, action } => {
            Look { shape: SHAPE_SQUARE, colour: RED, word: "FAULT", cause, action }
        }
    }
}

/// Pixels from one line to the next in both sizes on a screen of `size`.
pub(crate) fn text_px(size: (u32, u32)) -> (f32, f32) {
    let unit = unit(size);
    (30.0 * unit, 21.0 * unit)
}

/// Screen pixels for one pixel of an 800x480 display.
fn unit(size: (u32, u32)) -> f32 {
    (size.0 as f32 / 800.0).min(size.1 as f32 / 480.0).max(0.5)
}

/// Plates, shapes, glyphs: what `hud.frag` is compiled for.
pub(crate) const KINDS: usize = 3;

fn kind(shape: u32) -> usize {
    match shape {
        SHAPE_PLATE => 0,
        SHAPE_GLYPH => 2,
        _ => 1,
    }
}

/// Lays out into a list that keeps its memory from frame to frame.
pub(crate) struct HudLayout {
    size: (u32, u32),
    quads: Vec<HudQuad>,
    text: String,
}

impl HudLayout {
    pub(crate) fn new(size: (u32, u32)) -> Self {
        Self { size, quads: Vec::with_capacity(QUADS_MAX), text: String::with_capacity(64) }
    }

    /// The quads of `hud`, in drawing order.
    pub(crate) fn lay_out(&mut self, glyphs: &Glyphs, hud: &Hud) -> &[HudQuad] {
        self.quads.clear();
        self.training(glyphs);
        self.status(glyphs, &hud.status);
        self.counts(glyphs, hud);
        // Each kind is one draw. Nothing of a kind overlaps another of its kind, and plates lie beneath everything.
        self.quads.sort_unstable_by_key(|q| kind(q.shape));
        &self.quads
    }

    /// How many plates, shapes and glyphs there are.
    pub(crate) fn counts_by_kind(&self) -> [u32; KINDS] {
        let mut counts = [0; KINDS];
        for quad in &self.quads {
            counts[kind(quad.shape)] += 1;
        }
        counts
    }

    /// The whole pixels that the quads laid out last cover: everything stands on a plate.
    pub(crate) fn plates(&self) -> impl Iterator<Item = PixelRect> {
        let (width, height) = (self.size.0 as f32, self.size.1 as f32);
        self.quads.iter().filter(|q| q.shape == SHAPE_PLATE).filter_map(move |q| {
            let [x0, y0, x1, y1] = q.rect;
            let (x0, y0) = (x0.floor().clamp(0.0, width), y0.floor().clamp(0.0, height));
            let (x1, y1) = (x1.ceil().clamp(0.0, width), y1.ceil().clamp(0.0, height));
            (x0 < x1 && y0 < y1).then_some(PixelRect {
                x: x0 as u32,
                y: y0 as u32,
                width: (x1 - x0) as u32,
                height: (y1 - y0) as u32,
            })
        })
    }

    fn training(&mut self, glyphs: &Glyphs) {
        const WORD: &str = "TRAINING";
        let pad = 8.0 * unit(self.size);
        let (width, line) = (glyphs.width_of(TextSize::Large, WORD), glyphs.line(TextSize::Large));
        let x = ((self.size.0 as f32 - width) / 2.0).round();
        self.plate([x - pad, pad, x + width + pad, pad + line]);
        self.text(glyphs, TextSize::Large, (x, pad), AMBER, WORD);
    }

    fn status(&mut self, glyphs: &Glyphs, status: &Status) {
        let look = look(status);
        let pad = (8.0 * unit(self.size)).round();
        let (large, small) = (glyphs.line(TextSize::Large), glyphs.line(TextSize::Small));
        let icon = (large * 0.62).round();
        let lines = if look.action.is_empty() { large } else { large + small };
        let top = (self.size.1 as f32 - pad - lines).round();
        let text_x = pad * 2.0 + icon + pad;
        let first = glyphs.width_of(TextSize::Large, look.word)
            + if look.cause.is_empty() { 0.0 } else { pad + glyphs.width_of(TextSize::Small, look.cause) };
        let right = text_x + first.max(glyphs.width_of(TextSize::Small, look.action)) + pad;
        self.plate([pad, top, right.min(self.size.0 as f32 - pad), top + lines]);
        let icon_top = top + ((large - icon) / 2.0).round();
        self.shape(look.shape, [pad * 2.0, icon_top, pad * 2.0 + icon, icon_top + icon], look.colour);
        let end = self.text(glyphs, TextSize::Large, (text_x, top), look.colour, look.word);
        // Both sizes stand on one base line.
        let drop = glyphs.ascent(TextSize::Large) - glyphs.ascent(TextSize::Small);
        self.text(glyphs, TextSize::Small, (end + pad, top + drop), WHITE, look.cause);
        self.text(glyphs, TextSize::Small, (text_x, top + large), WHITE, look.action);
    }

    fn counts(&mut self, glyphs: &Glyphs, hud: &Hud) {
        let pad = (8.0 * unit(self.size)).round();
        let line = glyphs.line(TextSize::Small);
        let clock = if hud.clock_s.is_finite() { hud.clock_s.clamp(0.0, 359_999.0) as u64 } else { 0 };
        let mut text = std::mem::take(&mut self.text);
        // Writing to a String cannot fail.
        text.clear();
        let _ = write!(text, "ROUNDS {:>4}   {:02}:{:02}", hud.rounds_left.min(9999), clock / 60, clock % 60);
        let split = text.len();
        let _ = write!(text, "SHOTS {:>4}   HITS {:>4}", hud.shots.min(9999), hud.hits.min(9999));
        let (upper, lower) = text.split_at(split);
        let width = glyphs.width_of(TextSize::Small, upper).max(glyphs.width_of(TextSize::Small, lower));
        let x = (self.size.0 as f32 - 2.0 * pad - width).round();
        let top = (self.size.1 as f32 - pad - 2.0 * line).round();
        self.plate([x - pad, top, x + width + pad, top + 2.0 * line]);
        self.text(glyphs, TextSize::Small, (x, top), WHITE, upper);
        self.text(glyphs, TextSize::Small, (x, top + line), WHITE, lower);
        self.text = text;
    }

    fn push(&mut self, quad: HudQuad) {
        if self.quads.len() < QUADS_MAX {
            self.quads.push(quad);
        }
    }

    fn plate(&mut self, rect: [f32; 4]) {
        let edge = 5.0 * unit(self.size);
        self.push(HudQuad { rect, colour: PLATE, shape: SHAPE_PLATE, edge, ..HudQuad::default() });
    }

    fn shape(&mut self, shape: u32, rect: [f32; 4], colour: [f32; 3]) {
        let [r, g, b] = colour;
        self.push(HudQuad { rect, colour: [r, g, b, 1.0], shape, ..HudQuad::default() });
    }

    /// Sets a run of text whose line begins at `at`; returns where the next would begin.
    fn text(&mut self, glyphs: &Glyphs, size: TextSize, at: (f32, f32), colour: [f32; 3], text: &str) -> f32 {
        let [r, g, b] = colour;
        let base = (at.1 + glyphs.ascent(size)).round();
        let mut pen = at.0;
        for c in text.chars() {
            let glyph = glyphs.get(size, c);
            // Glyphs stand on whole pixels: the atlas then needs no filtering and edges stay sharp.
            let x = pen.round();
            let [x0, y0, x1, y1] = glyph.rect;
            if x1 > x0 {
                let rect = [x + x0, base + y0, x + x1, base + y1];
                let colour = [r, g, b, 1.0];
                self.push(HudQuad { rect, uv: glyph.uv, colour, shape: SHAPE_GLYPH, ..HudQuad::default() });
            }
            pen += glyph.advance;
        }
        pen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STATES: [Status; 5] = [
        Status::Ready,
        Status::Hit,
        Status::Miss,
        Status::NotScored { cause: "POSE 240 ms OLD", action: "Hold still until the frame is steady" },
        Status::Fault { cause: "NO CAMERA", action: "Check the camera's plug on the mount" },
    ];

    #[test]
    fn all_states_fit_all_screens_and_differ_in_shape_and_word_as_well_as_colour() {
        for size in [(800, 480), (1280, 720), (1920, 1080), (640, 480), (320, 180)] {
            let (large, small) = text_px(size);
            let glyphs = Glyphs::new(large, small).unwrap();
            let mut layout = HudLayout::new(size);
            let mut shapes = Vec::new();
            for status in STATES {
                let hud = Hud {
                    status,
                    warning: None,
                    rounds_left: 9999,
                    shots: 9999,
                    hits: 9999,
                    clock_s: 5999.0,
                };
                let quads = layout.lay_out(&glyphs, &hud).to_vec();
                assert!(quads.len() < QUADS_MAX);
                for quad in &quads {
                    let [x0, y0, x1, y1] = quad.rect;
                    assert!(
                        x0 >= 0.0 && y0 >= 0.0 && x1 <= size.0 as f32 && y1 <= size.1 as f32,
                        "{size:?} {quad:?}"
                    );
                }
                let shape = quads.iter().find(|q| q.shape > SHAPE_PLATE).unwrap();
                shapes.push((shape.shape, quads.len()));
                let plates: Vec<_> =
                    quads.iter().filter(|q| q.shape == SHAPE_PLATE).map(|q| q.rect).collect();
                assert_eq!(plates.len(), 3);
                if size.0 >= 640 {
                    let lower = |left: &bool| {
                        let on_side = |p: &&[f32; 4]| (p[0] < size.0 as f32 / 4.0) == *left;
                        *plates.iter().filter(|p| p[1] > size.1 as f32 / 2.0).find(on_side).unwrap()
                    };
                    assert!(lower(&true)[2] <= lower(&false)[0], "state runs into the counts at {size:?}");
                }
            }
            shapes.sort_unstable();
            shapes.dedup_by_key(|s| s.0);
            assert_eq!(shapes.len(), STATES.len());
        }
    }

    #[test]
    fn odd_numbers_neither_panic_nor_grow() {
        let (large, small) = text_px((800, 480));
        let glyphs = Glyphs::new(large, small).unwrap();
        let mut layout = HudLayout::new((800, 480));
        for clock_s in [f64::NAN, f64::INFINITY, -3.0, 1e300] {
            let hud = Hud {
                status: Status::Ready,
                warning: None,
                rounds_left: u32::MAX,
                shots: 0,
                hits: 0,
                clock_s,
            };
            assert!(!layout.lay_out(&glyphs, &hud).is_empty());
        }
    }
}
