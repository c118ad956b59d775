//! What each column of the picture shows where a line crosses it.

use std::ops::Range;

use super::{
    cells::PictureCells,
    fit::{EdgePoint, HorizonLine, LineSearch},
    steps::SHARP,
};

/// Rows that steps on the line and its parallels are taken over.
pub(super) const STEP: usize = 5;

/// Rows above the line that are looked at for an upper edge of land, at a width of 1280.
const SKY: Range<usize> = 8..60;

/// A step in them that makes the picture brighter downwards is no sky's from this share of the line's own step...
const BRIGHTER: f32 = 0.5;
/// ...and one that makes it darker from this: land is darker than the sky behind it.
const DARKER: f32 = 0.3;

/// What begins at a sharp edge is land if, on average down to the line, it differs by this share of the edge's step...
const LASTING: f32 = 0.85;
/// ...from so many rows above the edge. Under the edge of a cloud comes the next one.
const OVER: usize = 30;

/// Up to the picture's edge nothing has a step of more than this share of the line's own: so it is open.
const OPEN: f32 = 0.6;

/// Noise alone makes steps of no more than this many times what it makes neighbouring rows differ.
const NOISES: f32 = 3.0;

/// Rows by which sky must end off the line to speak against it: swell lifts and lowers the edge.
const NEAR: usize = 3;

/// Rows above and below the line, at a width of 1280, in which the end of the sky is sought.
const ENDS: (usize, usize) = (10, 40);

/// What a column shows at the line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Shown {
    /// Nothing that tells for or against the line: ships, haze, glare, other land.
    #[default]
    Else,
    /// Its edge lies on the line, under sky.
    Free,
    /// Its edge lies on the line, under what is no sky: the water's line before land.
    Land,
    /// Sky ends a little above the line: low land, or the line cuts through hills.
    Above,
    /// Sky reaches down past the line to an edge below it: no sea ends at the line.
    Past,
}

/// What all columns show, and how many of them what.
#[derive(Clone, Debug, Default)]
pub(super) struct ColumnViews {
    shown: Vec<Shown>,
    /// Free columns that have no step near as large as the line's own up to the picture's upper edge.
    pub open: usize,
    values: Vec<f32>,
}

/// The line that is looked along, and what is common to its columns.
struct Along<'a> {
    scene: &'a LineSearch<'a>,
    line: &'a HorizonLine,
    /// Lengths over those in a picture 1280 pixels wide.
    scale: f64,
    /// Rows that steps are taken over.
    size: usize,
    /// Median step and median brightness of the sky over the columns with an edge on the line, codes.
    own: f32,
    sky: f32,
}

impl ColumnViews {
    /// Looks along `line`; `solid` tells the columns with an edge on it.
    pub fn look(&mut self, scene: &LineSearch<'_>, line: &HorizonLine, points: &[EdgePoint], solid: &[bool]) {
        self.shown.clear();
        self.shown.resize(scene.cells.columns, Shown::Else);
        self.open = 0;
        let is_solid = |column: usize| solid.get(column).copied().unwrap_or(false);
        let mut along =
            Along { scene, line, scale: scene.cells.scale(), size: line.step_rows(STEP), own: 1.0, sky: 0.0 };
        let on_line = || points.iter().filter(|p| is_solid(p.column));
        let steps = on_line().filter_map(|p| along.step(p.column, p.row as usize));
        along.own = median(&mut self.values, steps).max(1.0);
        along.sky =
            median(&mut self.values, on_line().filter_map(|p| over(scene.cells, p.column, p.row as usize)));
        for (column, shown) in self.shown.iter_mut().enumerate() {
            let Some(row) = line.row(scene, column) else { continue };
            let row = row.round() as usize;
            *shown = if !is_solid(column) {
                along.end_of_sky(column, row)
            } else if along.is_sky(column, row) {
                self.open += usize::from(
                    scene.steps.largest_above(column, row.saturating_sub(SKY.start)) < OPEN * along.own,
                );
                Shown::Free
            } else {
                Shown::Land
            };
        }
    }

    /// Number of columns that show `what`.
    pub fn count(&self, what: Shown) -> usize {
        self.shown.iter().filter(|s| **s == what).count()
    }

    /// Whether the column shows the line under sky.
    pub fn is_free(&self, column: usize) -> bool {
        self.shown.get(column) == Some(&Shown::Free)
    }
}

