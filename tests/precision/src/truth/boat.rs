//! Boats of the truth: a box boat made here, the trainer's own models, and how they float.

use std::path::Path;

use anyhow::{Context, Result};
use bowwave_core::{
    geometry::RigidPose,
    model::{Model, ModelKind, Part, Vertex, Zone},
};
use glam::{DMat3, DQuat, DVec2, DVec3, Vec2, Vec3};
use hw_sim::ocean::{
    mesh::{BoatFrame, BoatMesh, MeshCorner},
    waves::Waves,
};

/// Name of the box boat.
pub const BOX_BOAT: &str = "box8";

/// The model of that name: [`BOX_BOAT`], one of the trainer's, or a file.
pub fn model(name: &str) -> Result<Model> {
    if name == BOX_BOAT {
        return Ok(box_boat());
    }
    bowwave_models::resolve(name, Path::new("."))
        .with_context(|| format!("no boat '{name}' ({BOX_BOAT} is one)"))
}

/// `model` at `pose` for rays to meet. A texture is not looked at: models with one keep their corners' colours.
pub fn mesh(model: &Model, pose: RigidPose) -> BoatMesh {
    let triangles = model.indices.chunks_exact(3).map(|i| {
        [0, 1, 2].map(|j| {
            let v = model.vertices[i[j] as usize];
            MeshCorner {
                position: pose.to_world(v.position.as_dvec3()),
                normal: pose.world_from_body * v.normal.as_dvec3(),
                albedo: v.albedo.as_dvec3(),
            }
        })
    });
    let frame = BoatFrame { world_from_boat: pose.world_from_body, position: pose.position };
    BoatMesh::new(triangles, frame, model.waterline.clone())
}

/// A boat of boxes, 8 m long and 2.6 m wide: red below, navy, white with an orange line, a cabin with windows and a mast. Its stripes
/// make it plain what a reflection shows.
pub fn box_boat() -> Model {
    let red = Vec3::new(0.22, 0.02, 0.02);
    let navy = Vec3::new(0.012, 0.018, 0.07);
    let white = Vec3::splat(0.75);
    let orange = Vec3::new(0.55, 0.14, 0.02);
    let yellow = Vec3::new(0.60, 0.36, 0.06);
    let dark = Vec3::splat(0.02);
    let mut made = BoxMaker::default();
    for (low, high, colour) in
        [(-0.6, 0.3, red), (0.3, 0.6, navy), (0.6, 0.95, white), (0.95, 1.05, orange), (1.05, 1.25, white)]
    {
        made.block(Vec3::new(-4.0, -1.3, low), Vec3::new(4.0, 1.3, high), colour);
    }
    made.block(Vec3::new(-1.6, -0.9, 1.25), Vec3::new(1.6, 0.9, 2.5), white);
    made.block(Vec3::new(-1.75, -1.0, 2.5), Vec3::new(1.75, 1.0, 2.65), yellow);
    for side in [-1.0f32, 1.0] {
        for x in [-1.0, 0.0, 1.0] {
            let (a, b) = (side * 0.89, side * 0.92);
            made.block(Vec3::new(x - 0.35, a.min(b), 1.75), Vec3::new(x + 0.35, a.max(b), 2.25), dark);
        }
    }
    made.block(Vec3::new(1.59, -0.7, 1.75), Vec3::new(1.62, 0.7, 2.25), dark);
    made.block(Vec3::new(-0.06, -0.06, 2.65), Vec3::new(0.06, 0.06, 4.4), dark);
    made.finish()
}

/// A box between two corners, for what is no boat: without parts and waterline.
pub fn block(low: Vec3, high: Vec3, albedo: Vec3) -> Model {
    let mut made = BoxMaker::default();
    made.block(low, high, albedo);
    Model { name: "block".to_owned(), parts: Vec::new(), waterline: Vec::new(), ..made.finish() }
}

#[derive(Default)]
struct BoxMaker {
    vertices: Vec<Vertex>,
    indices: Vec<u32>,
}

impl BoxMaker {
    fn block(&mut self, low: Vec3, high: Vec3, albedo: Vec3) {
        for axis in 0..3 {
            for sign in [-1.0f32, 1.0] {
                let mut normal = Vec3::ZERO;
                normal[axis] = sign;
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let base = self.vertices.len() as u32;
                for (a, b) in [(false, false), (true, false), (true, true), (false, true)] {
                    let mut p = if sign > 0.0 { high } else { low };
                    p[u] = if a { high[u] } else { low[u] };
                    p[v] = if b { high[v] } else { low[v] };
                    self.vertices.push(Vertex { position: p, normal, uv: Vec2::ZERO, albedo });
                }
                let order = if sign > 0.0 { [0, 1, 2, 0, 2, 3] } else { [0, 2, 1, 0, 3, 2] };
                self.indices.extend(order.map(|i| base + i));
            }
        }
    }

    fn finish(self) -> Model {
        let (min, max) = self
            .vertices
            .iter()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), v| (a.min(v.position), b.max(v.position)));
        let count = self.indices.len() as u32;
        Model {
            name: BOX_BOAT.to_owned(),
            kind: ModelKind::Mesh,
            vertices: self.vertices,
            indices: self.indices,
            parts: vec![Part { zone: Zone::Hull, indices: 0..count }],
            texture: None,
            waterline: vec![
                DVec2::new(-4.0, -1.3),
                DVec2::new(4.0, -1.3),
                DVec2::new(4.0, 1.3),
                DVec2::new(-4.0, 1.3),
            ],
            min,
            max,
        }
    }
}

/// Puts a boat at `place`, its bow to `heading` (radians clockwise from north), onto the plane that fits the water under its waterline
/// best: heave, pitch and roll without inertia.
pub fn float(model: &Model, place: DVec2, heading: f64, waves: &Waves) -> RigidPose {
    let (low, high) = model
        .waterline
        .iter()
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(a, b), &p| (a.min(p), b.max(p)));
    let forward = DVec2::new(heading.sin(), heading.cos());
    let port = forward.perp();
    let (nx, ny) = (17, 7);
    let (mut mean, mut along, mut across) = (0.0, DVec2::ZERO, DVec2::ZERO);
    for i in 0..nx {
        for j in 0..ny {
            let share =
                DVec2::new((f64::from(i) + 0.5) / f64::from(nx), (f64::from(j) + 0.5) / f64::from(ny));
            let p = low + (high - low) * share;
            let h = waves.height(place + forward * p.x + port * p.y);
            let off = p - (low + high) / 2.0;
            mean += h / f64::from(nx * ny);
            along += DVec2::new(off.x * h, off.x * off.x);
            across += DVec2::new(off.y * h, off.y * off.y);
        }
    }
    let (pitch, roll) = ((along.x / along.y.max(1e-9)).atan(), (across.x / across.y.max(1e-9)).atan());
    let level = DQuat::from_mat3(&DMat3::from_cols(forward.extend(0.0), port.extend(0.0), DVec3::Z));
    RigidPose {
        world_from_body: level * DQuat::from_rotation_y(-pitch) * DQuat::from_rotation_x(roll),
        position: place.extend(mean),
    }
}
