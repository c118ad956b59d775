//! Where the page goes that guides a maintainer through a calibration: what to do at the lower left, how far each quantity has come at
//! the upper left, which parts of the picture were seen at the upper right. Nothing stands in the middle: neither is there a mark to
//! aim with.

use bowwave_core::guide::{Cell, Coverage, Gauge, Guide, Rating, wrapped};

use super::{
    AMBER, CYAN, GREEN, Glyphs, HudLayout, HudQuad, RED, SHAPE_CROSS, SHAPE_DIAMOND, SHAPE_DISC, SHAPE_RING,
    SHAPE_SQUARE, SHAPE_TRIANGLE, TextSize, WHITE, kind, unit,
};

/// Squares of a gauge.
const SQUARES: usize = 8;
/// What is not there yet.
const DIM: [f32; 3] = [0.06, 0.07, 0.08];
/// Most lines of one text; the rest is on the terminal and in the report.
const LINES_MOST: usize = 3;
/// Parts of the picture that are shown at most.
const CELLS_MOST: usize = 64;

/// How a rating looks.
const fn look(rating: Option<Rating>) -> (u32, [f32; 3]) {
    match rating {
        Some(Rating::Good) => (SHAPE_DISC, GREEN),
        Some(Rating::Usable) => (SHAPE_TRIANGLE, AMBER),
        Some(Rating::Poor) => (SHAPE_CROSS, RED),
        None => (SHAPE_RING, DIM),
    }
}

/// A line of the panel at the lower left.
#[derive(Clone)]
struct Line<'a> {
    text: &'a str,
    colour: [f32; 3],
    icon: Option<(u32, [f32; 3])>,
}

impl HudLayout {
    /// The quads of a guide, in drawing order.
    pub(crate) fn lay_out_guide(&mut self, glyphs: &Glyphs, guide: &Guide) -> &[HudQuad] {
        self.quads.clear();
        self.training(glyphs, None);
        let floor = self.panel(glyphs, guide);
        self.gauges(glyphs, &guide.gauges, floor);
        if let Some(coverage) = &guide.coverage {
            self.coverage(glyphs, coverage, floor);
        }
        self.quads.sort_unstable_by_key(|q| kind(q.shape));
        &self.quads
    }

