//! The picture as sums of cells eight pixels wide and one row high, and running sums of these down each column.
//!
//! Only from these is a step over any number of rows, or how much the rows of a stretch differ, had by a few additions.

use std::ops::{Range, RangeInclusive};

use glam::DVec2;

use crate::event::{Picture, PixelFormat};

/// Width of a cell in reduced pixels: eight samples tell the row of a slightly tilted edge better than one, and a line that
/// tilts by a row across a cell is not smeared by more than that.
pub(super) const CELL: usize = 8;

/// Width that pictures are reduced to, about.
const WIDTH: u32 = 1280;

/// Rows that are summed before they are put in their columns: as many as one line of cache holds of a column.
const BLOCK: usize = 16;

/// Column sums of the rows of a picture that are looked at.
#[derive(Clone, Debug, Default)]
pub(super) struct PictureCells {
    /// Columns of cells.
    pub columns: usize,
    /// Rows of the whole reduced picture.
    pub height: usize,
    /// Size of the whole picture in reduced pixels, what is left over at its edges included.
    pub size: DVec2,
    reduction: usize,
    rows: Range<usize>,
    unit: f32,
    sums: Vec<i32>,
    wiggles: Vec<i32>,
    block: Vec<i32>,
}

impl PictureCells {
    /// Takes on the size of `picture`; its rows are read by [`PictureCells::fill`].
    pub fn measure(&mut self, picture: &Picture) {
        let reduction = ((picture.width() + WIDTH / 2) / WIDTH).max(1) as usize;
        self.reduction = reduction;
        self.columns = picture.width() as usize / (CELL * reduction);
        self.height = picture.height() as usize / reduction;
        self.size = DVec2::new(f64::from(picture.width()), f64::from(picture.height())) / reduction as f64;
        self.rows = 0..0;
    }

    /// Reads the rows of `wanted` that the picture has.
    pub fn fill(&mut self, picture: &Picture, wanted: Range<usize>) {
        self.rows = wanted.start.min(self.height)..wanted.end.min(self.height);
        let (columns, reduction, length) = (self.columns, self.reduction, self.rows.len());
        self.unit = 1.0 / (CELL * reduction * reduction * usize::from(picture.format().luma_weight())) as f32;
        self.sums.resize(columns * (length + 1), 0);
        self.wiggles.resize(columns * (length + 1), 0);
        self.block.resize(columns * BLOCK, 0);
        if columns == 0 || length == 0 {
            return;
        }
        for column in 0..columns {
            self.sums[column * (length + 1)] = 0;
            self.wiggles[column * (length + 1)] = 0;
        }
        for first in (0..length).step_by(BLOCK) {
            let count = BLOCK.min(length - first);
            for (row, line) in self.block.chunks_exact_mut(columns).take(count).enumerate() {
                line.fill(0);
                let row = (self.rows.start + first + row) * reduction;
                for y in row..row + reduction {
                    add_row(picture, y, reduction, line);
                }
            }
            self.run_down(first, count);
        }
    }

    /// Continues the running sums of all columns by the block's rows.
    fn run_down(&mut self, first: usize, count: usize) {
        let (columns, stride) = (self.columns, self.rows.len() + 1);
        for column in 0..columns {
            let from = column * stride + first;
            // The value of the row before is the difference of its running sums.
            let mut before = match first {
                0 => self.block[column],
                _ => self.sums[from] - self.sums[from - 1],
            };
            let (mut sum, mut wiggle) = (self.sums[from], self.wiggles[from]);
            let values = self.block[column..].iter().step_by(columns).take(count);
            let sums = &mut self.sums[from + 1..=from + count];
            let wiggles = &mut self.wiggles[from + 1..=from + count];
            // No sum of so few rows comes near its limit.
            for ((value, sum_here), wiggle_here) in values.zip(sums).zip(wiggles) {
                wiggle = wiggle.wrapping_add(value.wrapping_sub(before).wrapping_abs());
                before = *value;
                sum = sum.wrapping_add(*value);
                *sum_here = sum;
                *wiggle_here = wiggle;
            }
        }
    }

    /// Lengths over those in a picture 1280 pixels wide; no more than 1.
    pub fn scale(&self) -> f64 {
        (self.size.x / f64::from(WIDTH)).min(1.0)
    }

    /// Rows that were read.
    pub fn rows(&self) -> Range<usize> {
        self.rows.clone()
    }

    /// Codes (0 to 255) that one unit of the running sums stands for.
    pub fn unit(&self) -> f32 {
        self.unit
    }

    /// Running sums down a column: entry `i` is the sum of the first `i` rows that were read.
    pub fn column(&self, column: usize) -> &[i32] {
        let stride = self.rows.len() + 1;
        self.sums.get(column * stride..(column + 1) * stride).unwrap_or(&[])
    }

