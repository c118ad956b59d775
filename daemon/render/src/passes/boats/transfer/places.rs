//! Places all over a boat's surface, and the light that each gets: past the boat itself, then from face to face.

use bowwave_core::{
    colour::{LUMINANCE, srgb_to_linear},
    model::{Model, Texture, Vertex},
    sky::SkyLobes,
};
use glam::Vec3;

use super::{
    ABOVE, BELOW, DARK, SEA, SUN, SUN_TERMS, Transfer, directions, fit::Seat, picture::LayeredPicture,
};

/// Bounces from face to face that are followed: the next would bring a hundredth of the light to the inside of a white boat.
const BOUNCES: u32 = 3;

/// A place on the surface: what it sees is seen about its triangle's corners by their shares.
pub(super) struct Place {
    pub(super) at: Seat,
    /// Area that it stands for, over that of the mean place.
    pub(super) weight: f32,
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    face: u32,
    /// On the side of the normal and on the other: the light that it gets...
    pub(super) light: [Transfer; 2],
    /// ...and whether it lies within another part of the boat.
    pub(super) buried: [bool; 2],
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
        let corners = (0..).zip(model.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]));
        corners.filter_map(|(face, t)| Some((face, t, [at(t[0])?, at(t[1])?, at(t[2])?])))
    };
    let whole: f32 = triangles().map(|(_, _, t)| area(t)).sum::<f32>().max(f32::MIN_POSITIVE);
    let mut found = Vec::new();
    for (face, indices, corners) in triangles() {
        let count = (area(corners) / whole * ALL).clamp(1.0, MOST) as u32;
        for i in 0..count {
            // Roberts' sequence: evenly spread for any count.
            let fraction = |step: f32| (0.5 + step * i as f32).fract();
            let (u, v) = (fraction(0.754_877_7).sqrt(), fraction(0.569_840_3));
            let shares = [1.0 - u, u * (1.0 - v), u * v];
            let mix = |of: fn(&Vertex) -> Vec3| (0..3).map(|k| of(corners[k]) * shares[k]).sum::<Vec3>();
            found.push(Place {
                at: Seat { corners: indices.map(|i| i as usize), shares },
                weight: area(corners) / whole * ALL / count as f32,
                position: mix(|v| v.position),
                normal: mix(|v| v.normal).normalize_or(corners[0].normal),
                face,
                light: [DARK; 2],
                buried: [false; 2],
            });
        }
    }
    found
}

/// Places with the light that each gets.
pub(super) fn lit_places(model: &Model) -> Vec<Place> {
    let mut places = places(model);
    let glances = light_from_outside(model, &mut places);
    let albedo = face_luminance(model);
    let outside: Vec<[Transfer; 2]> = places.iter().map(|place| place.light).collect();
    for _ in 0..BOUNCES {
        let thrown = thrown(&albedo, &places);
        for (place, outside) in places.iter_mut().zip(&outside) {
            place.light = *outside;
        }
        for glance in &glances {
            let from = &thrown[glance.face as usize][usize::from(glance.towards_back)];
            let place = &mut places[glance.place as usize];
            let light = &mut place.light[usize::from(glance.from_back)];
            light.iter_mut().zip(from).for_each(|(of, value)| *of += value * glance.share);
        }
    }
    for (place, outside) in places.iter_mut().zip(&outside) {
        for (light, outside) in place.light.iter_mut().zip(outside) {
            let thrown = std::array::from_fn(|i| light[i] - outside[i]);
            light[SUN..].copy_from_slice(&by_suns_place(thrown));
        }
    }
    places
}

/// Light of the sun by way of the boat, by where the sun stands, from that of the sky's first lobes: 1 and the three coordinates of the
/// direction. Least squares over the half sphere, where their mean products are 1, a half (of 1 and z) and a third (of each with itself).
fn by_suns_place(thrown: [f32; SUN_TERMS]) -> [f32; SUN_TERMS] {
    let [even, x, y, z] = thrown.map(|of| 0.5 * of);
    [4.0 * even - 6.0 * z, 3.0 * x, 3.0 * y, 12.0 * z - 6.0 * even]
}

