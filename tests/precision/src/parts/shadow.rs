//! The sun's shadows of a boat on itself.

use std::cell::RefCell;

use anyhow::{Context as _, Result};
use bowwave_core::{
    colour::{linear_to_srgb, srgb_to_linear},
    estimate::light::{Light, SeaTones},
    event::Picture,
    frame::scene::{LeftOut, Pass, PassDecision, PixelRect, Scene},
    geometry::{CameraPose, Lens},
    model::Model,
    sea::BeaufortForce,
    sky::SkyLobes,
    water::ReflectionMethod,
};
use bowwave_models::resolve;
use bowwave_render::SOFTWARE;
use glam::{DVec2, DVec3, Vec3};
use hw_sim::ocean::mesh::BoatMesh;
use image::{Rgb, RgbImage};

use super::About;
use crate::{
    bench::{ExtremeResult, PartBench, Way},
    metric::flip_map,
    reflection::{
        cost::process_ms,
        draw::{Painter, picture},
        scenes::{self, Afloats},
    },
    truth::boat,
};

/// Description of this part.
pub const ABOUT: About = About {
    part: "shadow",
    what: "Shades a boat where it stands in its own sunlight.",
    truth: "the same boat drawn without shadows, the sun's part of each pixel by the share of the sun's disc, .53 degrees wide, that rays from \
            four places of the pixel find free; the tracer shares no code with the renderer. Mean FLIP over the boat's pixels, over skiff, RHIB, dhow \
            and, five times as far, frigate at 60, 150 and 400 m, suns 3 to 60 degrees up, and headings all round",
    rivals: "no shadow at all",
    why: "a map of each boat's own has its texels where the boat is seen, at any angle between sun and view",
};

const SIZE: (u32, u32) = (1280, 720);
/// Width of the view, degrees.
const HFOV_DEG: f64 = 40.0;
/// Height of the eye, metres.
const EYE_M: f64 = 8.0;
/// Radius of the sun's disc, radians.
const SUN_RADIUS: f64 = 0.5 * 0.53 * std::f64::consts::PI / 180.0;
/// Name of what the product does.
const MAP: &str = "a map a boat";

/// A boat in the sun.
#[derive(Clone, Copy, Debug)]
struct Sunlit {
    range_m: f64,
    heading_deg: f64,
    /// Unit vector towards the sun; y ahead.
    sun: DVec3,
}

fn sun(elevation_deg: f64, azimuth_deg: f64) -> DVec3 {
    let (up, level) = elevation_deg.to_radians().sin_cos();
    let (right, ahead) = azimuth_deg.to_radians().sin_cos();
    DVec3::new(level * right, level * ahead, up)
}

/// Everything that draws a boat, and the rays that judge it.
struct Studio {
    model: Model,
    painter: RefCell<Painter>,
    black: Picture,
}

impl Studio {
    fn new(boat: &str) -> Result<Self> {
        let mut model = resolve(boat, std::path::Path::new(""))?;
        // Rays do not look at textures.
        model.texture = None;
        let painter = Painter::new(SIZE, std::slice::from_ref(&model), &[], (1, Some(SOFTWARE)))?;
        Ok(Self { model, painter: RefCell::new(painter), black: picture(&RgbImage::new(SIZE.0, SIZE.1))? })
    }

    fn scene(&self, case: &Sunlit) -> Result<Scene> {
        let lens = Lens::pinhole(SIZE.0, SIZE.1, HFOV_DEG.to_radians());
        let camera = scenes::camera(EYE_M, case.range_m);
        let calm = BeaufortForce::new(1).context("no such force")?;
        let afloat = Self::afloat(case);
        let mut scene = scenes::scene(
            (camera, lens),
            SeaTones::default(),
            &self.model,
            &[afloat],
            (ReflectionMethod::Off, calm),
        );
        let sky = Vec3::new(0.16, 0.2, 0.26);
        scene.light = Light {
            sun_direction: case.sun,
            sun: Vec3::new(0.85, 0.8, 0.72),
            sky,
            dome: SkyLobes::even(sky),
            horizon: sky,
            sea: 0.2 * sky,
        };
        for pass in [Pass::Mirror, Pass::Water, Pass::Hud] {
            scene.passes[pass as usize] = PassDecision::LeftOut(LeftOut::ReflectionOff);
        }
        scene.passes[Pass::Shadow as usize] = PassDecision::Run;
        Ok(scene)
    }

