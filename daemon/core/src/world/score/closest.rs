//! Where a stretch of a round's path is closest to a boat that it does not strike.

use glam::{DVec2, DVec3};

use super::hit::{HullTriangle, corners, is_solid_at};
use crate::model::{Model, Texture};

/// Cells across and down a picture in which its opaque part is looked for.
const CELLS: u32 = 48;

/// Where a round was closest to a boat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// How far along the stretch, 0 to 1.
    pub fraction: f64,
    /// Distance, metres; 0 where it touches.
    pub distance_m: f64,
}

impl Closest {
    fn nearer(self, other: Self) -> Self {
        if other.distance_m < self.distance_m { other } else { self }
    }
}

/// A stretch from one point to another.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    from: DVec3,
    ray: DVec3,
}

impl Stretch {
    fn at(&self, fraction: f64) -> DVec3 {
        self.from + self.ray * fraction
    }

    fn closest_to(&self, point: DVec3) -> Closest {
        let length2 = self.ray.length_squared();
        let along = if length2 > 0.0 { (point - self.from).dot(self.ray) / length2 } else { 0.0 };
        let fraction = along.clamp(0.0, 1.0);
        Closest { fraction, distance_m: self.at(fraction).distance(point) }
    }

    /// Where it is closest to the line from `p` to `q` (Ericson 2005, Real-Time Collision Detection, 5.1.9).
    fn closest_to_side(&self, p: DVec3, q: DVec3) -> Closest {
        let side = Self { from: p, ray: q - p };
        let (a, e) = (self.ray.length_squared(), side.ray.length_squared());
        if a <= 0.0 || e <= 0.0 {
            return if e <= 0.0 { self.closest_to(p) } else { side.seen_from(self.from) };
        }
        let apart = self.from - p;
        let (b, c, f) = (self.ray.dot(side.ray), self.ray.dot(apart), side.ray.dot(apart));
        let denominator = a * e - b * b;
        let s =
            if denominator > 1e-12 * a * e { ((b * f - c * e) / denominator).clamp(0.0, 1.0) } else { 0.0 };
        let t = ((b * s + f) / e).clamp(0.0, 1.0);
        self.closest_to(side.at(t))
    }

    /// The distance of a stretch without length, at `point`, from this one.
    fn seen_from(&self, point: DVec3) -> Closest {
        Closest { fraction: 0.0, ..self.closest_to(point) }
    }

    /// Where it is closest to a triangle that it does not pierce: to a side, or with one of its ends to the inside.
    fn closest_to_triangle(&self, [p, q, r]: [DVec3; 3]) -> Closest {
        let sides =
            self.closest_to_side(p, q).nearer(self.closest_to_side(q, r)).nearer(self.closest_to_side(r, p));
        let normal = (q - p).cross(r - p);
        let Some(unit) = normal.try_normalize() else { return sides };
        [0.0, 1.0].into_iter().fold(sides, |best, fraction| {
            let off = (self.at(fraction) - p).dot(unit);
            let foot = self.at(fraction) - unit * off;
            let within = |a: DVec3, b: DVec3| (b - a).cross(foot - a).dot(normal) >= 0.0;
            if within(p, q) && within(q, r) && within(r, p) {
                best.nearer(Closest { fraction, distance_m: off.abs() })
            } else {
                best
            }
        })
    }
}

/// Where the stretch from `a` to `b` (in the boat's space), which strikes nothing of the model, is closest to its surface; `None` where that
/// is farther than `within_m`. Of a picture the opaque part counts, to a fiftieth of its size.
pub fn closest_to_surface(model: &Model, a: DVec3, b: DVec3, within_m: f64) -> Option<Closest> {
    let stretch = Stretch { from: a, ray: b - a };
    let mut best = Closest { fraction: 0.0, distance_m: within_m };
    for corner in model.indices.chunks_exact(3) {
        let Some(triangle) = corners(model, corner) else { continue };
        let places = triangle.map(|v| v.position.as_dvec3());
        // Most triangles are known by their first corner to be too far away.
        let size = places[1].distance(places[0]).max(places[2].distance(places[0]));
        if stretch.closest_to(places[0]).distance_m - size >= best.distance_m {
            continue;
        }
        best = match &model.texture {
            None => best.nearer(stretch.closest_to_triangle(places)),
            Some(texture) => {
                opaque(texture, triangle).fold(best, |best, point| best.nearer(stretch.closest_to(point)))
            }
        };
    }
    (best.distance_m < within_m).then_some(best)
}

