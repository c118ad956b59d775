//! The light of a simplified model: its fewer corners hold so much that its triangles are as bright as the surface that they stand for.

use bowwave_core::model::Model;
use glam::Vec3;

use super::{BakedLight, CornerLight, by_sides, fit::Seat, fit_side, places::Place, rays::Rays};

/// Places that are looked at for each triangle of a level.
const PLACES_A_TRIANGLE: usize = 8;

impl BakedLight {
    /// Light of the corners where the surface is drawn by `triangles` that lie within `error_m` of it: least squares of what it gets. Corners
    /// keep what they hold where none of the surface is nearest to their triangles.
    pub(crate) fn on_level(&self, triangles: &[[u32; 3]], error_m: f32) -> Vec<CornerLight> {
        let faces: Vec<Face> = triangles.iter().map(|t| Face::of(&self.surface, *t)).collect();
        let tree = Rays::of_triangles(faces.iter().map(|face| face.positions));
        let step = (self.places.len() / (PLACES_A_TRIANGLE * faces.len()).max(1)).max(1);
        let seated: Vec<(Seat, &Place)> = self
            .places
            .iter()
            .step_by(step)
            .filter_map(|p| Some((seat(&faces, &tree, p, error_m)?, p)))
            .collect();
        by_sides(|side| {
            let mut held: Vec<_> = self.corners.iter().map(|corner| corner[side]).collect();
            fit_side(seated.iter().map(|(at, place)| (*at, place.weight, *place)), side, &mut held);
            held
        })
    }
}

/// A triangle of a level.
struct Face {
    corners: [usize; 3],
    positions: [Vec3; 3],
    /// Of the corners' own normals: the side that counts as the front.
    normal: Vec3,
}

impl Face {
    fn of(model: &Model, triangle: [u32; 3]) -> Self {
        let vertices = triangle.map(|i| &model.vertices[i as usize]);
        let positions = vertices.map(|v| v.position);
        Self {
            corners: triangle.map(|i| i as usize),
            positions,
            normal: vertices.iter().map(|v| v.normal).sum::<Vec3>().normalize_or(Vec3::Z),
        }
    }
}

/// The place on a level that stands for a place on the model: the nearest, where turning away counts as distance; `None` of no triangles.
fn seat(faces: &[Face], tree: &Rays, place: &Place, error_m: f32) -> Option<Seat> {
    /// A face that stands at right angles counts as so many errors farther away.
    const TURNED: f32 = 2.0;
    let mut nearest = 2.25 * error_m * error_m;
    let mut found = None;
    tree.near(place.position, nearest, |number| {
        let face = &faces[number as usize];
        let along = face.normal.dot(place.normal);
        let turned = (TURNED * error_m).powi(2) * (1.0 - along);
        if along > 0.5 && turned < nearest {
            let shares = nearest_shares(place.position, face.positions);
            let there: Vec3 = face.positions.iter().zip(shares).map(|(p, share)| *p * share).sum();
            let distance = there.distance_squared(place.position) + turned;
            if distance < nearest {
                nearest = distance;
                found = Some(Seat { corners: face.corners, shares });
            }
        }
        nearest
    });
    found
}

/// Barycentric coordinates of the point of a triangle that is nearest to `p`.
fn nearest_shares(p: Vec3, [a, b, c]: [Vec3; 3]) -> [f32; 3] {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (bb, bc, cc) = (ab.dot(ab), ab.dot(ac), ac.dot(ac));
    let (pb, pc) = (ap.dot(ab), ap.dot(ac));
    let det = bb * cc - bc * bc;
    if det > 0.0 {
        let (v, w) = ((cc * pb - bc * pc) / det, (bb * pc - bc * pb) / det);
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
            return [1.0 - v - w, v, w];
        }
    }
    // On one of the edges.
    let along = |from: Vec3, to: Vec3| {
        let edge = to - from;
        let share = ((p - from).dot(edge) / edge.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        (share, (from + edge * share).distance_squared(p))
    };
    let [(ab, to_ab), (bc, to_bc), (ca, to_ca)] = [along(a, b), along(b, c), along(c, a)];
    if to_ab <= to_bc && to_ab <= to_ca {
        [1.0 - ab, ab, 0.0]
    } else if to_bc <= to_ca {
        [0.0, 1.0 - bc, bc]
    } else {
        [ca, 0.0, 1.0 - ca]
    }
}
