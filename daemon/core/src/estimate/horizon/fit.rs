//! The line through the edges near it: where each column crosses it, and the direction of up that fits these best.

use glam::{DMat2, DVec2, DVec3};

use super::{
    cells::{CELL, PictureCells},
    edges::quiet,
    mask::MaskedRows,
    rays::Rays,
    steps::StepBlocks,
};
use crate::statistics::biweight;

/// The scatter is read off the distance that this share of the points stay below...
const SCATTER_SHARE: f64 = 0.35;
/// ...which for normal deviates is their standard deviation over this.
const SCATTER_SCALE: f64 = 1.0 / 0.453_8;

/// Up in the camera's axes, for a camera rolled by `roll` that looks up by `elevation` (as [`crate::geometry::look`]), radians.
pub(super) fn up_of(roll: f64, elevation: f64) -> DVec3 {
    let ((sr, cr), (se, ce)) = (roll.sin_cos(), elevation.sin_cos());
    DVec3::new(-sr * ce, -cr * ce, se)
}

/// Roll and elevation of a camera in whose axes `up` is up; the inverse of [`up_of`].
pub(super) fn angles_of(up: DVec3) -> DVec2 {
    DVec2::new((-up.x).atan2(-up.y), up.z.clamp(-1.0, 1.0).asin())
}

/// Derivatives of [`up_of`] by roll and elevation.
fn turns(angles: DVec2) -> [DVec3; 2] {
    let ((sr, cr), (se, ce)) = (angles.x.sin_cos(), angles.y.sin_cos());
    [DVec3::new(-cr * ce, sr * ce, 0.0), DVec3::new(sr * se, cr * se, ce)]
}

/// Roll and elevation of a camera that sees the horizon along two rays, `a` to the left of `b`.
fn through(a: DVec3, b: DVec3, sin_dip: f64) -> Option<DVec2> {
    let level = b.cross(a).try_normalize()?;
    // Both rays lie below the horizontal by the dip.
    let middle = (a + b).try_normalize()?;
    Some(angles_of((level - middle * (sin_dip / middle.dot(a))).normalize()))
}

/// Input of the search for a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineSearch<'a> {
    pub cells: &'a PictureCells,
    pub rays: &'a Rays,
    pub steps: &'a StepBlocks,
    pub hidden: &'a MaskedRows,
    pub sin_dip: f64,
    /// How much noise alone makes rows differ, codes.
    pub floor: f32,
}

/// A line, as roll and elevation of the camera.
#[derive(Clone, Copy, Debug)]
pub(super) struct HorizonLine {
    pub angles: DVec2,
    pub brighter_below: bool,
}

impl HorizonLine {
    pub fn up(&self) -> DVec3 {
        up_of(self.angles.x, self.angles.y)
    }

    /// A step in the sense of this line is positive.
    pub fn signed(&self, step: f32) -> f32 {
        if self.brighter_below { step } else { -step }
    }

    /// Row at which a column crosses the line, where both lie in the picture and are not hidden.
    pub fn row(&self, scene: &LineSearch<'_>, column: usize) -> Option<f64> {
        let row = scene.rays.crossing(column, self.up(), scene.sin_dip)?;
        let margin = 4.0;
        let inside = row >= margin && row <= scene.cells.height as f64 - margin;
        (inside && !scene.hidden.touches(column, row as usize, 4)).then_some(row)
    }

    /// Rows over which steps are taken: `size`, or what a cell's width spreads a steep line over.
    pub fn step_rows(&self, size: usize) -> usize {
        size.max((0.7 * CELL as f64 * self.angles.x.tan().abs()).ceil() as usize)
    }
}

/// Where a column has its edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgePoint {
    pub column: usize,
    /// Row of the edge.
    pub row: f64,
    /// Row of the line less that of the edge.
    pub off: f64,
    ray: DVec3,
    down: DVec3,
    weight: f64,
}

/// How well a line fits.
#[derive(Clone, Copy, Debug)]
pub(super) struct HorizonFit {
    pub line: HorizonLine,
    /// Covariance of roll and elevation, rad^2.
    pub covariance: DMat2,
}

/// Fits lines; keeps its points' memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Fitter {
    points: Vec<EdgePoint>,
    offs: Vec<f64>,
}

