//! The part of the picture that is looked at, reduced, and reduced again by half.

use std::ops::Range;

use crate::event::Picture;

/// Width that pictures are reduced to, about: a sight's place errs by hundredths of these pixels.
const WIDTH: u32 = 640;
/// Largest factor that a picture is reduced by.
const REDUCTION_MAX: usize = 4;
/// Levels, each half as wide as the one before.
pub(super) const LEVELS: usize = 4;
/// Rows begin at a multiple of this, so that all levels share their grid.
const ALIGN: usize = 1 << (LEVELS - 1);

/// A strip of a grey picture, codes of 255. Places are pixels of the whole level; the centre of its first pixel is (0.5, 0.5).
#[derive(Clone, Debug, Default)]
pub(super) struct PyramidLevel {
    pub width: usize,
    /// Rows of the whole level that are there.
    pub rows: Range<usize>,
    pub codes: Vec<f32>,
}

/// A grey picture, reduced to about 640 pixels across, with levels that are each reduced by half.
#[derive(Clone, Debug, Default)]
pub struct GreyPyramid {
    /// Size of the whole finest level, pixels.
    pub size: (usize, usize),
    /// Pixels of the picture in one of the finest level's.
    pub reduction: usize,
    /// All levels, the finest first.
    pub(super) levels: [PyramidLevel; LEVELS],
    /// Standard deviation of the finest level's noise, codes.
    pub noise: f32,
    sums: Vec<u32>,
    scratch: Vec<f32>,
}

/// Noise is told on every so many-th row and pair of columns.
const NOISE_EVERY: usize = 8;
/// What rounding leaves of noise at least, codes.
const NOISE_MIN: f32 = 0.15;

impl GreyPyramid {
    /// Takes on the size of `picture`; its rows are read by [`GreyPyramid::fill`].
    pub fn measure(&mut self, picture: &Picture) {
        let reduction = ((picture.width() + WIDTH / 2) / WIDTH).max(1) as usize;
        self.reduction = reduction.min(REDUCTION_MAX);
        self.size = (picture.width() as usize / self.reduction, picture.height() as usize / self.reduction);
    }

    /// Reads these rows of the finest level, and some above, and makes the other levels of them.
    pub fn fill(&mut self, picture: &Picture, rows: Range<usize>) {
        let rows = rows.start / ALIGN * ALIGN..rows.end.min(self.size.1);
        let width = self.size.0;
        let unit =
            1.0 / ((self.reduction * self.reduction) as f32 * f32::from(picture.format().luma_weight()));
        let finest = &mut self.levels[0];
        finest.width = width;
        finest.codes.resize(width * rows.len(), 0.0);
        self.sums.resize(width, 0);
        for (row, line) in rows.clone().zip(finest.codes.chunks_exact_mut(width.max(1))) {
            self.sums.fill(0);
            for y in row * self.reduction..(row + 1) * self.reduction {
                add_row(picture, y, self.reduction, &mut self.sums);
            }
            for (code, sum) in line.iter_mut().zip(&self.sums) {
                *code = *sum as f32 * unit;
            }
        }
        finest.rows = rows;
        for level in 1..LEVELS {
            let (finer, coarser) = self.levels.split_at_mut(level);
            if let (Some(finer), Some(coarser)) = (finer.last(), coarser.first_mut()) {
                coarser.halve(finer);
            }
        }
        self.noise = self.noise_floor();
    }

    /// How much neighbours differ in ways that no slope explains, where that is least: noise.
    fn noise_floor(&mut self) -> f32 {
        let finest = &self.levels[0];
        self.scratch.clear();
        for both in finest.codes.chunks_exact((2 * finest.width).max(1)).step_by(NOISE_EVERY / 2) {
            let (upper, lower) = both.split_at(finest.width);
            let quads = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
            self.scratch.extend(quads.step_by(NOISE_EVERY).map(|([a, b], [c, d])| ((a - b) - (c - d)).abs()));
        }
        if self.scratch.is_empty() {
            return NOISE_MIN;
        }
        let middle = self.scratch.len() / 2;
        let (_, median, _) = self.scratch.select_nth_unstable_by(middle, f32::total_cmp);
        // The difference has twice the noise; the median of its size is .6745 of that.
        (*median / (2.0 * 0.6745)).max(NOISE_MIN)
    }
}

impl PyramidLevel {
    /// Becomes the means of two by two pixels of `finer`.
    fn halve(&mut self, finer: &Self) {
        self.width = finer.width / 2;
        self.rows = finer.rows.start / 2..finer.rows.end / 2;
        let (width, full) = (self.width, finer.width);
        self.codes.resize(width * self.rows.len(), 0.0);
        if width == 0 {
            return;
        }
        let pairs = finer.codes.chunks_exact(2 * full);
        for (line, both) in self.codes.chunks_exact_mut(width).zip(pairs) {
            let (upper, lower) = both.split_at(full);
            let quads = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
            for (code, ([a, b], [c, d])) in line.iter_mut().zip(quads) {
                *code = 0.25 * ((a + b) + (c + d));
            }
        }
    }

    /// A pixel of the whole level; `None` where it was not read.
    pub fn code(&self, x: usize, y: usize) -> Option<f32> {
        let row = y.checked_sub(self.rows.start)?;
        (x < self.width).then(|| self.codes.get(row * self.width + x).copied())?
    }
}

/// Adds a row of the picture, `reduction` pixels to a sum. Luma of RGB is (R + 2 G + B) / 4, times four.
fn add_row(picture: &Picture, y: usize, reduction: usize, sums: &mut [u32]) {
    let (per_pixel, row) = (picture.format().pixel_bytes(), picture.row(y));
    // Fixed steps, so that the compiler lays out the loops.
    match (per_pixel, reduction) {
        (1, 1) => add::<1>(row, sums, |p| total::<1>(p)),
        (1, 2) => add::<2>(row, sums, |p| total::<1>(p)),
        (1, 3) => add::<3>(row, sums, |p| total::<1>(p)),
        (1, _) => add::<4>(row, sums, |p| total::<1>(p)),
        (2, 1) => add::<2>(row, sums, |p| total::<2>(p)),
        (2, 2) => add::<4>(row, sums, |p| total::<2>(p)),
        (2, 3) => add::<6>(row, sums, |p| total::<2>(p)),
        (2, _) => add::<8>(row, sums, |p| total::<2>(p)),
        (_, 1) => add::<3>(row, sums, |p| colours(p)),
        (_, 2) => add::<6>(row, sums, |p| colours(p)),
        (_, 3) => add::<9>(row, sums, |p| colours(p)),
        (_, _) => add::<12>(row, sums, |p| colours(p)),
    }
}

/// Adds to each sum what `of` makes of the next `BYTES` bytes.
fn add<const BYTES: usize>(row: &[u8], sums: &mut [u32], of: impl Fn(&[u8; BYTES]) -> u32) {
    for (sum, bytes) in sums.iter_mut().zip(row.as_chunks::<BYTES>().0) {
        *sum += of(bytes);
    }
}

/// Sum of every `EVERY`-th byte.
fn total<const EVERY: usize>(bytes: &[u8]) -> u32 {
    bytes.iter().step_by(EVERY).map(|b| u32::from(*b)).sum()
}

/// Sum of red, twice green, and blue.
fn colours(bytes: &[u8]) -> u32 {
    bytes.as_chunks::<3>().0.iter().map(|[r, g, b]| u32::from(*r) + 2 * u32::from(*g) + u32::from(*b)).sum()
}