    fn afloat(case: &Sunlit) -> Afloats {
        Afloats { heading_deg: case.heading_deg, roll_deg: 4.0, pitch_deg: 2.0, ..Afloats::at(case.range_m) }
    }

    fn paint(&self, scene: &Scene) -> Result<RgbImage> {
        self.painter.borrow_mut().paint(scene, &self.black)
    }

    /// Errors of the product and of no shadow, FLIP over the boat's pixels, and how many pixels these are.
    fn errors(&self, case: &Sunlit) -> Result<([f64; 2], u32)> {
        let scene = self.scene(case)?;
        let shaded = self.paint(&scene)?;
        let bare = without_shadow(&scene);
        let around = Scene { light: Light { sun: Vec3::ZERO, ..bare.light }, ..bare.clone() };
        let (bare, around) = (self.paint(&bare)?, self.paint(&around)?);
        let mesh = boat::mesh(&self.model, Self::afloat(case).pose());
        let hull =
            scene.boats.first().and_then(|boat| boat.hull).context("the boat is out of the picture")?;
        let mut truth = bare.clone();
        let mut mask = vec![false; (SIZE.0 * SIZE.1) as usize];
        for ((x, y, pixel), on_boat) in truth.enumerate_pixels_mut().zip(&mut mask) {
            // Rays beside the boat would meet nothing.
            if !is_within(hull, (x, y)) {
                continue;
            }
            let Some(seen) = sun_seen(&mesh, &scene.camera, &scene.lens, (x, y), case.sun) else { continue };
            *on_boat = true;
            let (lit, dark) = (*pixel, around.get_pixel(x, y));
            *pixel = Rgb([0, 1, 2].map(|c| {
                let linear = |code: u8| srgb_to_linear(f32::from(code) / 255.0);
                let (lit, dark) = (linear(lit[c]), linear(dark[c]));
                (linear_to_srgb(dark + (lit - dark) * seen as f32) * 255.0).round() as u8
            }));
        }
        let count = mask.iter().filter(|on| **on).count();
        let error = |drawn: &RgbImage| -> Result<f64> {
            let map = flip_map(truth.as_raw(), drawn.as_raw(), SIZE)?;
            Ok(map.iter().zip(&mask).filter(|(_, on)| **on).map(|(e, _)| f64::from(*e)).sum())
        };
        Ok(([error(&shaded)?, error(&bare)?].map(|sum| sum / count.max(1) as f64), count as u32))
    }
}

fn is_within(rect: PixelRect, (x, y): (u32, u32)) -> bool {
    x.wrapping_sub(rect.x) < rect.width && y.wrapping_sub(rect.y) < rect.height
}

fn without_shadow(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene.passes[Pass::Shadow as usize] = PassDecision::LeftOut(LeftOut::NoSun);
    scene
}

/// Share of the sun's disc that a pixel's boat sees; nothing where the pixel has no boat above the water.
fn sun_seen(
    mesh: &BoatMesh,
    camera: &CameraPose,
    lens: &Lens,
    (x, y): (u32, u32),
    sun: DVec3,
) -> Option<f64> {
    const RAYS: u32 = 8;
    let across = sun.any_orthonormal_vector();
    let upwards = sun.cross(across);
    let (mut seen, mut hits) = (0.0, 0.0);
    for part in 0..4 {
        let within = DVec2::new(f64::from(part % 2), f64::from(part / 2)) * 0.5 + 0.25;
        let pixel = DVec2::new(f64::from(x), f64::from(y)) + within;
        let along = (camera.world_from_camera * lens.unproject(pixel)).normalize();
        let Some(hit) = mesh.meet(camera.position, along, f64::INFINITY) else { continue };
        // A little before the surface.
        let place = camera.position + along * (hit.t - 0.003);
        if place.z < 0.0 {
            continue;
        }
        hits += 1.0;
        let free = (0..RAYS).filter(|ray| {
            let out = SUN_RADIUS * ((f64::from(*ray) + 0.5) / f64::from(RAYS)).sqrt();
            let (sin, cos) = (f64::from(RAYS * part + ray) * 2.399_963).sin_cos();
            !mesh.blocks(place, (sun + (across * cos + upwards * sin) * out).normalize())
        });
        seen += free.count() as f64 / f64::from(RAYS);
    }
    (hits > 0.0).then(|| seen / hits)
}

