//! The largest steps of brightness down each column, by blocks of rows.
//!
//! Whether nothing in a stretch of sky has an edge is asked of each column of each line that is tried; from these it is had by a
//! few comparisons.

use std::ops::Range;

use super::cells::{PictureCells, bend};

/// Rows that steps are taken over: land's upper edge is sharp, clouds are soft.
pub(super) const SHARP: usize = 3;

/// Rows of a block.
const BLOCK: usize = 8;

/// Smallest and largest step of each block, codes, positive where it is brighter below.
#[derive(Clone, Debug, Default)]
pub(super) struct StepBlocks {
    first_row: usize,
    blocks: usize,
    ranges: Vec<(f32, f32)>,
    /// Size of the largest step from the upper edge down to the end of each block.
    largest: Vec<f32>,
}

impl StepBlocks {
    /// Measures the rows that `cells` have read.
    pub fn measure(&mut self, cells: &PictureCells) {
        self.first_row = cells.rows().start + SHARP;
        self.blocks = cells.rows().len().saturating_sub(2 * SHARP) / BLOCK;
        self.ranges.clear();
        self.largest.clear();
        if self.blocks == 0 {
            return;
        }
        let gain = cells.unit() / SHARP as f32;
        for column in 0..cells.columns {
            let sums = cells.column(column);
            let mut largest = 0.0_f32;
            for from in (0..self.blocks).map(|block| block * BLOCK) {
                let (low, high) = range(sums, from).unwrap_or_default();
                let range = (low as f32 * gain, high as f32 * gain);
                largest = largest.max(range.1).max(-range.0);
                self.ranges.push(range);
                self.largest.push(largest);
            }
        }
    }

    /// Smallest and largest step in the blocks that lie within `rows`; `None` where there is none.
    pub fn within(&self, column: usize, rows: Range<usize>) -> Option<(f32, f32)> {
        let from = rows.start.saturating_sub(self.first_row).div_ceil(BLOCK);
        let to = (rows.end.saturating_sub(self.first_row) / BLOCK).min(self.blocks);
        let blocks = self.ranges.get(column * self.blocks + from..column * self.blocks + to)?;
        blocks.iter().copied().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// Size of the largest step in the blocks above `row`, codes.
    pub fn largest_above(&self, column: usize, row: usize) -> f32 {
        let blocks = (row.saturating_sub(self.first_row) / BLOCK).min(self.blocks);
        let last = blocks.checked_sub(1).map(|block| column * self.blocks + block);
        last.and_then(|i| self.largest.get(i)).copied().unwrap_or(0.0)
    }
}

/// Smallest and largest second difference of the running sums over a block of rows, the first between `from` and twice
/// [`SHARP`] further; the whole block at once, as processors like it.
fn range(sums: &[i32], from: usize) -> Option<(i32, i32)> {
    let block = |from: usize| sums.get(from..)?.first_chunk::<BLOCK>();
    let (above, at, below) = (block(from)?, block(from + SHARP)?, block(from + 2 * SHARP)?);
    let steps: [i32; BLOCK] = std::array::from_fn(|i| bend(above[i], at[i], below[i]));
    let (mut low, mut high) = (i32::MAX, i32::MIN);
    for step in steps {
        low = low.min(step);
        high = high.max(step);
    }
    Some((low, high))
}
