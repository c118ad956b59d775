//! A straight stretch of a round's path against the shape of a moving boat.

use glam::{DVec2, DVec3};

use crate::{
    geometry::RigidPose,
    model::{Model, ModelKind, Texture, Vertex, Zone},
    world::boats::facing,
};

/// Slack of the triangle test, in shares of a side: a round through a seam between two triangles must not slip through.
const SEAM: f64 = 1e-9;
/// Texels of a picture less opaque than this are no part of the boat.
const OPAQUE: u8 = 128;

/// A boat over a short span of time.
#[derive(Clone, Copy, Debug)]
pub struct Moving<'a> {
    /// Its shape.
    pub model: &'a Model,
    /// When it is at `from`, seconds.
    pub from_s: f64,
    /// Its pose then.
    pub from: RigidPose,
    /// When it is at `to`, seconds.
    pub to_s: f64,
    /// Its pose then.
    pub to: RigidPose,
}

impl Moving<'_> {
    /// The pose at a time in (or close to) the span. A picture boat is turned towards `eye`.
    pub fn pose_at(&self, time_s: f64, eye: DVec3) -> RigidPose {
        let span = self.to_s - self.from_s;
        let s = if span > 0.0 { ((time_s - self.from_s) / span).clamp(-1.0, 2.0) } else { 1.0 };
        let pose = RigidPose {
            world_from_body: self.from.world_from_body.lerp(self.to.world_from_body, s),
            position: self.from.position.lerp(self.to.position, s),
        };
        match self.model.kind {
            ModelKind::Mesh => pose,
            ModelKind::Quad => facing(&pose, eye),
        }
    }

    /// Radius about the boat's origin that holds its bounding box, metres.
    pub(super) fn reach_m(&self) -> f64 {
        let (min, max) = (self.model.min.as_dvec3(), self.model.max.as_dvec3());
        min.abs().max(max.abs()).length()
    }
}

/// Where a round struck a boat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strike {
    /// How far along the stretch, 0 to 1.
    pub fraction: f64,
    /// The part that was struck.
    pub zone: Zone,
    /// The point in the boat's space, metres.
    pub point: DVec3,
}

/// The first triangle of the model that the stretch from `a` to `b` (both in the boat's space, each at its own time) pierces,
/// from either side. Transparent parts of a picture let the round through.
pub fn strike(model: &Model, a: DVec3, b: DVec3) -> Option<Strike> {
    if !touches_box(model, a, b) {
        return None;
    }
    let ray = b - a;
    let mut first: Option<Strike> = None;
    for part in &model.parts {
        let range = part.indices.start as usize..part.indices.end as usize;
        let Some(indices) = model.indices.get(range) else { continue };
        for corner in indices.chunks_exact(3) {
            let Some(triangle) = corners(model, corner) else { continue };
            let Some(pierced) = pierce(triangle, a, ray) else { continue };
            let earlier = first.is_none_or(|f| pierced.fraction < f.fraction);
            if earlier && is_solid(model.texture.as_ref(), triangle, pierced) {
                let point = a + ray * pierced.fraction;
                first = Some(Strike { fraction: pierced.fraction, zone: part.zone, point });
            }
        }
    }
    first
}

/// Slab test of the bounding box, a little widened.
fn touches_box(model: &Model, a: DVec3, b: DVec3) -> bool {
    let margin = DVec3::splat(1e-3);
    let (min, max) = (model.min.as_dvec3() - margin, model.max.as_dvec3() + margin);
    let ray = b - a;
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for axis in 0..3 {
        if ray[axis] == 0.0 {
            if a[axis] < min[axis] || a[axis] > max[axis] {
                return false;
            }
            continue;
        }
        let (s, t) = ((min[axis] - a[axis]) / ray[axis], (max[axis] - a[axis]) / ray[axis]);
        enter = enter.max(s.min(t));
        leave = leave.min(s.max(t));
    }
    enter <= leave
}

pub(super) type HullTriangle<'a> = [&'a Vertex; 3];

pub(super) fn corners<'a>(model: &'a Model, indices: &[u32]) -> Option<HullTriangle<'a>> {
    let corner = |i: usize| indices.get(i).and_then(|&index| model.vertices.get(index as usize));
    Some([corner(0)?, corner(1)?, corner(2)?])
}

/// Where a stretch pierces a triangle.
#[derive(Clone, Copy, Debug)]
struct Pierced {
    fraction: f64,
    /// Weights of the triangle's second and third corner.
    weights: DVec2,
}

/// Moller and Trumbore 1997, both sides. Triangles without area, or seen exactly edge-on, are not pierced.
fn pierce(triangle: HullTriangle<'_>, from: DVec3, ray: DVec3) -> Option<Pierced> {
    let [p0, p1, p2] = triangle.map(|v| v.position.as_dvec3());
    let (e1, e2) = (p1 - p0, p2 - p0);
    let across = ray.cross(e2);
    let determinant = e1.dot(across);
    if determinant.abs() <= 1e-14 * e1.length() * e2.length() * ray.length() {
        return None;
    }
    let offset = from - p0;
    let u = offset.dot(across) / determinant;
    let turned = offset.cross(e1);
    let v = ray.dot(turned) / determinant;
    let fraction = e2.dot(turned) / determinant;
    let inside = u >= -SEAM && v >= -SEAM && u + v <= 1.0 + SEAM;
    (inside && (0.0..=1.0).contains(&fraction)).then_some(Pierced { fraction, weights: DVec2::new(u, v) })
}

fn is_solid(texture: Option<&Texture>, triangle: HullTriangle<'_>, pierced: Pierced) -> bool {
    let Some(texture) = texture else { return true };
    let [t0, t1, t2] = triangle.map(|v| v.uv.as_dvec2());
    is_solid_at(texture, t0 + (t1 - t0) * pierced.weights.x + (t2 - t0) * pierced.weights.y)
}

/// Whether a picture is opaque there.
pub(super) fn is_solid_at(texture: &Texture, uv: DVec2) -> bool {
    let texel =
        |c: f64, size: u32| ((c - c.floor()).min(1.0) * f64::from(size)).floor().min(f64::from(size) - 1.0);
    // A picture's last row and column belong to it: 1 does not wrap to 0.
    let edge = |c: f64| if c == 1.0 { 1.0 - f64::EPSILON } else { c };
    let (x, y) = (texel(edge(uv.x), texture.width), texel(edge(uv.y), texture.height));
    let alpha = (y * f64::from(texture.width) + x) as usize * 4 + 3;
    texture.rgba.get(alpha).is_none_or(|&alpha| alpha >= OPAQUE)
}

#[cfg(test)]
#[path = "hit_tests.rs"]
pub(crate) mod tests;
