//! A patch of a picture, found again in another.
//!
//! Lucas and Kanade 1981, inverse compositional (Baker & Matthews 2004, fig. 3): slopes and their normal matrix belong to the patch and are
//! made once. How the patch is turned and stretched in the other picture is foretold by lens and orientation; only its place is sought. Mean
//! and contrast may differ, as exposure does.

use glam::{DMat2, DVec2, Vec2};

use super::pyramid::{GreyPyramid, LEVELS, PyramidLevel};

/// Half the side of a patch without its middle, pixels.
pub(super) const HALF: i32 = 7;
const SIDE: usize = 15;
const COUNT: usize = SIDE * SIDE;
const COUNT_F: f32 = COUNT as f32;
/// Steps on a level.
const STEPS: usize = 8;
/// Noise is no more than this share of a patch's variance: it then looks nine tenths like itself again.
const NOISE_SHARE_MAX: f32 = 0.1;
/// The coarsest level that a place is told on.
const FINEST_MAX: usize = LEVELS - 2;
/// A step shorter than this is the last, pixels of the level: of the finest one and of the others.
const STEP_SMALL: (f32, f32) = (0.02, 0.2);
/// A patch whose codes vary by less than this (mean square) has nothing on it.
const POWER_MIN: f32 = 1e-2;
/// A patch is not sought farther from where it is foretold than this, pixels of the level.
const REACH: f32 = 6.0;

/// How a patch looks on one level.
#[derive(Clone, Debug)]
struct PatchTemplate {
    codes: [f32; COUNT],
    across: [f32; COUNT],
    down: [f32; COUNT],
    /// Sums of the slopes, and of the slopes times the codes.
    slopes: Vec2,
    pull: Vec2,
    /// The inverse of the normal matrix: xx, xy, yy.
    inverse: [f32; 3],
    /// Sum of the squared codes, which have no mean.
    power: f32,
}

/// A patch of a picture to be found in others: how it looks on the levels on which it is whole and stands out from the noise.
#[derive(Clone, Debug)]
pub struct SkyPatch {
    levels: [Option<PatchTemplate>; LEVELS],
    /// The finest of these.
    finest: usize,
}

/// Where a patch was found.
#[derive(Clone, Copy, Debug)]
pub struct PatchMatch {
    /// Pixels of the finest level.
    pub place: DVec2,
    /// Correlation coefficient with what it looked like.
    pub likeness: f32,
}

/// Sums over what a patch is held against.
#[derive(Default)]
struct MatchSums {
    codes: f32,
    squares: f32,
    likeness: f32,
    pull: Vec2,
}

impl SkyPatch {
    /// The patch about a place of the finest level; `None` where it is not whole or has no texture but noise.
    pub fn take(pyramid: &GreyPyramid, place: DVec2) -> Option<Self> {
        let mut levels = [const { None }; LEVELS];
        for (k, (slot, level)) in levels.iter_mut().zip(&pyramid.levels).enumerate() {
            // A mean over four pixels has half of their noise.
            let noise = pyramid.noise / f32::from(1u8 << k);
            let least = COUNT_F * noise * noise / NOISE_SHARE_MAX;
            *slot = PatchTemplate::take(level, on_level(place, k)).filter(|t| t.power > least);
        }
        let finest = levels.iter().position(Option::is_some).filter(|k| *k <= FINEST_MAX)?;
        Some(Self { levels, finest })
    }

    /// Pixels of the finest level in one of the level that its place is told on.
    pub fn unit(&self) -> f64 {
        f64::from(1u32 << self.finest)
    }

    /// Seeks the patch from level `coarsest` down, near `guess`; `turned` takes offsets in the patch to offsets in this picture.
    pub fn find(
        &self,
        pyramid: &GreyPyramid,
        guess: DVec2,
        turned: DMat2,
        coarsest: usize,
    ) -> Option<PatchMatch> {
        let turned = turned.as_mat2().to_cols_array();
        let mut place = guess;
        let mut likeness = 0.0;
        for k in (self.finest..=coarsest.clamp(self.finest, LEVELS - 1)).rev() {
            let (Some(template), Some(level)) = (self.levels[k].as_ref(), pyramid.levels.get(k)) else {
                continue;
            };
            let small = if k == self.finest { STEP_SMALL.0 } else { STEP_SMALL.1 };
            match template.find(level, on_level(place, k), turned, small) {
                Some((at, like)) => {
                    place = at.as_dvec2() * f64::from(1u32 << k);
                    likeness = like;
                }
                // On a coarse level it may hang over the edge of what was read.
                None if k > self.finest => {}
                None => return None,
            }
        }
        Some(PatchMatch { place, likeness })
    }
}

fn on_level(place: DVec2, level: usize) -> Vec2 {
    (place / f64::from(1u32 << level)).as_vec2()
}

