//! Kolivand and Sunar's Table 1 (2014): frames a second of four ways at two resolutions, in one run, with the error beside them.

use anyhow::Result;
use bowwave_core::geometry::{CameraPose, Lens, RigidPose};
use bowwave_models::resolve;
use glam::{DVec2, DVec3};
use hw_sim::ocean::mesh::BoatMesh;
use rayon::prelude::*;

use super::{
    super::drawn_boat::towards,
    studio::{eye, on_disc},
};
use crate::{
    bench::{PartBench, Way, thread_ns},
    front::median,
    metric::flip_map,
    reflection::scenes::{self, Afloats},
    shadows::{
        METHODS, NamedMethod, ShadowEye, ShadowFrame, TABLE_1,
        mesh::CasterMesh,
        seen::{SeenPoint, SeenPoints},
    },
    truth::boat,
};

/// Objects on the ground: boat, metres ahead and to the right, heading in degrees.
const OBJECTS: [(&str, f64, f64, f64); 7] = [
    ("box8", 16.0, -3.0, 60.0),
    ("skiff", 24.0, 6.0, 110.0),
    ("rhib", 34.0, -10.0, 30.0),
    ("dhow", 55.0, 8.0, 75.0),
    ("box8", 75.0, -18.0, 150.0),
    ("skiff", 110.0, 16.0, 200.0),
    ("dhow", 150.0, -20.0, 100.0),
];

/// Light of the ground and of all objects without the sun, and what the sun adds to what faces it.
const AMBIENT: f32 = 0.12;
const SUN: f32 = 0.6;

/// Objects over a plane.
struct Grounds {
    camera: CameraPose,
    lens: Lens,
    sun: DVec3,
    meshes: Vec<CasterMesh>,
    rays: Vec<BoatMesh>,
}

/// What is seen of it.
struct Looked {
    seen: SeenPoints,
    /// Share of the sun's disc at each point.
    truth: Vec<f32>,
}

impl Grounds {
    fn new(size: (u32, u32)) -> Result<Self> {
        let (mut meshes, mut rays) = (Vec::new(), Vec::new());
        for (name, ahead_m, right_m, heading_deg) in OBJECTS {
            let model = if name == boat::BOX_BOAT {
                boat::box_boat()
            } else {
                resolve(name, std::path::Path::new(""))?
            };
            // Keels on the ground: nothing lies under it.
            let lifted_m = -f64::from(model.min.z);
            let pose: RigidPose = Afloats { right_m, heading_deg, lifted_m, ..Afloats::at(ahead_m) }.pose();
            meshes.push(CasterMesh::of(&model, pose, DVec3::ZERO));
            rays.push(boat::mesh(&model, pose));
        }
        let lens = Lens::pinhole(size.0, size.1, 50f64.to_radians());
        Ok(Self { camera: scenes::camera(6.0, 30.0), lens, sun: towards(35.0, 70.0), meshes, rays })
    }

    /// The nearest hit of a ray: its distance, normal and which object it is; the ground's where there is none.
    fn meet(&self, from: DVec3, along: DVec3) -> Option<(f64, DVec3, u32)> {
        let ground = (along.z < -1e-9).then(|| -from.z / along.z).filter(|t| *t < 250.0);
        let mut best = ground.map(|t| (t, DVec3::Z, SeenPoint::GROUND));
        for (number, mesh) in (0..).zip(&self.rays) {
            if let Some(hit) = mesh.meet(from, along, best.map_or(f64::INFINITY, |b| b.0)) {
                best = Some((hit.t, hit.normal, number));
            }
        }
        best
    }

    /// What the picture shows, with `rays` to the sun's disc for each pixel.
    fn look(&self, rays: u32) -> Looked {
        let size = [self.lens.width, self.lens.height];
        let lens = [self.lens.centre.as_vec2().to_array(), self.lens.focal.as_vec2().to_array()];
        let mut seen = SeenPoints::begin([0, 0], size, lens);
        let points: Vec<Option<(SeenPoint, f32)>> = (0..size[0] * size[1])
            .into_par_iter()
            .map(|i| self.point(i % size[0], i / size[0], rays))
            .collect();
        let mut truth = Vec::new();
        for found in points {
            if let Some((point, share)) = found {
                seen.push(point);
                truth.push(share);
            }
            seen.end_pixel();
        }
        Looked { seen, truth }
    }

