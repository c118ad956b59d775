//! The share of each cell of a fine grid that triangles cover, as a lens shows them.
//!
//! The cover of a triangle depends only on the directions of its corners. Its sides are arcs between them, which a lens bends. So each side is
//! followed until its chords are straight enough, and the polygon of all of them is filled along scan lines: exactly across, by several lines
//! down a cell.

use bowwave_core::geometry::{Bend, Lens, distance_squared_to_segment};
use glam::{DVec2, DVec3};

/// Nearer to the camera's plane than this nothing is drawn, metres.
const NEAR_M: f64 = 1e-3;
/// Nearer to the axis behind the camera than this nothing is drawn, metres.
const FAR_END_M: f64 = 1e-7;
/// Chords leave the bent side of a triangle by no more than this, pixels.
const CHORD_PX: f64 = 0.01;
/// Arcs longer than this are halved in any case, radians: the middle of a longer one does not tell how it bends.
const ARC_MOST: f64 = 0.15;
/// A side is halved no more often than this.
const HALVED_MOST: u32 = 12;
/// Steps that find the rim of what a lens shows, to a billionth of a radian.
const RIM_STEPS: u32 = 32;
/// Cells a pixel, fewer where the picture would take more than so many of them.
const CELLS_A_PIXEL: u32 = 4;
const CELLS_MOST: f64 = 4e7;
/// Scan lines a row of cells.
const LINES: usize = 4;
/// Spans of a scan line after which those that touch are joined.
const SPANS_MOST: usize = 512;

/// Values on a grid within the picture.
pub(super) struct Cover {
    /// Upper left corner, pixels.
    pub low: DVec2,
    /// Cells a pixel.
    pub scale: f64,
    /// Columns and rows.
    pub size: (u32, u32),
    /// Share of each cell that is *not* covered, rows from the top.
    pub free: Vec<f32>,
}

/// Cover of triangles of the camera's space; `None` where nothing of them is in the picture.
pub(super) fn cover(lens: &Lens, triangles: impl IntoIterator<Item = [DVec3; 3]>) -> Option<Cover> {
    let whole = DVec2::new(f64::from(lens.width), f64::from(lens.height));
    let mut polygons = Polygons::new(lens);
    triangles.into_iter().for_each(|triangle| polygons.add(triangle));
    let [low, high] = polygons.bounds;
    // A pixel of free cells all around, so that only the picture's border cuts a line short.
    let low = (low.floor() - 1.0).max(DVec2::ZERO);
    let high = (high.ceil() + 1.0).min(whole);
    if !(high - low).cmpgt(DVec2::ZERO).all() {
        return None;
    }
    let area = (high - low).element_product();
    let cells = (1..=CELLS_A_PIXEL).rev().find(|c| area * f64::from(c * c) <= CELLS_MOST).unwrap_or(1);
    let scale = f64::from(cells);
    let size = ((high - low) * scale).as_uvec2();
    let mut lines = ScanLines::new(size.x, size.y as usize * LINES);
    for polygon in &polygons.all {
        lines.fill(polygon.iter().map(|p| (*p - low) * scale));
    }
    Some(Cover { low, scale, size: (size.x, size.y), free: lines.free() })
}

/// Outlines of triangles, in pixels.
struct Polygons<'a> {
    lens: &'a Lens,
    all: Vec<Vec<DVec2>>,
    bounds: [DVec2; 2],
}

impl<'a> Polygons<'a> {
    fn new(lens: &'a Lens) -> Self {
        Self { lens, all: Vec::new(), bounds: [DVec2::INFINITY, DVec2::NEG_INFINITY] }
    }

    /// Adds what is before the camera's plane; of a fisheye, which may see behind it, also the rest by quarters: an arc around the axis's far
    /// end has no inside. That end itself lies on no side of the picture, and is left out.
    fn add(&mut self, triangle: [DVec3; 3]) {
        if self.lens.optics().bend != Bend::Fisheye {
            return self.piece(clipped(&triangle, DVec3::Z, NEAR_M));
        }
        self.piece(clipped(&triangle, DVec3::Z, 0.0));
        let behind = clipped(&triangle, DVec3::NEG_Z, 0.0);
        if !behind.is_empty() {
            for (x, y) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                let quarter = clipped(&clipped(&behind, DVec3::X * x, 0.0), DVec3::Y * y, 0.0);
                self.piece(clipped(&quarter, DVec3::new(x, y, 0.0), FAR_END_M));
            }
        }
    }

    /// Adds a convex piece by its corners.
    fn piece(&mut self, corners: Vec<DVec3>) {
        let directions: Vec<DVec3> =
            corners.into_iter().map(DVec3::normalize_or_zero).filter(|d| *d != DVec3::ZERO).collect();
        if directions.len() < 3 {
            return;
        }
        let places: Vec<DVec2> = directions.iter().map(|d| self.place(*d)).collect();
        let mut polygon = Vec::with_capacity(directions.len());
        for i in 0..directions.len() {
            let next = (i + 1) % directions.len();
            polygon.push(places[i]);
            self.follow([directions[i], directions[next]], [places[i], places[next]], 0, &mut polygon);
        }
        let whole = DVec2::new(f64::from(self.lens.width), f64::from(self.lens.height));
        let none = [DVec2::INFINITY, DVec2::NEG_INFINITY];
        let [low, high] = polygon.iter().fold(none, |[low, high], p| [low.min(*p), high.max(*p)]);
        if low.cmplt(whole).all() && high.cmpgt(DVec2::ZERO).all() {
            self.bounds = [self.bounds[0].min(low), self.bounds[1].max(high)];
            self.all.push(polygon);
        }
    }

    /// Adds places between the ends of an arc until its chords are straight enough.
    fn follow(&self, [a, b]: [DVec3; 2], [from, to]: [DVec2; 2], halved: u32, polygon: &mut Vec<DVec2>) {
        let middle = (a + b).normalize_or_zero();
        if halved >= HALVED_MOST || middle == DVec3::ZERO {
            return;
        }
        let place = self.place(middle);
        let is_straight = distance_squared_to_segment(place, from, to) < CHORD_PX * CHORD_PX;
        if is_straight && a.distance_squared(b) < ARC_MOST * ARC_MOST {
            return;
        }
        self.follow([a, middle], [from, place], halved + 1, polygon);
        polygon.push(place);
        self.follow([middle, b], [place, to], halved + 1, polygon);
    }

    /// The pixel of a direction; beyond the rim of what the lens shows, which is outside the picture, the rim's pixel on that side.
    fn place(&self, direction: DVec3) -> DVec2 {
        if let Some(pixel) = self.lens.project(direction) {
            return pixel;
        }
        let side = DVec3::new(direction.x, direction.y, 0.0).normalize_or(DVec3::X);
        let at = |off: f64| self.lens.project(side * off.sin() + DVec3::Z * off.cos());
        let (mut seen, mut beyond) = (0.0, direction.z.clamp(-1.0, 1.0).acos());
        for _ in 0..RIM_STEPS {
            let middle = 0.5 * (seen + beyond);
            *(if at(middle).is_some() { &mut seen } else { &mut beyond }) = middle;
        }
        at(seen).unwrap_or(self.lens.centre)
    }
}