impl PatchTemplate {
    fn take(level: &PyramidLevel, place: Vec2) -> Option<Self> {
        const WIDE: usize = SIDE + 2;
        let mut wide = [0.0; WIDE * WIDE];
        let from = place - Vec2::splat(HALF as f32 + 1.0);
        let mut i = 0;
        level.visit(from, [1.0, 0.0, 0.0, 1.0], WIDE, |code| {
            wide[i] = code;
            i += 1;
        })?;
        let mut out = Self {
            codes: [0.0; COUNT],
            across: [0.0; COUNT],
            down: [0.0; COUNT],
            slopes: Vec2::ZERO,
            pull: Vec2::ZERO,
            inverse: [0.0; 3],
            power: 0.0,
        };
        for i in 0..COUNT {
            let at = (i / SIDE + 1) * WIDE + i % SIDE + 1;
            out.codes[i] = wide[at];
            out.across[i] = 0.5 * (wide[at + 1] - wide[at - 1]);
            out.down[i] = 0.5 * (wide[at + WIDE] - wide[at - WIDE]);
        }
        let mean = out.codes.iter().sum::<f32>() / COUNT_F;
        let mut normal = [0.0; 3];
        for i in 0..COUNT {
            out.codes[i] -= mean;
            let (code, slope) = (out.codes[i], Vec2::new(out.across[i], out.down[i]));
            out.power += code * code;
            out.slopes += slope;
            out.pull += slope * code;
            normal[0] += slope.x * slope.x;
            normal[1] += slope.x * slope.y;
            normal[2] += slope.y * slope.y;
        }
        let [xx, xy, yy] = normal;
        let determinant = xx * yy - xy * xy;
        // An edge alone does not tell where along it the patch lies.
        if determinant <= 1e-4 * (xx + yy) * (xx + yy) || out.power <= COUNT_F * POWER_MIN {
            return None;
        }
        out.inverse = [yy / determinant, -xy / determinant, xx / determinant];
        Some(out)
    }

    fn find(&self, level: &PyramidLevel, guess: Vec2, turned: [f32; 4], small: f32) -> Option<(Vec2, f32)> {
        let [xx, xy, yx, yy] = turned;
        let mut at = guess;
        for _ in 0..STEPS {
            let sums = self.compare(level, at, turned)?;
            let mean = sums.codes / COUNT_F;
            let power = sums.squares - sums.codes * mean;
            if power <= COUNT_F * POWER_MIN {
                return None;
            }
            let contrast = (power / self.power).sqrt();
            let pull = (sums.pull - self.slopes * mean) / contrast - self.pull;
            let [a, b, c] = self.inverse;
            let step = Vec2::new(a * pull.x + b * pull.y, b * pull.x + c * pull.y);
            at -= Vec2::new(xx * step.x + yx * step.y, xy * step.x + yy * step.y);
            if !at.is_finite() || at.distance(guess) > REACH {
                return None;
            }
            if step.length() < small {
                return Some((at, sums.likeness / (power * self.power).sqrt()));
            }
        }
        None
    }

    /// `turned` in columns.
    fn compare(&self, level: &PyramidLevel, at: Vec2, turned: [f32; 4]) -> Option<MatchSums> {
        let [xx, xy, yx, yy] = turned;
        let half = HALF as f32;
        let from = at - Vec2::new(xx + yx, xy + yy) * half;
        let mut sums = MatchSums::default();
        let mut own = self.codes.iter().zip(self.across.iter().zip(&self.down));
        level.visit(from, turned, SIDE, |code| {
            if let Some((template, (across, down))) = own.next() {
                sums.codes += code;
                sums.squares += code * code;
                sums.likeness += code * template;
                sums.pull.x += code * across;
                sums.pull.y += code * down;
            }
        })?;
        Some(sums)
    }
}

impl PyramidLevel {
    /// Shows `see` the bilinear codes of `side` by `side` places from `from` on, row by row; `steps` are a step to the right and one down.
    /// `None` where not all of them were read.
    fn visit(&self, from: Vec2, steps: [f32; 4], side: usize, mut see: impl FnMut(f32)) -> Option<()> {
        let corner = from - Vec2::new(0.5, 0.5 + self.rows.start as f32);
        let (right, down) = (Vec2::new(steps[0], steps[1]), Vec2::new(steps[2], steps[3]));
        let reach = (side - 1) as f32;
        let far = [corner, corner + right * reach, corner + down * reach, corner + (right + down) * reach];
        let low = far.iter().fold(Vec2::splat(f32::MAX), |a, b| a.min(*b));
        let high = far.iter().fold(Vec2::splat(f32::MIN), |a, b| a.max(*b));
        let inside = low.x >= 0.0
            && low.y >= 0.0
            && high.x < self.width as f32 - 1.0
            && high.y < self.rows.len() as f32 - 1.0;
        if !inside {
            return None;
        }
        for row in 0..side {
            let mut at = corner + down * row as f32;
            for _ in 0..side {
                let (x, y) = (at.x.max(0.0) as usize, at.y.max(0.0) as usize);
                let (u, v) = (at.x - x as f32, at.y - y as f32);
                let i = y * self.width + x;
                let (upper, lower) =
                    (self.codes.get(i..i + 2)?, self.codes.get(i + self.width..i + self.width + 2)?);
                let ([a, b], [c, d]) = (upper, lower) else { return None };
                let (top, bottom) = (a + (b - a) * u, c + (d - c) * u);
                see(top + (bottom - top) * v);
                at += right;
            }
        }
        Some(())
    }
}
