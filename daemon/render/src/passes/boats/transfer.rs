//! Shares of the sky and of the sea that each corner of a boat sees past the boat itself: found once when a model is taken, so that a frame's light
//! of the whole sky is a sum of ten products a corner (precomputed radiance transfer, Sloan, Kautz and Snyder 2002, for matt surfaces).

use std::{
    collections::HashMap,
    hash::{DefaultHasher, Hash as _, Hasher as _},
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

use bowwave_core::{
    model::{Model, Vertex},
    sky::{LOBES, SkyLobes},
};
use glam::{DVec3, Vec2, Vec3};

/// Directions above the water and below it from which light comes. They spiral: no two are above each other.
const ABOVE: u32 = 120;
const BELOW: u32 = 40;
/// Texels along each side of the depth picture that is taken from each of them.
const TEXELS: usize = 256;

/// What a matt white corner makes of the light that there is: its radiance over that of each of the sky's lobes, then over that of the sea.
pub(crate) type Transfer = [f32; LOBES + 1];

/// Transfers of a model's corners: on the side of the normal, and on the other.
pub(crate) type Transfers = Arc<Vec<[Transfer; 2]>>;

/// The transfers of `model`, whose indices are known to lie within its vertices. Models that were seen before are not looked at again.
pub(crate) fn transfers(model: &Model) -> Transfers {
    static KNOWN: OnceLock<Mutex<HashMap<u64, Transfers>>> = OnceLock::new();
    let key = shape_hash(model);
    let known = || KNOWN.get_or_init(Mutex::default).lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(found) = known().get(&key) {
        return Arc::clone(found);
    }
    let found = Arc::new(found_by_pictures(model));
    known().insert(key, Arc::clone(&found));
    found
}

fn shape_hash(model: &Model) -> u64 {
    let mut hasher = DefaultHasher::new();
    for v in &model.vertices {
        v.position
            .to_array()
            .into_iter()
            .chain(v.normal.to_array())
            .for_each(|x| x.to_bits().hash(&mut hasher));
    }
    model.indices.hash(&mut hasher);
    hasher.finish()
}

/// Directions that stand for the same solid angle each, above the water or below it.
fn directions(count: u32, sign: f64) -> impl Iterator<Item = DVec3> {
    /// Turn from one to the next, radians: the golden angle.
    const TURN: f64 = 2.399_963_229_728_653;
    (0..count).map(move |i| {
        let z = (f64::from(i) + 0.5) / f64::from(count);
        let (sin, cos) = (f64::from(i) * TURN).sin_cos();
        let level = (1.0 - z * z).sqrt();
        DVec3::new(level * cos, level * sin, sign * z)
    })
}

/// A place on the surface: what it sees is seen about its triangle's corners by their shares.
struct Place {
    corners: [usize; 3],
    shares: [f32; 3],
    position: Vec3,
    normal: Vec3,
    /// On the side of the normal and on the other: what it sees, and what it would see alone.
    seen: [Transfer; 2],
    alone: [f32; 2],
}

/// Places all over the surface: more on large triangles, one on each at least.
fn places(model: &Model) -> Vec<Place> {
    /// About so many on the whole, and at most so many on a triangle.
    const ALL: f32 = 5000.0;
    const MOST: f32 = 16.0;
    let at = |i: u32| model.vertices.get(i as usize);
    let area =
        |t: [&Vertex; 3]| (t[1].position - t[0].position).cross(t[2].position - t[0].position).length();
    let triangles = || {
        let corners = model.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]);
        corners.filter_map(|t| Some((t, [at(t[0])?, at(t[1])?, at(t[2])?])))
    };
    let whole: f32 = triangles().map(|(_, t)| area(t)).sum();
    let mut found = Vec::new();
    for (indices, corners) in triangles() {
        let count = (area(corners) / whole * ALL).clamp(1.0, MOST) as u32;
        for i in 0..count {
            // Roberts' sequence: evenly spread for any count.
            let fraction = |step: f32| (0.5 + step * i as f32).fract();
            let (u, v) = (fraction(0.754_877_7).sqrt(), fraction(0.569_840_3));
            let shares = [1.0 - u, u * (1.0 - v), u * v];
            let mix = |of: fn(&Vertex) -> Vec3| (0..3).map(|k| of(corners[k]) * shares[k]).sum::<Vec3>();
            found.push(Place {
                corners: indices.map(|i| i as usize),
                shares,
                position: mix(|v| v.position),
                normal: mix(|v| v.normal).normalize_or(corners[0].normal),
                seen: [[0.0; LOBES + 1]; 2],
                alone: [0.0; 2],
            });
        }
    }
    found
}

