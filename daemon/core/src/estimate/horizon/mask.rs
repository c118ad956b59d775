//! The own ship's mask on the cells that a horizon is sought in.

use super::cells::{CELL, PictureCells};
use crate::own_ship::Mask;

/// A mask on the cells of a picture: how many rows of each column are hidden from the top on.
#[derive(Clone, Debug, Default)]
pub(super) struct MaskedRows {
    mask: Option<Mask>,
    size: (usize, usize),
    counts: Vec<u16>,
}

impl MaskedRows {
    /// Hides something else from now on.
    pub fn set(&mut self, mask: Option<Mask>) {
        self.mask = mask;
        self.size = (0, 0);
    }

    /// Lays the mask on cells of this size.
    pub fn lay(&mut self, cells: &PictureCells) {
        let size = (cells.columns, cells.height);
        let Some(mask) = self.mask.as_ref().filter(|_| self.size != size) else { return };
        self.size = size;
        self.counts.clear();
        for column in 0..cells.columns {
            let mut count = 0;
            self.counts.push(count);
            for row in 0..cells.height {
                let y = (row as f64 + 0.5) / cells.height as f64;
                let touches = |edge: usize| {
                    mask.hides((column * CELL + edge) as f64 / (cells.columns * CELL) as f64, y)
                };
                count += u16::from(touches(0) || touches(CELL / 2) || touches(CELL - 1));
                self.counts.push(count);
            }
        }
    }

    /// Whether the `reach` rows above or below `row` are hidden, some or all of them.
    pub fn touches(&self, column: usize, row: usize, reach: usize) -> bool {
        if self.mask.is_none() {
            return false;
        }
        let counts = self.counts.get(column * (self.size.1 + 1)..(column + 1) * (self.size.1 + 1));
        let Some(counts) = counts else { return false };
        let count = |row: usize| counts.get(row.min(self.size.1));
        count(row.saturating_sub(reach)) != count(row + reach)
    }
}