impl Fitter {
    /// The strongest edges of a wider stretch about a line: what merely is strongest somewhere in it lies anywhere, what
    /// belongs to a line lies on it.
    pub fn survey(&mut self, scene: &LineSearch<'_>, line: &HorizonLine) -> &[EdgePoint] {
        /// The stretch that is surveyed: rows to either side, rows that steps are taken over.
        const SURVEY: (usize, usize) = (10, 4);
        self.gather(scene, line, SURVEY.0, SURVEY.1, |_| true);
        self.measure(scene, line);
        &self.points
    }

    /// Fits `line` to the edges within ever smaller windows: (rows to either side, rows that steps are taken over). `None`
    /// where too few columns have an edge there.
    pub fn refine(
        &mut self,
        scene: &LineSearch<'_>,
        mut line: HorizonLine,
        windows: &[(usize, usize)],
        wanted: impl Fn(usize) -> bool,
    ) -> Option<HorizonFit> {
        /// Windows from this on may hold other edges than the line's, rows.
        const WIDE: usize = 12;
        let mut fit = None;
        for (window, size) in windows {
            self.gather(scene, &line, *window, *size, &wanted);
            if *window >= WIDE {
                line = self.consensus(scene, line);
            }
            let found = self.solve(scene, line)?;
            line = found.line;
            fit = Some(found);
        }
        fit
    }

    fn gather(
        &mut self,
        scene: &LineSearch<'_>,
        line: &HorizonLine,
        window: usize,
        size: usize,
        wanted: impl Fn(usize) -> bool,
    ) {
        /// A step that is larger than this says no more about its place, codes.
        const STEP_FULL: f32 = 15.0;
        self.points.clear();
        let size = line.step_rows(size);
        let window = window.max(size);
        for column in (0..scene.cells.columns).filter(|c| wanted(*c)) {
            let Some(row) = line.row(scene, column) else { continue };
            let Some((row, step)) = edge_near(scene, line, column, row, window, size) else { continue };
            let Some((ray, down)) = scene.rays.at(column, row) else { continue };
            let quiet = quiet(scene.cells, column, row as usize, step, scene.floor).unwrap_or(0.5);
            let weight = f64::from(quiet * step.min(STEP_FULL) / STEP_FULL);
            self.points.push(EdgePoint { column, row, off: 0.0, ray, down, weight });
        }
    }

    /// The line through two of the points that most others agree with, where they agree with it better than with `line`: half
    /// of the columns may show land, which no average forgives.
    fn consensus(&mut self, scene: &LineSearch<'_>, line: HorizonLine) -> HorizonLine {
        /// Pairs of points tried of each distance.
        const PAIRS: usize = 24;
        let mut best = (self.agreement(scene, &line), line);
        let count = self.points.len();
        for lag in [count / 2, count / 3, count / 5, count / 9] {
            for first in (0..count).step_by((count / PAIRS).max(1)) {
                let (Some(a), Some(b)) = (self.points.get(first), self.points.get(first + lag.max(1))) else {
                    break;
                };
                let Some(angles) = through(a.ray, b.ray, scene.sin_dip) else { continue };
                let line = HorizonLine { angles, ..line };
                let agreement = self.agreement(scene, &line);
                if agreement > best.0 {
                    best = (agreement, line);
                }
            }
        }
        best.1
    }

    /// Weight of the points near the line, those on it most.
    fn agreement(&self, scene: &LineSearch<'_>, line: &HorizonLine) -> f64 {
        /// A point agrees with a line within this, rows.
        const AGREE: f64 = 2.5;
        let up = line.up();
        let share = |p: &EdgePoint| {
            let off = (p.ray.dot(up) + scene.sin_dip) / -p.down.dot(up).min(-1e-9) / AGREE;
            p.weight * (1.0 - off * off).max(0.0)
        };
        self.points.iter().map(share).sum()
    }

