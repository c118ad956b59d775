//! A tag's corner to a fraction of a pixel.
//!
//! Around a corner two dark and two bright fields meet, so that the picture turned by half a turn about the corner is the same picture,
//! however blurred, smeared or slanted it is. The place about which it differs least from itself is the corner: as good as fitting the
//! true shape, without knowing it. It is approached along the edges, whose normals all pass the corner by (Förstner & Gülch 1987).

use glam::DVec2;

use super::picture::Plane;

/// How corners are found to fractions of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refinement {
    /// Where edges meet, in a window of so many pixels to every side at most.
    Edges(f64),
    /// Where the picture is most like itself turned by half a turn.
    Symmetry(f64),
}

impl Refinement {
    /// Choice of [`super::detect`]: larger windows err hardly less.
    pub const DEFAULT: Self = Self::Symmetry(8.0);

    const fn reach_px(self) -> f64 {
        match self {
            Self::Edges(reach) | Self::Symmetry(reach) => reach,
        }
    }
}

/// Least window, and the largest while a corner is approached, pixels.
const REACH_MIN: f64 = 2.0;
const APPROACH_PX: f64 = 8.0;

/// Pixels around a place, sampled between pixels.
struct CornerPatch {
    reach: i32,
    side: usize,
    values: Vec<f64>,
}

impl CornerPatch {
    fn around(plane: &Plane, place: DVec2, reach: i32) -> Self {
        let side = (2 * reach + 3) as usize;
        let step = |i: usize| i as f64 - f64::from(reach) - 1.0;
        let values =
            (0..side * side).map(|i| plane.at(place + DVec2::new(step(i % side), step(i / side)))).collect();
        Self { reach, side, values }
    }

    fn get(&self, dx: i32, dy: i32) -> f64 {
        let along = |d: i32| (d + self.reach + 1) as usize;
        self.values[along(dy) * self.side + along(dx)]
    }

    fn slope(&self, dx: i32, dy: i32) -> DVec2 {
        DVec2::new(self.get(dx + 1, dy) - self.get(dx - 1, dy), self.get(dx, dy + 1) - self.get(dx, dy - 1))
            * 0.5
    }

    /// Offsets within the window and their weights.
    fn offsets(&self) -> impl Iterator<Item = (i32, i32, f64)> + use<> {
        let (n, limit) = (self.reach, f64::from(self.reach * self.reach) + 0.5);
        (-n..=n).flat_map(move |y| (-n..=n).map(move |x| (x, y))).filter_map(move |(x, y)| {
            let square = f64::from(x * x + y * y);
            (square <= limit).then(|| (x, y, (-1.5 * square / limit).exp()))
        })
    }

    fn mean(&self) -> f64 {
        let add = |(sum, weights), (x, y, weight)| (sum + weight * self.get(x, y), weights + weight);
        let (sum, weights) = self.offsets().fold((0.0, 0.0), add);
        sum / weights
    }
}

/// Two equations for two unknowns, from sums of products.
#[derive(Default)]
struct CornerSums {
    xx: f64,
    xy: f64,
    yy: f64,
    right: DVec2,
}

impl CornerSums {
    fn add(&mut self, slope: DVec2, value: f64, weight: f64) {
        self.xx += weight * slope.x * slope.x;
        self.xy += weight * slope.x * slope.y;
        self.yy += weight * slope.y * slope.y;
        self.right += slope * (value * weight);
    }

    fn solve(&self) -> Option<DVec2> {
        /// Least of the smaller by the larger spread of edge directions: one edge alone is no corner.
        const EDGES: f64 = 0.04;
        let det = self.xx * self.yy - self.xy * self.xy;
        let mean = 0.5 * (self.xx + self.yy);
        // The eigenvalues' ratio, from their sum and product.
        let root = (mean * mean - det).max(0.0).sqrt();
        if mean <= 0.0 || (mean - root) < EDGES * (mean + root) {
            return None;
        }
        let step = DVec2::new(
            self.yy * self.right.x - self.xy * self.right.y,
            self.xx * self.right.y - self.xy * self.right.x,
        ) / det;
        step.is_finite().then_some(step)
    }
}

/// Half the side of the window about a corner of a tag of that height, `most` at most, pixels.
fn window(tag_px: f64, most: f64) -> i32 {
    /// The window by the tag's smallest height: within two modules of ten and three of gap there is nothing but the corner.
    const REACH_SHARE: f64 = 0.13;
    (REACH_SHARE * tag_px).min(most).max(REACH_MIN).round() as i32
}

/// One step towards where the edges' lines meet.
fn towards_edges(plane: &Plane, place: DVec2, reach: i32) -> Option<DVec2> {
    let patch = CornerPatch::around(plane, place, reach);
    let mut sums = CornerSums::default();
    for (x, y, weight) in patch.offsets() {
        let slope = patch.slope(x, y);
        sums.add(slope, slope.dot(DVec2::new(f64::from(x), f64::from(y))), weight);
    }
    sums.solve()
}