fn found_by_pictures(model: &Model) -> Vec<[Transfer; 2]> {
    let mut places = places(model);
    let mut picture = DepthPicture::of(model);
    for (above, count) in [(true, ABOVE), (false, BELOW)] {
        // A white surface's radiance is its irradiance over pi; each direction is a share of two pi.
        let share = 2.0 / f64::from(count);
        for direction in directions(count, if above { 1.0 } else { -1.0 }) {
            picture.take(model, direction.as_vec3());
            let lobes = SkyLobes::basis(direction).map(|value| (value * share) as f32);
            for place in &mut places {
                let cosine = place.normal.dot(direction.as_vec3());
                let side = usize::from(cosine < 0.0);
                let normal = if side == 0 { place.normal } else { -place.normal };
                let cosine = cosine.abs();
                place.alone[side] += cosine * share as f32;
                if !picture.sees(place.position, normal) {
                    continue;
                }
                let seen = &mut place.seen[side];
                if above {
                    seen.iter_mut().zip(lobes).for_each(|(of, value)| *of += value * cosine);
                } else {
                    seen[LOBES] += share as f32 * cosine;
                }
            }
        }
    }
    let mut found = vec![[[0.0; LOBES + 1]; 2]; model.vertices.len()];
    for side in 0..2 {
        let known = at_corners(&places, side, &mut found);
        fill_buried(model, side, known, &mut found);
    }
    found
}

/// What corners have to hold so that what is mixed of them over a triangle is what its places see: least squares, by the simultaneous
/// iterative reconstruction of Gilbert 1972. Whether each corner is known: those of triangles whose every place lies within another part of the
/// boat are not.
fn at_corners(places: &[Place], side: usize, found: &mut [[Transfer; 2]]) -> Vec<bool> {
    /// Share of what it would see alone at which a place counts as within another part.
    const BURIED: f32 = 0.02;
    const ROUNDS: u32 = 8;
    let outside = |p: &&Place| p.seen[side][0] + p.seen[side][LOBES] > BURIED * p.alone[side];
    let places: Vec<&Place> = places.iter().filter(outside).collect();
    let mut weights = vec![0.0_f32; found.len()];
    for place in &places {
        place.corners.iter().zip(place.shares).for_each(|(at, share)| weights[*at] += share);
    }
    let mut more = vec![[0.0_f32; LOBES + 1]; found.len()];
    for _ in 0..ROUNDS {
        more.fill([0.0; LOBES + 1]);
        for place in &places {
            let mut off = place.seen[side];
            for (at, share) in place.corners.iter().zip(place.shares) {
                off.iter_mut().zip(found[*at][side]).for_each(|(off, held)| *off -= share * held);
            }
            for (at, share) in place.corners.iter().zip(place.shares) {
                more[*at].iter_mut().zip(off).for_each(|(more, off)| *more += share * off);
            }
        }
        for ((held, more), weight) in found.iter_mut().zip(&more).zip(&weights) {
            held[side].iter_mut().zip(more).for_each(|(held, more)| *held += more / weight.max(0.05));
        }
    }
    // No face gets less than no light, and none much more than all.
    const ALL: f32 = 1.05;
    for held in found.iter_mut().map(|held| &mut held[side]) {
        held[0] = held[0].max(0.0);
        held[LOBES] = held[LOBES].max(0.0);
        let times = ALL / (held[0] + held[LOBES]).max(ALL);
        held.iter_mut().for_each(|held| *held *= times);
    }
    weights.into_iter().map(|weight| weight > 0.0).collect()
}

/// Corners that lie within another part of the boat see nothing, and would darken what is seen of their triangles: they get the mean of
/// their neighbours that do.
fn fill_buried(model: &Model, side: usize, mut known: Vec<bool>, found: &mut [[Transfer; 2]]) {
    /// Rounds: corners of two buried rings.
    const ROUNDS: u32 = 3;
    for _ in 0..ROUNDS {
        let mut sums: HashMap<usize, (Transfer, f32)> = HashMap::new();
        for t in model.indices.chunks_exact(3) {
            let corners = [t[0] as usize, t[1] as usize, t[2] as usize];
            for at in corners.into_iter().filter(|at| !known[*at]) {
                for other in corners.into_iter().filter(|other| known[*other]) {
                    let (sum, count) = sums.entry(at).or_insert(([0.0; LOBES + 1], 0.0));
                    sum.iter_mut().zip(found[other][side]).for_each(|(sum, value)| *sum += value);
                    *count += 1.0;
                }
            }
        }
        for (at, (sum, count)) in sums {
            found[at][side] = sum.map(|value| value / count);
            known[at] = true;
        }
    }
}

/// The boat seen from far away: how near its surface is at each place.
struct DepthPicture {
    middle: Vec3,
    radius: f32,
    across: Vec3,
    up: Vec3,
    towards: Vec3,
    /// Greatest way towards the light, metres.
    nearest: Vec<f32>,
}

