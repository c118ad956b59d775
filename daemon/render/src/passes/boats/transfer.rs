//! The light that each corner of a boat gets of the sky and of the sea past the boat itself, and by way of the boat: found once when a model is
//! taken, so that a frame's light of the whole sky is a sum of ten products a corner, and what the sun sends from hull to hull four more
//! (precomputed radiance transfer with interreflection, Sloan, Kautz and Snyder 2002, for matt surfaces).

mod fit;
mod level;
mod lighting;
mod places;
mod rays;
mod refine;

use std::{
    collections::HashMap,
    hash::{DefaultHasher, Hash as _, Hasher as _},
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

use bowwave_core::{
    model::{Model, ModelKind},
    sky::LOBES,
};

use crate::passes::boats::parts::Parts;
use fit::{Sample, Seat, fit};
use lighting::Lighting;
use places::{Place, places};
use refine::Surface;

/// Index of the sea in a [`Transfer`], and of what the sun sends from hull to hull.
pub(crate) const SEA: usize = LOBES;
pub(crate) const SUN: usize = LOBES + 1;
/// Terms of the latter: 1 and the three coordinates of the unit vector towards the sun.
const SUN_TERMS: usize = 4;

/// The light of a matt white corner, from outside and by way of the boat: its radiance over that of each of the sky's lobes,
/// then over that of the sea. Then, over the radiance of white that faces the sun, of what the boat's other faces throw to it, as a sum of
/// [`SUN_TERMS`]; the sun itself is not in it.
pub(crate) type Transfer = [f32; SUN + SUN_TERMS];

/// No light.
const DARK: Transfer = [0.0; SUN + SUN_TERMS];

/// A corner's light on the side of its normal, and on the other.
pub(crate) type CornerLight = [Transfer; 2];

/// The light of a model.
pub(crate) struct BakedLight {
    /// The model in triangles that are small where light changes, without texture and parts. Its first corners are the model's.
    pub(crate) surface: Model,
    /// At the corners of the surface...
    pub(crate) corners: Vec<CornerLight>,
    /// ...and at places all over it.
    places: Vec<Place>,
}

/// The light of `model`, whose indices are known to lie within its vertices. Models that were seen before are not looked at again.
pub(crate) fn baked_light(model: &Model) -> Arc<BakedLight> {
    static KNOWN: OnceLock<Mutex<HashMap<u64, Arc<BakedLight>>>> = OnceLock::new();
    let key = shape_hash(model);
    let known = || KNOWN.get_or_init(Mutex::default).lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(found) = known().get(&key) {
        return Arc::clone(found);
    }
    let found = Arc::new(BakedLight::of(model));
    known().insert(key, Arc::clone(&found));
    found
}

fn shape_hash(model: &Model) -> u64 {
    let mut hasher = DefaultHasher::new();
    for v in &model.vertices {
        let of = [v.position, v.normal, v.albedo, v.uv.extend(0.0)];
        of.iter().flat_map(|of| of.to_array()).for_each(|x| x.to_bits().hash(&mut hasher));
    }
    (model.kind == ModelKind::Quad).hash(&mut hasher);
    model.indices.hash(&mut hasher);
    model.texture.as_ref().map(|t| &t.rgba).hash(&mut hasher);
    hasher.finish()
}

impl BakedLight {
    fn of(model: &Model) -> Self {
        let parts = Parts::of(model);
        let closed = model.indices.chunks_exact(3).map(|t| parts.closed(t[0])).collect();
        let mut places = places(model);
        let lighting = Lighting::of(model, closed, &mut places);
        let Surface { vertices, triangles, held, .. } = Surface::finer(model, &lighting, &mut places);
        let surface = Model {
            name: model.name.clone(),
            kind: model.kind,
            vertices,
            indices: triangles.into_iter().flatten().collect(),
            parts: Vec::new(),
            texture: None,
            waterline: Vec::new(),
            min: model.min,
            max: model.max,
        };
        let corners = by_sides(|side| {
            let mut held = held[side].clone();
            let weights =
                fit_side(places.iter().map(|place| (place.at, place.weight, place)), side, &mut held);
            fill_hidden(&surface, weights.into_iter().map(|weight| weight > 0.0).collect(), &mut held);
            held
        });
        Self { surface, corners, places }
    }
}

/// Each corner's light from that of all corners on either side.
fn by_sides(light: impl FnMut(usize) -> Vec<Transfer>) -> Vec<CornerLight> {
    let [front, back] = [0, 1].map(light);
    front.into_iter().zip(back).map(|(front, back)| [front, back]).collect()
}

/// Fits what corners hold on a side to the places, with their seats and weights, that are not hidden there. The weight about each corner.
fn fit_side<'a>(
    places: impl Iterator<Item = (Seat, f32, &'a Place)>,
    side: usize,
    held: &mut [Transfer],
) -> Vec<f32> {
    let seen = places.filter(|(_, _, place)| !place.hidden[side]);
    let samples: Vec<_> =
        seen.map(|(at, weight, place)| Sample { at, weight, value: place.light[side] }).collect();
    let weights = fit(&samples, held);
    held.iter_mut().for_each(bound);
    weights
}

/// No face gets less than no light, and none much more than all.
fn bound(held: &mut Transfer) {
    const ALL: f32 = 1.05;
    held[0] = held[0].max(0.0);
    held[SEA] = held[SEA].max(0.0);
    let times = ALL / (held[0] + held[SEA]).max(ALL);
    held.iter_mut().for_each(|held| *held *= times);
}

/// Corners about which nothing is seen would darken what is seen of triangles that stand for them: they get the mean of their neighbours.
fn fill_hidden(model: &Model, mut known: Vec<bool>, found: &mut [Transfer]) {
    /// Rounds: corners of two hidden rings.
    const ROUNDS: u32 = 3;
    for _ in 0..ROUNDS {
        let mut sums: HashMap<usize, (Transfer, f32)> = HashMap::new();
        for t in model.indices.chunks_exact(3) {
            let corners = [t[0] as usize, t[1] as usize, t[2] as usize];
            for at in corners.into_iter().filter(|at| !known[*at]) {
                for other in corners.into_iter().filter(|other| known[*other]) {
                    let (sum, count) = sums.entry(at).or_insert((DARK, 0.0));
                    sum.iter_mut().zip(found[other]).for_each(|(sum, value)| *sum += value);
                    *count += 1.0;
                }
            }
        }
        for (at, (sum, count)) in sums {
            found[at] = sum.map(|value| value / count);
            known[at] = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use bowwave_core::sky::SkyLobes;
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::{passes::boats::parts::triangles, testing};

    /// Radiance of a white corner under a sky that is 1 everywhere over a black sea, and over a sea that is 1 under a black sky.
    fn parts(t: &Transfer) -> (f32, f32) {
        (t[0], t[SEA])
    }

    #[test]
    fn a_box_sees_what_its_sides_face() {
        let model = testing::box_model("box", [4.0, 2.0, 1.5], [0.5; 3]);
        let baked = baked_light(&model);
        for (vertex, t) in baked.surface.vertices.iter().zip(&baked.corners) {
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
            let mut model = bowwave_models::resolve(name, std::path::Path::new(".")).unwrap();
            model.vertices.iter_mut().for_each(|v| v.albedo = Vec3::ZERO);
            let found = BakedLight::of(&model).corners;
            let mut seen = 0.0;
            for (side, t) in found.iter().flat_map(|t| t.iter().enumerate()) {
                let (sky, sea) = parts(t);
                assert!(t.iter().all(|v| v.is_finite()) && sky >= 0.0 && sky + sea < 1.06, "{name}: {t:?}");
                // Nobody sees closed parts from within.
                seen += if side == 0 { sky + sea } else { 0.0 };
            }
            let mean = seen / found.len() as f32;
            println!("{name}: {} corners see {mean} on the average", found.len());
            assert!(mean > 0.2 && mean < 0.9, "{name}: {mean}");
        }
    }

    /// How far along a ray a triangle is (Moeller and Trumbore 1997), if it is met.
    fn way(from: DVec3, along: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
        let (u, v) = (b - a, c - a);
        let p = along.cross(v);
        let det = u.dot(p);
        if det.abs() < 1e-12 {
            return None;
        }
        let t = from - a;
        let q = t.cross(u);
        let (x, y, way) = (t.dot(p) / det, along.dot(q) / det, v.dot(q) / det);
        (x >= 0.0 && y >= 0.0 && x + y <= 1.0 && way > 1e-9).then_some(way)
    }

    fn meets(from: DVec3, along: DVec3, triangle: [DVec3; 3]) -> bool {
        way(from, along, triangle).is_some_and(|way| way > 0.004)
    }

    /// Light of a sky that brightens towards one side, and of the sea, on faces of four models: rays of other directions against what corners
    /// hold, mixed over the triangle as a rasteriser does. The mean error of the light and that of what is over.
    #[test]
    fn corners_hold_the_light_that_rays_find() {
        let mut lobes = SkyLobes::even(Vec3::splat(1.0));
        lobes.terms[1] = Vec3::splat(0.5);
        lobes.terms[3] = Vec3::splat(-0.6);
        lobes.terms[8] = Vec3::splat(0.15);
        const SEA_LIGHT: f64 = 0.2;
        let unit = |i: u64| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 11) as f64 / (1_u64 << 53) as f64;
        for (name, most) in [("skiff", 3.4), ("rhib", 5.0), ("dhow", 4.2), ("frigate", 3.7)] {
            let mut model = bowwave_models::resolve(name, std::path::Path::new(".")).unwrap();
            // Black, so that no light comes by way of the boat.
            model.vertices.iter_mut().for_each(|v| v.albedo = Vec3::ZERO);
            let seen = baked_light(&model);
            let at = |i: u32| &seen.surface.vertices[i as usize];
            let faces_of = |of: &Model| triangles(&of.indices);
            let positions = |t: &[u32; 3]| t.map(|i| at(i).position.as_dvec3());
            let hulls: Vec<[DVec3; 3]> = faces_of(&model).iter().map(positions).collect();
            let faces = faces_of(&seen.surface);
            let triangles: Vec<[DVec3; 3]> = faces.iter().map(positions).collect();
            let area = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).length();
            let whole: f64 = triangles.iter().map(area).sum();
            let (mut off, mut off_alone, mut light, mut points) = (0.0, 0.0, 0.0, 0);
            for point in 0..480_u64 {
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
                let (across, up) = normal.any_orthonormal_pair();
                for ray in 0..rays {
                    // As often as their cosines, so that light is their mean.
                    let out = (f64::from(ray) + unit(point * 5 + 4)) / f64::from(rays);
                    let (sin, cos) = (f64::from(ray) * 3.883_222_077 + point as f64).sin_cos();
                    let d = (across * cos + up * sin) * out.sqrt() + normal * (1.0 - out).sqrt();
                    let radiance = if d.z > 0.0 { f64::from(lobes.at(d).x) } else { SEA_LIGHT };
                    let light = radiance / f64::from(rays);
                    alone += light;
                    if !hulls.iter().any(|t| meets(from, d, *t)) {
                        truth += light;
                    }
                }
                let held = |k: usize| {
                    let t = &seen.corners[corners[k] as usize][0];
                    (0..LOBES).map(|i| f64::from(t[i] * lobes.terms[i].x)).sum::<f64>()
                        + f64::from(t[SEA]) * SEA_LIGHT
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
            assert!(percent(off) < most && off < 0.5 * off_alone && points > 180, "{name}: {off} of {light}");
        }
    }

    /// Light on the inside of an open box of which the sun and the sky reach a part, against paths of light.
    #[test]
    fn an_open_box_throws_light_to_itself_as_paths_do() {
        const ALBEDO: f64 = 0.6;
        let mut model = testing::box_model("box", [4.0, 2.0, 1.5], [ALBEDO as f32; 3]);
        model.indices.truncate(30);
        let corner = |i: &u32| model.vertices[*i as usize].position.as_dvec3();
        let triangles: Vec<[DVec3; 3]> =
            model.indices.chunks_exact(3).map(|t| [corner(&t[0]), corner(&t[1]), corner(&t[2])]).collect();
        let nearest = |from: DVec3, along: DVec3| {
            let hits = triangles.iter().filter_map(|t| Some((way(from, along, *t)?, *t)));
            hits.min_by(|a, b| a.0.total_cmp(&b.0))
        };
        // Radiance of white that faces the sun is 1, and so is that of the sky.
        let suns: Vec<DVec3> = [[0.9, 0.2], [0.5, -0.6], [-0.3, 0.1]]
            .map(|[x, y]: [f64; 2]| DVec3::new(x, y, (1.0 - x * x - y * y).sqrt()))
            .to_vec();
        let mut state = 1_u64;
        let mut even = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let lit_places = |model: &Model| {
            let mut lit = places(model);
            Lighting::of(model, vec![false; model.indices.len() / 3], &mut lit);
            lit
        };
        let places = lit_places(&model);
        let (mut found, mut truth) = ([0.0; 4], [0.0; 4]);
        const PATHS: u32 = 60;
        for place in places.iter().filter(|p| !p.hidden[1]).step_by(3) {
            let light = place.light[1].map(f64::from);
            found[0] += light[0];
            for (found, sun) in found[1..].iter_mut().zip(&suns) {
                let [one, x, y, z] = [0, 1, 2, 3].map(|i| light[SUN + i]);
                *found += (one + sun.dot(DVec3::new(x, y, z))).max(0.0);
            }
            for _ in 0..PATHS {
                let (mut at, mut normal, mut weight) =
                    (place.position.as_dvec3(), -place.normal.as_dvec3(), 1.0 / f64::from(PATHS));
                for bounce in 0..6 {
                    if bounce > 0 {
                        for (truth, sun) in truth[1..].iter_mut().zip(&suns) {
                            if normal.dot(*sun) > 0.0 && nearest(at, *sun).is_none() {
                                *truth += weight * normal.dot(*sun);
                            }
                        }
                    }
                    // Cosine-weighted (Malley).
                    let (radius, (sin, cos)) = (even().sqrt(), (even() * std::f64::consts::TAU).sin_cos());
                    let (u, v) = normal.any_orthonormal_pair();
                    let along = u * radius * cos + v * radius * sin + normal * (1.0 - radius * radius).sqrt();
                    let Some((far, t)) = nearest(at, along) else {
                        truth[0] += if along.z > 0.0 { weight } else { 0.0 };
                        break;
                    };
                    at += along * far;
                    normal = (t[1] - t[0]).cross(t[2] - t[0]).normalize();
                    normal *= -normal.dot(along).signum();
                    at += normal * 1e-6;
                    weight *= ALBEDO;
                }
            }
        }
        println!("found {found:?}, paths {truth:?}");
        assert!((found[0] / truth[0] - 1.0).abs() < 0.04, "sky: {found:?} {truth:?}");
        for k in 1..4 {
            assert!((found[k] / truth[k] - 1.0).abs() < 0.25, "sun {k}: {found:?} {truth:?}");
        }
        // By a black box nothing comes.
        model.vertices.iter_mut().for_each(|v| v.albedo = Vec3::ZERO);
        let thrown =
            |p: &Place| p.light.iter().flat_map(|l| l[SUN..].to_vec()).fold(0.0, |a: f32, b| a.max(b.abs()));
        assert!(lit_places(&model).iter().map(thrown).fold(0.0, f32::max) < 1e-5);
    }
}
