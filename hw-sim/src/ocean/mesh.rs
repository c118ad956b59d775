//! The boat's triangles in the world, and where rays meet them.

use glam::{DQuat, DVec2, DVec3};

/// A corner of a boat's triangle, in the world.
#[derive(Clone, Copy, Debug)]
pub struct MeshCorner {
    /// Place, metres.
    pub position: DVec3,
    /// Unit normal on the outer side.
    pub normal: DVec3,
    /// Diffuse reflectance.
    pub albedo: DVec3,
}

/// Place of a boat's axes in the world.
#[derive(Clone, Copy, Debug)]
pub struct BoatFrame {
    /// Rotation from the boat's axes to the world's.
    pub world_from_boat: DQuat,
    /// Origin, metres.
    pub position: DVec3,
}

/// One triangle.
#[derive(Clone, Copy, Debug)]
struct MeshTriangle {
    corner: DVec3,
    edges: [DVec3; 2],
    normals: [DVec3; 3],
    albedo: [DVec3; 3],
}

#[derive(Clone, Copy, Debug)]
struct MeshBounds {
    low: DVec3,
    high: DVec3,
}

impl MeshBounds {
    const EMPTY: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    fn with(self, p: DVec3) -> Self {
        Self { low: self.low.min(p), high: self.high.max(p) }
    }

    fn entry(&self, origin: DVec3, inverse: DVec3, t_max: f64) -> Option<f64> {
        let (a, b) = ((self.low - origin) * inverse, (self.high - origin) * inverse);
        let near = a.min(b).max_element().max(0.0);
        let far = a.max(b).min_element().min(t_max);
        (near <= far).then_some(near)
    }
}

enum MeshNode {
    Leaf {
        bounds: MeshBounds,
        range: std::ops::Range<usize>,
    },
    /// Children are the next node and `right`.
    Inner {
        bounds: MeshBounds,
        right: usize,
    },
}

/// Where a ray meets the boat.
#[derive(Clone, Copy, Debug)]
pub struct MeshHit {
    /// Distance along the ray.
    pub t: f64,
    /// Unit normal, interpolated, on the model's outer side.
    pub normal: DVec3,
    /// Diffuse reflectance.
    pub albedo: DVec3,
}

/// A boat in the world.
pub struct BoatMesh {
    triangles: Vec<MeshTriangle>,
    nodes: Vec<MeshNode>,
    frame: BoatFrame,
    waterline: Vec<DVec2>,
}

const LEAF: usize = 4;

impl BoatMesh {
    /// A boat of these triangles, with its outline at the waterline in its own axes, counter-clockwise from above.
    pub fn new(
        triangles: impl IntoIterator<Item = [MeshCorner; 3]>,
        frame: BoatFrame,
        waterline: Vec<DVec2>,
    ) -> Self {
        let mut triangles: Vec<MeshTriangle> = triangles
            .into_iter()
            .map(|corners| {
                let p = corners.map(|c| c.position);
                MeshTriangle {
                    corner: p[0],
                    edges: [p[1] - p[0], p[2] - p[0]],
                    normals: corners.map(|c| c.normal),
                    albedo: corners.map(|c| c.albedo),
                }
            })
            .collect();
        let mut nodes = Vec::new();
        let count = triangles.len();
        split(&mut triangles, 0..count, &mut nodes);
        Self { triangles, nodes, frame, waterline }
    }

    /// The boat's axes.
    pub fn frame(&self) -> &BoatFrame {
        &self.frame
    }

    /// Whether water at `point` would stand inside the hull: within its outline at the waterline and not far above it.
    pub fn holds_water(&self, point: DVec3) -> bool {
        let p = self.frame.world_from_boat.inverse() * (point - self.frame.position);
        self.waterline.len() > 2
            && p.z.abs() < 3.0
            && (0..self.waterline.len()).all(|i| {
                let (a, b) = (self.waterline[i], self.waterline[(i + 1) % self.waterline.len()]);
                (b - a).perp_dot(p.truncate() - a) >= 0.0
            })
    }

    /// The nearest hit before `t_max`.
    pub fn meet(&self, origin: DVec3, direction: DVec3, t_max: f64) -> Option<MeshHit> {
        let inverse = direction.recip();
        let mut best: Option<(f64, usize, f64, f64)> = None;
        let mut limit = t_max;
        let mut stack = [0usize; 64];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let index = stack[depth];
            match &self.nodes[index] {
                MeshNode::Leaf { bounds, range } => {
                    if bounds.entry(origin, inverse, limit).is_none() {
                        continue;
                    }
                    for i in range.clone() {
                        if let Some((t, u, v)) = self.triangles[i].meet(origin, direction)
                            && t < limit
                        {
                            limit = t;
                            best = Some((t, i, u, v));
                        }
                    }
                }
                MeshNode::Inner { bounds, right } => {
                    if bounds.entry(origin, inverse, limit).is_some() && depth + 2 <= stack.len() {
                        stack[depth] = *right;
                        stack[depth + 1] = index + 1;
                        depth += 2;
                    }
                }
            }
        }
        best.map(|(t, i, u, v)| {
            let tri = &self.triangles[i];
            let mixed = |c: &[DVec3; 3]| c[0] * (1.0 - u - v) + c[1] * u + c[2] * v;
            MeshHit { t, normal: mixed(&tri.normals).normalize_or(DVec3::Z), albedo: mixed(&tri.albedo) }
        })
    }

    /// Whether anything stands in the way.
    pub fn blocks(&self, origin: DVec3, direction: DVec3) -> bool {
        self.meet(origin, direction, f64::INFINITY).is_some()
    }
}

impl MeshTriangle {
    /// Moeller and Trumbore 1997.
    fn meet(&self, origin: DVec3, direction: DVec3) -> Option<(f64, f64, f64)> {
        let p = direction.cross(self.edges[1]);
        let det = self.edges[0].dot(p);
        if det.abs() < 1e-14 {
            return None;
        }
        let s = origin - self.corner;
        let u = s.dot(p) / det;
        let q = s.cross(self.edges[0]);
        let v = direction.dot(q) / det;
        let t = self.edges[1].dot(q) / det;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-6).then_some((t, u, v))
    }

    fn bounds(&self) -> MeshBounds {
        MeshBounds::EMPTY
            .with(self.corner)
            .with(self.corner + self.edges[0])
            .with(self.corner + self.edges[1])
    }

    fn middle(&self) -> DVec3 {
        self.corner + (self.edges[0] + self.edges[1]) / 3.0
    }
}

fn split(triangles: &mut [MeshTriangle], range: std::ops::Range<usize>, nodes: &mut Vec<MeshNode>) {
    let part = &mut triangles[range.clone()];
    let bounds = part.iter().fold(MeshBounds::EMPTY, |b, t| {
        let o = t.bounds();
        MeshBounds { low: b.low.min(o.low), high: b.high.max(o.high) }
    });
    if range.len() <= LEAF {
        if !range.is_empty() {
            nodes.push(MeshNode::Leaf { bounds, range });
        }
        return;
    }
    let axis = (bounds.high - bounds.low).max_position();
    let half = range.len() / 2;
    part.select_nth_unstable_by(half, |a, b| a.middle()[axis].total_cmp(&b.middle()[axis]));
    let here = nodes.len();
    nodes.push(MeshNode::Inner { bounds, right: 0 });
    split(triangles, range.start..range.start + half, nodes);
    let right = nodes.len();
    split(triangles, range.start + half..range.end, nodes);
    nodes[here] = MeshNode::Inner { bounds, right };
}
