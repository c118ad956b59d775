//! Draws every built-in model from several sides, close up and as seen over the sea, onto one contact sheet:
//! `cargo run -p bowwave-models --example turntable -- OUT.png [MODEL...]`.

use std::{env, error::Error, path::Path, process::ExitCode};

use bowwave_core::model::{Model, ModelKind, Zone};
use bowwave_models::{built_in_names, raster::SideCanvas, resolve};
use glam::{Mat4, Vec2, Vec3};
use image::{RgbaImage, imageops};

const TILE: (u32, u32) = (560, 330);
/// Pixels a radian of the trainer's picture: 1280 wide over 40 degrees.
const PX_PER_RAD: f32 = 1758.0;

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("turntable: {e}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let mut args = env::args().skip(1);
    let out = args.next().ok_or("usage: turntable OUT.png [MODEL...]")?;
    let named: Vec<String> = args.collect();
    let names =
        if named.is_empty() { built_in_names().into_iter().map(str::to_owned).collect() } else { named };
    let mut rows = Vec::new();
    for name in &names {
        let model = resolve(name, Path::new("."))?;
        describe(&model);
        rows.push(row(&model));
    }
    let columns = rows.iter().map(Vec::len).max().unwrap_or(1) as u32;
    let mut sheet = RgbaImage::new(TILE.0 * columns, TILE.1 * rows.len() as u32);
    for (r, tiles) in rows.iter().enumerate() {
        for (c, tile) in tiles.iter().enumerate() {
            imageops::replace(&mut sheet, tile, i64::from(TILE.0) * c as i64, i64::from(TILE.1) * r as i64);
        }
    }
    sheet.save(out)?;
    Ok(())
}

fn describe(m: &Model) {
    let triangles = |zone: Zone| -> u32 {
        m.parts.iter().filter(|p| p.zone == zone).map(|p| p.indices.len() as u32 / 3).sum()
    };
    eprintln!(
        "{:13} {:6.2} x {:5.2} m, {:5.2} above and {:4.2} below water; triangles {} (hull {}, engine {}, helm {}), vertices {}",
        m.name,
        m.length_m(),
        m.beam_m(),
        m.height_m(),
        -m.min.z,
        m.indices.len() / 3,
        triangles(Zone::Hull),
        triangles(Zone::Engine),
        triangles(Zone::Helm),
        m.vertices.len()
    );
}

/// Bow quarter, beam, stern quarter, from above, then as the trainer shows it at two distances (its pixels enlarged).
fn row(m: &Model) -> Vec<RgbaImage> {
    let size = m.length_m() as f32;
    let (near, far) = if size > 50.0 { (900.0, 2500.0) } else { (60.0, 250.0) };
    let close = |azimuth: f32, height: f32| view(m, azimuth, size * 2.0, size * height, 0.62, 1);
    if m.kind == ModelKind::Quad {
        return vec![close(-90.0, 0.1), trainer(m, -90.0, near), trainer(m, -90.0, far)];
    }
    vec![
        close(-35.0, 0.25),
        close(-90.0, 0.12),
        close(-150.0, 0.30),
        close(60.0, 0.75),
        trainer(m, -50.0, near),
        trainer(m, -90.0, far),
    ]
}

/// As in the trainer's picture from 10 m above the sea, enlarged.
fn trainer(m: &Model, azimuth: f32, distance: f32) -> RgbaImage {
    // Whole numbers only, and small enough for the boat to fit.
    let boat_px = (m.length_m() as f32 / distance * PX_PER_RAD).max(1.0);
    let enlarge = ((TILE.0 as f32 * 0.8 / boat_px) as u32).clamp(2, 8);
    let width = TILE.0 / enlarge;
    view(m, azimuth, distance, 10.0, width as f32 / PX_PER_RAD, enlarge)
}

/// A view of the boat from `azimuth` degrees (0 ahead, 90 to port), `fov` radians across.
fn view(m: &Model, azimuth: f32, distance: f32, eye_height: f32, fov: f32, enlarge: u32) -> RgbaImage {
    let (w, h) = (TILE.0 / enlarge, TILE.1 / enlarge);
    let (sin, cos) = azimuth.to_radians().sin_cos();
    let middle = (m.min + m.max) / 2.0;
    let target = Vec3::new(middle.x, 0.0, middle.z.max(0.0) * 0.8);
    let eye = Vec3::new(cos * distance + target.x, sin * distance, eye_height);
    let look = glam::camera::rh::view::look_at_mat4(eye, target, Vec3::Z);
    let aspect = w as f32 / h as f32;
    let fov_y = 2.0 * ((fov / 2.0).tan() / aspect).atan();
    let clip = glam::camera::rh::proj::directx::perspective_infinite(fov_y, aspect, 0.1) * look;
    let mut canvas = SideCanvas::new(w, h, 3);
    let from_clip = clip.inverse();
    canvas.backdrop(|p| sea_and_sky(from_clip, eye, p));
    let sun = Vec3::new(0.35, -0.62, 0.70).normalize();
    canvas.draw(m, clip, |at, normal, albedo| {
        let lit = albedo
            * (Vec3::new(0.34, 0.40, 0.47) * (0.75 + 0.25 * normal.z) + 0.85 * normal.dot(sun).max(0.0));
        // From far off the sea hides what lies below it; close up it is shown.
        (enlarge == 1 || at.z > 0.0).then_some(lit)
    });
    let picture = canvas.finish();
    imageops::resize(&picture, TILE.0, TILE.1, imageops::FilterType::Nearest)
}

fn sea_and_sky(from_clip: Mat4, eye: Vec3, p: Vec2) -> Vec3 {
    let ndc = Vec3::new(p.x * 2.0 - 1.0, 1.0 - p.y * 2.0, 0.5);
    let ray = (from_clip.project_point3(ndc) - eye).normalize_or(Vec3::Z);
    if ray.z > 0.0 {
        Vec3::new(0.45, 0.56, 0.68).lerp(Vec3::new(0.18, 0.32, 0.56), ray.z.min(1.0))
    } else {
        Vec3::new(0.16, 0.24, 0.29).lerp(Vec3::new(0.03, 0.07, 0.10), (-ray.z * 2.0).min(1.0))
    }
}
