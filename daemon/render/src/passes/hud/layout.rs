//! Where everything of the head-up display goes. The middle of the picture stays free: TRAINING stands at the top between clock
//! and counts, the state at the lower left, a warning above it. Colour is never alone: each state and the warning have a shape of
//! their own, and each state a word.
//!
//! Sizes are for a 7 inch display of 800x480 pixels at arm's length; other screens get the same share of their pixels. Capitals
//! of what must be read at a glance subtend 20 minutes of arc there, those of the rest 16 (ISO 9241-303: 16 at least, 20 to 22
//! preferred).

use std::fmt::Write;

use bowwave_core::{
    estimate::sea::SeaSource,
    fault::Fault,
    frame::scene::{Hud, PixelRect, Status, StatusWords},
    sea::WmoSeaState,
    world::{exercise::Engagement, weapon::WeaponState},
};
use shaders_spirv::interface::{
    HudQuad, SHAPE_BARRED, SHAPE_CROSS, SHAPE_DIAMOND, SHAPE_DISC, SHAPE_GLYPH, SHAPE_PLATE, SHAPE_RING,
    SHAPE_SQUARE, SHAPE_TRIANGLE,
};

use crate::{
    frame_data::QUADS_MAX,
    passes::hud::glyphs::{Glyphs, TextSize},
};

/// Linear light of the texts and shapes.
const WHITE: [f32; 3] = [0.9, 0.9, 0.9];
const GREEN: [f32; 3] = [0.10, 0.75, 0.16];
const AMBER: [f32; 3] = [1.0, 0.45, 0.02];
const RED: [f32; 3] = [1.0, 0.14, 0.10];
const CYAN: [f32; 3] = [0.12, 0.65, 0.85];
const MAGENTA: [f32; 3] = [0.95, 0.16, 0.80];
/// Plates behind the texts: dark enough for every colour above when the camera looks into the sun.
const PLATE: [f32; 4] = [0.004, 0.006, 0.010, 0.94];

/// Shape and colour of a state.
const fn look(status: &Status) -> (u32, [f32; 3]) {
    match status {
        Status::Ready => (SHAPE_DISC, GREEN),
        Status::Hit { .. } => (SHAPE_RING, CYAN),
        Status::NeutralHit { .. } => (SHAPE_BARRED, MAGENTA),
        Status::Miss => (SHAPE_CROSS, WHITE),
        Status::NotChecked { .. } => (SHAPE_DISC, AMBER),
        Status::Paused => (SHAPE_SQUARE, WHITE),
        Status::NotScored { .. } => (SHAPE_TRIANGLE, AMBER),
        Status::Fault { .. } => (SHAPE_SQUARE, RED),
    }
}

/// Pixels from one line to the next in both sizes on a screen of `size`.
pub(crate) fn text_px(size: (u32, u32)) -> (f32, f32) {
    let unit = unit(size);
    (39.0 * unit, 30.0 * unit)
}

