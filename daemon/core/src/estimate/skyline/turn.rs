//! How the camera turned between two pictures, by the pictures alone: nothing that is believed of the orientation goes in.
//!
//! Patches all over the one picture are sought in the other where they were (Lucas & Kanade on the pyramid, `patch`). The turn that most
//! of them agree on is found by trying those of pairs (Fischler & Bolles 1981, without chance) and refined by weights (Tukey's biweight).

use std::ops::RangeInclusive;

use glam::{DMat2, DMat3, DVec2, DVec3};

use super::{
    SkyPatch, corners,
    grid::{FIELD, FieldGrid},
    patch::HALF,
    pyramid::{GreyPyramid, LEVELS},
};
use crate::{
    event::Picture,
    geometry::Lens,
    own_ship::Mask,
    statistics::{BIWEIGHT_END, biweight},
    time::Time,
};

/// Patches that are followed: fewer tell nothing.
const PATCHES: RangeInclusive<usize> = 8..=24;
/// Patches within so many reduced pixels of a turn speak for it.
const AGREE_PX: f64 = 1.5;

/// A turn of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurnSeen {
    /// Time of the picture before.
    pub from: Time,
    /// The turn since then about the camera's axes, radians.
    pub turn: DVec3,
    /// Covariance of its error by how the patches scatter, rad^2.
    pub covariance: DMat3,
    /// Patches that agree, and patches that were found.
    pub patches: (usize, usize),
}

/// A patch in both pictures: unit vectors in the camera's axes.
#[derive(Clone, Copy, Debug)]
struct Pair {
    before: DVec3,
    moved: DVec3,
}

impl Pair {
    /// What of its move a turn does not explain. What stands in the world moves by minus the turn.
    fn off(&self, turn: DVec3) -> DVec3 {
        self.moved - self.before.cross(turn)
    }

    /// Its part of the normal matrix and of the right side, least squares for the turn.
    fn normal(&self) -> (DMat3, DVec3) {
        let b = self.before;
        let outer = DMat3::from_cols(b * b.x, b * b.y, b * b.z);
        (DMat3::IDENTITY - outer, self.moved.cross(b))
    }
}

/// A picture that the next one is held against, and its lens.
#[derive(Clone, Debug)]
struct Begun {
    time: Time,
    picture: Picture,
    lens: Lens,
}

/// Finds how the camera turned from one picture to the next.
#[derive(Clone, Debug, Default)]
pub struct TurnFinder {
    pyramid: GreyPyramid,
    grid: FieldGrid,
    begun: Option<Begun>,
    patches: Vec<(DVec2, SkyPatch)>,
    pairs: Vec<Pair>,
}

impl TurnFinder {
    /// Sets the mask of the own ship or gun in the pictures, from now on.
    pub fn set_mask(&mut self, mask: Option<Mask>) {
        self.grid.set_mask(mask);
    }

    /// Whether a picture was taken that the next one is to be held against.
    pub fn is_begun(&self) -> bool {
        self.begun.is_some()
    }

    /// Takes a picture that the next one is held against, in place of one that was taken before. It is kept, and looked at in
    /// [`TurnFinder::finish`] only.
    pub fn begin(&mut self, time: Time, picture: &Picture, lens: &Lens) {
        self.begun = Some(Begun { time, picture: picture.clone(), lens: *lens });
    }

    /// Takes the patches of a picture that are sought in the next one.
    fn take_patches(&mut self, picture: &Picture, lens: &Lens) {
        /// One field in so many is searched for a patch.
        const FIELDS_EVERY: usize = 4;
        let lens = self.read(picture, lens);
        self.grid.make(&lens, self.pyramid.size);
        self.patches.clear();
        let (columns, count) = (self.grid.columns, self.grid.columns * self.grid.rows);
        for field in 0..count {
            let (column, row) = (field % columns, field / columns);
            if !(column + 3 * row).is_multiple_of(FIELDS_EVERY) || self.patches.len() == *PATCHES.end() {
                continue;
            }
            let usable = |place: DVec2| self.grid.is_open(place);
            let Some(place) = corners::best(&self.pyramid, (column * FIELD, row * FIELD), usable) else {
                continue;
            };
            self.patches.extend(SkyPatch::take(&self.pyramid, place).map(|patch| (place, patch)));
        }
    }

    /// The turn from the picture that was begun with to this one; `None` where too few patches are found again or agree.
    pub fn finish(&mut self, picture: &Picture, lens: &Lens) -> Option<TurnSeen> {
        /// A patch that looks less like itself than this is not it.
        const LIKENESS_MIN: f32 = 0.8;
        let begun = self.begun.take()?;
        self.take_patches(&begun.picture, &begun.lens);
        if self.patches.len() < *PATCHES.start() {
            return None;
        }
        let lens = self.read(picture, lens);
        self.pairs.clear();
        for (place, patch) in &self.patches {
            let found = patch.find(&self.pyramid, *place, DMat2::IDENTITY, LEVELS - 1);
            if let Some(found) = found.filter(|f| f.likeness >= LIKENESS_MIN) {
                let before = lens.unproject(*place);
                let moved = lens.unproject(found.place) - before;
                if moved.is_finite() {
                    self.pairs.push(Pair { before, moved });
                }
            }
        }
        if self.pairs.len() < *PATCHES.start() {
            return None;
        }
        let pixel = 1.0 / lens.focal.x;
        agreed(&self.pairs, pixel).map(|(turn, covariance, agree)| TurnSeen {
            from: begun.time,
            turn,
            covariance,
            patches: (agree, self.pairs.len()),
        })
    }

