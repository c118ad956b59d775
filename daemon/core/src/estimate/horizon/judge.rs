//! Whether a line is the sea's horizon.

use super::{
    answer::LineQuality,
    columns::{ColumnViews, STEP, Shown},
    edges::above,
    fit::{EdgePoint, HorizonFit, LineSearch},
};

/// Contrast at which a line is no worse for being faint, codes.
const CONTRAST_FULL: f64 = 15.0;

/// Rows from the line to the parallels that it is compared with.
const PARALLELS: [f64; 11] = [8.0, 12.0, 16.0, 20.0, 24.0, 28.0, 32.0, 36.0, 40.0, 44.0, 48.0];

/// A column's step counts no more than this, codes, so that one white boat does not make a line.
const STEP_MAX: f32 = 40.0;

/// Parallels are never quieter than this, codes.
const PARALLEL_MIN: f32 = 0.3;

/// A point is on the line within this distance across it, reduced pixels.
const INLIER: f64 = 1.5;

/// A line whose points scatter more than this is the worse for it, rows: skylines of hills do.
const SCATTER_FULL: f64 = 0.3;

/// Neighbouring columns to either side by which a point is judged...
const NEIGHBOURS: usize = 4;
/// ...and how many of these must have a point on the line too. Where the strongest edge lies on the line by chance in half of
/// the columns, one in seven passes; of a real edge almost all do.
const NEIGHBOURS_MIN: usize = 6;

/// Memory of the judgement.
#[derive(Clone, Debug, Default)]
pub(super) struct HorizonJudge {
    on_line: Vec<bool>,
    /// Columns whose neighbours agree with them.
    solid: Vec<bool>,
    views: ColumnViews,
    /// The views of a line that was weighed before.
    kept: ColumnViews,
    values: Vec<f32>,
}

fn free_of(views: &ColumnViews) -> Option<impl Fn(usize) -> bool> {
    /// Fewer columns are better fitted with their neighbours.
    const FREE_MIN: usize = 16;
    (views.count(Shown::Free) >= FREE_MIN).then_some(|column| views.is_free(column))
}

impl HorizonJudge {
    /// What speaks for and against the line, of which `points` are the strongest edges around it.
    pub fn weigh(&mut self, scene: &LineSearch<'_>, fit: &HorizonFit, points: &[EdgePoint]) -> LineQuality {
        self.mark(scene, fit, points);
        self.views.look(scene, &fit.line, points, &self.solid);
        let columns = scene.cells.columns.max(1) as f64;
        let visible = (0..scene.cells.columns).filter(|c| fit.line.row(scene, *c).is_some()).count();
        let count = |what: Shown| self.views.count(what);
        let share = |part: usize, free: usize| part as f64 / (part + free).max(1) as f64;
        let free = count(Shown::Free);
        let (contrast, peak_ratio) = self.contrast(scene, fit);
        let mut quality = LineQuality {
            columns: free,
            solid_share: free as f64 / visible.max(1) as f64,
            land_share: share(count(Shown::Land), free),
            past_share: share(count(Shown::Past), free),
            above_share: share(count(Shown::Above), free),
            open_share: self.views.open as f64 / free.max(1) as f64,
            visible_share: visible as f64 / columns,
            contrast,
            peak_ratio,
            texture: self.texture(scene, points),
            noise: f64::from(scene.floor),
            sharpness: self.sharpness(scene, fit, points),
            scatter_px: self.scatter(points) * fit.line.angles.x.cos(),
            score: 0.0,
        };
        quality.score = quality.solid_share.sqrt()
            * (1.0 - 2.0 * quality.past_share).max(0.0)
            * (1.0 - 1.5 * quality.above_share).max(0.0)
            * (1.0 - quality.land_share)
            * if fit.line.brighter_below {
                quality.open_share.powi(2)
            } else {
                (0.5 + 0.5 * quality.open_share).sqrt()
            }
            * (SCATTER_FULL / quality.scatter_px).min(1.0)
            * quality.visible_share.sqrt()
            * (quality.peak_ratio / 1.5).ln().max(0.0)
            * 1.3
            * (0.4 + quality.contrast / CONTRAST_FULL).clamp(0.0, 1.0);
        quality
    }

    fn mark(&mut self, scene: &LineSearch<'_>, fit: &HorizonFit, points: &[EdgePoint]) {
        self.on_line.clear();
        self.on_line.resize(scene.cells.columns, false);
        let across = fit.line.angles.x.cos();
        for point in points.iter().filter(|p| p.off.abs() * across < INLIER) {
            if let Some(on_line) = self.on_line.get_mut(point.column) {
                *on_line = true;
            }
        }
        let on_line = &self.on_line;
        let solid = |column: usize| {
            let around = column.saturating_sub(NEIGHBOURS)..(column + NEIGHBOURS + 1).min(on_line.len());
            // At the picture's sides there are fewer neighbours.
            let wanted = NEIGHBOURS_MIN * (around.len() - 1) / (2 * NEIGHBOURS);
            on_line[column] && on_line[around].iter().filter(|o| **o).count() > wanted
        };
        self.solid.clear();
        self.solid.extend((0..on_line.len()).map(solid));
    }

