//! The board in a picture.
//!
//! Dark quadrilaterals are read at every scale of a pyramid; what the neighbours of a tag predict is looked for in turn, so that one tag
//! is enough to find the others through blur and glare; what does not stand where its neighbours say is no tag of the board.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec2;

use super::{
    Target, bend,
    corner::{self, Refinement},
    picture::{Grey, Plane},
    quads::{self, Quad},
    read::{self, TagView, WRONG_EXPECTED},
};
use crate::lens::{BoardView, Corner};

/// How far any corner may be from the middle of what the nearest other tags expect: by the tag's least height and the distance in tags,
/// and pixels more; or by the median of the other tags, where the lens bends the board.
const STRAY: f64 = 0.1;
const STRAY_PX: f64 = 0.7;
const STRAY_MEDIANS: f64 = 4.0;

/// A tag in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tag {
    /// Which one.
    pub id: usize,
    /// Its corners, pixels: lower left, lower right, upper right, upper left as printed.
    pub corners: [DVec2; 4],
}

/// The picture and its halves, the whole first, and how corners are refined in them.
struct TagPyramid {
    planes: Vec<Plane>,
    by: Refinement,
}

impl TagPyramid {
    fn new(picture: &Grey, by: Refinement) -> Self {
        /// Smallest side of a picture of the pyramid, pixels.
        const LEAST_PX: usize = 100;
        let mut planes = vec![Plane::smoothed(picture)];
        while let Some(last) = planes.last().filter(|p| p.width.min(p.height) >= 2 * LEAST_PX) {
            planes.push(last.halved());
        }
        Self { planes, by }
    }

    /// The corners near `quad`, pixels of the whole picture, from scale `level` down to the finest; `None` where one of them is none of a
    /// tag's.
    fn refine(&self, quad: &Quad, level: usize) -> Option<Quad> {
        let mut found = *quad;
        for (level, plane) in self.planes.iter().enumerate().take(level + 1).rev() {
            let scale = (1_u32 << level) as f64;
            let tag_px = height_px(&found) / scale;
            for corner in &mut found {
                *corner = corner::refine(plane, *corner / scale, tag_px, self.by)? * scale;
            }
        }
        self.crosses(&found).then_some(found)
    }

    /// Whether the edges that cross at each corner run along the tag's sides.
    fn crosses(&self, quad: &Quad) -> bool {
        let tag_px = height_px(quad);
        (0..4).all(|i| {
            let sides = [1, 3].map(|step| quad[(i + step) % 4] - quad[i]);
            corner::crosses(self.finest(), quad[i], sides, tag_px, self.by)
        })
    }

    /// Where the search for the corners of a tag of that size begins.
    fn level_for(&self, tag_px: f64) -> usize {
        /// Side of a tag where the search for its corners begins, pixels.
        const BEGIN_PX: f64 = 24.0;
        ((tag_px / BEGIN_PX).log2().max(0.0) as usize).min(self.planes.len() - 1)
    }

    fn finest(&self) -> &Plane {
        &self.planes[0]
    }
}

/// Least height of a quadrilateral over one of its sides, about, pixels.
fn height_px(q: &Quad) -> f64 {
    let area = 0.5 * (q[2] - q[0]).perp_dot(q[3] - q[1]).abs();
    let longest = (0..4).map(|i| q[i].distance(q[(i + 1) % 4])).fold(1e-9, f64::max);
    area / longest
}

/// The tags of the board that `picture` shows; two at least (one on a board of one), else none. In order of their ids.
pub fn detect(target: &Target, picture: &Grey) -> Vec<Tag> {
    detect_by(target, picture, Refinement::DEFAULT)
}

