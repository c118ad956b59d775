//! Directions that the cells see, with the lens's distortion undone, from a table.

use glam::{DVec2, DVec3};

use super::cells::{CELL, PictureCells};
use crate::geometry::Lens;

/// Rows between the entries of a column: between them a line errs by .02 px with the strongest lens of an action camera.
const SPACING: usize = 8;

/// Directions along the middle of each column, in the camera's axes.
#[derive(Clone, Debug, Default)]
pub(super) struct Rays {
    made_for: Option<(Lens, DVec2)>,
    nodes: usize,
    rays: Vec<DVec3>,
    /// The same for the middle row's camera where a rolling shutter was turned while it read; else empty.
    turned: Vec<DVec3>,
    /// Largest distance from the axis of what is seen, tangent.
    pub reach: f64,
    /// Reduced pixels to a radian at the axis, down.
    pub focal: f64,
}

impl Rays {
    /// Makes the table where lens or size have changed; how the camera turned is another for each picture.
    pub fn make(&mut self, lens: &Lens, cells: &PictureCells) {
        self.make_still(&Lens { row_turn: DVec3::ZERO, ..*lens }, cells);
        self.turned.clear();
        if lens.row_turn == DVec3::ZERO {
            return;
        }
        let rows = f64::from(lens.height) / cells.size.y;
        self.turned.extend_from_slice(&self.rays);
        for node in 0..self.nodes {
            let turn = lens.turned_at((node * SPACING) as f64 * rows);
            self.turned.iter_mut().skip(node).step_by(self.nodes).for_each(|ray| *ray = turn * *ray);
        }
    }

    fn make_still(&mut self, lens: &Lens, cells: &PictureCells) {
        let key = (*lens, cells.size);
        if self.made_for == Some(key) {
            return;
        }
        self.made_for = Some(key);
        self.nodes = cells.height.div_ceil(SPACING) + 1;
        // The lens may be given for another size than the picture has.
        let scale = DVec2::new(f64::from(lens.width), f64::from(lens.height)) / cells.size;
        self.focal = lens.focal.y / scale.y;
        self.rays.clear();
        for column in 0..cells.columns {
            for node in 0..self.nodes {
                let place = DVec2::new(((column * CELL) + CELL / 2) as f64, (node * SPACING) as f64);
                self.rays.push(lens.unproject(place * scale));
            }
        }
        let tangent = |ray: &DVec3| ray.truncate().length() / ray.z.max(1e-3);
        self.reach = self.rays.iter().map(tangent).filter(|t| t.is_finite()).fold(0.0, f64::max);
    }

    fn column(&self, column: usize) -> &[DVec3] {
        let rays = if self.turned.is_empty() { &self.rays } else { &self.turned };
        rays.get(column * self.nodes..(column + 1) * self.nodes).unwrap_or(&[])
    }

    /// Direction that the column sees at `row` (0 at the picture's upper edge), of about unit length, and its change from one
    /// row to the next. `None` for a column that there is not, and where the lens folds back.
    pub fn at(&self, column: usize, row: f64) -> Option<(DVec3, DVec3)> {
        let nodes = self.column(column);
        let place = row / SPACING as f64;
        let node = (place.max(0.0) as usize).min(nodes.len().checked_sub(2)?);
        let (a, b) = (*nodes.get(node)?, *nodes.get(node + 1)?);
        let ray = a + (b - a) * (place - node as f64);
        ray.is_finite().then_some((ray, (b - a) / SPACING as f64))
    }

    /// Row at which the column sees the sea's horizon where `up` is up, in the camera's axes, and the sine of the dip; beyond
    /// the picture, the first and last entries are followed on. `None` where the column does not cross it from above.
    pub fn crossing(&self, column: usize, up: DVec3, sin_dip: f64) -> Option<f64> {
        let nodes = self.column(column);
        let height = |node: usize| nodes.get(node).map(|ray| ray.dot(up) + sin_dip);
        let last = nodes.len().checked_sub(2)?;
        let (mut low, mut high) = (0, last);
        // The last node at which the column still looks above the horizon.
        while low < high {
            let middle = (low + high).div_ceil(2);
            if height(middle)? >= 0.0 { low = middle } else { high = middle - 1 }
        }
        let (above, below) = (height(low)?, height(low + 1)?);
        let fall = above - below;
        (fall > 1e-6).then(|| (low as f64 + above / fall) * SPACING as f64)
    }
}
