//! Rays from a boat's surface to the boat: a tree of boxes over its triangles, cut where rays meet boxes least often (MacDonald
//! and Booth 1990, by slices as in Wald 2007).

use bowwave_core::model::Model;
use glam::{Vec3, Vec3A};

/// Triangles of a leaf at most.
const LEAF: usize = 4;
/// Slices of a box between which it may be cut.
const SLICES: usize = 12;
/// Boxes that wait while a ray goes through others: the tree is less deep.
const WAITING: usize = 64;
/// Nothing nearer to a ray's start than this is met, metres: what lies on a surface hides nothing of it.
const NEAR_M: f32 = 0.004;

/// A triangle by a corner and two edges.
#[derive(Clone, Copy)]
struct Face {
    corner: Vec3A,
    edges: [Vec3A; 2],
    number: u32,
}

impl Face {
    fn bounds(&self) -> Bounds {
        let [b, c] = self.edges.map(|edge| self.corner + edge);
        Bounds { low: self.corner.min(b).min(c), high: self.corner.max(b).max(c) }
    }

    fn middle(&self) -> Vec3A {
        self.corner + (self.edges[0] + self.edges[1]) / 3.0
    }

    /// The way along a ray to this triangle (Moeller and Trumbore 1997).
    fn meet(&self, from: Vec3A, along: Vec3A) -> Option<f32> {
        let p = along.cross(self.edges[1]);
        let det = self.edges[0].dot(p);
        let (t, size) = ((from - self.corner) * det.signum(), det.abs());
        let q = t.cross(self.edges[0]);
        let (u, v) = (t.dot(p), along.dot(q));
        if u < 0.0 || v < 0.0 || u + v > size || size < 1e-12 {
            return None;
        }
        let way = self.edges[1].dot(q) / size;
        (way > NEAR_M).then_some(way)
    }
}

/// A box.
#[derive(Clone, Copy)]
struct Bounds {
    low: Vec3A,
    high: Vec3A,
}

impl Bounds {
    const NONE: Self = Self { low: Vec3A::MAX, high: Vec3A::MIN };

    fn with(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Half of its surface.
    fn area(&self) -> f32 {
        let e = (self.high - self.low).max(Vec3A::ZERO);
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    /// Where a ray enters it, if it does before `limit`; flat boxes are entered whatever the rounding.
    fn entry(&self, from: Vec3A, inverse: Vec3A, limit: f32) -> Option<f32> {
        let (a, b) = ((self.low - from) * inverse, (self.high - from) * inverse);
        let (into, out) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        (into <= (out * 1.000_01 + 1e-5).min(limit)).then_some(into)
    }
}

/// A box about the faces `first..first + count`, or, of none, about the nodes `first` and the next.
struct Node {
    bounds: Bounds,
    first: u32,
    count: u32,
}

/// A boat's triangles, ready for rays.
pub(super) struct Rays {
    faces: Vec<Face>,
    nodes: Vec<Node>,
}

impl Rays {
    pub(super) fn of(model: &Model) -> Self {
        let at = |i: u32| model.vertices.get(i as usize).map_or(Vec3::ZERO, |v| v.position);
        Self::of_triangles(model.indices.chunks_exact(3).map(|t| [at(t[0]), at(t[1]), at(t[2])]))
    }

    /// The same of any triangles.
    pub(super) fn of_triangles(triangles: impl Iterator<Item = [Vec3; 3]>) -> Self {
        let face = |(number, t): (u32, [Vec3; 3])| {
            let [corner, b, c] = t.map(Vec3A::from);
            Face { number, corner, edges: [b - corner, c - corner] }
        };
        let faces: Vec<Face> = (0..).zip(triangles).map(face).collect();
        let whole = Node { bounds: Bounds::NONE, first: 0, count: faces.len() as u32 };
        let mut made = Self { faces, nodes: vec![whole] };
        let mut next = 0;
        while next < made.nodes.len() {
            made.cut(next);
            next += 1;
        }
        made
    }

    /// Finds how far a node reaches, and cuts it in two if it holds too many triangles.
    fn cut(&mut self, at: usize) {
        let (first, count) = (self.nodes[at].first as usize, self.nodes[at].count as usize);
        let faces = &mut self.faces[first..first + count];
        self.nodes[at].bounds = faces.iter().fold(Bounds::NONE, |all, face| all.with(face.bounds()));
        if count <= LEAF {
            return;
        }
        let half = halves(faces);
        (self.nodes[at].first, self.nodes[at].count) = (self.nodes.len() as u32, 0);
        for (first, count) in [(first, half), (first + half, count - half)] {
            self.nodes.push(Node { bounds: Bounds::NONE, first: first as u32, count: count as u32 });
        }
    }

    /// The triangle that a ray along a unit vector meets first.
    pub(super) fn meet(&self, from: Vec3, along: Vec3) -> Option<u32> {
        let (from, along) = (Vec3A::from(from), Vec3A::from(along));
        let inverse = along.recip();
        let (mut nearest, mut found) = (f32::INFINITY, None);
        let mut waiting = [(0_u32, 0.0_f32); WAITING];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (node, into) = waiting[count];
            if into > nearest {
                continue;
            }
            let node = &self.nodes[node as usize];
            let first = node.first as usize;
            if node.count > 0 {
                for face in &self.faces[first..first + node.count as usize] {
                    if let Some(way) = face.meet(from, along).filter(|way| *way < nearest) {
                        (nearest, found) = (way, Some(face.number));
                    }
                }
            } else if let Some([one, other]) =
                self.nodes.get(first..first + 2).and_then(|n| n.first_chunk::<2>())
            {
                let entry = |node: &Node| node.bounds.entry(from, inverse, nearest).unwrap_or(f32::INFINITY);
                let (a, b) = ((node.first, entry(one)), (node.first + 1, entry(other)));
                let (near, far) = if a.1 <= b.1 { (a, b) } else { (b, a) };
                for child in [far, near] {
                    if child.1 < f32::INFINITY && count < WAITING {
                        waiting[count] = child;
                        count += 1;
                    }
                }
            }
        }
        found
    }

    /// Shows `look` the triangles that may lie within the root of `within` metres of a place; it says within which they are wanted from then on.
    pub(super) fn near(&self, place: Vec3, mut within: f32, mut look: impl FnMut(u32) -> f32) {
        let place = Vec3A::from(place);
        let mut waiting = [0_u32; WAITING];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let node = &self.nodes[waiting[count] as usize];
            let apart = place - place.clamp(node.bounds.low, node.bounds.high.max(node.bounds.low));
            if apart.length_squared() >= within {
                continue;
            }
            let first = node.first as usize;
            for face in &self.faces[first..first + node.count as usize] {
                within = look(face.number);
            }
            if node.count == 0 && !self.faces.is_empty() {
                for child in [node.first, node.first + 1] {
                    if let Some(room) = waiting.get_mut(count) {
                        *room = child;
                        count += 1;
                    }
                }
            }
        }
    }
}