/// The same with corners found in another way.
pub fn detect_by(target: &Target, picture: &Grey, by: Refinement) -> Vec<Tag> {
    let (width, height) = picture.size();
    if width < 32 || height < 32 {
        return Vec::new();
    }
    let pyramid = TagPyramid::new(picture, by);
    let mut found = together(target, &seeds(target, &pyramid));
    if target.tags() == 1 {
        return found.into_iter().map(|(id, corners)| Tag { id, corners }).collect();
    }
    // A tag of which one corner was mistaken is found by its neighbours, once it is dropped.
    for _ in 0..2 {
        grow(target, &pyramid, &mut found);
        settle(target, &mut found);
    }
    found.into_iter().map(|(id, corners)| Tag { id, corners }).collect()
}

/// Tags that are read by themselves.
fn seeds(target: &Target, pyramid: &TagPyramid) -> BTreeMap<usize, Quad> {
    let mut best: BTreeMap<usize, (u32, Quad)> = BTreeMap::new();
    for (level, plane) in pyramid.planes.iter().enumerate() {
        let scale = (1_u32 << level) as f64;
        for quad in quads::find(plane) {
            let quad = quad.map(|p| p * scale);
            let known =
                |(_, other): &(u32, Quad)| middle(&quad).distance(middle(other)) < 0.2 * height_px(other);
            if best.values().any(known) {
                continue;
            }
            let Some(refined) = pyramid.refine(&quad, level) else { continue };
            let Some((id, wrong, corners)) = read::read(pyramid.finest(), &refined, target) else { continue };
            if best.get(&id).is_none_or(|b| wrong < b.0) {
                best.insert(id, (wrong, corners));
            }
        }
    }
    best.into_iter().map(|(id, (_, quad))| (id, quad)).collect()
}

fn middle(q: &Quad) -> DVec2 {
    q.iter().sum::<DVec2>() / 4.0
}

/// Steps from one tag to another on the board, the larger of across and upwards.
pub(super) fn steps(target: &Target, a: usize, b: usize) -> usize {
    let (columns, place) = (target.columns(), |id: usize, n: usize| (id % n, id / n));
    let ((ax, ay), (bx, by)) = (place(a, columns), place(b, columns));
    ax.abs_diff(bx).max(ay.abs_diff(by))
}

/// Distance on the board from a tag to a place, by the side of a tag: how far its view must be carried on to tell where that is seen. That
/// errs by the square of it through a lens that bends.
fn beyond(target: &Target, id: usize, place: DVec2) -> f64 {
    let off = target.corners(id).map(|c| c.distance(place));
    off.into_iter().fold(f64::INFINITY, f64::min) / target.tag_m()
}

/// Whether two tags beside each other on the board stand in the picture as the board says.
fn agree(target: &Target, (a, one): (usize, &Quad), (b, other): (usize, &Quad)) -> bool {
    /// How far the nearest corner of a tag may be from where another tag expects it: by its least height and the distance between them in
    /// tags, and pixels more.
    const APART: f64 = 0.3;
    const APART_PX: f64 = 1.0;
    let Some(expected) = TagView::of(one).and_then(|s| s.expected(target, a, b)) else { return false };
    let away = target.corners(b).map(|place| beyond(target, a, place));
    let nearest = (0..4).min_by(|i, k| away[*i].total_cmp(&away[*k])).unwrap_or(0);
    let allowed = APART * height_px(other) * away[nearest] + APART_PX;
    steps(target, a, b) == 1 && expected[nearest].distance(other[nearest]) <= allowed
}

/// The largest group of tags of which each agrees with one near it.
fn together(target: &Target, all: &BTreeMap<usize, Quad>) -> BTreeMap<usize, Quad> {
    let mut left: BTreeSet<usize> = all.keys().copied().collect();
    let mut largest = BTreeMap::new();
    while let Some(first) = left.pop_first() {
        let mut group = BTreeMap::from([(first, all[&first])]);
        let mut open = vec![first];
        while let Some(id) = open.pop() {
            let near: Vec<usize> =
                left.iter().copied().filter(|o| agree(target, (id, &all[&id]), (*o, &all[o]))).collect();
            for other in near {
                left.remove(&other);
                group.insert(other, all[&other]);
                open.push(other);
            }
        }
        if group.len() > largest.len() {
            largest = group;
        }
    }
    largest
}