    fn solve(&mut self, scene: &LineSearch<'_>, mut line: HorizonLine) -> Option<HorizonFit> {
        /// Fewer columns than this are no line.
        const POINTS_MIN: usize = 10;
        /// Rounds of reweighting at each window.
        const ROUNDS: usize = 4;
        let mut scatter = f64::INFINITY;
        let mut covariance = DMat2::IDENTITY;
        for _ in 0..ROUNDS {
            if self.points.len() < POINTS_MIN {
                return None;
            }
            self.measure(scene, &line);
            scatter = self.scatter();
            let (normal, right) = self.equations(&line, scatter);
            if normal.determinant() <= 1e-12 * (normal.col(0).x * normal.col(1).y).abs() {
                return None;
            }
            covariance = normal.inverse();
            line.angles -= covariance * right;
            if !line.angles.is_finite() {
                return None;
            }
        }
        self.measure(scene, &line);
        let covariance = covariance * (scatter * scatter * self.likeness(scatter));
        Some(HorizonFit { line, covariance })
    }

    /// How far each point lies from the line, in rows.
    fn measure(&mut self, scene: &LineSearch<'_>, line: &HorizonLine) {
        let up = line.up();
        for point in &mut self.points {
            point.off = (point.ray.dot(up) + scene.sin_dip) / -point.down.dot(up).min(-1e-9);
        }
    }

    /// Standard deviation of the points about the line from their lower distances, rows: land may hold more than half of them.
    fn scatter(&mut self) -> f64 {
        /// Columns are never told apart better than this, rows.
        const SCATTER_MIN: f64 = 0.08;
        self.offs.clear();
        self.offs.extend(self.points.iter().map(|p| p.off.abs()));
        let place = (self.offs.len() as f64 * SCATTER_SHARE) as usize;
        let (_, off, _) = self.offs.select_nth_unstable_by(place, f64::total_cmp);
        (*off * SCATTER_SCALE).max(SCATTER_MIN)
    }

    /// Normal equations of roll and elevation with Tukey's weights.
    fn equations(&self, line: &HorizonLine, scatter: f64) -> (DMat2, DVec2) {
        let (up, [by_roll, by_elevation]) = (line.up(), turns(line.angles));
        let (mut normal, mut right) = (DMat2::ZERO, DVec2::ZERO);
        for point in &self.points {
            let weight = point.weight * biweight(point.off, scatter);
            let fall = -point.down.dot(up).min(-1e-9);
            let slope = DVec2::new(point.ray.dot(by_roll), point.ray.dot(by_elevation)) / fall;
            normal += DMat2::from_cols(slope * slope.x, slope * slope.y) * weight;
            right += slope * (weight * point.off);
        }
        (normal, right)
    }

    /// How many times the variance is larger because neighbouring columns err alike: (1 + r) / (1 - r) for a correlation of r.
    fn likeness(&self, scatter: f64) -> f64 {
        let (mut squares, mut products, mut pairs, mut count) = (0.0, 0.0, 0.0, 0.0);
        let kept = |p: &EdgePoint| p.off.abs() < 3.0 * scatter;
        for pair in self.points.windows(2) {
            let [a, b] = pair else { continue };
            if kept(a) {
                squares += a.off * a.off;
                count += 1.0;
            }
            if kept(a) && kept(b) && b.column == a.column + 1 {
                products += a.off * b.off;
                pairs += 1.0;
            }
        }
        if squares <= 0.0 || pairs < 8.0 {
            return 2.0;
        }
        let r: f64 = ((products / pairs) / (squares / count)).clamp(0.0, 0.9);
        (1.0 + r) / (1.0 - r)
    }
}

/// The largest step in the line's sense within `window` rows of `row`, to a fraction of a row by a parabola, and its size.
/// `None` where it still grows at the window's edge.
fn edge_near(
    scene: &LineSearch<'_>,
    line: &HorizonLine,
    column: usize,
    row: f64,
    window: usize,
    size: usize,
) -> Option<(f64, f32)> {
    let middle = row.round() as usize;
    let rows = middle.saturating_sub(window)..=middle + window;
    let (best, most) = scene
        .cells
        .steps(column, rows.clone(), size)?
        .map(|(row, step)| (row, line.signed(step)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .filter(|(best, most)| *most > 0.0 && best != rows.start() && best != rows.end())?;
    let step = |row: usize| Some(line.signed(scene.cells.step(column, row, size)?));
    if scene.hidden.touches(column, best, size) {
        return None;
    }
    let (before, after) = (step(best.checked_sub(1)?)?, step(best + 1)?);
    let bend = before - 2.0 * most + after;
    let shift = if bend < 0.0 { (before - after) / (2.0 * bend) } else { 0.0 };
    Some((best as f64 + f64::from(shift.clamp(-0.5, 0.5)), most))
}