impl DepthPicture {
    fn of(model: &Model) -> Self {
        let middle = 0.5 * (model.min + model.max);
        let radius = model.vertices.iter().map(|v| v.position.distance(middle)).fold(0.1, f32::max);
        Self {
            middle,
            radius,
            across: Vec3::X,
            up: Vec3::Y,
            towards: Vec3::Z,
            nearest: vec![f32::NEG_INFINITY; TEXELS * TEXELS],
        }
    }

    /// Metres of a texel.
    fn texel_m(&self) -> f32 {
        2.0 * self.radius / (TEXELS - 4) as f32
    }

    /// Texel coordinates and way towards the light.
    fn place(&self, p: Vec3) -> Vec3 {
        let (p, half) = (p - self.middle, 0.5 * TEXELS as f32);
        let flat = Vec2::new(p.dot(self.across), p.dot(self.up)) / self.texel_m() + half;
        flat.extend(p.dot(self.towards))
    }

    fn take(&mut self, model: &Model, towards: Vec3) {
        (self.across, self.up) = towards.any_orthonormal_pair();
        self.towards = towards;
        self.nearest.fill(f32::NEG_INFINITY);
        let placed: Vec<Vec3> = model.vertices.iter().map(|v| self.place(v.position)).collect();
        for t in model.indices.chunks_exact(3) {
            self.draw([t[0], t[1], t[2]].map(|i| placed[i as usize]));
        }
    }