/// One step towards where the picture is most like itself turned by half a turn, and how like it is now.
fn towards_symmetry(plane: &Plane, place: DVec2, reach: i32) -> Option<(DVec2, f64)> {
    let patch = CornerPatch::around(plane, place, reach);
    let mean = patch.mean();
    let mut sums = CornerSums::default();
    let (mut both, mut own) = (0.0, 1e-9);
    for (x, y, weight) in patch.offsets() {
        let (here, there) = (patch.get(x, y), patch.get(-x, -y));
        both += weight * (here - mean) * (there - mean);
        own += weight * (here - mean) * (here - mean);
        sums.add(patch.slope(x, y) - patch.slope(-x, -y), there - here, weight);
    }
    Some((sums.solve()?, both / own))
}

/// Whether the edges that cross at `place` run along `sides`: what covers a corner makes others with the tag's.
pub(super) fn crosses(plane: &Plane, place: DVec2, sides: [DVec2; 2], tag_px: f64, by: Refinement) -> bool {
    /// Half the widths of the edges, sharp and blurred, whose crossings a corner is held against, by the window's reach...
    const SOFT: [f64; 3] = [0.2, 0.5, 1.0];
    /// ...and its least correlation with the best of them. At 0.95 boards that are tilted by 60 degrees, edges askew, lose six tags of ten, at 0.9
    /// none; with rectangles over the board it takes nearly all corners more than two pixels off.
    const CROSSING: f64 = 0.9;
    let reach = window(tag_px, by.reach_px());
    let patch = CornerPatch::around(plane, place, reach);
    let mean = patch.mean();
    // Noise is another half a turn on, so that it does not count.
    let mut own = 0.0;
    for (x, y, weight) in patch.offsets() {
        own += weight * (patch.get(x, y) - mean) * (patch.get(-x, -y) - mean);
    }
    let normals = sides.map(|s| s.perp().normalize_or_zero());
    let widths = SOFT.into_iter().flat_map(|one| SOFT.map(|other| [one, other]));
    let most = widths.map(|soft| {
        let (mut both, mut square, mut sum, mut weights) = (0.0, 0.0, 0.0, 0.0);
        for (x, y, weight) in patch.offsets() {
            let off = DVec2::new(f64::from(x), f64::from(y)) / f64::from(reach);
            let [one, other] = [0, 1].map(|i| (normals[i].dot(off) / soft[i]).clamp(-1.0, 1.0));
            both += weight * one * other * (patch.get(x, y) - mean);
            square += weight * (one * other).powi(2);
            sum += weight * one * other;
            weights += weight;
        }
        let ideal = square - sum * sum / weights;
        both.abs() / (ideal * own).max(1e-9).sqrt()
    });
    most.fold(0.0, f64::max) >= CROSSING
}

/// The corner near `start`, pixels of this plane, of a tag whose smallest height is `tag_px` there; `None` where there is none.
pub(super) fn refine(plane: &Plane, start: DVec2, tag_px: f64, by: Refinement) -> Option<DVec2> {
    /// How far the corner may be from where it was expected, by the tag's smallest height, and pixels more.
    const OFF_SHARE: f64 = 0.1;
    const OFF_PX: f64 = 1.0;
    /// Least correlation of the window with itself turned by half a turn: what covers a corner, or glare, is not symmetric.
    const LIKENESS: f64 = 0.9;
    let off_max = OFF_SHARE * tag_px + OFF_PX;
    let reach = window(tag_px, APPROACH_PX);
    let fine = |p: DVec2| plane.surrounds(p, f64::from(reach) + 1.0) && p.distance(start) <= off_max;
    let mut place = start;
    for _ in 0..6 {
        if !fine(place) {
            return None;
        }
        let step = towards_edges(plane, place, reach)?;
        place += step.clamp_length_max(f64::from(reach));
        if step.length() < 0.1 {
            break;
        }
    }
    let reach = window(tag_px, by.reach_px());
    for _ in 0..12 {
        if !fine(place) {
            return None;
        }
        let (step, likeness, near) = match by {
            // As OpenCV ends: small windows do not come to rest.
            Refinement::Edges(_) => (towards_edges(plane, place, reach)?, 1.0, 0.1),
            Refinement::Symmetry(_) => {
                let (step, likeness) = towards_symmetry(plane, place, reach)?;
                (step, likeness, 2e-3)
            }
        };
        place += step.clamp_length_max(0.7);
        if step.length() < near {
            return (likeness >= LIKENESS && fine(place)).then_some(place);
        }
    }
    None
}