    fn is_free(&self, column: usize) -> bool {
        self.views.is_free(column)
    }

    /// Keeps what the columns of the line weighed last show.
    pub fn keep(&mut self) {
        std::mem::swap(&mut self.views, &mut self.kept);
    }

    /// Columns in which the line that was weighed last is free; `None` where they are too few to fit a line to.
    pub fn free(&self) -> Option<impl Fn(usize) -> bool> {
        free_of(&self.views)
    }

    /// The same of the line that was kept.
    pub fn kept_free(&self) -> Option<impl Fn(usize) -> bool> {
        free_of(&self.kept)
    }

    /// Mean step of the solid columns on the line, codes, and that over the root mean square of those on its parallels.
    fn contrast(&self, scene: &LineSearch<'_>, fit: &HorizonFit) -> (f64, f64) {
        let line = &fit.line;
        let size = line.step_rows(STEP);
        let scale = scene.cells.scale();
        let mut on = (0.0_f32, 0_usize);
        let mut off = [(0.0_f32, 0_usize); 2 * PARALLELS.len()];
        for column in (0..scene.cells.columns).filter(|c| self.is_free(*c)) {
            let Some(row) = line.row(scene, column) else { continue };
            let add = |shift: i32, (sum, count): &mut (f32, usize)| {
                let Ok(row) = usize::try_from(row.round() as i32 + shift) else { return };
                if scene.hidden.touches(column, row, size) {
                    return;
                }
                if let Some(step) = scene.cells.step(column, row, size) {
                    *sum += line.signed(step).clamp(-STEP_MAX, STEP_MAX);
                    *count += 1;
                }
            };
            add(0, &mut on);
            let parallels = PARALLELS.map(|p| (p * scale).round().max((size + 1) as f64) as i32);
            parallels.iter().flat_map(|p| [-*p, *p]).zip(&mut off).for_each(|(shift, sum)| add(shift, sum));
        }
        let on_line = on.0 / on.1.max(1) as f32;
        // A sky that brightens downwards has steps everywhere, half of which the line's own step holds.
        let side = |below: usize| {
            let means = off.iter().skip(below).step_by(2).filter(move |(_, count)| *count * 2 > on.1);
            means.map(|(sum, n)| sum / *n as f32)
        };
        let mean = |below: usize| {
            let (sum, n) = side(below).fold((0.0, 0.0_f32), |(sum, n), mean| (sum + mean, n + 1.0));
            if n > 2.0 { sum / n } else { 0.0 }
        };
        let slope = mean(0);
        let contrast = on_line - 0.5 * slope.max(0.0);
        let squares = side(0).map(|m| (m - slope) * (m - slope)).chain(side(1).map(|m| m * m));
        let (squares, count) = squares.fold((0.0, 0.0_f32), |(sum, n), square| (sum + square, n + 1.0));
        let rms = if count > 0.0 { (squares / count).sqrt() } else { f32::INFINITY };
        (f64::from(contrast), f64::from((contrast / rms.max(PARALLEL_MIN)).max(0.0)))
    }

    /// Standard deviation of the solid columns' points about the line, rows: by the mean distance.
    fn scatter(&self, points: &[EdgePoint]) -> f64 {
        let offs = points.iter().filter(|p| self.is_free(p.column)).map(|p| p.off.abs());
        let (sum, count) = offs.fold((0.0, 0.0), |(sum, n), off| (sum + off, n + 1.0));
        (std::f64::consts::PI / 2.0).sqrt() * sum / f64::max(count, 1.0)
    }

    /// How much rows above the solid columns' points differ, codes: the median.
    fn texture(&mut self, scene: &LineSearch<'_>, points: &[EdgePoint]) -> f64 {
        let (values, views) = (&mut self.values, &self.views);
        let points = points.iter().filter(|p| views.is_free(p.column));
        values.clear();
        values.extend(points.filter_map(|p| above(scene.cells, p.column, p.row as usize)));
        let middle = values.len() / 2;
        if values.is_empty() {
            return 0.0;
        }
        f64::from(*values.select_nth_unstable_by(middle, f32::total_cmp).1)
    }

    /// Share of the change over 20 rows that lies within 3: 1 for a crisp edge, less for one blurred by motion or haze.
    fn sharpness(&self, scene: &LineSearch<'_>, fit: &HorizonFit, points: &[EdgePoint]) -> f64 {
        let (mut short, mut long) = (0.0, 0.0);
        for point in points.iter().filter(|p| self.is_free(p.column)) {
            let row = point.row.round() as usize;
            let step = |size| scene.cells.step(point.column, row, fit.line.step_rows(size));
            if let (Some(a), Some(b)) = (step(3), step(20)) {
                short += fit.line.signed(a);
                long += fit.line.signed(b);
            }
        }
        if long > 0.0 { f64::from(short / long) } else { 1.0 }
    }
}