    fn draw(&mut self, [a, b, c]: [Vec3; 3]) {
        let edge = |p: Vec3, q: Vec3| (q - p).truncate();
        let area = edge(a, b).perp_dot(edge(a, c));
        if area.abs() < 1e-6 {
            return;
        }
        let last = (TEXELS - 1) as f32;
        let low = a.min(b).min(c).clamp(Vec3::ZERO, Vec3::splat(last));
        let high = a.max(b).max(c).clamp(Vec3::ZERO, Vec3::splat(last));
        // Ways grow linearly over the triangle.
        let (of_b, of_c) = (edge(a, c).perp() / -area, edge(a, b).perp() / area);
        for y in low.y.floor() as usize..=high.y.floor() as usize {
            for x in low.x.floor() as usize..=high.x.floor() as usize {
                let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) - a.truncate();
                let (u, v) = (p.dot(of_b), p.dot(of_c));
                if u < 0.0 || v < 0.0 || u + v > 1.0 {
                    continue;
                }
                let way = a.z + u * (b.z - a.z) + v * (c.z - a.z);
                let nearest = &mut self.nearest[y * TEXELS + x];
                *nearest = nearest.max(way);
            }
        }
    }

    /// Whether nothing is between a place on the surface, on the side of `normal`, and the light.
    fn sees(&self, p: Vec3, normal: Vec3) -> bool {
        /// Texels by which the place is lifted off its own surface, and by which something else must be nearer.
        const OFF: f32 = 1.5;
        const NEARER: f32 = 0.75;
        let at = self.place(p + normal * (OFF * self.texel_m()));
        let (x, y) = (at.x.max(0.0) as usize, at.y.max(0.0) as usize);
        let nearest = self.nearest.get(y.min(TEXELS - 1) * TEXELS + x.min(TEXELS - 1));
        nearest.is_none_or(|nearest| at.z + NEARER * self.texel_m() >= *nearest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    /// Radiance of a white corner under a sky that is 1 everywhere over a black sea, and over a sea that is 1 under a black sky.
    fn parts(t: &Transfer) -> (f32, f32) {
        (t[0], t[LOBES])
    }

    #[test]
    fn a_box_sees_what_its_sides_face() {
        let model = testing::box_model("box", [4.0, 2.0, 1.5], [0.5; 3]);
        for (vertex, t) in model.vertices.iter().zip(transfers(&model).iter()) {
            let (sky, sea) = parts(&t[0]);
            let expected = match vertex.normal.z {
                z if z > 0.9 => (1.0, 0.0),
                z if z < -0.9 => (0.0, 1.0),
                _ => (0.5, 0.5),
            };
            assert!(
                (sky - expected.0).abs() < 0.05 && (sea - expected.1).abs() < 0.06,
                "{} {sky} {sea}",
                vertex.normal
            );
        }
    }

    #[test]
    fn boats_hide_parts_of_the_sky_from_themselves_and_never_add_to_it() {
        for name in ["skiff", "rhib", "dhow", "frigate"] {
            let model = bowwave_models::resolve(name, std::path::Path::new(".")).unwrap();
            let found = found_by_pictures(&model);
            let mut seen = 0.0;
            for t in found.iter().flatten() {
                let (sky, sea) = parts(t);
                assert!(t.iter().all(|v| v.is_finite()) && sky >= 0.0 && sky + sea < 1.06, "{name}: {t:?}");
                seen += sky + sea;
            }
            let mean = seen / (2 * found.len()) as f32;
            println!("{name}: {} corners see {mean} on the average", found.len());
            assert!(mean > 0.2 && mean < 0.9, "{name}: {mean}");
        }
    }

    /// Whether a ray meets a triangle (Moeller and Trumbore 1997).
    fn meets(from: DVec3, along: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
        let (u, v) = (b - a, c - a);
        let p = along.cross(v);
        let det = u.dot(p);
        if det.abs() < 1e-12 {
            return false;
        }
        let t = from - a;
        let q = t.cross(u);
        let (x, y, way) = (t.dot(p) / det, along.dot(q) / det, v.dot(q) / det);
        x >= 0.0 && y >= 0.0 && x + y <= 1.0 && way > 0.004
    }

    /// Light of a sky that brightens towards one side, and of the sea, on faces of four models: rays of other directions against what corners
    /// hold, mixed over the triangle as a rasteriser does. The mean error of the light and that of what is over.
    #[test]
    fn corners_hold_the_light_that_rays_find() {
        let mut lobes = SkyLobes::even(Vec3::splat(1.0));
        lobes.terms[1] = Vec3::splat(0.5);
        lobes.terms[3] = Vec3::splat(-0.6);
        lobes.terms[8] = Vec3::splat(0.15);
        const SEA: f64 = 0.2;
        let unit = |i: u64| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 11) as f64 / (1_u64 << 53) as f64;
        for name in ["skiff", "rhib", "dhow", "frigate"] {
            let model = bowwave_models::resolve(name, std::path::Path::new(".")).unwrap();
            let seen = transfers(&model);
            let at = |i: u32| &model.vertices[i as usize];
            let faces: Vec<[u32; 3]> = model.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
            let triangles: Vec<[DVec3; 3]> =
                faces.iter().map(|t| t.map(|i| at(i).position.as_dvec3())).collect();
            let area = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).length();
            let whole: f64 = triangles.iter().map(area).sum();
            let (mut off, mut off_alone, mut light, mut points) = (0.0, 0.0, 0.0, 0);
            for point in 0..160_u64 {
                // By area.
                let mut left = unit(point * 5 + 1) * whole;
                let Some(number) = triangles.iter().position(|t| {
                    left -= area(t);
                    left <= 0.0
                }) else {
                    continue;
                };
                let (u, v) = (unit(point * 5 + 2).sqrt(), unit(point * 5 + 3));
                let shares = [1.0 - u, u * (1.0 - v), u * v];
                let corners = faces[number];
                let mix =
                    |of: &dyn Fn(u32) -> DVec3| (0..3).map(|k| of(corners[k]) * shares[k]).sum::<DVec3>();
                let place = mix(&|i| at(i).position.as_dvec3());
                let normal = mix(&|i| at(i).normal.as_dvec3()).normalize();
                let from = place + normal * 0.004;
                let (mut truth, mut alone, rays) = (0.0, 0.0, 400);
                for ray in 0..rays {
                    let z = 1.0 - 2.0 * (f64::from(ray) + 0.5) / f64::from(rays);
                    let (sin, cos) = (f64::from(ray) * 3.883_222_077 + point as f64).sin_cos();
                    let d = DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
                    let cosine = d.dot(normal);
                    if cosine <= 0.0 {
                        continue;
                    }
                    let radiance = if z > 0.0 { f64::from(lobes.at(d).x) } else { SEA };
                    let light = radiance * cosine * 4.0 / f64::from(rays);
                    alone += light;
                    if !triangles.iter().any(|t| meets(from, d, *t)) {
                        truth += light;
                    }
                }
                let held = |k: usize| {
                    let t = &seen[corners[k] as usize][0];
                    (0..LOBES).map(|i| f64::from(t[i] * lobes.terms[i].x)).sum::<f64>()
                        + f64::from(t[LOBES]) * SEA
                };
                // Places within another part of the boat are seen by nobody.
                if truth > 0.0 {
                    let found: f64 = (0..3).map(|k| held(k) * shares[k]).sum();
                    (off, light, points) = (off + (found - truth).abs(), light + truth, points + 1);
                    off_alone += alone - truth;
                }
            }
            let percent = |off: f64| 100.0 * off / light;
            println!(
                "{name}: {:.1} % of the light at {points} places, {:.0} % as if nothing hid",
                percent(off),
                percent(off_alone)
            );
            assert!(percent(off) < 12.0 && off < 0.5 * off_alone && points > 60, "{name}: {off} of {light}");
        }
    }
}
