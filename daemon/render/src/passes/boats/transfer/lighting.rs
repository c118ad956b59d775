//! The light that places on a boat get: past the boat itself, then from face to face.

use std::{f32::consts::TAU, thread};

use bowwave_core::{
    colour::{LUMINANCE, srgb_to_linear},
    model::{Model, Texture},
    sky::SkyLobes,
};
use glam::{Mat3, Vec3};

use super::{DARK, SEA, SUN, SUN_TERMS, Transfer, places::Place, rays::Rays};

/// Bounces from face to face that are followed: the next would bring a hundredth of the light to the inside of a white boat.
const BOUNCES: u32 = 3;
/// Rays from a side of a place; fewer where there are more than so many places, which lie the denser, down to the least.
const RAYS: usize = 64;
const MANY_PLACES: usize = 20_000;
const RAYS_MIN: usize = 16;
/// Rays start so far off the surface, metres.
const OFF_M: f32 = 0.004;

/// The light about a boat, past it and by way of it.
pub(super) struct Lighting {
    rays: Rays,
    /// Directions about a normal, as often as their cosines.
    fan: Vec<Vec3>,
    /// Directions of the faces' normals, of any length, and whether their parts are closed.
    normals: Vec<Vec3>,
    closed: Vec<bool>,
    /// The radiance of each face, on either side.
    thrown: Vec<[Transfer; 2]>,
}

/// A direction in which a place sees another face of the boat.
struct Glance {
    /// On which side of the place, and how much of what comes there.
    side: usize,
    share: f32,
    /// The face that it sees, and on which side.
    face: u32,
    face_side: usize,
}

impl Lighting {
    /// Gives `places` on the surface of `model`, some of whose faces belong to closed parts, the light that each gets.
    pub(super) fn of(model: &Model, closed: Vec<bool>, places: &mut [Place]) -> Self {
        let albedo = face_luminance(model);
        let mut made = Self {
            rays: Rays::of(model),
            fan: fan((RAYS * MANY_PLACES / places.len().max(1)).clamp(RAYS_MIN, RAYS)),
            normals: face_normals(model),
            closed,
            thrown: vec![[DARK; 2]; albedo.len()],
        };
        let glances = made.look_out(places);
        let outside: Vec<[Transfer; 2]> = places.iter().map(|place| place.light).collect();
        for _ in 0..BOUNCES {
            made.thrown = thrown(&albedo, places);
            for ((place, glances), outside) in places.iter_mut().zip(&glances).zip(&outside) {
                place.light = *outside;
                made.add_thrown(place, glances);
            }
        }
        for (place, outside) in places.iter_mut().zip(&outside) {
            split_off_sun(place, outside);
        }
        made
    }

    /// Gives more places their light.
    pub(super) fn light(&self, places: &mut [Place]) {
        let glances = self.look_out(places);
        for (place, glances) in places.iter_mut().zip(&glances) {
            let outside = place.light;
            self.add_thrown(place, glances);
            split_off_sun(place, &outside);
        }
    }

    /// Gives each place the light that reaches it past the boat; and lists where it sees the boat.
    fn look_out(&self, places: &mut [Place]) -> Vec<Vec<Glance>> {
        let threads = thread::available_parallelism().map_or(1, usize::from);
        let each = places.len().div_ceil(threads).max(256);
        thread::scope(|scope| {
            let jobs: Vec<_> = (places.chunks_mut(each))
                .map(|some| {
                    scope.spawn(|| some.iter_mut().map(|place| self.look_round(place)).collect::<Vec<_>>())
                })
                .collect();
            let done = jobs
                .into_iter()
                .map(|job| job.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            done.flatten().collect()
        })
    }

    fn look_round(&self, place: &mut Place) -> Vec<Glance> {
        let mut glances = Vec::new();
        for side in 0..2 {
            place.light[side] = DARK;
            place.hidden[side] = true;
            if side == 1 && self.closed[place.face as usize] {
                continue;
            }
            let normal = if side == 0 { place.normal } else { -place.normal };
            let from = place.position + normal * OFF_M;
            let turned = about(normal, place.position);
            // What comes from above and from below the horizon is known on the whole: (1 + z) / 2 and (1 - z) / 2.
            let above = self.fan.iter().filter(|direction| (turned * **direction).z > 0.0).count() as f32;
            let below = self.fan.len() as f32 - above;
            let shares = [0.5 * (1.0 + normal.z) / above.max(1.0), 0.5 * (1.0 - normal.z) / below.max(1.0)];
            for direction in &self.fan {
                let direction = turned * *direction;
                let share = shares[usize::from(direction.z <= 0.0)];
                if let Some(face) = self.rays.meet(from, direction) {
                    let is_back = self.normals[face as usize].dot(direction) > 0.0;
                    glances.push(Glance { side, share, face, face_side: usize::from(is_back) });
                    continue;
                }
                place.hidden[side] = false;
                let seen = &mut place.light[side];
                if direction.z > 0.0 {
                    let lobes = SkyLobes::basis(direction.as_dvec3());
                    seen.iter_mut().zip(lobes).for_each(|(of, value)| *of += value as f32 * share);
                } else {
                    seen[SEA] += share;
                }
            }
        }
        glances
    }

    /// Adds what a place gets from the faces that it sees.
    fn add_thrown(&self, place: &mut Place, glances: &[Glance]) {
        for Glance { side, share, face, face_side } in glances {
            let from = &self.thrown[*face as usize][*face_side];
            place.light[*side].iter_mut().zip(from).for_each(|(of, value)| *of += value * share);
        }
    }
}

/// Directions about the z axis, as often as their cosines: a white surface's radiance is the mean of what comes from them. Their azimuths
/// differ by the golden angle.
fn fan(count: usize) -> Vec<Vec3> {
    const TURN: f32 = 2.399_963_2;
    let direction = |i: usize| {
        let out = (i as f32 + 0.5) / count as f32;
        let (sin, cos) = (i as f32 * TURN).sin_cos();
        Vec3::new(out.sqrt() * cos, out.sqrt() * sin, (1.0 - out).sqrt())
    };
    (0..count).map(direction).collect()
}

/// Axes with a normal as the third, turned about it otherwise at each place: what one place's rays miss another's find.
fn about(normal: Vec3, place: Vec3) -> Mat3 {
    let (x, y) = normal.any_orthonormal_pair();
    let bits = place.to_array().map(f32::to_bits);
    let hash =
        bits.into_iter().fold(0_u32, |hash, bits| (hash ^ bits).wrapping_mul(0x9e37_79b1).rotate_left(15));
    let (sin, cos) = (TAU * (hash >> 8) as f32 / (1_u32 << 24) as f32).sin_cos();
    Mat3::from_cols(x * cos + y * sin, y * cos - x * sin, normal)
}

/// Puts what came by way of the boat of the sun's light in its own terms: all but `outside`.
fn split_off_sun(place: &mut Place, outside: &[Transfer; 2]) {
    for (light, outside) in place.light.iter_mut().zip(outside) {
        let thrown = std::array::from_fn(|i| light[i] - outside[i]);
        light[SUN..].copy_from_slice(&by_suns_place(thrown));
    }
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

/// The radiance of each face, on either side: its albedo times the mean of what its places get that are not hidden.
fn thrown(albedo: &[f32], places: &[Place]) -> Vec<[Transfer; 2]> {
    let mut thrown = vec![[DARK; 2]; albedo.len()];
    let mut counts = vec![[0.0_f32; 2]; albedo.len()];
    for place in places {
        let face = place.face as usize;
        for side in (0..2).filter(|side| !place.hidden[*side]) {
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