/// The part of a convex polygon that lies at least `least` along `axis` (Sutherland and Hodgman 1974).
fn clipped(corners: &[DVec3], axis: DVec3, least: f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (a, b) in corners.iter().zip(corners.iter().cycle().skip(1)) {
        let (from, to) = (a.dot(axis) - least, b.dot(axis) - least);
        if from >= 0.0 {
            kept.push(*a);
        }
        if (from >= 0.0) != (to >= 0.0) {
            // The same place whichever way the side runs, so that neighbours leave no gap.
            let (from, to, a, b) = if from >= 0.0 { (from, to, a, b) } else { (to, from, b, a) };
            kept.push(a.lerp(*b, from / (from - to)));
        }
    }
    kept
}

/// Spans that polygons cover on horizontal lines.
struct ScanLines {
    width: u32,
    spans: Vec<Vec<[f64; 2]>>,
    crossings: Vec<(usize, f64)>,
}

impl ScanLines {
    fn new(width: u32, lines: usize) -> Self {
        Self { width, spans: vec![Vec::new(); lines], crossings: Vec::new() }
    }

    /// Adds a polygon, in cells, by the even-odd rule.
    fn fill(&mut self, corners: impl Iterator<Item = DVec2> + Clone) {
        self.crossings.clear();
        let last = self.spans.len() as f64 - 1.0;
        for (a, b) in corners.clone().zip(corners.clone().skip(1).chain(corners.take(1))) {
            // Line i lies (i + 0.5) / LINES below the top. From above, whichever way the side runs: neighbours leave no gap.
            let (top, bottom) = if (a.y, a.x) <= (b.y, b.x) { (a, b) } else { (b, a) };
            let line = |y: f64| y * LINES as f64 - 0.5;
            let (first, end) = (line(top.y).ceil().max(0.0), (line(bottom.y).ceil() - 1.0).min(last));
            if end < first {
                continue;
            }
            let slope = (bottom.x - top.x) / (bottom.y - top.y);
            for i in first as usize..=end as usize {
                self.crossings.push((i, top.x + ((i as f64 + 0.5) / LINES as f64 - top.y) * slope));
            }
        }
        self.crossings.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        for pair in self.crossings.chunks_exact(2) {
            let span = [pair[0].1.max(0.0), pair[1].1.min(f64::from(self.width))];
            let Some(spans) = self.spans.get_mut(pair[0].0).filter(|_| span[0] < span[1]) else { continue };
            spans.push(span);
            if spans.len() >= SPANS_MOST {
                joined(spans);
            }
        }
    }

    /// Share of each cell that is not covered.
    fn free(mut self) -> Vec<f32> {
        let width = self.width as usize;
        let mut free = Vec::with_capacity(width * self.spans.len() / LINES);
        for lines in self.spans.chunks_exact_mut(LINES) {
            let row = free.len();
            free.resize(row + width, 1.0_f32);
            for spans in lines {
                joined(spans);
                for &[from, to] in spans.iter() {
                    let cells = from as usize..(to.ceil() as usize).min(width);
                    for (cell, share) in free[row..].iter_mut().enumerate().take(cells.end).skip(cells.start)
                    {
                        let covered = to.min(cell as f64 + 1.0) - from.max(cell as f64);
                        *share -= covered.max(0.0) as f32 / LINES as f32;
                    }
                }
            }
        }
        free
    }
}

/// Joins spans that touch. Sides of neighbours are the same to a millionth of a cell.
fn joined(spans: &mut Vec<[f64; 2]>) {
    const TOUCHES: f64 = 1e-6;
    spans.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    spans.dedup_by(|next, kept| {
        let touches = next[0] <= kept[1] + TOUCHES;
        if touches {
            kept[1] = kept[1].max(next[1]);
        }
        touches
    });
}