/// Mean luminance of what a texture shows, linear.
fn mean_luminance(texture: &Texture) -> f32 {
    let (mut light, mut shown) = (0.0, 1e-6);
    for texel in texture.rgba.chunks_exact(4) {
        let [red, green, blue, alpha] = [0, 1, 2, 3].map(|i| f32::from(texel[i]) / 255.0);
        light += alpha * Vec3::new(red, green, blue).map(srgb_to_linear).dot(LUMINANCE);
        shown += alpha;
    }
    light / shown
}

/// A direction in which a place sees another face of the boat.
struct Glance {
    place: u32,
    /// The face that it sees.
    face: u32,
    /// Of the radiance there, what white at the place makes of it.
    share: f32,
    /// On which side of the place, and of the face.
    from_back: bool,
    towards_back: bool,
}

/// Gives each place the light that reaches it past the boat; and lists where it sees the boat.
fn light_from_outside(model: &Model, places: &mut [Place]) -> Vec<Glance> {
    /// Share of what it would see alone at which a place counts as within another part.
    const BURIED: f32 = 0.02;
    let mut picture = LayeredPicture::of(model);
    let mut alone = vec![[0.0_f32; 2]; places.len()];
    let mut glances = Vec::new();
    let normals = face_normals(model);
    for (above, count) in [(true, ABOVE), (false, BELOW)] {
        // A white surface's radiance is its irradiance over pi; each direction is a share of two pi.
        let share = 2.0 / f64::from(count);
        for direction in directions(count, if above { 1.0 } else { -1.0 }) {
            picture.take(model, direction.as_vec3());
            let lobes = SkyLobes::basis(direction).map(|value| (value * share) as f32);
            for ((number, place), alone) in (0..).zip(&mut *places).zip(&mut alone) {
                let cosine = place.normal.dot(direction.as_vec3());
                let side = usize::from(cosine < 0.0);
                let normal = if side == 0 { place.normal } else { -place.normal };
                let cosine = cosine.abs();
                alone[side] += cosine * share as f32;
                if let Some(face) = picture.before(place.position, normal) {
                    glances.push(Glance {
                        place: number,
                        face,
                        share: cosine * share as f32,
                        from_back: side == 1,
                        towards_back: normals[face as usize].dot(direction.as_vec3()) > 0.0,
                    });
                    continue;
                }
                let seen = &mut place.light[side];
                if above {
                    seen.iter_mut().zip(lobes).for_each(|(of, value)| *of += value * cosine);
                } else {
                    seen[SEA] += share as f32 * cosine;
                }
            }
        }
    }
    for (place, alone) in places.iter_mut().zip(alone) {
        place.buried = [0, 1].map(|side: usize| {
            let seen = &place.light[side];
            seen[0] + seen[SEA] <= BURIED * alone[side]
        });
    }
    glances
}

/// Directions of the faces' normals, of any length.
fn face_normals(model: &Model) -> Vec<Vec3> {
    let normal = |i: u32| model.vertices.get(i as usize).map_or(Vec3::ZERO, |v| v.normal);
    model.indices.chunks_exact(3).map(|t| t.iter().map(|i| normal(*i)).sum()).collect()
}

/// Luminance of each face's albedo.
fn face_luminance(model: &Model) -> Vec<f32> {
    let mean = model.texture.as_ref().map_or(1.0, mean_luminance);
    let luminance = |i: u32| model.vertices.get(i as usize).map_or(0.0, |v| v.albedo.dot(LUMINANCE));
    let faces = model.indices.chunks_exact(3);
    faces.map(|t| mean * t.iter().map(|i| luminance(*i)).sum::<f32>() / 3.0).collect()
}

/// The radiance of each face, on either side: its albedo times the mean of what its places get that are not buried.
fn thrown(albedo: &[f32], places: &[Place]) -> Vec<[Transfer; 2]> {
    let mut thrown = vec![[DARK; 2]; albedo.len()];
    let mut counts = vec![[0.0_f32; 2]; albedo.len()];
    for place in places {
        let face = place.face as usize;
        for side in (0..2).filter(|side| !place.buried[*side]) {
            counts[face][side] += 1.0;
            thrown[face][side].iter_mut().zip(place.light[side]).for_each(|(of, light)| *of += light);
        }
    }
    for ((thrown, counts), albedo) in thrown.iter_mut().zip(counts).zip(albedo) {
        for (thrown, count) in thrown.iter_mut().zip(counts) {
            thrown.iter_mut().for_each(|of| *of *= albedo / count.max(1.0));
        }
    }
    thrown
}
