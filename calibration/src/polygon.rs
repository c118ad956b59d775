//! Polygons that were traced by hand: what crosses itself is refused, the rest is cut into triangles.

use glam::DVec2;

/// Why a polygon has no triangles.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PolygonError {
    /// Fewer than three corners that differ.
    #[error("the outline has {0} corners that differ: three or more are needed")]
    Corners(usize),
    /// Two of its edges cross or touch.
    #[error(
        "the outline crosses itself: the edge from corner {} to {} meets that from {} to {}; trace it around once, in order", .0[0], .0[1], .1[0], .1[1]
    )]
    Crosses([usize; 2], [usize; 2]),
    /// All corners lie on a line.
    #[error("the outline has no area: all its corners lie on a line")]
    Flat,
}

/// Triangles that cover a polygon, concave ones too, by the numbers of its corners; each runs the way the polygon does. (Ear clipping, Meisters
/// 1975: a corner is cut off whose triangle holds no other one.) Corners that repeat the one before are left out.
///
/// # Errors
/// A polygon that crosses or touches itself, or has no area. Corners are counted from 1.
pub fn triangles(polygon: &[DVec2]) -> Result<Vec<[usize; 3]>, PolygonError> {
    let count = polygon.len();
    let mut left: Vec<usize> =
        (0..count).filter(|i| polygon[*i] != polygon[(*i + count - 1) % count] || count == 1).collect();
    if left.len() < 3 {
        return Err(PolygonError::Corners(left.len()));
    }
    if let Some(crossing) = crossing(polygon, &left) {
        return Err(crossing);
    }
    let area: f64 =
        (0..left.len()).map(|i| polygon[left[i]].perp_dot(polygon[left[(i + 1) % left.len()]])).sum();
    let [low, high] =
        polygon.iter().fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[l, h], p| [l.min(*p), h.max(*p)]);
    if area.abs() <= 1e-12 * (high - low).length_squared() {
        return Err(PolygonError::Flat);
    }
    let sign = area.signum();
    let turn = |[a, b, c]: [usize; 3]| sign * (polygon[b] - polygon[a]).perp_dot(polygon[c] - polygon[b]);
    let mut cut = Vec::with_capacity(left.len() - 2);
    while left.len() > 3 {
        let count = left.len();
        let corner = |i: usize| [left[(i + count - 1) % count], left[i], left[(i + 1) % count]];
        let is_ear = |i: usize| {
            let ear = corner(i);
            let holds = |other: usize| {
                !ear.contains(&other) && (0..3).all(|k| turn([ear[k], ear[(k + 1) % 3], other]) >= 0.0)
            };
            turn(ear) > 0.0 && !left.iter().any(|other| holds(*other))
        };
        // Of a simple polygon there is always one (Meisters 1975); with rounding the fullest corner stands in for it. A corner on a straight line
        // is dropped without a triangle.
        let flat = (0..count).find(|i| turn(corner(*i)) == 0.0);
        let ear = flat
            .or_else(|| (0..count).find(|i| is_ear(*i)))
            .or_else(|| (0..count).max_by(|a, b| turn(corner(*a)).total_cmp(&turn(corner(*b)))));
        let Some(ear) = ear else { break };
        if flat.is_none() {
            cut.push(corner(ear));
        }
        left.remove(ear);
    }
    if let [a, b, c] = left[..] {
        cut.push([a, b, c]);
    }
    Ok(cut)
}

/// The first two edges that meet elsewhere than at a corner that they share.
fn crossing(polygon: &[DVec2], corners: &[usize]) -> Option<PolygonError> {
    let count = corners.len();
    let edge = |i: usize| [corners[i], corners[(i + 1) % count]];
    for i in 0..count {
        for k in i + 1..count {
            let (a, b) = (edge(i), edge(k));
            let shared = a.iter().find(|corner| b.contains(corner));
            let meets = match shared {
                // Neighbours meet once more only where one runs back along the other.
                Some(shared) => {
                    let end = |edge: [usize; 2]| polygon[if edge[0] == *shared { edge[1] } else { edge[0] }];
                    let (from, to) = (end(a) - polygon[*shared], end(b) - polygon[*shared]);
                    from.perp_dot(to) == 0.0 && from.dot(to) > 0.0
                }
                None => segments_meet(a.map(|c| polygon[c]), b.map(|c| polygon[c])),
            };
            if meets {
                return Some(PolygonError::Crosses(a.map(|c| c + 1), b.map(|c| c + 1)));
            }
        }
    }
    None
}

