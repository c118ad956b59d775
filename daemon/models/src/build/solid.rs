//! Closed surfaces made of triangles, and what the builders do with them. Boat axes: x forward, y to port, z up, metres.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};

use super::paint::Paint;

/// A triangle, counter-clockwise seen from outside.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tri {
    /// Corners.
    pub(crate) p: [Vec3; 3],
    /// Its paint.
    pub(crate) paint: Paint,
}

impl Tri {
    /// Twice the area times the outward unit normal.
    pub(crate) fn area_vector(&self) -> Vec3 {
        (self.p[1] - self.p[0]).cross(self.p[2] - self.p[0])
    }
}

/// A closed surface.
#[derive(Clone, Debug)]
pub(crate) struct Solid {
    /// The triangles.
    pub(crate) tris: Vec<Tri>,
    /// Edges whose faces meet at more than this angle stay hard, radians.
    pub(crate) crease: f32,
}

/// Corners closer than this are one corner, metres.
pub(crate) const WELD: f32 = 1e-4;

impl Solid {
    /// Collects the triangles that have an area; the crease angle is in degrees.
    pub(crate) fn new(crease_deg: f32) -> Self {
        Self { tris: Vec::new(), crease: crease_deg.to_radians() }
    }

    /// Adds a triangle unless two of its corners coincide.
    pub(crate) fn tri(&mut self, a: Vec3, b: Vec3, c: Vec3, paint: Paint) {
        let apart = |p: Vec3, q: Vec3| key(p) != key(q);
        if apart(a, b) && apart(b, c) && apart(c, a) {
            self.tris.push(Tri { p: [a, b, c], paint });
        }
    }

    /// Adds a quadrilateral, split along its shorter diagonal.
    pub(crate) fn quad(&mut self, [a, b, c, d]: [Vec3; 4], paint: Paint) {
        if a.distance_squared(c) <= b.distance_squared(d) {
            self.tri(a, b, c, paint);
            self.tri(a, c, d, paint);
        } else {
            self.tri(a, b, d, paint);
            self.tri(b, c, d, paint);
        }
    }

    /// Volume, cubic metres; negative where the surface is inside out.
    pub(crate) fn volume(&self) -> f32 {
        self.tris.iter().map(|t| t.p[0].dot(t.p[1].cross(t.p[2])) / 6.0).sum()
    }

    /// Turns an inside-out surface over.
    fn outward(mut self) -> Self {
        if self.volume() < 0.0 {
            self.tris.iter_mut().for_each(|t| t.p.swap(1, 2));
        }
        self
    }

    /// Applies `f` to every corner; `f` must not mirror.
    pub(crate) fn map(mut self, f: impl Fn(Vec3) -> Vec3) -> Self {
        self.tris.iter_mut().for_each(|t| t.p = t.p.map(&f));
        self
    }

    /// Shifted.
    pub(crate) fn moved(self, by: Vec3) -> Self {
        self.map(|p| p + by)
    }

    /// Turned about the origin.
    pub(crate) fn turned(self, by: Quat) -> Self {
        self.map(|p| by * p)
    }

    /// Another crease angle, degrees.
    pub(crate) fn creased(mut self, degrees: f32) -> Self {
        self.crease = degrees.to_radians();
        self
    }

    /// Cuts every triangle that crosses the plane `normal . p = d`, so that paints and parts can change there.
    pub(crate) fn cut(mut self, normal: Vec3, d: f32) -> Self {
        let mut cut = Self { tris: Vec::with_capacity(self.tris.len()), crease: self.crease };
        for t in self.tris.drain(..) {
            cut_one(&t, normal, d, &mut cut);
        }
        cut
    }

    /// Paints what lies wholly where `inside` says so for a triangle's middle; call [`Solid::cut`] first.
    pub(crate) fn repaint(mut self, paint: Paint, inside: impl Fn(Vec3) -> bool) -> Self {
        for t in &mut self.tris {
            if inside((t.p[0] + t.p[1] + t.p[2]) / 3.0) {
                t.paint = paint;
            }
        }
        self
    }

    /// Cuts at height `z` and paints what lies below it.
    pub(crate) fn paint_below(self, z: f32, paint: Paint) -> Self {
        self.cut(Vec3::Z, z).repaint(paint, |p| p.z < z)
    }

    /// Cuts at height `z` and paints what lies above it.
    pub(crate) fn paint_above(self, z: f32, paint: Paint) -> Self {
        self.cut(Vec3::Z, z).repaint(paint, |p| p.z > z)
    }
}

/// Corner identity: the position in units of [`WELD`].
pub(crate) fn key(p: Vec3) -> [i32; 3] {
    (p / WELD).round().to_array().map(|v| v as i32)
}

/// Splits one triangle at a plane; the cut point of an edge is the same from both of its triangles.
fn cut_one(t: &Tri, normal: Vec3, d: f32, out: &mut Solid) {
    // Corners nearer than this to the plane count as in it: no slivers.
    const ON_PLANE: f32 = 0.004;
    let side = t.p.map(|p| {
        let s = normal.dot(p) - d;
        if s.abs() < ON_PLANE { 0.0 } else { s }
    });
    let crosses = |i: usize, j: usize| side[i] * side[j] < 0.0;
    let point = |i: usize, j: usize| {
        // The same corner first whichever way round the edge is met: bit-equal points.
        let (i, j) = if key(t.p[i]) < key(t.p[j]) { (i, j) } else { (j, i) };
        t.p[i].lerp(t.p[j], side[i] / (side[i] - side[j]))
    };
    for i in 0..3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        if crosses(i, j) && crosses(k, i) {
            let (ij, ki) = (point(i, j), point(k, i));
            out.tri(t.p[i], ij, ki, t.paint);
            out.quad([ij, t.p[j], t.p[k], ki], t.paint);
            return;
        }
        if crosses(i, j) && side[k] == 0.0 {
            let ij = point(i, j);
            out.tri(t.p[i], ij, t.p[k], t.paint);
            out.tri(ij, t.p[j], t.p[k], t.paint);
            return;
        }
    }
    out.tri(t.p[0], t.p[1], t.p[2], t.paint);
}

