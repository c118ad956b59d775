//! Steps from one brightness to another along the columns, and the lines on which they lie.

use std::ops::Range;

use glam::{DVec2, Vec2};

use super::{
    cells::{PictureCells, bend},
    mask::MaskedRows,
    rays::Rays,
};

/// Rows that steps are taken over, and how much a step counts: the shorter, the more of it is noise.
const SCALES: [(usize, f32); 3] = [(3, 0.7), (8, 1.0), (20, 1.0)];

/// Steps kept of a column.
const PER_COLUMN: usize = 4;

/// Steps of a column are farther from each other than this, rows.
const APART: usize = 6;

/// A step smaller than this is none, codes.
const STEP_MIN: f32 = 1.0;

/// A step counts no more than one of this size, codes: a white hull is no better horizon than a dark sea.
const STEP_MAX: f32 = 30.0;

/// Rows above an edge that should be sky.
const SKY: Range<usize> = 7..40;

/// Angle between the rolls that lines are sought at, radians.
const ROLL_STEP: f64 = std::f64::consts::PI / 180.0;

/// Steepest line that is sought, radians: beyond it too few columns cross it.
pub(super) const ROLL_MAX: f64 = 65.0 * std::f64::consts::PI / 180.0;

/// Breadth of a bin of the height at the axis, reduced pixels: half a step of roll moves the ends of a line as much.
const BIN_PX: f64 = 6.0;

/// Fewest and most bins of the height.
const BINS_MIN: usize = 3;
const BINS_MAX: usize = 1024;

/// A step of brightness.
#[derive(Clone, Copy, Debug)]
struct BrightnessStep {
    /// Where it lies on the plane at a distance of one before the camera.
    place: Vec2,
    weight: f32,
}

/// One of the steps that are kept of a column.
#[derive(Clone, Copy, Debug)]
struct KeptStep {
    row: usize,
    /// Codes, positive where it is brighter below.
    step: f32,
    weight: f32,
}

/// A line that many steps lie on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LineCandidate {
    /// Roll and elevation of the camera, radians.
    pub angles: DVec2,
    /// Whether the sea is brighter than the sky.
    pub brighter_below: bool,
}

/// Where lines are sought: rolls, elevations (radians).
#[derive(Clone, Copy, Debug)]
pub(super) struct LineSpan {
    pub roll: (f64, f64),
    pub elevation: (f64, f64),
}

/// How quiet the rows above `row` are, from 1 (sky) to 0: `floor` is what noise alone would give; clouds above a `step` of many
/// codes are quiet beside it.
pub(super) fn quiet(cells: &PictureCells, column: usize, row: usize, step: f32, floor: f32) -> Option<f32> {
    /// Rows that differ by this share of the step are as quiet as those that differ by the noise.
    const SHARE: f32 = 0.015;
    let wiggle = above(cells, column, row)?;
    Some(1.0 / (1.0 + (wiggle / (1.5 * floor.max(SHARE * step.abs()))).powi(2)))
}

/// How much the rows above `row` that should be sky differ from one to the next, codes; `None` too near the upper edge.
pub(super) fn above(cells: &PictureCells, column: usize, row: usize) -> Option<f32> {
    let top = row.saturating_sub(SKY.end).max(cells.rows().start);
    let bottom = row.checked_sub(SKY.start)?;
    if bottom < top + 6 {
        return None;
    }
    cells.wiggle(column, top..bottom)
}

/// Finds the strongest steps of each column and the lines through them.
#[derive(Clone, Debug, Default)]
pub(super) struct Seeker {
    response: Vec<f32>,
    edges: [Vec<BrightnessStep>; 2],
    taken: Vec<BrightnessStep>,
    votes: Vec<f32>,
}