    fn point(&self, x: u32, y: u32, rays: u32) -> Option<(SeenPoint, f32)> {
        let ray = self.lens.unproject(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
        let along = (self.camera.world_from_camera * ray).normalize();
        let (t, normal, mesh) = self.meet(self.camera.position, along)?;
        let place = self.camera.position + along * (t - 0.003);
        let normal = if normal.dot(along) > 0.0 { -normal } else { normal };
        let free = (0..rays).filter(|i| {
            let towards = on_disc(self.sun, *i, (f64::from(*i) + 0.5) / f64::from(rays));
            !self.rays.iter().any(|mesh| mesh.blocks(place, towards))
        });
        let share = free.count() as f32 / rays as f32;
        let depth = self.camera.to_camera(place).z as f32;
        let (place, normal) = (place.as_vec3(), normal.as_vec3());
        Some((SeenPoint { number: 0, mesh, place, normal, ray: (ray / ray.z).as_vec3(), depth }, share))
    }

    fn eye(&self) -> ShadowEye {
        eye(&self.camera, &self.lens, DVec3::ZERO)
    }

    fn frame(&self) -> ShadowFrame<'_> {
        ShadowFrame { sun: self.sun.as_vec3(), meshes: &self.meshes, eye: self.eye() }
    }

    /// A grey picture by shares of the sun.
    fn picture(&self, seen: &SeenPoints, mut share: impl FnMut(&SeenPoint) -> f32) -> Vec<u8> {
        let sun = self.sun.as_vec3();
        let mut made = Vec::with_capacity(3 * (seen.size[0] * seen.size[1]) as usize);
        for pixel in seen.first.windows(2) {
            let light = match seen.points.get(pixel[0] as usize).filter(|_| pixel[0] < pixel[1]) {
                Some(point) => AMBIENT + SUN * share(point) * point.normal.dot(sun).max(0.0),
                None => 0.5,
            };
            // The square root stands for sRGB's curve: the picture is one of time as well.
            made.extend([(light.clamp(0.0, 1.0).sqrt() * 255.0) as u8; 3]);
        }
        made
    }
}

/// Pictures of the objects: the truth, and what each method makes of it that a test by method and setting says yes to.
pub fn pictures(size: (u32, u32), wants: impl Fn(&NamedMethod) -> bool) -> Result<Vec<(String, Vec<u8>)>> {
    let grounds = Grounds::new(size)?;
    let looked = grounds.look(16);
    let truth = grounds.picture(&looked.seen, |point| looked.truth[point.number as usize]);
    let mut made = vec![("rays to the sun's disc".to_owned(), truth)];
    for named in METHODS.iter().filter(|named| !named.four_points && wants(named)) {
        let mut method = (named.make)();
        method.prepare(&grounds.frame(), &looked.seen);
        let picture = grounds.picture(&looked.seen, |point| method.share(point));
        made.push((format!("{}, {}", named.method, named.setting), picture));
    }
    Ok(made)
}

/// Measures the table.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let size = if bench.is_quick() { (320, 180) } else { (960, 540) };
    let grounds = Grounds::new(size)?;
    let looked = grounds.look(if bench.is_quick() { 4 } else { 16 });
    let truth = grounds.picture(&looked.seen, |point| looked.truth[point.number as usize]);
    for (side, methods) in TABLE_1.iter().take(if bench.is_quick() { 1 } else { 2 }) {
        let mut rows = Vec::new();
        for (named, printed) in methods {
            let mut made = (named.make)();
            made.prepare(&grounds.frame(), &looked.seen);
            let (grounds, seen) = (&grounds, &looked.seen);
            let bytes = made.bytes();
            let mut work = move || {
                made.prepare(&grounds.frame(), seen);
                grounds.picture(seen, |point| made.share(point))
            };
            let map = flip_map(&truth, &work(), size)?;
            let error = map.iter().map(|e| f64::from(*e)).sum::<f64>() / map.len() as f64;
            let mut times: Vec<f64> = (0..5)
                .map(|_| {
                    let before = thread_ns();
                    std::hint::black_box(work());
                    thread_ns() - before
                })
                .collect();
            rows.push((named, work, error, bytes, 1e9 / median(&mut times), *printed / methods[0].1));
        }
        let plain = rows.first().map_or(1.0, |row| row.4);
        let ways = rows.into_iter().map(|(named, work, error, bytes, fps, printed)| {
            let note = format!(
                "{fps:.1} frames a second, {:.2} of those of plain maps; as printed {printed:.2}",
                fps / plain
            );
            Way::new(named.method, named.setting, error, 1, work).holds(bytes).note(note)
        });
        bench.scene(&format!("Kolivand and Sunar's Table 1, {side} x {side}"), "FLIP", 0.001, ways.collect());
    }
    Ok(())
}