/// Screen pixels for one pixel of an 800x480 display.
fn unit(size: (u32, u32)) -> f32 {
    (size.0 as f32 / 800.0).min(size.1 as f32 / 480.0).max(0.375)
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
        self.training(glyphs, hud.message.as_deref());
        self.clock(glyphs, hud.clock_s);
        if let Some((state, source)) = hud.sea {
            self.sea(glyphs, state, source);
        }
        if let Some(tenths) = hud.heading_tenths_deg {
            self.heading(glyphs, tenths, if hud.sea.is_some() { 2 } else { 1 });
        }
        self.exercise(glyphs, hud);
        self.counts(glyphs, hud);
        let top = self.status(glyphs, &hud.status);
        if let Some(fault) = hud.warning {
            self.warning(glyphs, fault, top);
        }
        // Each kind is one draw. Nothing of a kind overlaps another of its kind, and plates lie beneath everything.
        self.quads.sort_unstable_by_key(|q| kind(q.shape));
        &self.quads
    }

    /// What was laid out last.
    pub(crate) fn quads(&self) -> &[HudQuad] {
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

    /// Pixels between plates and the screen's edges, and within plates beside the text.
    fn pad(&self) -> f32 {
        (8.0 * unit(self.size)).round()
    }

    /// The word that is always there, with the scenario's text below it.
    fn training(&mut self, glyphs: &Glyphs, message: Option<&str>) {
        const WORD: &str = "TRAINING";
        let pad = self.pad();
        let (width, line) = (glyphs.width_of(TextSize::Large, WORD), glyphs.line(TextSize::Large));
        let x = ((self.size.0 as f32 - width) / 2.0).round();
        self.plate([x - pad, pad, x + width + pad, pad + line]);
        self.text(glyphs, TextSize::Large, (x, pad), AMBER, WORD);
        if let Some(message) = message {
            let (width, small) = (glyphs.width_of(TextSize::Small, message), glyphs.line(TextSize::Small));
            let (x, top) = (((self.size.0 as f32 - width) / 2.0).round(), (pad + line).ceil());
            self.plate([x - pad, top, x + width + pad, top + small]);
            self.text(glyphs, TextSize::Small, (x, top), WHITE, message);
        }
    }

    /// Rules of engagement, and what keeps the virtual weapon from firing, below the clock and what stands there.
    fn exercise(&mut self, glyphs: &Glyphs, hud: &Hud) {
        let mut row = 1 + u8::from(hud.sea.is_some()) + u8::from(hud.heading_tenths_deg.is_some());
        if let Some(rules) = hud.rules {
            let (word, colour) = match rules {
                Engagement::Hold => ("HOLD FIRE", AMBER),
                Engagement::Warn => ("WARN FIRST", AMBER),
                Engagement::Tight => ("WEAPONS TIGHT", AMBER),
                Engagement::Free => ("WEAPONS FREE", WHITE),
            };
            self.below_clock(glyphs, row, colour, format_args!("{word}"));
            row += 1;
        }
        let word = match hud.weapon {
            WeaponState::Safe => "SAFE",
            WeaponState::Stoppage => "STOPPAGE",
            WeaponState::Reloading => "RELOADING",
            // The count says it.
            WeaponState::Ready | WeaponState::Empty => return,
        };
        self.below_clock(glyphs, row, AMBER, format_args!("{word}"));
    }

    /// The state's plate at the lower left; returns its upper edge.
    fn status(&mut self, glyphs: &Glyphs, status: &Status) -> f32 {
        let (shape, colour) = look(status);
        let StatusWords { word, cause, action } = status.words();
        let pad = self.pad();
        let (large, small) = (glyphs.line(TextSize::Large), glyphs.line(TextSize::Small));
        let width = |text: &str| glyphs.width_of(TextSize::Small, text);
        let icon = (large * 0.62).round();
        let text_x = pad * 2.0 + icon + pad;
        let right_max = self.size.0 as f32 - pad;
        let word_end = text_x + glyphs.width_of(TextSize::Large, word);
        // The cause stands beside the word where there is room, else on a line of its own.
        let beside = word_end + 2.0 * pad + width(cause) + pad <= right_max;
        let (first, second) = match (cause, beside) {
            ("", _) => (word_end, ""),
            (cause, true) => (word_end + 2.0 * pad + width(cause), ""),
            (cause, false) => (word_end, cause),
        };
        let below = [second, action].into_iter().filter(|line| !line.is_empty());
        let lines = large + small * below.clone().count() as f32;
        let right = below.clone().map(|line| text_x + width(line)).fold(first, f32::max) + pad;
        let top = (self.size.1 as f32 - pad - lines).round();
        self.plate([pad, top, right.min(right_max), top + lines]);
        let icon_top = top + ((large - icon) / 2.0).round();
        self.shape(shape, [pad * 2.0, icon_top, pad * 2.0 + icon, icon_top + icon], colour);
        let end = self.text(glyphs, TextSize::Large, (text_x, top), colour, word);
        if beside {
            // Both sizes stand on one base line.
            let drop = glyphs.ascent(TextSize::Large) - glyphs.ascent(TextSize::Small);
            self.text(glyphs, TextSize::Small, (end + 2.0 * pad, top + drop), WHITE, cause);
        }
        for (line, n) in below.zip(0_u8..) {
            self.text(glyphs, TextSize::Small, (text_x, top + large + small * f32::from(n)), WHITE, line);
        }
        top
    }

    /// What the sailor should know though training goes on, above the state's plate, whose upper edge is `floor`: cause and what
    /// to do on one line where there is room, else on two.
    fn warning(&mut self, glyphs: &Glyphs, fault: Fault, floor: f32) {
        const DASH: &str = " - ";
        let (cause, action) = (fault.cause(), fault.action());
        if cause.is_empty() {
            return;
        }
        let pad = self.pad();
        let small = glyphs.line(TextSize::Small);
        let width = |text: &str| glyphs.width_of(TextSize::Small, text);
        let icon = (small * 0.7).round();
        let text_x = pad * 2.0 + icon + pad;
        let right_max = self.size.0 as f32 - pad;
        let line = text_x + width(cause) + width(DASH) + width(action) + pad;
        let one = line <= right_max;
        let right = if one { line } else { text_x + width(cause).max(width(action)) + pad };
        let bottom = floor - (0.5 * pad).round();
        let top = (bottom - if one { small } else { 2.0 * small }).round();
        self.plate([pad, top, right.min(right_max), bottom]);
        let icon_top = top + ((small - icon) / 2.0).round();
        self.shape(SHAPE_DIAMOND, [pad * 2.0, icon_top, pad * 2.0 + icon, icon_top + icon], AMBER);
        let end = self.text(glyphs, TextSize::Small, (text_x, top), AMBER, cause);
        if one {
            let end = self.text(glyphs, TextSize::Small, (end, top), AMBER, DASH);
            self.text(glyphs, TextSize::Small, (end, top), WHITE, action);
        } else {
            self.text(glyphs, TextSize::Small, (text_x, top + small), WHITE, action);
        }
    }

    /// Time since the scenario began, at the upper left.
    fn clock(&mut self, glyphs: &Glyphs, clock_s: f64) {
        let clock = if clock_s.is_finite() { clock_s.clamp(0.0, 359_999.0) as u64 } else { 0 };
        let mut text = std::mem::take(&mut self.text);
        text.clear();
        // Writing to a String cannot fail.
        let _ = write!(text, "{:02}:{:02}", clock / 60, clock % 60);
        let pad = self.pad();
        let line = glyphs.line(TextSize::Small);
        let width = glyphs.width_of(TextSize::Small, &text);
        self.plate([pad, pad, 3.0 * pad + width, pad + line]);
        self.text(glyphs, TextSize::Small, (2.0 * pad, pad), WHITE, &text);
        self.text = text;
    }

    /// State of the sea that is drawn and where it comes from, below the clock.
    fn sea(&mut self, glyphs: &Glyphs, state: WmoSeaState, source: SeaSource) {
        let word = match source {
            SeaSource::Ordered => "ORDERED",
            SeaSource::Measured => "VIDEO",
            SeaSource::Kept => "KEPT",
            SeaSource::Assumed => "ASSUMED",
        };
        self.below_clock(glyphs, 1, WHITE, format_args!("SEA {} {word}", state.get()));
    }

    /// How well the heading is known, below the clock and what stands there: it is told only where that is worse than it should be.
    fn heading(&mut self, glyphs: &Glyphs, tenths_deg: u16, row: u8) {
        let deg = f32::from(tenths_deg) / 10.0;
        self.below_clock(glyphs, row, AMBER, format_args!("HDG ±{deg:.1}°"));
    }

    /// A line of text so many rows below the clock.
    fn below_clock(&mut self, glyphs: &Glyphs, row: u8, colour: [f32; 3], words: std::fmt::Arguments<'_>) {
        let mut text = std::mem::take(&mut self.text);
        text.clear();
        // Writing to a String cannot fail.
        let _ = text.write_fmt(words);
        let pad = self.pad();
        let line = glyphs.line(TextSize::Small);
        // The plates are of whole pixels.
        let top = (pad + line).ceil() + f32::from(row.saturating_sub(1)) * line.ceil();
        let width = glyphs.width_of(TextSize::Small, &text);
        self.plate([pad, top, 3.0 * pad + width, top + line]);
        self.text(glyphs, TextSize::Small, (2.0 * pad, top), colour, &text);
        self.text = text;
    }

    /// Rounds left, shots and hits at the upper right, one below the other; hits on neutrals where there are any.
    fn counts(&mut self, glyphs: &Glyphs, hud: &Hud) {
        let pad = self.pad();
        let line = glyphs.line(TextSize::Small);
        let rows = [
            ("ROUNDS", hud.rounds_left, WHITE),
            ("SHOTS", hud.shots, WHITE),
            ("HITS", hud.hits, WHITE),
            ("NEUTRAL", hud.neutral_hits, MAGENTA),
        ];
        let rows = if hud.neutral_hits > 0 { &rows[..] } else { &rows[..3] };
        let words = rows.iter().map(|(word, ..)| glyphs.width_of(TextSize::Small, word)).fold(0.0, f32::max);
        let digits = glyphs.width_of(TextSize::Small, "9999");
        let end = self.size.0 as f32 - 2.0 * pad;
        let x = (end - digits - pad - words).round();
        self.plate([x - pad, pad, end + pad, pad + rows.len() as f32 * line]);
        let mut text = std::mem::take(&mut self.text);
        for ((word, count, colour), n) in rows.iter().zip(0_u8..) {
            let top = pad + line * f32::from(n);
            self.text(glyphs, TextSize::Small, (x, top), *colour, word);
            text.clear();
            // Writing to a String cannot fail.
            let _ = write!(text, "{}", count.min(&9999));
            let from = end - glyphs.width_of(TextSize::Small, &text);
            self.text(glyphs, TextSize::Small, (from, top), *colour, &text);
        }
        self.text = text;
    }

    fn push(&mut self, quad: HudQuad) {
        if self.quads.len() < QUADS_MAX {
            self.quads.push(quad);
        }
    }

    /// A plate of whole pixels around `rect`.
    fn plate(&mut self, [x0, y0, x1, y1]: [f32; 4]) {
        let rect = [x0.floor(), y0.floor(), x1.ceil(), y1.ceil()];
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

#[path = "guide.rs"]
mod guide;

#[cfg(test)]
#[path = "layout_tests.rs"]
mod tests;
