//! Which pixels a boat can touch, finer than one rectangle: a mast makes a boat's rectangle tall, but covers little of it. A model
//! is held by a few dozen boxes; their projections mark cells of the screen, and runs of marked cells become rectangles.

use bowwave_core::{frame::scene::PixelRect, model::Model};
use glam::{DVec2, DVec3, Vec3};

use crate::{
    passes::boats::parts::Parts,
    rects::{cut, joined, overlap},
};

/// Slices of a model along its length.
const SLICES: usize = 24;
/// Bands of a slice along its height.
const BANDS: usize = 16;
/// Pixels to a cell, each way.
const CELL_PX: u32 = 8;

/// Boxes that together hold a model, in its own space.
#[derive(Clone, Debug, Default)]
pub(crate) struct Boxes(Vec<(DVec3, DVec3)>);

/// Cross-section of lines whose reflection is left out, square metres: blurred, nothing of it is seen.
const LINE_SECTION_M2: f32 = 0.004;

impl Boxes {
    /// Boxes that hold all of a model.
    pub(crate) fn of(model: &Model) -> Self {
        Self::holding(model, |_| true)
    }

    /// Boxes that hold a model but for its stays and rails.
    pub(crate) fn without_lines(model: &Model) -> Self {
        let parts = Parts::of(model);
        Self::holding(model, |corner| !parts.is_line(corner, LINE_SECTION_M2))
    }

    /// Boxes that hold the triangles whose first corner is `wanted`.
    fn holding(model: &Model, wanted: impl Fn(u32) -> bool) -> Self {
        let (low, size) = (model.min, (model.max - model.min).max(Vec3::splat(1e-3)));
        // Extent across and upwards of what lies in each slice and band.
        let mut bands = vec![[None::<(Vec3, Vec3)>; BANDS]; SLICES];
        for t in model.indices.chunks_exact(3).filter(|t| wanted(t[0])) {
            let Some(corners) = corners(model, t) else { continue };
            let at = |x: f32| (((x - low.x) / size.x * SLICES as f32) as usize).min(SLICES - 1);
            let (first, last) =
                corners.iter().fold((SLICES, 0), |(a, b), p| (a.min(at(p.x)), b.max(at(p.x))));
            for (slice, bands) in bands.iter_mut().enumerate().take(last + 1).skip(first) {
                let x0 = low.x + size.x * slice as f32 / SLICES as f32;
                let Some((from, to)) = slab(&corners, x0, x0 + size.x / SLICES as f32) else { continue };
                let band = |z: f32| (((z - low.z) / size.z * BANDS as f32) as usize).min(BANDS - 1);
                for b in &mut bands[band(from.z)..=band(to.z)] {
                    *b = Some(b.map_or((from, to), |(l, h)| (l.min(from), h.max(to))));
                }
            }
        }
        let mut boxes = Vec::new();
        for slice in &bands {
            // Bands that follow each other become one box.
            let mut open: Option<(Vec3, Vec3)> = None;
            for band in slice.iter().chain([&None]) {
                match (band, open) {
                    (Some((l, h)), Some((a, b))) => open = Some((a.min(*l), b.max(*h))),
                    (Some(pair), None) => open = Some(*pair),
                    (None, Some((a, b))) => {
                        boxes.push((a.as_dvec3(), b.as_dvec3()));
                        open = None;
                    }
                    (None, None) => {}
                }
            }
        }
        Self(boxes)
    }

    /// Marks the cells of `within` that the boxes' projections, `margin` pixels wider, touch. `project` takes a point of the
    /// model to the screen; where it cannot, all of `within` is marked.
    pub(crate) fn mark(
        &self,
        cells: &mut Cells,
        within: PixelRect,
        margin: DVec2,
        project: impl Fn(DVec3) -> Option<DVec2>,
    ) {
        for (low, high) in &self.0 {
            let (mut from, mut to) = (DVec2::MAX, DVec2::MIN);
            for i in 0..8 {
                let pick = |bit: usize, a: f64, b: f64| if i & bit == 0 { a } else { b };
                let corner =
                    DVec3::new(pick(1, low.x, high.x), pick(2, low.y, high.y), pick(4, low.z, high.z));
                let Some(p) = project(corner) else {
                    cells.mark(within);
                    return;
                };
                (from, to) = (from.min(p), to.max(p));
            }
            cells.mark_span(from - margin, to + margin, within);
        }
    }
}