    /// What to do, at the lower left; returns the panel's upper edge.
    fn panel<'a>(&mut self, glyphs: &Glyphs, guide: &'a Guide) -> f32 {
        let pad = self.pad();
        let (large, small) = (glyphs.line(TextSize::Large), glyphs.line(TextSize::Small));
        let icon = (small * 0.6).round();
        let text_x = 2.0 * pad + icon + pad;
        let right_max = self.size.0 as f32 - pad;
        let room = right_max - pad - text_x;
        // Half of the picture stays free: what is wrong and what to do about it go before the rest.
        let mut left = ((0.62 * self.size.1 as f32 - large) / small).floor().max(3.0) as usize;
        let mut part = |texts: &mut dyn Iterator<Item = &'a str>, colour, icon| {
            let fits = |line: &str| glyphs.width_of(TextSize::Small, line) <= room;
            let line = |(n, text)| Line { text, colour, icon: if n == 0 { icon } else { None } };
            let lines: Vec<Line<'a>> = texts
                .flat_map(|text| wrapped(text, fits).into_iter().take(LINES_MOST).enumerate().map(line))
                .take(left)
                .collect();
            left -= lines.len();
            lines
        };
        let problem = part(&mut guide.problem.as_deref().into_iter(), AMBER, Some((SHAPE_DIAMOND, AMBER)));
        let says = part(&mut [guide.says.as_str()].into_iter(), GREEN, Some((SHAPE_DISC, GREEN)));
        let keys = part(&mut [guide.keys].into_iter(), CYAN, None);
        let lines = part(&mut guide.lines.iter().map(String::as_str), WHITE, None);
        let lines = [lines, problem, says, keys].concat();
        let height = large + small * lines.len() as f32 + 0.5 * pad;
        let top = (self.size.1 as f32 - pad - height).round();
        let width = |l: &Line<'_>| glyphs.width_of(TextSize::Small, l.text);
        let word = guide.verdict().map_or_else(String::new, |word| format!(" {word}"));
        let colour = if guide.passed == Some(true) { GREEN } else { RED };
        let title = guide.title.as_str();
        let head = glyphs.width_of(TextSize::Large, title) + glyphs.width_of(TextSize::Large, &word);
        let right = lines.iter().map(|l| text_x + width(l)).fold(2.0 * pad + head, f32::max) + pad;
        self.plate([pad, top, right.min(right_max), top + height]);
        let size = if 2.0 * pad + head <= right_max - pad { TextSize::Large } else { TextSize::Small };
        let end = self.text(glyphs, size, (2.0 * pad, top), WHITE, title);
        self.text(glyphs, size, (end, top), colour, &word);
        for (line, n) in lines.iter().zip(0_u8..) {
            let y = top + large + small * f32::from(n);
            if let Some((shape, colour)) = line.icon {
                let at = y + ((small - icon) / 2.0).round();
                self.shape(shape, [2.0 * pad, at, 2.0 * pad + icon, at + icon], colour);
            }
            self.text(glyphs, TextSize::Small, (text_x, y), line.colour, line.text);
        }
        top
    }

    /// How far quantities have come, at the upper left, above `floor`.
    fn gauges(&mut self, glyphs: &Glyphs, gauges: &[Gauge], floor: f32) {
        let pad = self.pad();
        let small = glyphs.line(TextSize::Small);
        let top = (2.0 * pad + glyphs.line(TextSize::Large)).ceil();
        let rows = ((floor - pad - top) / small).floor().max(0.0) as usize;
        let shown = gauges.get(..rows.min(gauges.len())).unwrap_or_default();
        if shown.is_empty() {
            return;
        }
        let width = |text: &str| glyphs.width_of(TextSize::Small, text);
        let square = (small * 0.5).round();
        let pitch = square + (square * 0.25).round();
        let bar = pitch * SQUARES as f32;
        let names = shown.iter().map(|g| width(g.name)).fold(0.0, f32::max);
        let icon_x = 2.0 * pad;
        let name_x = icon_x + square + pad;
        let bar_x = (name_x + names + pad).round();
        let value_x = bar_x + bar + pad;
        let values = shown.iter().map(|g| width(short(&g.value))).fold(0.0, f32::max);
        // A narrow screen has no room for them.
        let has_values = value_x + values + 2.0 * pad <= self.size.0 as f32;
        let right = if has_values { value_x + values + pad } else { value_x };
        self.plate([pad, top, right, top + small * shown.len() as f32]);
        for (gauge, n) in shown.iter().zip(0_u8..) {
            let y = top + small * f32::from(n);
            let middle = y + ((small - square) / 2.0).round();
            let (shape, colour) = look(gauge.rating);
            self.shape(shape, [icon_x, middle, icon_x + square, middle + square], colour);
            self.text(glyphs, TextSize::Small, (name_x, y), WHITE, gauge.name);
            let full = (gauge.share.clamp(0.0, 1.0) * SQUARES as f64).round() as usize;
            for i in 0..SQUARES {
                let x = bar_x + pitch * i as f32;
                let paint = if i >= full { DIM } else { gauge.rating.map_or(WHITE, |_| colour) };
                self.shape(SHAPE_SQUARE, [x, middle, x + square, middle + square], paint);
            }
            if has_values {
                self.text(glyphs, TextSize::Small, (value_x, y), WHITE, short(&gauge.value));
            }
        }
    }

    /// Which parts of the picture were seen, at the upper right, above `floor`.
    fn coverage(&mut self, glyphs: &Glyphs, coverage: &Coverage, floor: f32) {
        let pad = self.pad();
        let top = (2.0 * pad + glyphs.line(TextSize::Large)).ceil();
        let (columns, count) = (coverage.columns.max(1), coverage.cells.len());
        if count == 0 || count > CELLS_MOST || columns > CELLS_MOST {
            return;
        }
        let rows = count.div_ceil(columns);
        let cell = (14.0 * unit(self.size)).round();
        let pitch = cell + (0.25 * cell).round();
        let right = self.size.0 as f32 - pad;
        let left = (right - 2.0 * pad - pitch * columns as f32).round();
        let bottom = top + 2.0 * pad + pitch * rows as f32;
        // A narrow screen has no room beside the gauges.
        let taken = self.quads.iter().any(|q| q.rect[2] > left && q.rect[3] > top && q.rect[1] < bottom);
        if left < pad || bottom > floor - pad || taken {
            return;
        }
        self.plate([left, top, right, bottom]);
        for (i, seen) in coverage.cells.iter().enumerate() {
            let x = left + pad + pitch * (i % columns) as f32;
            let y = top + pad + pitch * (i / columns) as f32;
            let (shape, colour) = match seen {
                Cell::Empty => (SHAPE_SQUARE, DIM),
                Cell::Few => (SHAPE_RING, AMBER),
                Cell::Many => (SHAPE_SQUARE, GREEN),
            };
            self.shape(shape, [x, y, x + cell, y + cell], colour);
        }
    }
}

/// A value without what follows its comma: metres stand in the result.
fn short(value: &str) -> &str {
    value.split(',').next().unwrap_or(value)
}

#[cfg(test)]
#[path = "guide_tests.rs"]
mod tests;