impl Seeker {
    /// Collects steps; `rows` gives the rows of a column that are looked at. Returns how many there are.
    pub fn collect(
        &mut self,
        cells: &PictureCells,
        rays: &Rays,
        hidden: &MaskedRows,
        floor: f32,
        rows: impl Fn(usize) -> Range<usize>,
    ) -> usize {
        self.edges.iter_mut().for_each(Vec::clear);
        for column in 0..cells.columns {
            self.respond(cells, column);
            let weight = |row: usize, step: f32| {
                step.abs().min(STEP_MAX) * quiet(cells, column, row, step, floor).unwrap_or(0.5)
            };
            for KeptStep { row, step, weight } in
                self.strongest(cells, rows(column), weight).into_iter().flatten()
            {
                if hidden.touches(column, row, SCALES[1].0) {
                    continue;
                }
                let Some((ray, _)) = rays.at(column, row as f64) else { continue };
                let place = (ray.truncate() / ray.z.max(1e-3)).as_vec2();
                self.edges[usize::from(step > 0.0)].push(BrightnessStep { place, weight });
            }
        }
        self.edges.iter().map(Vec::len).sum()
    }

    /// The largest step at each row that was read, over any number of rows, in codes.
    fn respond(&mut self, cells: &PictureCells, column: usize) {
        let sums = cells.column(column);
        self.response.clear();
        self.response.resize(sums.len(), 0.0);
        for (size, gain) in SCALES {
            if sums.len() <= 2 * size {
                continue;
            }
            let gain = gain * cells.unit() / size as f32;
            let around = sums.iter().zip(&sums[size..]).zip(&sums[2 * size..]);
            for (best, ((above, at), below)) in self.response[size..].iter_mut().zip(around) {
                let step = bend(*above, *at, *below) as f32 * gain;
                *best = if step.abs() > best.abs() { step } else { *best };
            }
        }
    }

    /// The steps of the column responded to that `weigh` (row, step in codes; no more than the step's size) finds to count
    /// most. Below the horizon waves have larger steps than it, but no sky above them.
    fn strongest(
        &self,
        cells: &PictureCells,
        rows: Range<usize>,
        weigh: impl Fn(usize, f32) -> f32,
    ) -> [Option<KeptStep>; PER_COLUMN] {
        let offset = cells.rows().start;
        let mut kept: [Option<KeptStep>; PER_COLUMN] = [None; PER_COLUMN];
        let from = rows.start.saturating_sub(offset);
        let to = rows.end.saturating_sub(offset).min(self.response.len());
        let strength = |k: &Option<KeptStep>| k.map_or(0.0, |k| k.weight);
        let mut weakest = 0.0;
        for (i, around) in self.response.get(from..to).unwrap_or(&[]).windows(3).enumerate() {
            let size = around[1].abs();
            if size <= STEP_MIN.max(weakest) || size < around[0].abs() || size < around[2].abs() {
                continue;
            }
            let row = offset + from + i + 1;
            let weight = weigh(row, around[1]);
            // A stronger step near by is kept in place of this one, a weaker one makes room for it.
            let near = kept.iter().position(|k| k.is_some_and(|k| row.abs_diff(k.row) < APART));
            let place = near.or_else(|| {
                (0..PER_COLUMN).min_by(|a, b| strength(&kept[*a]).total_cmp(&strength(&kept[*b])))
            });
            if let Some(slot) = place.and_then(|p| kept.get_mut(p))
                && strength(slot) < weight
            {
                *slot = Some(KeptStep { row, step: around[1], weight });
            }
            weakest = kept.iter().map(strength).fold(f32::MAX, f32::min);
        }
        kept
    }