fn corners(model: &Model, t: &[u32]) -> Option<[Vec3; 3]> {
    let at = |i: usize| t.get(i).and_then(|v| model.vertices.get(*v as usize)).map(|v| v.position);
    Some([at(0)?, at(1)?, at(2)?])
}

/// Bounds of the part of a triangle between two planes across the model's length.
fn slab(corners: &[Vec3; 3], x0: f32, x1: f32) -> Option<(Vec3, Vec3)> {
    let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
    let mut take = |p: Vec3| (low, high) = (low.min(p), high.max(p));
    for (i, a) in corners.iter().enumerate() {
        let b = &corners[(i + 1) % 3];
        if (x0..=x1).contains(&a.x) {
            take(*a);
        }
        for x in [x0, x1] {
            if (a.x < x) != (b.x < x) {
                take(a.lerp(*b, (x - a.x) / (b.x - a.x)).with_x(x));
            }
        }
    }
    (low.x <= high.x).then_some((low, high))
}

/// A grid over the screen.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cells {
    size: (u32, u32),
    columns: u32,
    rows: u32,
    marked: Vec<bool>,
    /// Cells that hold all marks: x and y of the first, x and y beyond the last.
    used: Option<[u32; 4]>,
    /// Runs that the row before left open: first column, column beyond, first row.
    open: Vec<[u32; 3]>,
    next: Vec<[u32; 3]>,
}

impl Cells {
    pub(crate) fn new(size: (u32, u32)) -> Self {
        let (columns, rows) = (size.0.div_ceil(CELL_PX), size.1.div_ceil(CELL_PX));
        let room = columns as usize;
        Self {
            size,
            columns,
            rows,
            marked: vec![false; (columns * rows) as usize],
            used: None,
            open: Vec::with_capacity(room),
            next: Vec::with_capacity(room),
        }
    }

    /// Marks every cell that `r` touches.
    pub(crate) fn mark(&mut self, r: PixelRect) {
        let Some(r) = cut(r, self.size) else { return };
        let (x0, y0) = (r.x / CELL_PX, r.y / CELL_PX);
        let (x1, y1) = ((r.x + r.width).div_ceil(CELL_PX), (r.y + r.height).div_ceil(CELL_PX));
        for y in y0..y1 {
            let row = (y * self.columns) as usize;
            self.marked[row + x0 as usize..row + x1 as usize].fill(true);
        }
        let [a, b, c, d] = self.used.unwrap_or([x0, y0, x1, y1]);
        self.used = Some([a.min(x0), b.min(y0), c.max(x1), d.max(y1)]);
    }

    /// Marks the cells that the span of pixels touches within `within`.
    pub(crate) fn mark_span(&mut self, from: DVec2, to: DVec2, within: PixelRect) {
        let clamp = |v: f64| v.clamp(-1e6, 1e6).floor() as i64;
        let (x0, y0) = (clamp(from.x).max(0), clamp(from.y).max(0));
        let (x1, y1) = (clamp(to.x) + 1, clamp(to.y) + 1);
        if x1 > x0 && y1 > y0 {
            let (x, y, width, height) = (x0 as u32, y0 as u32, (x1 - x0) as u32, (y1 - y0) as u32);
            if let Some(r) = overlap(PixelRect { x, y, width, height }, within) {
                self.mark(r);
            }
        }
    }

    /// Takes the marks back where all of a cell fulfils `test`, which is given the cell's four corners.
    pub(crate) fn unmark(&mut self, test: impl Fn([DVec2; 4]) -> bool) {
        let Some([x0, y0, x1, y1]) = self.used else { return };
        for y in y0..y1 {
            for x in x0..x1 {
                let at = |dx: u32, dy: u32| {
                    DVec2::new(f64::from((x + dx) * CELL_PX), f64::from((y + dy) * CELL_PX))
                };
                let marked = &mut self.marked[(y * self.columns + x) as usize];
                *marked = *marked && !test([at(0, 0), at(1, 0), at(0, 1), at(1, 1)]);
            }
        }
    }