/// Adds the tags beside those that were found, and beside these.
fn grow(target: &Target, pyramid: &TagPyramid, found: &mut BTreeMap<usize, Quad>) {
    let mut open: Vec<usize> = found.keys().copied().collect();
    while let Some(id) = open.pop() {
        for other in (0..target.tags()).filter(|o| steps(target, id, *o) == 1) {
            if found.contains_key(&other) {
                continue;
            }
            let Some(expected) = bend::expected(target, found, id, other) else { continue };
            let Some(quad) = pyramid.refine(&expected, pyramid.level_for(height_px(&expected))) else {
                continue;
            };
            let wrong = read::wrong_as(pyramid.finest(), &quad, target, other);
            if wrong.is_some_and(|w| w <= WRONG_EXPECTED) && agree(target, (id, &found[&id]), (other, &quad))
            {
                found.insert(other, quad);
                open.push(other);
            }
        }
    }
}

/// The middle one, or between the two middle ones.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = |i: usize| values.get(i).copied().unwrap_or(f64::NAN);
    0.5 * (at(values.len() / 2) + at(values.len().saturating_sub(1) / 2))
}

/// How far the worst corner of a tag is from the middle of what its neighbours expect, in times of what is allowed; infinite without
/// neighbours.
fn stray(target: &Target, found: &BTreeMap<usize, Quad>, id: usize) -> f64 {
    let own = &found[&id];
    let near = |other: &&usize| steps(target, **other, id) == 1;
    let seen = |other: &usize| Some((*other, bend::expected(target, found, *other, id)?));
    let expected: Vec<(usize, Quad)> = found.keys().filter(near).filter_map(seen).collect();
    let off = |i: usize| {
        let away = |other: usize| beyond(target, other, target.corners(id)[i]);
        let least = expected.iter().map(|e| away(e.0)).fold(f64::INFINITY, f64::min);
        let nearest = || expected.iter().filter(|e| away(e.0) < 1.5 * least).map(|e| e.1[i]);
        let along = |f: fn(DVec2) -> f64| median(nearest().map(f).collect());
        let allowed = STRAY * height_px(own) * least + STRAY_PX;
        own[i].distance(DVec2::new(along(|p| p.x), along(|p| p.y))) / allowed
    };
    if expected.is_empty() { f64::INFINITY } else { (0..4).map(off).fold(0.0, f64::max) }
}

/// Drops tags whose corners are not where their neighbours expect them, the worst one first: it may be what spoils the others, so these are
/// judged without it.
fn settle(target: &Target, found: &mut BTreeMap<usize, Quad>) {
    /// No lens bends it so far, in times of what is allowed: of few tags, wrong ones would make a large median.
    const STRAY_MOST: f64 = 2.5;
    let strays = |found: &BTreeMap<usize, Quad>| -> Vec<(usize, f64)> {
        found.keys().map(|id| (*id, stray(target, found, *id))).collect()
    };
    let mut all = strays(found);
    while let Some((worst, off)) = all.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))
        && off > 1.0
    {
        let mut others = found.clone();
        others.remove(&worst);
        all = strays(&others);
        let usual = median(all.iter().map(|s| s.1).collect());
        if off <= (STRAY_MEDIANS * usual).clamp(1.0, STRAY_MOST) {
            return;
        }
        *found = others;
    }
}

/// The corners of the board as the solvers take them.
pub fn view(target: &Target, tags: &[Tag]) -> BoardView {
    let corners = tags.iter().flat_map(|tag| {
        let places = target.corners(tag.id).into_iter().zip(tag.corners);
        places.map(|(board, pixel)| Corner { board, pixel })
    });
    BoardView { corners: corners.collect() }
}
