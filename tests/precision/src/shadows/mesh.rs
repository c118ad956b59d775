//! What throws shadows: triangles in the world, which of them belong to closed hulls, and their edges.

use std::collections::HashMap;

use bowwave_core::{geometry::RigidPose, model::Model};
use glam::{DVec3, Vec3};

/// An edge of a triangle between two places; a triangle uses it in this direction or in the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshEdge {
    /// Numbers of its ends in [`CasterMesh::places`], the lower first.
    pub ends: [u32; 2],
    /// First of its uses in [`CasterMesh::uses`], and how many there are.
    pub uses: (u32, u32),
}

/// A triangle's use of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EdgeUse {
    /// The triangle.
    pub triangle: u32,
    /// Whether it runs from the higher end to the lower one.
    pub is_reversed: bool,
}

/// A mesh that throws shadows. Corners that lie in one place are one.
#[derive(Clone, Debug)]
pub struct CasterMesh {
    /// Places of corners, metres about the frame's origin.
    pub places: Vec<Vec3>,
    /// Three places each, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Whether a triangle belongs to a closed part; the others are open shells, which have two sides.
    pub is_closed: Vec<bool>,
    /// Edges, each once.
    pub edges: Vec<MeshEdge>,
    /// Uses of the edges, edge by edge.
    pub uses: Vec<EdgeUse>,
    /// Unit vector along its length.
    pub ahead: Vec3,
    /// Unit vector to its side.
    pub across: Vec3,
    /// Corners of the model's own box, metres.
    pub corners: [Vec3; 8],
}

impl CasterMesh {
    /// `model` at `pose`, places about `origin`.
    pub fn of(model: &Model, pose: RigidPose, origin: DVec3) -> Self {
        let world = |p: Vec3| (pose.to_world(p.as_dvec3()) - origin).as_vec3();
        let (places, triangles) = welded(model);
        let is_closed = closed(&places, &triangles);
        let (edges, uses) = edges(&triangles);
        let axis = |v: DVec3| (pose.world_from_body * v).as_vec3();
        let corner = |i: usize| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { model.min[axis] } else { model.max[axis] };
            world(Vec3::new(pick(0), pick(1), pick(2)))
        };
        Self {
            places: places.into_iter().map(world).collect(),
            triangles,
            is_closed,
            edges,
            uses,
            ahead: axis(DVec3::X),
            across: axis(DVec3::Y),
            corners: std::array::from_fn(corner),
        }
    }

    /// Corners of a triangle, metres.
    pub fn corners_of(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|i| self.places[i as usize])
    }
}

/// Corners of `model` that lie in one place as one, and its triangles by them.
fn welded(model: &Model) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    /// Places closer than this are one, metres.
    const SAME_M: f32 = 1e-4;
    let mut known: HashMap<[i32; 3], u32> = HashMap::new();
    let mut places = Vec::new();
    let mut number = |i: u32| {
        let p = model.vertices[i as usize].position;
        *known.entry((p / SAME_M).round().to_array().map(|v| v as i32)).or_insert_with(|| {
            places.push(p);
            places.len() as u32 - 1
        })
    };
    let triangles = model.indices.chunks_exact(3).map(|t| [0, 1, 2].map(|i| number(t[i])));
    let triangles: Vec<[u32; 3]> =
        triangles.filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]).collect();
    (places, triangles)
}

/// Directed edges of a triangle.
fn directed(t: [u32; 3]) -> [[u32; 2]; 3] {
    [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]
}

/// Whether each triangle belongs to a part each of whose edges is used as often in each direction, and that is not inside out.
fn closed(places: &[Vec3], triangles: &[[u32; 3]]) -> Vec<bool> {
    let mut parent: Vec<u32> = (0..places.len() as u32).collect();
    for t in triangles {
        let roots = t.map(|i| root(&mut parent, i));
        roots.iter().for_each(|r| parent[*r as usize] = roots[0]);
    }
    let mut balance: HashMap<[u32; 2], i32> = HashMap::new();
    let mut volume = vec![0.0_f32; places.len()];
    for t in triangles {
        let [a, b, c] = t.map(|i| places[i as usize]);
        volume[root(&mut parent, t[0]) as usize] += a.dot(b.cross(c));
        for [from, to] in directed(*t) {
            *balance.entry([from.min(to), from.max(to)]).or_default() += if from < to { 1 } else { -1 };
        }
    }
    for (ends, count) in balance {
        if count != 0 {
            volume[root(&mut parent, ends[0]) as usize] = f32::NEG_INFINITY;
        }
    }
    triangles.iter().map(|t| volume[root(&mut parent, t[0]) as usize] > 0.0).collect()
}

/// Representative of a set, with path halving.
fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

fn edges(triangles: &[[u32; 3]]) -> (Vec<MeshEdge>, Vec<EdgeUse>) {
    let mut found: Vec<([u32; 2], EdgeUse)> = Vec::with_capacity(3 * triangles.len());
    for (triangle, corners) in (0..).zip(triangles) {
        for [from, to] in directed(*corners) {
            let of = EdgeUse { triangle, is_reversed: from > to };
            found.push(([from.min(to), from.max(to)], of));
        }
    }
    found.sort_by_key(|(ends, of)| (*ends, of.triangle));
    let mut edges: Vec<MeshEdge> = Vec::new();
    for (i, (ends, _)) in (0..).zip(&found) {
        match edges.last_mut().filter(|edge| edge.ends == *ends) {
            Some(edge) => edge.uses.1 += 1,
            None => edges.push(MeshEdge { ends: *ends, uses: (i, 1) }),
        }
    }
    (edges, found.into_iter().map(|(_, of)| of).collect())
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::truth::boat::box_boat;

    #[test]
    fn boxes_are_closed_and_each_of_their_edges_has_two_uses() {
        let pose = RigidPose { world_from_body: DQuat::IDENTITY, position: DVec3::ZERO };
        let mesh = CasterMesh::of(&box_boat(), pose, DVec3::ZERO);
        assert!(mesh.is_closed.iter().all(|closed| *closed));
        // Boxes that stand on each other share the places of their corners.
        assert!(mesh.edges.iter().all(|edge| edge.uses.1 % 2 == 0));
        let one = Model { indices: box_boat().indices[..6].to_vec(), ..box_boat() };
        assert!(CasterMesh::of(&one, pose, DVec3::ZERO).is_closed.iter().all(|closed| !closed));
    }
}