/// A skin over closed rings of equally many points, its ends closed by fans.
pub(crate) fn skin(rings: &[Vec<Vec3>], paint: Paint, crease_deg: f32) -> Solid {
    let mut solid = Solid::new(crease_deg);
    for pair in rings.windows(2) {
        let n = pair[0].len().min(pair[1].len());
        for k in 0..n {
            let next = (k + 1) % n;
            solid.quad([pair[0][k], pair[0][next], pair[1][next], pair[1][k]], paint);
        }
    }
    for (ring, flip) in [(rings.first(), true), (rings.last(), false)] {
        if let Some(ring) = ring {
            fan(&mut solid, ring, flip, paint);
        }
    }
    solid.outward()
}

/// Closes a convex ring, with the shorter diagonal where it has four corners.
fn fan(solid: &mut Solid, ring: &[Vec3], flip: bool, paint: Paint) {
    let ordered: Vec<Vec3> = if flip { ring.iter().rev().copied().collect() } else { ring.to_vec() };
    match ordered[..] {
        [a, b, c, d] => solid.quad([a, b, c, d], paint),
        [first, ref rest @ ..] => rest.windows(2).for_each(|w| solid.tri(first, w[0], w[1], paint)),
        [] => {}
    }
}

/// A block between two opposite corners.
pub(crate) fn block(a: Vec3, b: Vec3, paint: Paint) -> Solid {
    tapered(a.min(b), a.max(b), [0.0; 4], paint)
}

/// A block whose top is drawn in by `inset` = [aft, forward, starboard, port] metres.
pub(crate) fn tapered(min: Vec3, max: Vec3, inset: [f32; 4], paint: Paint) -> Solid {
    let [aft, fore, star, port] = inset;
    let low = [(min.x, min.y), (max.x, min.y), (max.x, max.y), (min.x, max.y)];
    let high = [
        (min.x + aft, min.y + star),
        (max.x - fore, min.y + star),
        (max.x - fore, max.y - port),
        (min.x + aft, max.y - port),
    ];
    prism(&low, min.z, &high, max.z, paint)
}

/// A prismatoid between a polygon at one height and another of as many corners at a second height.
pub(crate) fn prism(low: &[(f32, f32)], z_low: f32, high: &[(f32, f32)], z_high: f32, paint: Paint) -> Solid {
    let ring = |points: &[(f32, f32)], z: f32| points.iter().map(|&(x, y)| Vec3::new(x, y, z)).collect();
    skin(&[ring(low, z_low), ring(high, z_high)], paint, 25.0)
}

/// An ellipse of `sides` corners with half axes `u` and `v` about `centre`.
pub(crate) fn ellipse(centre: Vec3, u: Vec3, v: Vec3, sides: usize) -> Vec<Vec3> {
    (0..sides)
        .map(|k| {
            let a = (k as f32 + 0.5) / sides as f32 * TAU;
            centre + u * a.cos() + v * a.sin()
        })
        .collect()
}

/// A pipe along a path with a radius at each of its points; flat ends.
pub(crate) fn pipe(path: &[(Vec3, f32)], sides: usize, paint: Paint) -> Solid {
    let mut rings = Vec::with_capacity(path.len());
    let mut side = Vec3::ZERO;
    for (i, &(p, r)) in path.iter().enumerate() {
        let before = path[i.saturating_sub(1)].0;
        let after = path[(i + 1).min(path.len() - 1)].0;
        let along = (after - before).normalize_or(Vec3::Z);
        // Carry the previous ring's direction on, so that the pipe does not twist.
        side = (side - along * side.dot(along))
            .try_normalize()
            .unwrap_or_else(|| along.any_orthonormal_vector());
        rings.push(ellipse(p, side * r, along.cross(side) * r, sides));
    }
    skin(&rings, paint, 65.0)
}

/// A thin straight bar.
pub(crate) fn bar(from: Vec3, to: Vec3, radius: f32, paint: Paint) -> Solid {
    pipe(&[(from, radius), (to, radius)], 4, paint).creased(30.0)
}

/// A pipe with rounded ends.
pub(crate) fn capsule(from: Vec3, to: Vec3, r_from: f32, r_to: f32, sides: usize, paint: Paint) -> Solid {
    let along = (to - from).normalize_or(Vec3::Z);
    pipe(
        &[
            (from - along * r_from * 0.8, r_from * 0.55),
            (from, r_from),
            (to, r_to),
            (to + along * r_to * 0.8, r_to * 0.55),
        ],
        sides,
        paint,
    )
}

/// An ellipsoid with half axes `radii`.
pub(crate) fn ellipsoid(centre: Vec3, radii: Vec3, sides: usize, rows: usize, paint: Paint) -> Solid {
    let rings: Vec<Vec<Vec3>> = (0..=rows)
        .map(|i| {
            let (sin, cos) = (i as f32 / rows as f32 * TAU / 2.0).sin_cos();
            let at = centre - Vec3::Z * radii.z * cos;
            ellipse(at, Vec3::X * radii.x * sin, Vec3::Y * radii.y * sin, sides)
        })
        .collect();
    skin(&rings, paint, 80.0)
}

/// An upright cylinder.
pub(crate) fn drum(foot: Vec3, radius: f32, height: f32, sides: usize, paint: Paint) -> Solid {
    pipe(&[(foot, radius), (foot + Vec3::Z * height, radius)], sides, paint)
}
