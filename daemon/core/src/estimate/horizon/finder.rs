//! The search for the horizon in one picture.

use std::ops::Range;

use glam::{DMat2, DVec2, DVec3};

use super::{
    answer::{Horizon, HorizonView, LineQuality, NoHorizon, Prior},
    cells::PictureCells,
    edges::{LineCandidate, LineSpan, ROLL_MAX, Seeker},
    fit::{Fitter, HorizonFit, HorizonLine, LineSearch, angles_of},
    judge::HorizonJudge,
    mask::MaskedRows,
    rays::Rays,
    steps::StepBlocks,
};
use crate::{event::Picture, geometry::horizon_dip, own_ship::Mask};

/// Share of a crisp edge's sharpness below which it is blurred: motion over 15 rows, or fog, which moves the edge that is seen.
const SHARPNESS_MIN: f64 = 0.3;

/// A prediction is sought within this many of its standard deviations...
const GATE_SIGMAS: f64 = 3.0;
/// ...and no closer than this, radians.
const GATE_MIN: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// Standard deviation of what moves all of an edge, reduced pixels: of a crisp one, and for each time that a step over 20
/// rows is larger than one over 3.
const SHIFT_PX: f64 = 0.1;
const SHIFT_SOFT_PX: f64 = 0.8;

/// Finds horizons; keeps its memory from picture to picture.
#[derive(Clone, Debug, Default)]
pub struct HorizonFinder {
    cells: PictureCells,
    rays: Rays,
    steps: StepBlocks,
    hidden: MaskedRows,
    seeker: Seeker,
    fitter: Fitter,
    judge: HorizonJudge,
    scratch: Vec<f32>,
}

impl HorizonFinder {
    /// A finder that has not seen a picture.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the mask of the own ship or gun in the pictures, from now on.
    pub fn set_mask(&mut self, mask: Option<Mask>) {
        self.hidden.set(mask);
    }

    /// The horizon of `picture`.
    pub fn find(&mut self, picture: &Picture, view: &HorizonView) -> Result<Horizon, NoHorizon> {
        /// A prediction less certain than this is none, radians.
        const GATE_MAX: f64 = 10.0 * std::f64::consts::PI / 180.0;
        /// Smallest picture, in cells and rows.
        const SIZE_MIN: (usize, usize) = (16, 64);
        self.cells.measure(picture);
        if self.cells.columns < SIZE_MIN.0 || self.cells.height < SIZE_MIN.1 {
            return Err(NoHorizon::TooSmall);
        }
        self.rays.make(&view.lens, &self.cells);
        self.hidden.lay(&self.cells);
        let dip = horizon_dip(view.eye_height_m);
        let gate = view.prior.map(|p| Gate::new(&p, dip.sin())).filter(|g| g.half <= GATE_MAX);
        let rows = match &gate {
            Some(gate) => gate.all_rows(&self.rays, &self.cells).ok_or(NoHorizon::OutOfView)?,
            None => 0..self.cells.height,
        };
        self.cells.fill(picture, rows);
        self.steps.measure(&self.cells);
        let floor = self.noise_floor();
        let (cells, rays) = (&self.cells, &self.rays);
        let count = self.seeker.collect(cells, rays, &self.hidden, floor, |column| match &gate {
            Some(gate) => gate.rows(rays, cells, column).unwrap_or(0..0),
            None => cells.rows(),
        });
        if count == 0 {
            return Err(NoHorizon::Featureless);
        }
        let lines: [Option<LineCandidate>; 6] = self.seeker.lines(&self.rays, dip, span(gate.as_ref()));
        let (fit, quality) = self.best(&lines, dip.sin(), floor).ok_or(NoHorizon::Featureless)?;
        refusal(&quality).map_or(Ok(()), Err)?;
        let up = fit.line.up();
        if gate.is_some_and(|g| g.up.angle_between(up) > 1.5 * g.half) {
            return Err(NoHorizon::Elsewhere(quality));
        }
        let covariance = fit.covariance + unseen(&quality, dip, self.rays.focal, self.cells.size.x);
        Ok(Horizon { up, covariance, quality })
    }

    /// Refines the lines roughly, and the best of them finely.
    fn best(
        &mut self,
        lines: &[Option<LineCandidate>],
        sin_dip: f64,
        floor: f32,
    ) -> Option<(HorizonFit, LineQuality)> {
        /// Score from which a line is so clear that no other need be tried.
        const SCORE_CLEAR: f64 = 1.2;
        let (cells, rays, steps, hidden) = (&self.cells, &self.rays, &self.steps, &self.hidden);
        let scene = LineSearch { cells, rays, steps, hidden, sin_dip, floor };
        let mut best: Option<(HorizonFit, LineQuality)> = None;
        for candidate in lines.iter().flatten() {
            let line = HorizonLine { angles: candidate.angles, brighter_below: candidate.brighter_below };
            let Some(mut fit) = self.fitter.refine(&scene, line, &[(12, 8), (6, 6)], |_| true) else {
                continue;
            };
            let mut quality = self.judge.weigh(&scene, &fit, self.fitter.survey(&scene, &fit.line));
            if quality.score < SCORE_CLEAR {
                // Land has pulled at the line before it was known for it.
                let free = self.judge.free();
                let freed = free.and_then(|free| self.fitter.refine(&scene, fit.line, &[(6, 6)], free));
                if let Some(freed) = freed {
                    fit = freed;
                    quality = self.judge.weigh(&scene, &fit, self.fitter.survey(&scene, &fit.line));
                }
            }
            if best.is_none_or(|(_, b)| b.score < quality.score) {
                best = Some((fit, quality));
                self.judge.keep();
            }
            if quality.score >= SCORE_CLEAR && refusal(&quality).is_none() {
                break;
            }
        }
        let (line, windows) = (best?.0.line, [(4, 4), (3, 3)]);
        let fit = match self.judge.kept_free() {
            Some(is_free) => self.fitter.refine(&scene, line, &windows, is_free),
            None => self.fitter.refine(&scene, line, &windows, |_| true),
        }?;
        let quality = self.judge.weigh(&scene, &fit, self.fitter.survey(&scene, &fit.line));
        Some((fit, quality))
    }