    /// Mean of the `size` rows below `row` less that of the `size` rows above it, codes; `None` where not all of them were
    /// read.
    pub fn step(&self, column: usize, row: usize, size: usize) -> Option<f32> {
        let (sums, i) = (self.column(column), row.checked_sub(self.rows.start)?);
        let (above, at, below) = (*sums.get(i.checked_sub(size)?)?, *sums.get(i)?, *sums.get(i + size)?);
        Some(bend(above, at, below) as f32 * self.unit / size as f32)
    }

    /// [`PictureCells::step`] at each of `rows` that has one; `None` where none has.
    pub fn steps(
        &self,
        column: usize,
        rows: RangeInclusive<usize>,
        size: usize,
    ) -> Option<impl Iterator<Item = (usize, f32)>> {
        let (sums, first) = (self.column(column), self.rows.start);
        let from = rows.start().saturating_sub(first).max(size);
        let to = rows.end().checked_sub(first)?.checked_add(size)?.min(sums.len().checked_sub(1)?);
        let around = sums.get(from - size..=to)?;
        let (at, below) = (around.get(size..)?, around.get(2 * size..)?);
        let gain = self.unit / size as f32;
        let steps = around.iter().zip(at).zip(below).map(move |((a, b), c)| bend(*a, *b, *c) as f32 * gain);
        Some((first + from..).zip(steps))
    }

    /// Mean of `rows`, codes; `None` where not all of them were read.
    pub fn mean(&self, column: usize, rows: Range<usize>) -> Option<f32> {
        let sums = self.column(column);
        let (a, b) = (rows.start.checked_sub(self.rows.start)?, rows.end.checked_sub(self.rows.start)?);
        let (from, to) = (*sums.get(a)?, *sums.get(b)?);
        (b > a).then(|| (to - from) as f32 * self.unit / (b - a) as f32)
    }

    /// Mean difference of a row from the next over `rows`, codes; `None` where not all of them were read.
    pub fn wiggle(&self, column: usize, rows: Range<usize>) -> Option<f32> {
        let stride = self.rows.len() + 1;
        let wiggles = self.wiggles.get(column * stride..(column + 1) * stride)?;
        let (a, b) = (rows.start.checked_sub(self.rows.start)?, rows.end.checked_sub(self.rows.start)?);
        let (from, to) = (*wiggles.get(a)?, *wiggles.get(b)?);
        (b > a).then(|| (to - from) as f32 * self.unit / (b - a) as f32)
    }
}

/// Second difference of running sums, which is that of what lies between the first two and the last two. It does not overflow:
/// no sum comes near its limit.
pub(super) const fn bend(above: i32, at: i32, below: i32) -> i32 {
    below.wrapping_sub(at.wrapping_mul(2)).wrapping_add(above)
}

/// Adds a row of the picture to the cells of `line`. Luma of RGB is (R + 2 G + B) / 4, times four: near enough to BT.601 for
/// edges.
fn add_row(picture: &Picture, y: usize, reduction: usize, line: &mut [i32]) {
    let (per_pixel, row) = (picture.format().pixel_bytes(), picture.row(y));
    for (cell, pixels) in line.iter_mut().zip(row.chunks_exact(CELL * reduction * per_pixel)) {
        let sum = match picture.format() {
            PixelFormat::Nv12 => eights(pixels).map(pairs).map(total).sum::<i32>(),
            PixelFormat::Yuyv => eights(pixels).map(|w| total(w & EVEN)).sum(),
            PixelFormat::Rgb => rgb(pixels),
        };
        *cell = cell.wrapping_add(sum);
    }
}

/// Every other byte, from the first.
const EVEN: u64 = 0x00ff_00ff_00ff_00ff;

fn eights(bytes: &[u8]) -> impl Iterator<Item = u64> {
    bytes.as_chunks().0.iter().map(|b| u64::from_le_bytes(*b))
}

/// Sums of neighbouring bytes, in four lanes of 16 bits.
const fn pairs(word: u64) -> u64 {
    (word & EVEN) + ((word >> 8) & EVEN)
}

/// Sum of four lanes of 16 bits whose sum fits one.
const fn total(lanes: u64) -> i32 {
    (lanes.wrapping_mul(0x0001_0001_0001_0001) >> 48) as i32
}

/// Where green lies in the three words of eight pixels of RGB.
const GREEN: [u64; 3] = [0xff00_00ff_0000_ff00, 0x0000_ff00_00ff_0000, 0x00ff_0000_ff00_00ff];

/// Sum of red, twice green, and blue.
fn rgb(pixels: &[u8]) -> i32 {
    let (eight_pixels, _) = pixels.as_chunks::<24>();
    let sum = |bytes: &[u8; 24]| {
        let words = eights(bytes).zip(GREEN);
        total(words.map(|(word, green)| pairs(word) + pairs(word & green)).sum())
    };
    eight_pixels.iter().map(sum).sum()
}
