//! What of the picture shows the own ship or gun, and is not looked at.

use super::cells::{CELL, Cells};

/// Parts of the picture that show the own ship or the gun: they stay where they are in the picture, and have edges of their
/// own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    width: usize,
    height: usize,
    hidden: Vec<bool>,
}

impl Mask {
    /// A grid of `width` x `height` fields that covers the whole picture, rows from the top; `true` is not looked at. `None`
    /// where there are not as many fields as that, or none.
    pub fn new(width: usize, height: usize, hidden: Vec<bool>) -> Option<Self> {
        let fields = width.checked_mul(height)?;
        (fields > 0 && fields == hidden.len()).then_some(Self { width, height, hidden })
    }

    /// Whether the field at these shares of width and height is hidden.
    pub(crate) fn hides(&self, x: f64, y: f64) -> bool {
        let column = ((x * self.width as f64) as usize).min(self.width - 1);
        let row = ((y * self.height as f64) as usize).min(self.height - 1);
        self.hidden.get(row * self.width + column).copied().unwrap_or(false)
    }
}

/// A mask on the cells of a picture: how many rows of each column are hidden from the top on.
#[derive(Clone, Debug, Default)]
pub(super) struct Hidden {
    mask: Option<Mask>,
    size: (usize, usize),
    counts: Vec<u16>,
}

impl Hidden {
    /// Hides something else from now on.
    pub fn set(&mut self, mask: Option<Mask>) {
        self.mask = mask;
        self.size = (0, 0);
    }

    /// Lays the mask on cells of this size.
    pub fn lay(&mut self, cells: &Cells) {
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
