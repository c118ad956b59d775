//! Long edges cut short, for lenses that bend straight lines: only corners go through the lens, and what lies between two of them is
//! drawn straight. An edge that is seen so many pixels long lies off its curve by the square of that.

use std::collections::HashMap;

use glam::{Vec2, Vec3, Vec4};
use shaders_spirv::interface::MeshVertex;

/// No edge is drawn longer than this, pixels: through a fisheye of 120 deg it then lies within half a pixel of its curve.
pub(crate) const EDGE_PX: f32 = 64.0;

/// Edges are halved so often at most: one of a pixel's length is that of a thousand.
const HALVED_MAX: usize = 10;

/// Cuts triangles until none of their edges is longer than `longest_m`; new corners are added to `vertices`. Whether an edge is cut is
/// decided by its own length alone, so that neighbours agree and no crack opens. With each triangle goes what was said of it.
pub(crate) fn split(
    vertices: &mut Vec<MeshVertex>,
    mut triangles: Vec<([u32; 3], bool)>,
    longest_m: f32,
) -> Vec<([u32; 3], bool)> {
    let mut middles = HashMap::new();
    for _ in 0..HALVED_MAX {
        let before = vertices.len();
        let mut shorter = Vec::with_capacity(triangles.len());
        for (t, closed) in triangles {
            let cut =
                [(0, 1), (1, 2), (2, 0)].map(|(a, b)| cut(vertices, &mut middles, (t[a], t[b]), longest_m));
            shorter.extend(pieces(t, cut).into_iter().flatten().map(|piece| (piece, closed)));
        }
        triangles = shorter;
        if vertices.len() == before {
            break;
        }
    }
    triangles
}

/// The corner in the middle of an edge that is too long.
fn cut(
    vertices: &mut Vec<MeshVertex>,
    middles: &mut HashMap<(u32, u32), u32>,
    (a, b): (u32, u32),
    longest_m: f32,
) -> Option<u32> {
    let key = (a.min(b), a.max(b));
    if let Some(middle) = middles.get(&key) {
        return Some(*middle);
    }
    let (a, b) = (vertices.get(key.0 as usize)?, vertices.get(key.1 as usize)?);
    if Vec3::from(a.position).distance(Vec3::from(b.position)) <= longest_m {
        return None;
    }
    let middle = |a: [f32; 3], b: [f32; 3]| Vec3::from(a).midpoint(Vec3::from(b));
    let normal = middle(a.normal, b.normal).normalize_or(Vec3::from(a.normal));
    let new = MeshVertex {
        position: middle(a.position, b.position).to_array(),
        normal: normal.to_array(),
        uv: Vec2::from(a.uv).midpoint(Vec2::from(b.uv)).to_array(),
        albedo: middle(a.albedo, b.albedo).to_array(),
        sky0: Vec4::from(a.sky0).midpoint(Vec4::from(b.sky0)).to_array(),
        sky1: Vec4::from(a.sky1).midpoint(Vec4::from(b.sky1)).to_array(),
        sky2: Vec2::from(a.sky2).midpoint(Vec2::from(b.sky2)).to_array(),
        thrown: Vec4::from(a.thrown).midpoint(Vec4::from(b.thrown)).to_array(),
    };
    let index = u32::try_from(vertices.len()).ok()?;
    vertices.push(new);
    middles.insert(key, index);
    Some(index)
}

/// The pieces of a triangle whose edges (from corner 0, 1 and 2 on) have been cut, the same way round.
fn pieces([a, b, c]: [u32; 3], cut: [Option<u32>; 3]) -> [Option<[u32; 3]>; 4] {
    match cut {
        [None, None, None] => [Some([a, b, c]), None, None, None],
        [Some(ab), Some(bc), Some(ca)] => {
            [Some([a, ab, ca]), Some([ab, b, bc]), Some([ca, bc, c]), Some([ab, bc, ca])]
        }
        // The rest is one of these, turned.
        [Some(ab), None, None] => [Some([a, ab, c]), Some([ab, b, c]), None, None],
        [Some(ab), Some(bc), None] => [Some([ab, b, bc]), Some([a, ab, bc]), Some([a, bc, c]), None],
        [x, y, z] => pieces([b, c, a], [y, z, x]),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Surface and the way round stay, edges are short, and each inner edge has two neighbours as before.
        #[test]
        fn a_surface_stays_whole(
            corners in prop::array::uniform4([-4.0..4.0f32, -4.0..4.0, -4.0..4.0]), longest in 0.3..3.0f32,
        ) {
            let mut vertices: Vec<MeshVertex> =
                corners.iter().map(|p| MeshVertex { position: *p, ..MeshVertex::default() }).collect();
            // A tetrahedron: every edge is shared by two triangles.
            let triangles = vec![([0, 1, 2], true), ([0, 3, 1], true), ([1, 3, 2], true), ([2, 3, 0], true)];
            let area = |vertices: &[MeshVertex], triangles: &[([u32; 3], bool)]| {
                let at = |i: u32| Vec3::from(vertices[i as usize].position);
                triangles.iter().map(|(t, _)| (at(t[1]) - at(t[0])).cross(at(t[2]) - at(t[0]))).fold(
                    (Vec3::ZERO, 0.0), |(sum, size), area| (sum + area, size + area.length()))
            };
            let before = area(&vertices, &triangles);
            let cut = split(&mut vertices, triangles, longest);
            let after = area(&vertices, &cut);
            prop_assert!((before.1 - after.1).abs() < 1e-3 * before.1.max(1.0), "{} {}", before.1, after.1);
            prop_assert!((before.0 - after.0).length() < 1e-3 * before.1.max(1.0));
            let mut sides: HashMap<(u32, u32), i32> = HashMap::new();
            for (t, _) in &cut {
                for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                    let at = |i: u32| Vec3::from(vertices[i as usize].position);
                    prop_assert!(at(a).distance(at(b)) <= longest);
                    *sides.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
                }
            }
            // Once each way.
            prop_assert!(sides.values().all(|sum| *sum == 0));
        }
    }

    #[test]
    fn what_is_short_stays_as_it_is() {
        let mut vertices = vec![MeshVertex::default(); 3];
        assert_eq!(split(&mut vertices, vec![([0, 1, 2], false)], 1.0), [([0, 1, 2], false)]);
        assert_eq!(vertices.len(), 3);
    }
}
