//! Shadow volumes (Crow 1977; Hughes, Konttinen and Pattanaik 2004, section 4.4): edges of the silhouette as the sun sees it, drawn out away from the sun,
//! counted before or behind each place that is seen.
//!
//! **As it should be**: drawn out to infinity (homogeneous weight 0, where all parallel edges meet in one place, so that the far cap is a point), and
//! counted behind what is seen, with caps (depth-fail; Everitt and Kilgard 2002), wherever the eye is. The cap is the far side of a closed hull: no lit
//! face lies on it. Open shells count whichever way they face, edges by how often (Kim, Kim and Lee 2008).
//!
//! **As printed** (4.4.1 and 4.4.2): drawn out by some length, no caps, counted before what is seen: wrong where the eye is within a volume, and
//! where the length ends before the shadow does.

use glam::{Vec2, Vec3};

use super::{
    ShadowEye, ShadowFrame, ShadowMethod,
    mesh::{CasterMesh, MeshEdge},
    seen::{SeenPoint, SeenPoints},
};

/// What is counted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Counting {
    /// Faces behind what is seen, with caps, to infinity.
    DepthFail,
    /// Faces before what is seen, without caps, drawn out by so many metres.
    DepthPass {
        /// Metres away from the sun.
        length_m: f32,
    },
}

/// One drawing of the picture in a sequence of passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stage {
    /// Its task.
    pub task: &'static str,
    /// Times that the meshes seen are drawn, that volumes are drawn, and that the whole picture is gone over.
    pub drawn: [u32; 3],
}

/// Shadows of virtual things on real ones (Hughes, Konttinen and Pattanaik 2004, 4.4.4). Volumes are drawn twice, once for either side.
pub const FIVE_STAGES: [Stage; 5] = [
    Stage { task: "phantoms of real things to depth", drawn: [1, 0, 0] },
    Stage { task: "darken what no phantom covers", drawn: [0, 0, 1] },
    Stage { task: "volumes to the stencil", drawn: [0, 2, 0] },
    Stage { task: "light what is not in shadow", drawn: [1, 0, 0] },
    Stage { task: "darken what is in shadow", drawn: [0, 0, 1] },
];

/// Shadows of real and virtual things on virtual ones (the same, 4.4.5).
pub const FOUR_STAGES: [Stage; 4] = [
    Stage { task: "clear the stencil", drawn: [0, 0, 1] },
    Stage { task: "virtual things in ambient light", drawn: [1, 0, 0] },
    Stage { task: "volumes to the stencil", drawn: [0, 2, 0] },
    Stage { task: "what is not in shadow in full light", drawn: [1, 0, 0] },
];

/// A place is so much nearer to the eye than what it is compared with, metres: a cap may lie where it does.
const NEARER_M: f32 = 0.003;

/// Volumes of all meshes, counted at what is seen.
pub struct ShadowVolumes {
    counting: Counting,
    counts: Vec<i16>,
}

impl ShadowVolumes {
    /// Volumes that are counted so.
    pub fn new(counting: Counting) -> Self {
        Self { counting, counts: Vec::new() }
    }

    fn add_mesh(&mut self, frame: &ShadowFrame<'_>, mesh: &CasterMesh, seen: &SeenPoints) {
        let lit: Vec<i16> = (0..mesh.triangles.len()).map(|t| casting(mesh, t, frame.sun)).collect();
        let eye = &frame.eye;
        let in_eye = |place: Vec3| turned(eye, place - eye.position);
        let away = turned(eye, -frame.sun);
        for edge in &mesh.edges {
            let count = silhouette(mesh, edge, &lit);
            if count == 0 {
                continue;
            }
            let [a, b] = edge.ends.map(|i| in_eye(mesh.places[i as usize]));
            match self.counting {
                Counting::DepthFail => self.add_face([a, b, away], true, count, seen),
                Counting::DepthPass { length_m } => {
                    let (c, d) = (b + away * length_m, a + away * length_m);
                    self.add_face([a, b, c], false, count, seen);
                    self.add_face([a, c, d], false, count, seen);
                }
            }
        }
        if self.counting == Counting::DepthFail {
            for (triangle, count) in lit.iter().enumerate().filter(|(_, count)| **count != 0) {
                let corners = mesh.corners_of(triangle).map(in_eye);
                // A cap bounds its volume on its side towards the sun, the other faces on their left-hand side.
                self.add_face(corners, false, -count, seen);
            }
        }
    }

