//! Where a tag is expected, through a lens that bends the board.
//!
//! The view of one tag carried on to the next errs by the square of the distance: by a tenth of a tag and more near the rim of a fisheye.
//! The error at the tags around is known and changes smoothly: a parabola through it is subtracted.

use std::collections::BTreeMap;

use glam::DVec2;
use nalgebra::{Matrix6, Matrix6x2, Vector6};

use super::{Target, detect::steps, quads::Quad, read::TagView};

/// Tags up to so many steps away say how the lens bends.
const AROUND: usize = 1;
/// Weight of "it does not bend", in corners: of one or two tags alone nothing is carried on.
const FLAT: f64 = 0.1;

/// Terms of a parabola.
fn terms(p: DVec2) -> Vector6<f64> {
    Vector6::new(1.0, p.x, p.y, p.x * p.x, p.x * p.y, p.y * p.y)
}

/// Corners of tag `other` as the view of tag `id` has them, bent as those of `found` around are, `other` itself left out.
pub(super) fn expected(
    target: &Target,
    found: &BTreeMap<usize, Quad>,
    id: usize,
    other: usize,
) -> Option<Quad> {
    let sight = TagView::of(found.get(&id)?)?;
    let mut quad = sight.expected(target, id, other)?;
    let middle = target.corners(other).iter().sum::<DVec2>() / 4.0;
    let place = |corner: DVec2| terms((corner - middle) / target.tag_m());
    let mut normal = Matrix6::from_diagonal_element(FLAT);
    let mut right = Matrix6x2::zeros();
    for (around, seen) in found {
        if *around == other || steps(target, *around, other) > AROUND {
            continue;
        }
        let Some(carried) = sight.expected(target, id, *around) else { continue };
        for ((corner, carried), seen) in target.corners(*around).into_iter().zip(carried).zip(seen) {
            let (row, off) = (place(corner), *seen - carried);
            normal += row * row.transpose();
            right += row * nalgebra::RowVector2::new(off.x, off.y);
        }
    }
    let bend = normal.cholesky()?.solve(&right);
    for (pixel, corner) in quad.iter_mut().zip(target.corners(other)) {
        let off = place(corner).transpose() * bend;
        *pixel += DVec2::new(off.x, off.y);
    }
    Some(quad)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// The board as an equidistant fisheye of 400 pixels a radian sees it, 55 degrees off its axis.
    fn seen(target: &Target) -> BTreeMap<usize, Quad> {
        let (sin, cos) = 55f64.to_radians().sin_cos();
        let pixel = |corner: DVec2| {
            let at = corner - target.size_m() / 2.0;
            let point = DVec3::new(at.x * cos + 0.25 * sin, -at.y, 0.25 * cos - at.x * sin);
            let across = point.truncate();
            across.normalize() * across.length().atan2(point.z) * 400.0
        };
        (0..target.tags()).map(|id| (id, target.corners(id).map(pixel))).collect()
    }

    #[test]
    fn a_tag_near_the_rim_is_expected_where_the_lens_puts_it() {
        let target = Target::A4;
        let all = seen(&target);
        let (mut bent, mut flat): (f64, f64) = (0.0, 0.0);
        // Each of the last column, told by the others around it.
        for row in 0..6 {
            let (id, other) = (row * 6 + 4, row * 6 + 5);
            let mut found = all.clone();
            found.remove(&other);
            let truth = all[&other];
            let worst = |quad: Quad| (0..4).map(|i| quad[i].distance(truth[i])).fold(0.0, f64::max);
            bent = bent.max(worst(expected(&target, &found, id, other).unwrap()));
            flat = flat.max(worst(TagView::of(&all[&id]).unwrap().expected(&target, id, other).unwrap()));
        }
        assert!(bent < 0.5 * flat && bent < 2.0, "{bent} px, {flat} px without");
    }

    #[test]
    fn one_tag_alone_is_carried_on_as_it_is_seen() {
        let target = Target::A4;
        let found = BTreeMap::from([(7, seen(&target)[&7])]);
        let plain = TagView::of(&found[&7]).unwrap().expected(&target, 7, 8).unwrap();
        let carried = expected(&target, &found, 7, 8).unwrap();
        assert!((0..4).all(|i| carried[i].distance(plain[i]) < 1e-9), "{carried:?} {plain:?}");
        assert_eq!(expected(&target, &found, 8, 7), None, "not found");
    }
}