    /// Reads a picture; the lens of what was read.
    fn read(&mut self, picture: &Picture, lens: &Lens) -> Lens {
        self.pyramid.measure(picture);
        let rows = 0..self.pyramid.size.1;
        self.pyramid.fill(picture, rows);
        let full = DVec2::new(f64::from(picture.width()), f64::from(picture.height()));
        let scale =
            full / DVec2::new(f64::from(lens.width), f64::from(lens.height)) / self.pyramid.reduction as f64;
        Lens {
            width: (f64::from(lens.width) * scale.x).round() as u32,
            height: (f64::from(lens.height) * scale.y).round() as u32,
            focal: lens.focal * scale,
            centre: lens.centre * scale,
            row_turn: DVec3::ZERO,
            ..*lens
        }
    }
}

/// The turn that most pairs agree on, its covariance, and how many agree.
fn agreed(pairs: &[Pair], pixel: f64) -> Option<(DVec3, DMat3, usize)> {
    let tolerance = AGREE_PX * pixel;
    let agree = |turn: DVec3| pairs.iter().filter(|p| p.off(turn).length() < tolerance).count();
    let mut best: Option<(usize, DVec3)> = None;
    for stride in [1, pairs.len() / 3, pairs.len() / 2] {
        for (i, first) in pairs.iter().enumerate() {
            let second = pairs.get((i + stride.max(1)) % pairs.len())?;
            let ((a, p), (b, q)) = (first.normal(), second.normal());
            let normal = a + b;
            if normal.determinant().abs() < 1e-4 {
                continue;
            }
            let turn = normal.inverse() * (p + q);
            let count = agree(turn);
            if best.is_none_or(|(most, _)| count > most) {
                best = Some((count, turn));
            }
        }
    }
    weighed(pairs, best?.1, pixel)
}

/// The turn near `turn` by least squares over the pairs, far ones weighed down; as for [`agreed`].
fn weighed(pairs: &[Pair], mut turn: DVec3, pixel: f64) -> Option<(DVec3, DMat3, usize)> {
    /// At least this share of the patches that are found must agree.
    const AGREED_LEAST: f64 = 0.5;
    /// Rounds of weighing.
    const ROUNDS: usize = 3;
    /// A place scatters no less than this, reduced pixels: what interpolation errs by.
    const SCATTER_LEAST_PX: f64 = 0.1;
    let tolerance = AGREE_PX * pixel;
    let mut scatter = tolerance / BIWEIGHT_END;
    let (mut normal, mut inliers) = (DMat3::ZERO, 0);
    for _ in 0..ROUNDS {
        let mut pull = DVec3::ZERO;
        let (mut squares, mut weights) = (0.0, 0.0);
        (normal, inliers) = (DMat3::ZERO, 0);
        for pair in pairs {
            let weight = biweight(pair.off(turn).length(), scatter);
            if weight == 0.0 {
                continue;
            }
            let (matrix, right) = pair.normal();
            normal += matrix * weight;
            pull += right * weight;
            squares += weight * pair.off(turn).length_squared();
            weights += weight;
            inliers += 1;
        }
        if normal.determinant().abs() < 1e-6 {
            return None;
        }
        turn = normal.inverse() * pull;
        // Two axes to a place.
        scatter = (0.5 * squares / weights).sqrt().clamp(SCATTER_LEAST_PX * pixel, tolerance);
    }
    let enough = inliers >= *PATCHES.start() && inliers as f64 >= AGREED_LEAST * pairs.len() as f64;
    // Patches overlap on coarse levels, so that neighbours err alike.
    let shared = f64::from(HALF) / 2.0;
    enough.then(|| (turn, normal.inverse() * (shared * scatter * scatter), inliers))
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::{
        estimate::skyline::tests::{clouds, lens, painted},
        geometry::{look, rotation_vector},
    };

    fn seen(from: DQuat, to: DQuat) -> Option<TurnSeen> {
        let mut finder = TurnFinder::default();
        finder.begin(Time::from_ns(0), &painted(from, 1, clouds), &lens());
        finder.finish(&painted(to, 2, clouds), &lens())
    }

    #[test]
    fn turns_about_all_axes_are_seen_without_being_foretold() {
        let from = look(0.3, 0.12, 0.05);
        for (azimuth, elevation, roll) in [
            (0.3, 0.12, 0.05),
            (0.32, 0.12, 0.05),
            (0.3, 0.10, 0.05),
            (0.3, 0.12, 0.075),
            (0.285, 0.13, 0.03),
        ] {
            let to = look(azimuth, elevation, roll);
            let seen = seen(from, to).expect("a turn");
            let truth = rotation_vector(from.inverse() * to);
            let error = (seen.turn - truth).length();
            assert!(
                error < 1.5e-3 && error < 5.0 * seen.covariance.diagonal_sum().sqrt() + 5e-4,
                "{seen:?} {truth}"
            );
        }
    }

    #[test]
    fn what_shows_nothing_tells_no_turn() {
        let mut finder = TurnFinder::default();
        let (a, b) = (look(0.0, 0.5, 0.0), look(0.01, 0.5, 0.0));
        finder.begin(Time::from_ns(0), &painted(a, 1, |_, _| 120.0), &lens());
        assert_eq!(finder.finish(&painted(b, 2, |_, _| 120.0), &lens()), None);
        assert!(finder.finish(&painted(b, 2, |_, _| 120.0), &lens()).is_none(), "nothing was begun");
    }

    trait DiagonalSum {
        fn diagonal_sum(&self) -> f64;
    }

    impl DiagonalSum for DMat3 {
        fn diagonal_sum(&self) -> f64 {
            self.x_axis.x + self.y_axis.y + self.z_axis.z
        }
    }
}