/// Whether two segments have a point in common.
fn segments_meet([a, b]: [DVec2; 2], [c, d]: [DVec2; 2]) -> bool {
    let side = |from: DVec2, to: DVec2, p: DVec2| (to - from).perp_dot(p - from);
    let within =
        |from: DVec2, to: DVec2, p: DVec2| p.cmpge(from.min(to)).all() && p.cmple(from.max(to)).all();
    let sides = [side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b)];
    let parts = |x: f64, y: f64| (x > 0.0 && y < 0.0) || (x < 0.0 && y > 0.0);
    (parts(sides[0], sides[1]) && parts(sides[2], sides[3]))
        || (sides[0] == 0.0 && within(a, b, c))
        || (sides[1] == 0.0 && within(a, b, d))
        || (sides[2] == 0.0 && within(c, d, a))
        || (sides[3] == 0.0 && within(c, d, b))
}

#[cfg(test)]
mod tests {
    use bowwave_core::geometry::is_inside;
    use proptest::prelude::*;

    use super::*;

    fn corners(list: &[[f64; 2]]) -> Vec<DVec2> {
        list.iter().map(|c| DVec2::from_array(*c)).collect()
    }

    fn area(polygon: &[DVec2]) -> f64 {
        (0..polygon.len()).map(|i| 0.5 * polygon[i].perp_dot(polygon[(i + 1) % polygon.len()])).sum()
    }

    /// Triangles run as the polygon does and have its area.
    fn covers(polygon: &[DVec2]) {
        let cut = triangles(polygon).unwrap();
        let whole = area(polygon);
        let sum: f64 = cut
            .iter()
            .map(|t| {
                let own = area(&t.map(|i| polygon[i]));
                assert!(own * whole > 0.0, "{t:?} runs the other way");
                let middle = t.iter().map(|i| polygon[*i]).sum::<DVec2>() / 3.0;
                assert!(is_inside(polygon, middle), "{t:?} lies outside");
                own
            })
            .sum();
        assert!((sum / whole - 1.0).abs() < 1e-9, "{sum} {whole}");
    }

    #[test]
    fn concave_polygons_are_covered_whichever_way_they_run() {
        let shield = corners(&[
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 3.0],
            [2.5, 3.0],
            [2.5, 1.0],
            [1.5, 1.0],
            [1.5, 3.0],
            [0.0, 3.0],
        ]);
        covers(&shield);
        covers(&shield.iter().rev().copied().collect::<Vec<_>>());
        // A comb whose corners lie on lines, and a corner that is clicked twice.
        covers(&corners(&[
            [0.0, 0.0],
            [2.0, 0.0],
            [2.0, 0.0],
            [4.0, 0.0],
            [4.0, 2.0],
            [3.0, 1.0],
            [2.0, 2.0],
            [1.0, 1.0],
            [0.0, 2.0],
        ]));
        let square = corners(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(triangles(&square).unwrap().len(), 2);
    }

    #[test]
    fn what_crosses_itself_names_its_edges() {
        let bow = corners(&[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]]);
        assert_eq!(triangles(&bow), Err(PolygonError::Crosses([1, 2], [3, 4])));
        // A corner on another edge, and an edge that runs back along its neighbour.
        let touches = corners(&[[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 0.0], [0.0, 2.0]]);
        assert_eq!(triangles(&touches), Err(PolygonError::Crosses([1, 2], [3, 4])));
        let back = corners(&[[0.0, 0.0], [4.0, 0.0], [2.0, 0.0], [2.0, 2.0]]);
        assert_eq!(triangles(&back), Err(PolygonError::Crosses([1, 2], [2, 3])));
        let said = triangles(&bow).unwrap_err().to_string();
        assert!(said.contains("from corner 1 to 2 meets that from 3 to 4"), "{said}");
    }

    #[test]
    fn what_has_no_area_is_refused() {
        assert_eq!(triangles(&[]), Err(PolygonError::Corners(0)));
        assert_eq!(triangles(&corners(&[[1.0, 1.0]; 5])), Err(PolygonError::Corners(0)));
        let line = corners(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]);
        assert!(triangles(&line).is_err());
    }

    proptest! {
        /// Stars of any radii about a middle never cross themselves.
        #[test]
        fn stars_are_covered(radii in proptest::collection::vec(0.1..1.0f64, 3..64), turn in 0.0..6.3f64) {
            let step = std::f64::consts::TAU / radii.len() as f64;
            let star: Vec<DVec2> =
                radii.iter().enumerate().map(|(i, r)| DVec2::from_angle(turn + i as f64 * step) * *r).collect();
            covers(&star);
        }
    }
}
