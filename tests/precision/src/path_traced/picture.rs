//! The part of a picture that shows a boat, by paths.

use bowwave_core::{
    frame::scene::PixelRect,
    geometry::{CameraPose, Lens},
};
use glam::{DVec2, DVec3, Vec3};
use hw_sim::ocean::{mesh::BoatMesh, random::LightPath};
use rayon::prelude::*;

use super::{
    light::TracedLight,
    tracer::{Gathered, Tracer},
};

/// Where light came from, at once or by way of the hull.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    /// The disc of sun or moon.
    Sun,
    /// The sky.
    Sky,
    /// The sea.
    Sea,
    /// The hull's own image in the sea.
    HullInSea,
}

/// The eye and what it looks at.
pub struct View<'a> {
    /// Its pose.
    pub camera: &'a CameraPose,
    /// Its lens.
    pub lens: &'a Lens,
    /// Pixels that may show the boat.
    pub within: PixelRect,
}

/// One pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct TracedPixel {
    /// Share of it that the boat covers.
    pub covered: f32,
    /// Light of the boat by [`Component`], times that share.
    pub parts: [Vec3; 4],
    /// Albedo times that share, ...
    pub albedo: Vec3,
    /// ...and times the cosine to the sun, without shadows.
    pub facing: Vec3,
}

/// The pixels of [`View::within`], row by row.
pub struct TracedPicture {
    /// Pixels.
    pub pixels: Vec<TracedPixel>,
}

impl TracedPicture {
    /// Traces so many paths a pixel, a quarter of them at each of four places; another seed gives other paths.
    pub fn new(view: &View<'_>, mesh: &BoatMesh, light: &TracedLight, (paths, seed): (u32, u64)) -> Self {
        let tracer = Tracer { mesh, light };
        let rect = view.within;
        let pixels = (0..rect.width * rect.height)
            .into_par_iter()
            .map(|i| traced(view, &tracer, (rect.x + i % rect.width, rect.y + i / rect.width), (paths, seed)))
            .collect();
        Self { pixels }
    }
}

fn traced(
    view: &View<'_>,
    tracer: &Tracer<'_>,
    (x, y): (u32, u32),
    (paths, seed): (u32, u64),
) -> TracedPixel {
    let mut pixel = TracedPixel::default();
    let number = u64::from(y) << 32 | u64::from(x);
    for part in 0..4 {
        let within = DVec2::new(f64::from(part % 2), f64::from(part / 2)) * 0.5 + 0.25;
        let place = DVec2::new(f64::from(x), f64::from(y)) + within;
        let along = (view.camera.world_from_camera * view.lens.unproject(place)).normalize();
        let from = view.camera.position;
        let Some(hit) = tracer.mesh.meet(from, along, f64::INFINITY) else { continue };
        if (from + along * hit.t).z < 0.0 {
            continue;
        }
        pixel.covered += 0.25;
        let albedo = hit.albedo.as_vec3();
        pixel.albedo += 0.25 * albedo;
        pixel.facing += 0.25 * albedo * cosine(hit.normal, along, tracer.light.sun_direction);
        for path in (part..paths).step_by(4) {
            let mut numbers = LightPath::new(seed, number, u64::from(path));
            let Gathered { parts } = tracer.gather(&hit, from, along, &mut numbers);
            pixel.parts.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part / paths as f32);
        }
    }
    pixel
}

/// Cosine to the sun on the side that is seen.
fn cosine(normal: DVec3, along: DVec3, sun: DVec3) -> f32 {
    let normal = if normal.dot(along) > 0.0 { -normal } else { normal };
    normal.dot(sun).max(0.0) as f32
}
