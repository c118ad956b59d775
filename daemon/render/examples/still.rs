//! Draws boats into a photograph, to be looked at:
//! `still PHOTO OUT.png [METHOD [FORCE [WIDTHxHEIGHT [MODEL:RANGE:BEARING:YAW[:SPEED[:TURN]]...]]]]`, METHOD being one of printed,
//! full, mirror, waves, physics, physics_printed, off; angles in degrees, metres a second, and degrees a second. `BOWWAVE_VALIDATE` in the environment switches Vulkan's validation layer on.

use std::{error::Error, path::Path, sync::Arc, time::Duration};

use bowwave_core::{
    daylight::Daylight,
    estimate::light::LightMeter,
    event::{Picture, PixelFormat},
    frame::{
        fires::{Burning, PUFFS_A_BOAT},
        scene::{LeftOut, Pass, PassDecision, RoundView},
    },
    geometry::look,
    sea::BeaufortForce,
    time::Time,
    water::{ReflectionMethod, ShadowLevel, Water},
};
use bowwave_render::{DrawRequest, Needs, RenderConfig, Renderer, TimeOuts};
use glam::{DVec2, DVec3, Vec3};

#[allow(dead_code, clippy::unwrap_used, reason = "each user takes a part; scenes of constants are sound")]
#[path = "../src/testing.rs"]
mod testing;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let (photo, out) = (args.next().ok_or("which photograph?")?, args.next().ok_or("which output?")?);
    let method = match args.next().as_deref() {
        Some("printed") => ReflectionMethod::FullAsPublished,
        Some("mirror") => ReflectionMethod::Mirror,
        Some("off") => ReflectionMethod::Off,
        Some("waves") => ReflectionMethod::Baked,
        Some("physics") => ReflectionMethod::Physics,
        Some("physics_printed") => ReflectionMethod::PhysicsAsPublished,
        _ => ReflectionMethod::Full,
    };
    let force = BeaufortForce::new(args.next().map_or(Ok(1), |f| f.parse())?).ok_or("no such wind force")?;
    let image = image::open(photo)?.to_rgb8();
    let (width, height) = match args.next().as_deref().and_then(|s| s.split_once('x')) {
        Some((w, h)) => (w.parse()?, h.parse()?),
        None => image.dimensions(),
    };
    let picture =
        Picture::new(PixelFormat::Rgb, image.width(), image.height(), Arc::from(image.as_raw().as_slice()))?;
    let mut models = Vec::new();
    let mut scene = testing::empty_scene(width, height);
    scene.camera.world_from_camera = look(0.0, 0.0, 0.0);
    scene.camera.position = DVec3::new(0.0, 0.0, 5.0);
    scene.water = Water { method, force, shadow: ShadowLevel::Gradual };
    // As the trainer does: light from the picture, to which the lens of the scene belongs.
    let daylight = Daylight::fixed(scene.light.sun_direction, 20_000.0);
    let mut meter = LightMeter::new(&daylight, method == ReflectionMethod::Baked);
    let lens = scene.lens.covering(image.width(), image.height());
    meter.observe(Time::from_ns(0), &picture, &lens, &scene.camera);
    (scene.light, scene.sky, scene.tones) = (meter.light(), meter.sky(force.wind_mean_m_s()), meter.tones());
    if std::env::var_os("BOWWAVE_NO_HUD").is_some() {
        scene.passes[Pass::Hud as usize] = PassDecision::LeftOut(LeftOut::NoTrainee);
    }
    let mut boats: Vec<String> = args.collect();
    if boats.is_empty() {
        boats = ["dhow:60:-8:170", "skiff:30:6:150", "rhib:110:9:20"].map(str::to_owned).to_vec();
    }
    for boat in &boats {
        let mut parts = boat.split(':');
        let name = parts.next().unwrap_or_default();
        let numbers: Vec<f64> = parts.map(str::parse).collect::<Result<_, _>>()?;
        let (speed, turn) = (numbers.get(3).copied().unwrap_or(0.0), numbers.get(4).copied().unwrap_or(0.0));
        let [range, bearing, yaw, ..] = numbers[..] else {
            return Err("a boat is MODEL:RANGE:BEARING:YAW[:SPEED[:TURN]]".into());
        };
        models.push(bowwave_models::resolve(name, Path::new("."))?);
        let (bearing, yaw) = (bearing.to_radians(), yaw.to_radians());
        let motion = [speed, turn.to_radians()];
        testing::add_moving_boat(&mut scene, &models, models.len() - 1, [range, bearing, yaw], motion);
    }
    if std::env::var_os("BOWWAVE_ROUNDS").is_some() {
        scene.rounds = rounds(&scene);
        scene.passes[Pass::Rounds as usize] = PassDecision::Run;
    }
    let config = RenderConfig {
        width,
        height,
        device: None,
        validation: std::env::var_os("BOWWAVE_VALIDATE").is_some(),
        frames_in_flight: 2,
        needs: Needs {
            noise: false,
            boats_max: 8,
            lights_max: 0,
            lamps: scene.runs(bowwave_core::frame::scene::Pass::Lamplight),
            rounds_max: 8 + PUFFS_A_BOAT,
            wakes_max: 8,
            waters: vec![(method, scene.water.shadow)],
            optics: scene.lens.optics(),
            phantoms: Default::default(),
        },
        picture: None,
        time_outs: TimeOuts::default(),
    };
    let (mut renderer, mut completions) = Renderer::new(&config, &models)?;
    renderer.submit(DrawRequest::new(&scene, &picture, true))?;
    let frame = completions.wait_next(Duration::from_secs(10))?.ok_or("no frame")?;
    image::save_buffer(out, frame.rgba(), width, height, image::ExtendedColorType::Rgba8)?;
    for message in renderer.validation_messages() {
        eprintln!("{message}");
    }
    Ok(())
}

/// A fire on the first boat, a tracer towards it, a splash before it and a strike on it.
fn rounds(scene: &bowwave_core::frame::scene::Scene) -> Vec<RoundView> {
    let Some(boat) = scene.boats.first() else { return Vec::new() };
    let (at, eye) = (boat.pose.position, scene.camera.position);
    let on = |share: f64| eye - DVec3::Z * 0.3 + (at + DVec3::Z - eye) * share;
    let burning = Burning {
        boat: 0,
        since_s: 0.0,
        wind: DVec2::new(4.0, 1.0),
        eye,
        visibility_m: 20_000.0,
        white_cd_m2: 20_000.0,
    };
    let mut views = Vec::new();
    burning.puffs(60.0, |_| Some(at + DVec3::new(2.0, 0.0, 1.2)), &mut views);
    views.sort_by(|a, b| b.place().distance(eye).total_cmp(&a.place().distance(eye)));
    views.extend([
        RoundView::Splash { at: at + DVec3::new(4.0, 6.0, 0.0), height_m: 5.0, radius_m: 0.9, opacity: 0.9 },
        RoundView::Splash { at: at - DVec3::new(3.0, 8.0, 0.0), height_m: 3.0, radius_m: 0.7, opacity: 0.8 },
        RoundView::Strike { at: at + DVec3::Z * 1.5, radius_m: 0.8, opacity: 0.9 },
        RoundView::Tracer { from: on(0.5), to: on(0.8), radiance: Vec3::new(4.0, 1.2, 0.5) },
    ]);
    views
}
