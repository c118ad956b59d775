//! Which tag a quadrilateral is.

use glam::{DVec2, DVec3};
use nalgebra::Matrix3;

use super::{BORDER, DATA, MODULES, Target, codes::TAG36H11, picture::Plane, quads::Quad};
use crate::{
    lens::homography,
    solve::so3::{dvec, vector},
};

/// Wrong modules that are allowed: a mirrored tag has four at least.
pub(super) const WRONG_MOST: u32 = 3;
/// Wrong modules that are allowed where the neighbours tell which tag it must be.
pub(super) const WRONG_EXPECTED: u32 = 5;
/// Least difference of white and black, codes.
const CONTRAST: f64 = 8.0;
/// Most of the 96 places on border and gap that may have the wrong colour: with one corner mistaken, more have.
const FRAME_WRONG: usize = 6;

/// The view of a tag: its modules' places to pixels. Places count modules from the lower left corner, x right, y up.
pub(super) struct TagView(Matrix3<f64>);

impl TagView {
    /// From the pixels of lower left, lower right, upper right and upper left corner.
    pub fn of(quad: &Quad) -> Option<Self> {
        let side = MODULES as f64;
        let corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)].map(DVec2::from);
        let pairs: Vec<(DVec2, DVec2)> = corners.into_iter().zip(*quad).collect();
        homography(&pairs).map(Self)
    }

    /// The pixel of a place; `None` behind the horizon.
    pub fn pixel(&self, place: DVec2) -> Option<DVec2> {
        // The sign of the third coordinate is that of the tag's middle, where it is in front.
        let at = |p: DVec2| -> DVec3 { dvec(&(self.0 * vector(p.extend(1.0)))) };
        let (seen, middle) = (at(place), at(DVec2::splat(0.5 * MODULES as f64)));
        let pixel = seen.truncate() / seen.z;
        (seen.z * middle.z > 0.0 && pixel.is_finite()).then_some(pixel)
    }

    /// Where the corners of tag `other` of the board are expected, from those of tag `id`.
    pub fn expected(&self, target: &Target, id: usize, other: usize) -> Option<Quad> {
        let (from, scale) = (target.corners(id)[0], MODULES as f64 / target.tag_m());
        let mut quad = [DVec2::ZERO; 4];
        for (pixel, corner) in quad.iter_mut().zip(target.corners(other)) {
            *pixel = self.pixel((corner - from) * scale)?;
        }
        Some(quad)
    }
}

/// A plane through brightnesses at places: how bright black or white is where.
#[derive(Default)]
struct BrightnessPlane {
    normal: Matrix3<f64>,
    right: DVec3,
}

impl BrightnessPlane {
    fn add(&mut self, place: DVec2, value: f64) {
        let row = place.extend(1.0);
        self.normal += vector(row) * vector(row).transpose();
        self.right += row * value;
    }

    fn solve(&self) -> Option<DVec3> {
        self.normal.cholesky().map(|c| dvec(&c.solve(&vector(self.right))))
    }
}

/// The 36 modules as a code, the first in the highest bit, as if the quadrilateral's first corner were the lower left one.
fn code(plane: &Plane, sight: &TagView, spacing: f64) -> Option<u64> {
    let (side, border) = (MODULES as f64, BORDER as f64);
    let (mut black, mut white, mut frame) =
        (BrightnessPlane::default(), BrightnessPlane::default(), Vec::new());
    // Along the middle of the border, and of the gap where it is narrow; between the corners' black squares only.
    let beyond = (0.5 * spacing * side).min(1.0);
    for i in 0..12 {
        let along = (f64::from(i) + 0.5) / 12.0 * (side - border) + 0.5 * border;
        for (inside, level, is_white) in [(0.5 * border, &mut black, false), (-beyond, &mut white, true)] {
            let places = [(along, inside), (along, side - inside), (inside, along), (side - inside, along)];
            for place in places.map(DVec2::from) {
                let value = plane.at(sight.pixel(place)?);
                level.add(place, value);
                frame.push((place.extend(1.0), value, is_white));
            }
        }
    }
    let (black, white) = (black.solve()?, white.solve()?);
    let wrong =
        |(at, value, is_white): &&(DVec3, f64, bool)| (*value > 0.5 * (black + white).dot(*at)) != *is_white;
    if frame.iter().filter(wrong).count() > FRAME_WRONG {
        return None;
    }
    let mut code = 0;
    for i in 0..DATA * DATA {
        let module = DVec2::new((BORDER + i % DATA) as f64, (MODULES - 1 - BORDER - i / DATA) as f64);
        let mut value = 0.0;
        for k in 0..9 {
            let place = module + DVec2::new(f64::from(k % 3), f64::from(k / 3)) * 0.2 + 0.3;
            value += plane.at(sight.pixel(place)?) / 9.0;
        }
        let at = (module + 0.5).extend(1.0);
        let (dark, bright) = (black.dot(at), white.dot(at));
        if bright - dark < CONTRAST {
            return None;
        }
        code = code << 1 | u64::from(value > 0.5 * (dark + bright));
    }
    Some(code)
}

/// Wrong modules where `quad` is taken for tag `id`.
pub(super) fn wrong_as(plane: &Plane, quad: &Quad, target: &Target, id: usize) -> Option<u32> {
    let code = code(plane, &TagView::of(quad)?, target.spacing())?;
    TAG36H11.get(id).map(|own| (own ^ code).count_ones())
}

/// Which tag of the board `quad` is, its wrong modules, and its corners from the lower left one on.
pub(super) fn read(plane: &Plane, quad: &Quad, target: &Target) -> Option<(usize, u32, Quad)> {
    let mut best: Option<(usize, u32, Quad)> = None;
    let mut turned = *quad;
    for _ in 0..4 {
        let code = code(plane, &TagView::of(&turned)?, target.spacing())?;
        for (id, own) in TAG36H11.iter().take(target.tags()).enumerate() {
            let wrong = (own ^ code).count_ones();
            if wrong <= WRONG_MOST && best.is_none_or(|b| wrong < b.1) {
                best = Some((id, wrong, turned));
            }
        }
        turned.rotate_left(1);
    }
    best
}