/// Sorts faces into two parts whose boxes rays meet least often; how many the first has. Where they differ too little, halves.
fn halves(faces: &mut [Face]) -> usize {
    /// A part has at least one of so many faces, so that no tree gets deeper than [`WAITING`].
    const LEAST: usize = 4;
    let middle = |face: &Face| Bounds { low: face.middle(), high: face.middle() };
    let middles = faces.iter().fold(Bounds::NONE, |all, face| all.with(middle(face)));
    let extent = middles.high - middles.low;
    let slice = |face: &Face, axis: usize| {
        let share = (face.middle()[axis] - middles.low[axis]) / extent[axis].max(f32::MIN_POSITIVE);
        ((share * SLICES as f32) as usize).min(SLICES - 1)
    };
    let mut cheapest = (f32::INFINITY, 0, 0);
    for axis in 0..3 {
        let mut slices = [(Bounds::NONE, 0_usize); SLICES];
        for face in &*faces {
            let (bounds, count) = &mut slices[slice(face, axis)];
            (*bounds, *count) = (bounds.with(face.bounds()), *count + 1);
        }
        let part = |slices: &[(Bounds, usize)]| {
            slices
                .iter()
                .fold((Bounds::NONE, 0), |(all, sum), (bounds, count)| (all.with(*bounds), sum + count))
        };
        for cut in 1..SLICES {
            let parts = [part(&slices[..cut]), part(&slices[cut..])];
            let cost: f32 = parts.iter().map(|(bounds, count)| bounds.area() * *count as f32).sum();
            if parts.iter().all(|(_, count)| count * LEAST >= faces.len()) && cost < cheapest.0 {
                cheapest = (cost, axis, cut);
            }
        }
    }
    let (cost, axis, cut) = cheapest;
    if cost.is_infinite() {
        return faces.len() / 2;
    }
    faces.sort_unstable_by_key(|face| slice(face, axis) >= cut);
    faces.partition_point(|face| slice(face, axis) < cut)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_meets_what_is_nearest_of_all_triangles() {
        let mut state = 7_u64;
        let mut even = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
        };
        for name in ["skiff", "frigate"] {
            let model = bowwave_models::resolve(name, std::path::Path::new(".")).unwrap();
            let rays = Rays::of(&model);
            let size = model.max - model.min;
            let mut met = 0;
            for _ in 0..400 {
                let from = model.min + size * (0.5 * Vec3::new(even(), even(), even()) + 0.5);
                let along = Vec3::new(even(), even(), even()).normalize();
                let ways = rays
                    .faces
                    .iter()
                    .filter_map(|face| Some((face.meet(from.into(), along.into())?, face.number)));
                let expected = ways.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, number)| number);
                assert_eq!(rays.meet(from, along), expected, "{name}");
                met += u32::from(expected.is_some());
            }
            assert!(met > 100 && met < 400, "{met}");
        }
    }

    #[test]
    fn nothing_is_met_of_no_triangles_and_equal_ones_end() {
        let mut model = crate::testing::box_model("box", [4.0, 2.0, 1.5], [0.5; 3]);
        model.indices = model.indices[..3].repeat(100_000);
        let rays = Rays::of(&model);
        assert!(rays.nodes.len() > 10_000);
        model.indices.clear();
        assert_eq!(Rays::of(&model).meet(Vec3::ZERO, Vec3::Z), None);
    }
}