    /// Counts one face of a volume at all points that it lies behind, or before. Its corners are right, down and ahead of the eye; with `to_infinity` the
    /// last of them is a direction. A ray that crosses it along its normal, by its corners counter-clockwise, enters `count` volumes.
    fn add_face(&mut self, corners: [Vec3; 3], to_infinity: bool, count: i16, seen: &SeenPoints) {
        let [a, b, c] = corners;
        // A ray from the eye goes through the face where it is on one side of all three planes through the eye (Olano and Greer 1997).
        let inside = a.dot(b.cross(c));
        if inside == 0.0 {
            return;
        }
        let side = inside.signum();
        let planes = [a.cross(b), b.cross(c), c.cross(a)].map(|plane| plane * side);
        let normal = (b - a).cross(if to_infinity { c } else { c - a });
        let Some(area) = bounds(corners, seen) else { return };
        let is_pass = matches!(self.counting, Counting::DepthPass { .. });
        let count = if (side > 0.0) == is_pass { count } else { -count };
        let nearest = a.dot(normal);
        for y in area[0][1]..area[1][1] {
            let Some(columns) = columns(&planes, y, area, seen) else { continue };
            let points = seen.of_pixel(columns[0], y).start..seen.of_pixel(columns[1] - 1, y).end;
            for point in &seen.points[points] {
                if planes.iter().any(|plane| plane.dot(point.ray) < 0.0) {
                    continue;
                }
                let depth = nearest / normal.dot(point.ray);
                if (depth < point.depth - NEARER_M) == is_pass {
                    self.counts[point.number as usize] += count;
                }
            }
        }
    }
}

impl ShadowMethod for ShadowVolumes {
    fn prepare(&mut self, frame: &ShadowFrame<'_>, seen: &SeenPoints) {
        self.counts.clear();
        self.counts.resize(seen.points.len(), 0);
        frame.meshes.iter().for_each(|mesh| self.add_mesh(frame, mesh, seen));
    }

    fn share(&self, point: &SeenPoint) -> f32 {
        f32::from(self.counts[point.number as usize] == 0)
    }

    fn bytes(&self) -> usize {
        self.counts.capacity() * size_of::<i16>()
    }
}

/// A vector to the right, downwards and ahead of an eye.
fn turned(eye: &ShadowEye, v: Vec3) -> Vec3 {
    Vec3::from_array(eye.axes.map(|axis| axis.dot(v)))
}

/// Whether a triangle casts: far sides of closed parts do, once; triangles of open shells do whichever way they face, with the sign of their facing.
fn casting(mesh: &CasterMesh, triangle: usize, sun: Vec3) -> i16 {
    let [a, b, c] = mesh.corners_of(triangle);
    let facing = (b - a).cross(c - a).dot(sun);
    match (mesh.is_closed[triangle], facing < 0.0) {
        (_, true) => -1,
        (true, false) => 0,
        (false, false) => 1,
    }
}

/// Net count of an edge, in the direction from its lower end to its higher, over the triangles that cast.
fn silhouette(mesh: &CasterMesh, edge: &MeshEdge, casting: &[i16]) -> i16 {
    let (first, count) = edge.uses;
    let uses = &mesh.uses[first as usize..(first + count) as usize];
    uses.iter().map(|u| casting[u.triangle as usize] * if u.is_reversed { -1 } else { 1 }).sum()
}

/// Pixels of what is seen between which a face may lie, from and to; nothing where it lies behind the eye or beside them.
fn bounds(corners: [Vec3; 3], seen: &SeenPoints) -> Option<[[u32; 2]; 2]> {
    /// Nearer than this nothing is projected, metres ahead.
    const NEAR: f32 = 1e-3;
    let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
    let mut add = |p: Vec3| {
        let flat = p.truncate() / p.z;
        (low, high) = (low.min(flat), high.max(flat));
    };
    for (from, to) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (corners[i], corners[j])) {
        if from.z >= NEAR {
            add(from);
        }
        if (from.z < NEAR) != (to.z < NEAR) {
            add(from.lerp(to, (NEAR - from.z) / (to.z - from.z)));
        }
    }
    let [[cx, cy], [fx, fy]] = seen.lens;
    let pixel =
        |p: Vec2| Vec2::new(cx + p.x * fx - seen.corner[0] as f32, cy + p.y * fy - seen.corner[1] as f32);
    let (low, high) = (pixel(low), pixel(high));
    let end = |v: f32, most: u32| (v.max(0.0) as u32).min(most);
    let from = [end(low.x.floor(), seen.size[0]), end(low.y.floor(), seen.size[1])];
    let to = [end(high.x.floor() + 1.0, seen.size[0]), end(high.y.floor() + 1.0, seen.size[1])];
    (from[0] < to[0] && from[1] < to[1]).then_some([from, to])
}