/// Points all over the opaque part of a textured triangle.
fn opaque<'a>(texture: &'a Texture, triangle: HullTriangle<'a>) -> impl Iterator<Item = DVec3> + 'a {
    let [p, q, r] = triangle.map(|v| v.position.as_dvec3());
    let [t, u, v] = triangle.map(|v| v.uv.as_dvec2());
    let (across, down) = (u - t, v - t);
    let area = across.perp_dot(down);
    (0..CELLS * CELLS).filter_map(move |i| {
        let uv = DVec2::new(f64::from(i % CELLS) + 0.5, f64::from(i / CELLS) + 0.5) / f64::from(CELLS);
        let off = uv - t;
        let (x, y) = (off.perp_dot(down) / area, across.perp_dot(off) / area);
        let inside = x >= 0.0 && y >= 0.0 && x + y <= 1.0;
        (inside && is_solid_at(texture, uv)).then(|| p + (q - p) * x + (r - p) * y)
    })
}

/// Where the stretch from `a` to `b` (in the boat's space) is closest to the model's bounding box, which is never farther than its surface.
pub fn closest_to_box(model: &Model, a: DVec3, b: DVec3) -> Closest {
    let (min, max) = (model.min.as_dvec3(), model.max.as_dvec3());
    let ray = b - a;
    // The distance to a convex body is convex along the stretch, so its slope has one zero: halve towards it.
    let outside = |s: f64| {
        let p = a + ray * s;
        p - p.max(min).min(max)
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..48 {
        let middle = (low + high) / 2.0;
        if outside(middle).dot(ray) < 0.0 { low = middle } else { high = middle }
    }
    // The end itself where the stretch still approaches there.
    let fraction = if outside(1.0).dot(ray) < 0.0 { 1.0 } else { high };
    Closest { fraction, distance_m: outside(fraction).length() }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::world::score::hit::tests::{boxed, picture, vector};

    proptest! {
        /// A box is the one shape whose distance is known by a formula.
        #[test]
        fn the_closest_point_is_what_dense_sampling_finds(
            low in vector(4.0), size in vector(4.0), a in vector(30.0), b in vector(30.0),
        ) {
            let low = low.as_vec3();
            let model = boxed(low, low + size.abs().as_vec3() + 0.01);
            let (min, max) = (model.min.as_dvec3(), model.max.as_dvec3());
            let distance = |p: DVec3| (p - p.clamp(min, max)).length();
            let sampled = (0..=4000).map(|i| distance(a.lerp(b, f64::from(i) / 4000.0))).fold(f64::INFINITY, f64::min);
            prop_assume!(sampled > 0.02);
            let found = closest_to_surface(&model, a, b, 100.0).expect("within reach");
            prop_assert!((0.0..=1.0).contains(&found.fraction));
            prop_assert!((found.distance_m - distance(a.lerp(b, found.fraction))).abs() < 1e-6);
            prop_assert!(found.distance_m <= sampled + 1e-6 && found.distance_m > sampled - 0.02, "{found:?}, sampled {sampled}");
            prop_assert_eq!(closest_to_surface(&model, a, b, found.distance_m), None);
        }
    }

    #[test]
    fn between_deck_and_mast_a_round_is_as_far_as_from_what_is_there() {
        // A hull 6 m long and 1 m high, and a mast of 3 m at its bow.
        let mut model = boxed(Vec3::new(-3.0, -1.0, -0.5), Vec3::new(3.0, 1.0, 0.5));
        let mast = boxed(Vec3::new(2.8, -0.1, 0.5), Vec3::new(3.0, 0.1, 3.5));
        let first = model.vertices.len() as u32;
        model.vertices.extend(mast.vertices);
        model.indices.extend(mast.indices.iter().map(|i| i + first));
        model.max.z = 3.5;
        // Across the deck, two metres above it: well within the bounding box.
        let found =
            closest_to_surface(&model, DVec3::new(-1.0, -20.0, 2.5), DVec3::new(-1.0, 20.0, 2.5), 50.0);
        assert!((found.expect("near").distance_m - 2.0).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn through_the_clear_part_of_a_picture_a_round_is_as_far_as_from_its_opaque_part() {
        let found =
            closest_to_surface(&picture(), DVec3::new(1.0, -5.0, 1.0), DVec3::new(1.0, 5.0, 1.0), 50.0);
        let distance = found.expect("near").distance_m;
        assert!((distance - 1.0).abs() < 0.06, "{distance} m from the half that is opaque");
    }
}