    /// Appends rectangles that hold the marked cells, each pixel once, and clears the grid. Returns the rectangle around all of
    /// them. More than `limit` become that one rectangle.
    pub(crate) fn take(&mut self, rects: &mut Vec<PixelRect>, limit: usize) -> Option<PixelRect> {
        let [x0, y0, x1, y1] = self.used.take()?;
        let first = rects.len();
        self.open.clear();
        for y in y0..=y1 {
            self.next.clear();
            let mut x = x0;
            while y < y1 && x < x1 {
                let row = (y * self.columns) as usize;
                if !self.marked[row + x as usize] {
                    x += 1;
                    continue;
                }
                let from = x;
                while x < x1 && self.marked[row + x as usize] {
                    x += 1;
                }
                let begun = self.open.iter().position(|o| (o[0], o[1]) == (from, x));
                let since = begun.map_or(y, |i| self.open.swap_remove(i)[2]);
                self.next.push([from, x, since]);
            }
            // What is still open did not go on in this row.
            for [from, to, since] in self.open.drain(..) {
                let (x, top) = (from * CELL_PX, since * CELL_PX);
                let r = PixelRect { x, y: top, width: (to - from) * CELL_PX, height: (y - since) * CELL_PX };
                rects.extend(cut(r, self.size));
            }
            std::mem::swap(&mut self.open, &mut self.next);
        }
        for y in y0..y1.min(self.rows) {
            let row = (y * self.columns) as usize;
            self.marked[row + x0 as usize..row + x1 as usize].fill(false);
        }
        let around = rects[first..].iter().copied().reduce(joined)?;
        if rects.len() - first > limit {
            rects.truncate(first);
            rects.push(around);
        }
        Some(around)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn boxes_hold_every_corner_and_much_less_than_the_bounding_box() {
        for name in ["skiff", "dhow", "frigate"] {
            let model = bowwave_models::resolve(name, std::path::Path::new(".")).unwrap();
            let boxes = Boxes::of(&model);
            for v in &model.vertices {
                let p = v.position.as_dvec3();
                let held = boxes.0.iter().any(|(l, h)| p.cmpge(*l - 1e-3).all() && p.cmple(*h + 1e-3).all());
                assert!(held, "{name}: {p} is in no box");
            }
            let solid: f64 =
                Boxes::without_lines(&model).0.iter().copied().map(|(l, h)| (h.x - l.x) * (h.z - l.z)).sum();
            let area = |(l, h): (DVec3, DVec3)| (h.x - l.x) * (h.z - l.z);
            let boxed: f64 = boxes.0.iter().copied().map(area).sum();
            assert!(boxed < 0.7 * area((model.min.as_dvec3(), model.max.as_dvec3())), "{name}: {boxed}");
            assert!(solid <= boxed && solid > 0.3 * boxed, "{name}: {solid} of {boxed}");
            assert!(boxes.0.len() <= SLICES * 4, "{name}: {} boxes", boxes.0.len());
        }
    }

    proptest! {
        #[test]
        fn rectangles_hold_the_marked_cells_once(
            marks in prop::collection::vec((0_u32..330, 0_u32..190, 1_u32..90, 1_u32..60), 0..12),
        ) {
            let size = (325, 187);
            let mut cells = Cells::new(size);
            let mut wanted = std::collections::HashSet::new();
            for &(x, y, width, height) in &marks {
                let r = PixelRect { x, y, width, height };
                cells.mark(r);
                if let Some(r) = cut(r, size) {
                    for y in r.y / CELL_PX..(r.y + r.height).div_ceil(CELL_PX) {
                        wanted.extend((r.x / CELL_PX..(r.x + r.width).div_ceil(CELL_PX)).map(|x| (x, y)));
                    }
                }
            }
            let mut rects = Vec::new();
            let around = cells.take(&mut rects, 1000);
            prop_assert_eq!(around.is_some(), !wanted.is_empty());
            for y in 0..size.1 {
                for x in 0..size.0 {
                    let holds = |r: &PixelRect| (r.x..r.x + r.width).contains(&x) && (r.y..r.y + r.height).contains(&y);
                    let count = rects.iter().filter(|r| holds(r)).count();
                    prop_assert_eq!(count, usize::from(wanted.contains(&(x / CELL_PX, y / CELL_PX))), "pixel {} {}", x, y);
                }
            }
            // The grid is clean again.
            prop_assert_eq!(cells.take(&mut rects, 1000), None);
        }
    }
}