/// Columns of a row of pixels, from and to, in which rays may lie on the inner side of all planes.
fn columns(planes: &[Vec3; 3], y: u32, [low, high]: [[u32; 2]; 2], seen: &SeenPoints) -> Option<[u32; 2]> {
    let [[cx, cy], [fx, fy]] = seen.lens;
    let tangent = |y: u32| ((seen.corner[1] + y) as f32 - cy) / fy;
    let (upper, lower) = (tangent(y), tangent(y + 1));
    let (mut from, mut to) = (f32::NEG_INFINITY, f32::INFINITY);
    for plane in planes {
        let most = (plane.y * upper).max(plane.y * lower) + plane.z;
        if plane.x > 0.0 {
            from = from.max(-most / plane.x);
        } else if plane.x < 0.0 {
            to = to.min(-most / plane.x);
        } else if most < 0.0 {
            return None;
        }
    }
    let column = |tangent: f32| (cx + tangent * fx - seen.corner[0] as f32).floor().clamp(-1.0, 1e6) as i64;
    let from = column(from).max(i64::from(low[0]));
    let to = (column(to) + 1).min(i64::from(high[0]));
    (from < to).then_some([from as u32, to as u32])
}

#[cfg(test)]
mod tests {
    use bowwave_core::geometry::RigidPose;
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::truth::boat::{box_boat, mesh};

    /// Share of the ground's pixels at which a method and rays to the sun agree, for an eye that looks along `ahead`.
    fn agreed(counting: Counting, eye: Vec3, ahead: Vec3) -> f64 {
        const SIDE: u32 = 48;
        let pose = RigidPose { world_from_body: DQuat::IDENTITY, position: DVec3::ZERO };
        let (rays, caster) = (mesh(&box_boat(), pose), CasterMesh::of(&box_boat(), pose, DVec3::ZERO));
        let sun = Vec3::new(0.6, 0.1, 0.79).normalize();
        let ahead = ahead.normalize();
        let right = ahead.cross(Vec3::Z).normalize();
        let half = 0.5 * SIDE as f32;
        let axes = [right, ahead.cross(right), ahead];
        let eye = ShadowEye { position: eye, axes, reach: [1.0; 2], pixel: 1.0 / half };
        let mut seen = SeenPoints::begin([0, 0], [SIDE; 2], [[half; 2]; 2]);
        for i in 0..SIDE * SIDE {
            let pixel = |v: u32| (v as f32 + 0.5 - half) / half;
            let ray = Vec3::new(pixel(i % SIDE), pixel(i / SIDE), 1.0);
            let along = axes[0] * ray.x + axes[1] * ray.y + axes[2];
            // The ground lies a little below the keel.
            let depth = (-0.65 - eye.position.z) / along.z;
            let place = eye.position + along * depth;
            if depth > 0.0 && rays.meet(eye.position.as_dvec3(), along.as_dvec3(), f64::from(depth)).is_none()
            {
                seen.push(SeenPoint {
                    number: 0,
                    mesh: SeenPoint::GROUND,
                    place,
                    normal: Vec3::Z,
                    ray,
                    depth,
                });
            }
            seen.end_pixel();
        }
        let meshes = [caster];
        let mut volumes = ShadowVolumes::new(counting);
        volumes.prepare(&ShadowFrame { sun, meshes: &meshes, eye }, &seen);
        let is_free = |p: &SeenPoint| !rays.blocks(p.place.as_dvec3(), sun.as_dvec3());
        let same = seen.points.iter().filter(|p| (volumes.share(p) > 0.5) == is_free(p)).count();
        assert!(
            seen.points.len() > 200 && seen.points.iter().any(is_free) && !seen.points.iter().all(is_free)
        );
        same as f64 / seen.points.len() as f64
    }

    #[test]
    fn counting_behind_is_right_wherever_the_eye_is_and_counting_before_is_not() {
        let (far, far_ahead) = (Vec3::new(-5.0, -12.0, 5.0), Vec3::new(0.0, 1.0, -0.4));
        let (shaded, shaded_ahead) = (Vec3::new(-4.3, 0.05, 0.2), Vec3::new(-1.0, 0.03, -0.2));
        let pass = Counting::DepthPass { length_m: 100.0 };
        assert!(agreed(Counting::DepthFail, far, far_ahead) > 0.995);
        assert!(agreed(pass, far, far_ahead) > 0.995);
        assert!(agreed(Counting::DepthFail, shaded, shaded_ahead) > 0.995);
        assert!(agreed(pass, shaded, shaded_ahead) < 0.5);
    }
}