/// Mean of the errors of cases, those of a boat with few pixels counting as much as others.
fn mean(studio: &Studio, cases: &[Sunlit]) -> Result<[f64; 2]> {
    let (mut sums, mut count) = ([0.0; 2], 0.0);
    for case in cases {
        let (errors, pixels) = studio.errors(case)?;
        if pixels > 0 {
            sums = [0, 1].map(|i| sums[i] + errors[i]);
            count += 1.0;
        }
    }
    Ok(sums.map(|sum| sum / f64::max(count, 1.0)))
}

const BOATS: [(&str, f64); 4] = [("skiff", 1.0), ("rhib", 1.0), ("dhow", 1.0), ("frigate", 5.0)];

/// Measures the scenes.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let headings = if bench.is_quick() { 2 } else { 20 };
    let studios = BOATS.map(|(boat, _)| Studio::new(boat));
    let mut ready = Vec::new();
    for (studio, (_, scale)) in studios.into_iter().zip(BOATS) {
        ready.push((studio?, scale));
    }
    for range_m in [60.0, 150.0, 400.0] {
        let mut all = [0.0; 2];
        for (studio, scale) in &ready {
            let cases: Vec<Sunlit> = (0..headings)
                .map(|n| {
                    let share = (f64::from(n) + 0.5) / f64::from(headings);
                    // Suns low and high, all round, in an order of their own.
                    let elevation = 3.0 + 57.0 * (share * 7.0).fract();
                    let azimuth = 360.0 * (share * 3.0 + 0.21).fract();
                    Sunlit {
                        range_m: range_m * scale,
                        heading_deg: 360.0 * share,
                        sun: sun(elevation, azimuth),
                    }
                })
                .collect();
            let errors = mean(studio, &cases)?;
            all = [0, 1].map(|i| all[i] + errors[i] / BOATS.len() as f64);
        }
        let Some((studio, _)) = ready.first() else { return Ok(()) };
        let scene = studio.scene(&Sunlit { range_m, heading_deg: 70.0, sun: sun(30.0, 120.0) })?;
        let bare = without_shadow(&scene);
        let timed = |scene: Scene| {
            move || {
                let before = process_ms();
                // A frame that fails has drawn nothing: it is counted as endless.
                if studio.paint(&scene).is_ok() { (process_ms() - before) * 1e6 } else { f64::INFINITY }
            }
        };
        bench.scene(
            &format!("a boat at {range_m:.0} m"),
            "FLIP",
            0.002,
            vec![
                Way::telling(MAP, "2 x 2 texels", all[0], 1, timed(scene)).default_if(true),
                Way::telling("no shadow", "", all[1], 1, timed(bare)),
            ],
        );
    }
    for (name, sun) in [
        ("the sun behind the eye, light along the view", sun(3.0, 180.0)),
        ("the sun ahead, light against the view", sun(3.0, 0.0)),
        ("the sun on the horizon, abeam", sun(0.05, 90.0)),
        ("the sun overhead", DVec3::Z),
    ] {
        let mut worst = [0.0_f64; 2];
        for (studio, scale) in &ready {
            let case = |heading_deg| Sunlit { range_m: 60.0 * scale, heading_deg, sun };
            let errors = mean(studio, &[case(20.0), case(100.0)])?;
            worst = [0, 1].map(|i| worst[i].max(errors[i]));
        }
        bench.extreme(
            name,
            "FLIP",
            vec![
                ExtremeResult::product(MAP, "2 x 2 texels", worst[0]),
                ExtremeResult::rival("no shadow", "", worst[1]),
            ],
        );
    }
    Ok(())
}