    /// How much rows differ from one to the next where nothing is but noise: a low quantile over pieces of the picture, codes.
    fn noise_floor(&mut self) -> f32 {
        /// Rows never differ less than this, codes: what rounding leaves.
        const NOISE_MIN: f32 = 0.3;
        let rows = self.cells.rows();
        self.scratch.clear();
        for column in (0..self.cells.columns).step_by(4) {
            for from in rows.clone().step_by(32) {
                self.scratch.extend(self.cells.wiggle(column, from..(from + 32).min(rows.end)));
            }
        }
        let tenth = self.scratch.len() / 10;
        if self.scratch.is_empty() {
            return NOISE_MIN;
        }
        let (_, low, _) = self.scratch.select_nth_unstable_by(tenth, f32::total_cmp);
        low.max(NOISE_MIN)
    }
}

/// Why a line with these qualities is not the horizon; `None` if it is.
fn refusal(quality: &LineQuality) -> Option<NoHorizon> {
    /// Score from which a line is taken for the horizon.
    const SCORE_MIN: f64 = 0.55;
    /// Share of the picture's width that shows it free at least: shorter edges are straight by chance.
    const FREE_MIN: f64 = 0.12;
    /// Contrast that a horizon has at least, codes.
    const CONTRAST_MIN: f64 = 2.0;
    /// Sky differs from row to row no more than this many times what noise does, or by this share of the step below it; trees,
    /// houses and rocks do.
    const TEXTURE_MAX: (f64, f64) = (2.0, 0.1);
    let (noises, steps) = TEXTURE_MAX;
    let texture_max = (noises * quality.noise).max(steps * quality.contrast);
    let free = quality.solid_share * quality.visible_share;
    if quality.score < SCORE_MIN || free < FREE_MIN || quality.contrast < CONTRAST_MIN {
        Some(NoHorizon::Unclear(*quality))
    } else if quality.sharpness < SHARPNESS_MIN {
        Some(NoHorizon::Blurred(*quality))
    } else if quality.texture > texture_max {
        Some(NoHorizon::Textured(*quality))
    } else {
        None
    }
}

/// Covariance of what the scatter of the columns does not show: haze and swell move all of an edge, and the more the softer
/// it is; and where land stands behind part of the line, the water may end before it does at the horizon: from an eye at
/// height h, a shore at a quarter of the horizon's distance lies lower by its dip (h / d + d / 2 R, less the square root of
/// 2 h / R).
fn unseen(quality: &LineQuality, dip: f64, focal_px: f64, width_px: f64) -> DMat2 {
    /// Standard deviation by which the line's ends are moved against each other.
    const TURN_PX: f64 = 0.05;
    let softness = (1.0 / quality.sharpness.clamp(SHARPNESS_MIN, 1.0) - 1.0).max(0.0);
    let shift = (SHIFT_PX + SHIFT_SOFT_PX * softness) / focal_px;
    let turn = TURN_PX * 2.0 / (quality.visible_share * width_px).max(1.0);
    let shore = quality.land_share * dip;
    DMat2::from_diagonal(DVec2::new(turn * turn, shift * shift + shore * shore))
}

/// Where a prediction lets the horizon be.
struct Gate {
    up: DVec3,
    angles: DVec2,
    half: f64,
    sin_dip: f64,
}

impl Gate {
    fn new(prior: &Prior, sin_dip: f64) -> Self {
        let up = prior.up.normalize_or(DVec3::NEG_Y);
        let half = (GATE_SIGMAS * prior.sigma.abs()).max(GATE_MIN);
        Self { up, angles: angles_of(up), half, sin_dip }
    }

    /// Rows in which a column may cross the horizon.
    fn rows(&self, rays: &Rays, cells: &PictureCells, column: usize) -> Option<Range<usize>> {
        let row = rays.crossing(column, self.up, self.sin_dip)?;
        let (ray, down) = rays.at(column, row)?;
        // Pitch moves a column's row by this much, roll by as much as it lies off the axis.
        let fall = -down.dot(self.up);
        let reach = 4.0 + self.half * (1.0 + ray.truncate().length()) / fall.max(1e-6);
        let (from, to) = (row - reach, row + reach);
        let rows = from.max(0.0) as usize..(to.max(0.0) as usize).min(cells.height);
        (rows.start < rows.end).then_some(rows)
    }

    /// Rows that have to be read.
    fn all_rows(&self, rays: &Rays, cells: &PictureCells) -> Option<Range<usize>> {
        /// Rows beyond the predicted ones that are read as well: the longest step, the sky above an edge, the parallels.
        const MARGIN: f64 = 60.0;
        let rows = (0..cells.columns).filter_map(|column| self.rows(rays, cells, column));
        let all = rows.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end))?;
        let margin = MARGIN as usize;
        Some(all.start.saturating_sub(margin)..(all.end + margin).min(cells.height))
    }
}

/// Rolls and elevations that lines are sought at.
fn span(gate: Option<&Gate>) -> LineSpan {
    match gate {
        Some(g) => {
            let around = |angle: f64| (angle - g.half, angle + g.half);
            LineSpan { roll: around(g.angles.x), elevation: around(g.angles.y) }
        }
        None => LineSpan { roll: (-ROLL_MAX, ROLL_MAX), elevation: (-1.4, 1.4) },
    }
}
