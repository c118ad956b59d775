//! Where in the picture there is sky, in fields, so that points are spread over it.

use std::ops::Range;

use glam::{DVec2, DVec3};

use crate::{geometry::Lens, own_ship::Mask};

use super::patch::HALF;

/// Side of a field, pixels of the finest level.
pub(super) const FIELD: usize = 40;

/// The fields of a picture.
#[derive(Clone, Debug, Default)]
pub(super) struct FieldGrid {
    made_for: Option<(Lens, (usize, usize))>,
    pub columns: usize,
    pub rows: usize,
    /// Unit vectors in the camera's axes that the fields' corners see, row by row.
    corners: Vec<DVec3>,
    /// Mask of the own ship, by field.
    hidden: Vec<bool>,
    mask: Option<Mask>,
    /// Fields of which some is in the sky.
    pub sky: Vec<bool>,
}

impl FieldGrid {
    pub fn set_mask(&mut self, mask: Option<Mask>) {
        self.mask = mask;
        self.made_for = None;
    }

    /// Lays fields on a picture of `size` that `lens` makes.
    pub fn make(&mut self, lens: &Lens, size: (usize, usize)) {
        if self.made_for == Some((*lens, size)) {
            return;
        }
        self.made_for = Some((*lens, size));
        (self.columns, self.rows) = (size.0 / FIELD, size.1 / FIELD);
        let corner = |i: usize| {
            let (x, y) = (i % (self.columns + 1) * FIELD, i / (self.columns + 1) * FIELD);
            lens.unproject(DVec2::new(x as f64, y as f64))
        };
        self.corners.clear();
        self.corners.extend((0..(self.columns + 1) * (self.rows + 1)).map(corner));
        let count = self.columns * self.rows;
        self.hidden.clear();
        self.hidden.resize(count, false);
        self.sky.clear();
        self.sky.resize(count, false);
        if let Some(mask) = &self.mask {
            for (i, hidden) in self.hidden.iter_mut().enumerate() {
                let corner = DVec2::new((i % self.columns) as f64, (i / self.columns) as f64) * FIELD as f64;
                let touched = |k: usize| {
                    let at = corner + DVec2::new((k % 5) as f64, (k / 5) as f64) * (FIELD as f64 / 4.0);
                    mask.hides(at.x / size.0 as f64, at.y / size.1 as f64)
                };
                *hidden = (0..25).any(touched);
            }
        }
    }

    /// Marks the fields that see, somewhere, higher than `sine` over the horizontal where `up` is up; the rows that they lie in.
    pub fn mark(&mut self, up: DVec3, sine: f64) -> Option<Range<usize>> {
        let stride = self.columns + 1;
        let mut rows: Option<Range<usize>> = None;
        for (i, sky) in self.sky.iter_mut().enumerate() {
            let (column, row) = (i % self.columns, i / self.columns);
            let first = row * stride + column;
            let above = |corner: usize| self.corners.get(corner).is_some_and(|c| c.dot(up) > sine);
            let seen = [first, first + 1, first + stride, first + stride + 1].into_iter().any(above);
            *sky = seen && !self.hidden.get(i).copied().unwrap_or(true);
            if *sky {
                let own = row * FIELD..(row + 1) * FIELD;
                rows = Some(rows.map_or(own.clone(), |r| r.start.min(own.start)..r.end.max(own.end)));
            }
        }
        rows
    }

    /// The field of a place; `None` beyond them.
    pub fn field(&self, place: DVec2) -> Option<usize> {
        if !(place.x >= 0.0 && place.y >= 0.0) {
            return None;
        }
        let (column, row) = (place.x as usize / FIELD, place.y as usize / FIELD);
        (column < self.columns && row < self.rows).then_some(row * self.columns + column)
    }

    /// Whether a patch about `place` has nothing of the own ship in it.
    pub fn is_open(&self, place: DVec2) -> bool {
        let half = f64::from(HALF);
        [DVec2::new(-half, -half), DVec2::new(half, -half), DVec2::new(-half, half), DVec2::new(half, half)]
            .into_iter()
            .filter_map(|corner| self.field(place + corner))
            .all(|field| !self.hidden.get(field).copied().unwrap_or(false))
    }
}