    /// The `N` lines with most steps on them, best first. The steps on a line that was found are not counted for those after
    /// it: a skyline would else be found again and again, turned a little about one of its points.
    pub fn lines<const N: usize>(
        &mut self,
        rays: &Rays,
        dip: f64,
        span: LineSpan,
    ) -> [Option<LineCandidate>; N] {
        let bin_size = (BIN_PX / rays.focal).max(2.0 * rays.reach / BINS_MAX as f64);
        let low = (span.elevation.0.tan() + dip).max(-rays.reach);
        let high = (span.elevation.1.tan() + dip).min(rays.reach);
        // A peak is told by its neighbours: in a coarse picture a prediction's span is less than three bins.
        let low = low.min(0.5 * (low + high) - 1.5 * bin_size);
        let bins = (((high - low) / bin_size).ceil().max(0.0) as usize + 1).clamp(BINS_MIN, BINS_MAX);
        let rolls = ((span.roll.1 - span.roll.0) / ROLL_STEP).ceil().max(0.0) as usize + 1;
        let grid = LineHistogram { low, bin_size, bins, roll_0: span.roll.0 };
        self.votes.clear();
        self.votes.resize(2 * bins * rolls, 0.0);
        for (edges, votes) in self.edges.iter().zip(self.votes.chunks_exact_mut(bins * rolls)) {
            grid.vote(edges, votes, 1.0);
        }
        let mut found = [None; N];
        // Only the votes from which a line was taken change.
        let mut peaks =
            [0, 1].map(|sign| self.votes.chunks_exact(bins * rolls).nth(sign).and_then(|v| grid.peak(v)));
        for slot in &mut found {
            let sign = match &peaks {
                [Some(darker), Some(brighter)] => usize::from(brighter.votes >= darker.votes),
                [Some(_), None] => 0,
                [None, Some(_)] => 1,
                [None, None] => break,
            };
            let Some(peak) = peaks[sign].take() else { break };
            let angles = grid.angles(&peak, dip);
            *slot = Some(LineCandidate { angles, brighter_below: sign == 1 });
            let (edges, taken) = (&mut self.edges[sign], &mut self.taken);
            taken.clear();
            edges.retain(|edge| {
                let stays = !grid.is_on(edge, &peak);
                if !stays {
                    taken.push(*edge);
                }
                stays
            });
            if let Some(votes) = self.votes.chunks_exact_mut(bins * rolls).nth(sign) {
                grid.vote(taken, votes, -1.0);
                peaks[sign] = grid.peak(votes);
            }
        }
        found
    }
}

/// Rolls, and heights at the picture's middle, that lines are counted by.
struct LineHistogram {
    low: f64,
    bin_size: f64,
    bins: usize,
    roll_0: f64,
}

/// A place of the grid with many votes.
struct Peak {
    roll: usize,
    bin: usize,
    votes: f32,
}

impl LineHistogram {
    fn roll(&self, roll: usize) -> f64 {
        self.roll_0 + roll as f64 * ROLL_STEP
    }

    /// Adds the edges' weights, times `sign`, to all lines through them.
    fn vote(&self, edges: &[BrightnessStep], votes: &mut [f32], sign: f32) {
        let per_bin = 1.0 / self.bin_size as f32;
        let low = self.low as f32 * per_bin;
        for (roll, votes) in votes.chunks_exact_mut(self.bins).enumerate() {
            let (sin, cos) = self.roll(roll).sin_cos();
            let (sin, cos) = (sin as f32 * per_bin, cos as f32 * per_bin);
            for edge in edges {
                let bin = edge.place.x * sin + edge.place.y * cos - low;
                if bin >= 0.0
                    && let Some(vote) = votes.get_mut(bin as usize)
                {
                    *vote += sign * edge.weight;
                }
            }
        }
    }

    /// The line with most votes, with half of what its neighbours have.
    fn peak(&self, votes: &[f32]) -> Option<Peak> {
        let mut best = Peak { roll: 0, bin: 0, votes: 1.0 };
        for (roll, line) in votes.chunks_exact(self.bins).enumerate() {
            let around = line.windows(3).map(|w| 0.5 * w[0] + w[1] + 0.5 * w[2]);
            for (i, votes) in around.enumerate() {
                if votes > best.votes {
                    best = Peak { roll, bin: i + 1, votes };
                }
            }
        }
        (best.bin > 0).then_some(best)
    }

    /// Roll and elevation of a camera that sees the horizon there.
    fn angles(&self, peak: &Peak, dip: f64) -> DVec2 {
        let tangent = self.low + (peak.bin as f64 + 0.5) * self.bin_size - dip;
        DVec2::new(self.roll(peak.roll), tangent.atan())
    }

    /// Whether the edge lies on that line, or next to it.
    fn is_on(&self, edge: &BrightnessStep, peak: &Peak) -> bool {
        let (sin, cos) = self.roll(peak.roll).sin_cos();
        let tangent = f64::from(edge.place.x) * sin + f64::from(edge.place.y) * cos;
        let bin = (tangent - self.low) / self.bin_size;
        (bin - (peak.bin as f64 + 0.5)).abs() <= 1.5
    }
}
