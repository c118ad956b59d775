//! A quay that a camera sees, with real crates and a virtual boat on it: what the passages of Hughes, Konttinen and Pattanaik (2004) are drawn with.

use bowwave_core::{
    geometry::{CameraPose, Lens, RigidPose, look},
    model::Model,
};
use glam::{DQuat, DVec2, DVec3, Vec3};
use hw_sim::ocean::mesh::BoatMesh;
use image::{Rgb, RgbImage};
use rayon::prelude::*;

use crate::{
    shadows::{
        ShadowEye,
        mesh::CasterMesh,
        seen::{SeenPoint, SeenPoints},
    },
    truth::{
        boat::{block, box_boat, mesh},
        files::code,
    },
};

/// Size of its pictures.
pub const SIZE: (u32, u32) = (480, 270);

/// A thing that stands on the quay.
pub struct Standing {
    /// For rays.
    pub rays: BoatMesh,
    /// For shadow volumes.
    pub caster: CasterMesh,
    /// A thing that the camera sees, and not drawn.
    pub is_real: bool,
}

/// What a pixel shows.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Its place, metres.
    pub at: DVec3,
    /// Unit normal towards the eye's side.
    pub normal: DVec3,
    /// Reflectance.
    pub albedo: Vec3,
    /// Which thing; nothing for the ground.
    pub thing: Option<usize>,
    /// Distance along the view, metres.
    pub depth: f64,
}

/// The quay.
pub struct Quay {
    /// Things on it.
    pub things: Vec<Standing>,
    camera: CameraPose,
    lens: Lens,
}

/// A crate of that length, width and height, its bottom at height 0.
fn crate_model([length, beam, height]: [f32; 3], albedo: Vec3) -> Model {
    let half = Vec3::new(length / 2.0, beam / 2.0, 0.0);
    block(-half, half.with_z(height), albedo)
}

impl Quay {
    /// Two real crates, and a virtual boat between them if `with_boat`.
    pub fn new(with_boat: bool) -> Self {
        let stand = |model: &Model, at: DVec3, turn: f64, is_real| {
            let pose = RigidPose { world_from_body: DQuat::from_rotation_z(turn), position: at };
            Standing { rays: mesh(model, pose), caster: CasterMesh::of(model, pose, DVec3::ZERO), is_real }
        };
        let brown = Vec3::new(0.3, 0.2, 0.11);
        let mut things = vec![
            stand(&crate_model([2.2, 1.6, 1.9], brown), DVec3::new(-6.2, 14.5, 0.0), 0.3, true),
            stand(
                &crate_model([3.0, 1.4, 1.2], Vec3::new(0.13, 0.19, 0.14)),
                DVec3::new(5.4, 16.5, 0.0),
                -0.5,
                true,
            ),
        ];
        if with_boat {
            things.push(stand(&box_boat(), DVec3::new(-0.3, 13.5, 0.6), 0.5, false));
        }
        let (lens, position) = (Lens::pinhole(SIZE.0, SIZE.1, 58f64.to_radians()), DVec3::new(0.0, 0.0, 4.2));
        Self { things, camera: CameraPose { world_from_camera: look(0.0, -0.24, 0.0), position }, lens }
    }

    /// The same seen from elsewhere: place, azimuth clockwise from north and elevation, radians.
    pub fn from(self, position: DVec3, azimuth: f64, elevation: f64) -> Self {
        Self { camera: CameraPose { world_from_camera: look(azimuth, elevation, 0.0), position }, ..self }
    }

    /// The nearest of the ground and of the things that a test says yes to.
    fn meet(&self, from: DVec3, along: DVec3, has: impl Fn(&Standing) -> bool) -> Option<Surface> {
        let ground = (along.z < -1e-9).then(|| -from.z / along.z).filter(|t| *t < 60.0);
        let mut best = ground.map(|t| {
            let at = from + along * t;
            // Slabs of concrete with joints.
            let joint = (at.x.rem_euclid(3.0) < 0.06) || (at.y.rem_euclid(3.0) < 0.08);
            let tone = if joint { 0.12 } else { 0.34 + 0.04 * f64::from((at.x / 3.0).floor() as i32 % 2) };
            Surface { at, normal: DVec3::Z, albedo: Vec3::splat(tone as f32), thing: None, depth: t }
        });
        for (number, thing) in self.things.iter().enumerate().filter(|(_, thing)| has(thing)) {
            if let Some(hit) = thing.rays.meet(from, along, best.map_or(f64::INFINITY, |b| b.depth)) {
                let normal = if hit.normal.dot(along) > 0.0 { -hit.normal } else { hit.normal };
                let (at, albedo) = (from + along * hit.t, hit.albedo.as_vec3());
                best = Some(Surface { at, normal, albedo, thing: Some(number), depth: hit.t });
            }
        }
        best.map(|s| Surface { at: s.at - along * 0.003, ..s })
    }

    /// What each pixel shows, row by row, of the ground and of the things that a test says yes to.
    pub fn look(&self, has: impl Fn(&Standing) -> bool + Sync) -> Vec<Option<Surface>> {
        let of = |i: u32| {
            let pixel = DVec2::new(f64::from(i % SIZE.0) + 0.5, f64::from(i / SIZE.0) + 0.5);
            let along = (self.camera.world_from_camera * self.lens.unproject(pixel)).normalize();
            self.meet(self.camera.position, along, &has)
        };
        (0..SIZE.0 * SIZE.1).into_par_iter().map(of).collect()
    }

    /// The same as the report's shadow methods get it; their origin is the world's.
    pub fn seen(&self, surfaces: &[Option<Surface>]) -> SeenPoints {
        let lens = [self.lens.centre.as_vec2().to_array(), self.lens.focal.as_vec2().to_array()];
        let mut seen = SeenPoints::begin([0, 0], [SIZE.0, SIZE.1], lens);
        for surface in surfaces {
            if let Some(s) = surface {
                let at = self.camera.to_camera(s.at);
                seen.push(SeenPoint {
                    number: 0,
                    mesh: s.thing.map_or(SeenPoint::GROUND, |i| i as u32),
                    place: s.at.as_vec3(),
                    normal: s.normal.as_vec3(),
                    ray: (at / at.z).as_vec3(),
                    depth: at.z as f32,
                });
            }
            seen.end_pixel();
        }
        seen
    }

    /// The eye as those methods get it.
    pub fn eye(&self) -> ShadowEye {
        let half = 0.5 * DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1));
        ShadowEye {
            position: self.camera.position.as_vec3(),
            axes: DVec3::AXES.map(|axis| (self.camera.world_from_camera * axis).as_vec3()),
            reach: (half / self.lens.focal).as_vec2().to_array(),
            pixel: self.lens.focal.max_element().recip() as f32,
        }
    }

    /// Whether one of the things that a test says yes to stands between a place and what is in that direction, so far off.
    pub fn blocks(&self, from: DVec3, towards: DVec3, reach_m: f64, has: impl Fn(&Standing) -> bool) -> bool {
        let met = |thing: &Standing| thing.rays.meet(from, towards, reach_m).is_some();
        self.things.iter().filter(|thing| has(thing)).any(met)
    }
}

/// A picture from linear light by pixel.
pub fn picture_of(light: impl Fn(usize) -> Vec3) -> RgbImage {
    RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        let light = light((y * SIZE.0 + x) as usize).clamp(Vec3::ZERO, Vec3::ONE);
        Rgb(light.to_array().map(code))
    })
}
