//! The parts that a mesh is put together from, and what is special about them.

use std::collections::HashMap;

use bowwave_core::model::Model;
use glam::{IVec3, Vec3};

/// Corners closer than this are one corner of the shape, metres.
pub(crate) const WELD_M: f32 = 1e-4;
/// What is shorter is no line.
const LINE_LENGTH_M: f32 = 0.8;

/// Indices by triangles.
pub(crate) fn triangles(indices: &[u32]) -> Vec<[u32; 3]> {
    indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect()
}

/// A place in steps of [`WELD_M`]: the same for corners that are one.
pub(crate) fn spot(place: Vec3) -> IVec3 {
    (place / WELD_M).round().as_ivec3()
}

/// The parts of a model: triangles that share corners.
pub(crate) struct Parts {
    /// Part of each vertex.
    of: Vec<u32>,
    /// By part: six times its volume, 0 if it is not closed.
    volume: HashMap<u32, f32>,
    /// By part: its extent, smallest first.
    extent: HashMap<u32, [f32; 3]>,
}

impl Parts {
    /// Finds them; the model's indices lie within its vertices.
    pub(crate) fn of(model: &Model) -> Self {
        let vertices = &model.vertices;
        let triangles = triangles(&model.indices);
        let mut ids = HashMap::new();
        let welded: Vec<u32> = vertices
            .iter()
            .map(|v| {
                let next = ids.len() as u32;
                *ids.entry(spot(v.position)).or_insert(next)
            })
            .collect();
        let corners = |t: &[u32; 3]| t.map(|i| welded[i as usize]);
        let mut parent: Vec<u32> = (0..ids.len() as u32).collect();
        for t in &triangles {
            let [a, b, c] = corners(t);
            for other in [b, c] {
                let (a, other) = (root(&mut parent, a), root(&mut parent, other));
                parent[a as usize] = other;
            }
        }
        let of: Vec<u32> = welded.iter().map(|w| root(&mut parent, *w)).collect();
        // How much more often each edge is used in one direction than in the other.
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        let mut volume: HashMap<u32, f32> = HashMap::new();
        for t in &triangles {
            let [a, b, c] = corners(t);
            for (from, to) in [(a, b), (b, c), (c, a)] {
                if from != to {
                    *edges.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
                }
            }
            let [p, q, r] = t.map(|i| vertices[i as usize].position);
            *volume.entry(of[t[0] as usize]).or_default() += p.dot(q.cross(r));
        }
        for ((from, _), balance) in edges {
            if balance != 0 {
                volume.insert(root(&mut parent, from), 0.0);
            }
        }
        let mut bounds: HashMap<u32, (Vec3, Vec3)> = HashMap::new();
        for (v, part) in vertices.iter().zip(&of) {
            let (low, high) = bounds.entry(*part).or_insert((Vec3::MAX, Vec3::MIN));
            (*low, *high) = (low.min(v.position), high.max(v.position));
        }
        let sorted = |(low, high): (Vec3, Vec3)| {
            let mut extent = (high - low).to_array();
            extent.sort_by(f32::total_cmp);
            extent
        };
        let extent = bounds.into_iter().map(|(part, b)| (part, sorted(b))).collect();
        Self { of, volume, extent }
    }

    /// Whether a vertex belongs to a closed part that is not inside out: every edge is used once in each direction.
    pub(crate) fn closed(&self, vertex: u32) -> bool {
        let part = self.of.get(vertex as usize);
        part.and_then(|p| self.volume.get(p)).is_some_and(|volume| *volume > 0.0)
    }

    /// Whether a vertex belongs to a line, a stay or a rail: longer than `LINE_LENGTH_M`, its mean cross-section smaller than
    /// `section_m2`.
    pub(crate) fn is_line(&self, vertex: u32, section_m2: f32) -> bool {
        let Some(part) = self.of.get(vertex as usize) else { return false };
        let (Some(volume), Some(extent)) = (self.volume.get(part), self.extent.get(part)) else {
            return false;
        };
        let length = Vec3::from(*extent).length();
        *volume > 0.0 && length > LINE_LENGTH_M && volume / 6.0 < section_m2 * length
    }

    /// Whether a vertex belongs to something flat that lies on something else, a window or a stripe: moved by its thickness it
    /// would sink in and vanish, large as it may be.
    pub(crate) fn is_panel(&self, vertex: u32, error: f32) -> bool {
        let part = self.of.get(vertex as usize);
        part.and_then(|p| self.extent.get(p))
            .is_some_and(|[thin, middle, _]| *thin < 3.0 * error && *middle > 6.0 * error)
    }
}

/// Representative of `i`'s set, with path halving.
fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}