impl Along<'_> {
    /// Step of a column in the sense of the line, codes.
    fn step(&self, column: usize, row: usize) -> Option<f32> {
        self.scene.cells.step(column, row, self.size).map(|s| self.line.signed(s))
    }

    fn rows(&self, rows: usize) -> usize {
        (self.scale * rows as f64).round() as usize
    }

    /// Whether steps from `low` to `high`, codes, are none of land, where the sky brightens by `even` codes a row.
    fn is_calm(&self, (low, high): (f32, f32), even: f32) -> bool {
        let (noise, even) = (NOISES * self.scene.floor, even * SHARP as f32);
        low - even > -(DARKER * self.own).max(noise) && high - even < (BRIGHTER * self.own).max(noise)
    }

    /// Whether nothing above the line has an edge as land has.
    fn is_sky(&self, column: usize, row: usize) -> bool {
        let top = row.saturating_sub(self.rows(SKY.end)).max(self.scene.cells.rows().start);
        let sky = top..row.saturating_sub(SKY.start);
        let even = self.even(column, sky.clone());
        let range = self.scene.steps.within(column, sky.clone());
        range.is_none_or(|range| self.is_calm(range, even)) || !self.is_lasting(column, row, sky)
    }

    /// Whether what begins at the sharpest edge of `sky` lasts down to the line at `row`, as land does and clouds do not.
    fn is_lasting(&self, column: usize, row: usize, sky: Range<usize>) -> bool {
        let cells = self.scene.cells;
        let steps = cells.steps(column, sky.start..=sky.end, SHARP).into_iter().flatten();
        let Some((edge, step)) = steps.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())) else { return false };
        let top = edge.saturating_sub(OVER).max(cells.rows().start);
        let over = cells.mean(column, top..edge.saturating_sub(1));
        let under = cells.mean(column, edge + 1..row.saturating_sub(SHARP));
        let change = over.zip(under).map_or(step, |(over, under)| under - over);
        change * step.signum() > LASTING * step.abs()
    }

    /// Even brightening over `rows`, codes a row.
    fn even(&self, column: usize, rows: Range<usize>) -> f32 {
        let value = |row: usize| self.scene.cells.mean(column, row..row + 2);
        let rise = value(rows.end).zip(value(rows.start)).map_or(0.0, |(below, above)| below - above);
        rise / rows.len().max(1) as f32
    }

    /// Where sky ends in a column that has no edge on the line.
    fn end_of_sky(&self, column: usize, row: usize) -> Shown {
        let cells = self.scene.cells;
        let (from, to) = (row.saturating_sub(ENDS.0), row + self.rows(ENDS.1).max(ENDS.0));
        let sky = from.saturating_sub(self.rows(20)).max(cells.rows().start)..from;
        let even = self.even(column, sky.clone());
        if self.scene.steps.within(column, sky).is_some_and(|range| !self.is_calm(range, even)) {
            return Shown::Else;
        }
        let (even, most) = (self.line.signed(even) * self.size as f32, BRIGHTER * self.own);
        let mut steps = (from..to).map(|row| (row, self.step(column, row).unwrap_or(0.0) - even));
        let Some((mut end, mut size)) = steps.find(|(_, step)| step.abs() > most) else { return Shown::Else };
        for (row, step) in steps {
            if step < size {
                break;
            }
            (end, size) = (row, step);
        }
        let like_sky = over(cells, column, end).is_some_and(|over| (over - self.sky).abs() < self.own);
        if size < 0.0 || !like_sky {
            Shown::Else
        } else if end > row + NEAR {
            Shown::Past
        } else if end + NEAR < row {
            Shown::Above
        } else {
            Shown::Else
        }
    }
}

/// Brightness just above an edge, codes.
fn over(cells: &PictureCells, column: usize, row: usize) -> Option<f32> {
    cells.mean(column, row.checked_sub(10)?..row.checked_sub(4)?)
}

fn median(memory: &mut Vec<f32>, values: impl Iterator<Item = f32>) -> f32 {
    memory.clear();
    memory.extend(values);
    let middle = memory.len() / 2;
    if memory.is_empty() {
        return 0.0;
    }
    *memory.select_nth_unstable_by(middle, f32::total_cmp).1
}
