//! What the GPU draws of light thrown back by waves, against `core::reflection::compose` on the processor.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod common;

use bowwave_core::{
    light::{linear_to_srgb, srgb_to_linear},
    reflection::{BANDS, Billboard, Lobes, Place, SeaTones, Seen, Table, compose, water_light},
    scene::{Pass, PassDecision, ReflectionMethod, Scene, ShadowLevel},
};
use common::{
    draw, sea,
    testing::{add_boat, box_model, empty_scene},
};
use glam::{DVec2, DVec3, Vec3, Vec4};

const SIZE: (u32, u32) = (640, 360);
const BOX: [f32; 3] = [8.0, 2.4, 1.6];
const RANGE_M: f64 = 45.0;

/// A box broadside on, in light that has no direction, so that its picture is one colour.
fn scene(method: ReflectionMethod, wind: DVec2) -> Scene {
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    scene.water.method = method;
    scene.water.shadow = ShadowLevel::None;
    scene.wind = wind;
    scene.light.sun = Vec3::ZERO;
    scene.light.sea = scene.light.sky;
    scene.tones = SeaTones { mean: [0.36, 0.0, 0.0], spread: [0.06, 0.0, 0.0], roots: [0.05, 0.9] };
    add_boat(&mut scene, &[boat()], 0, RANGE_M, 0.0, 0.0);
    scene.passes[Pass::Boats as usize] = PassDecision::Run;
    scene
}

fn boat() -> bowwave_core::model::Model {
    box_model("box", BOX, [0.1, 0.05, 0.02])
}

/// The processor's picture over `before`.
fn composed(before: &[u8], scene: &Scene) -> Vec<Vec3> {
    let linear = |p: &[u8]| Vec3::from_array([0, 1, 2].map(|c| srgb_to_linear(f32::from(p[c]) / 255.0)));
    let mut picture: Vec<Vec3> = before.chunks_exact(4).map(linear).collect();
    let project = |p: DVec3| scene.lens.project(scene.camera.to_camera(p)).unwrap();
    let level = scene.boats[0].water_level;
    let foot = scene.boats[0].pose.position.with_z(level);
    let anchor = project(foot);
    // The near side of the box.
    let side = |x: f64| project(DVec3::new(x, foot.y - f64::from(BOX[1]) / 2.0, level)) - anchor;
    let (left, right) = (side(-4.0), side(4.0));
    let eye_m = scene.camera.position.z - level;
    let lift = 0.002 * scene.boats[0].range_m;
    let focal_px = (project(foot - DVec3::Z * lift) - anchor).length() / lift * RANGE_M;
    let place = Place {
        anchor,
        down: DVec2::Y,
        first: left.x,
        pitch: (right.x - left.x) / 31.0,
        line: vec![left.y; 32],
        eye_m,
        tangent: eye_m / RANGE_M,
        focal_px,
        foot_px: 3.0,
    };
    let light = (scene.light.sky * Vec3::new(0.1, 0.05, 0.02)).extend(1.0);
    let columns: Vec<[Vec4; BANDS]> = vec![[light; BANDS]; 64];
    let billboard = Billboard { first: left.x, pitch: (right.x - left.x) / 64.0, columns };
    let wind_to_view = scene.wind.x.atan2(scene.wind.y);
    let seen = Seen {
        wind_to_view,
        sky: scene.sky,
        water: water_light(&scene.light),
        level_m: level - scene.boats[0].hidden_m,
        eye_m,
        range_m: RANGE_M,
        height_m: f64::from(BOX[2]) - level,
        width_m: 8.0,
        tilt: 0.0,
        pixel: 1.0 / focal_px,
    };
    let lobes = Lobes::of(&Table::baked().sea(scene.wind.length()), &seen);
    compose(&mut picture, SIZE.0 as usize, &place, &billboard, &lobes, &scene.tones);
    picture
}

#[test]
fn the_gpu_draws_what_the_processor_draws() {
    let models = [boat()];
    let mut failures = Vec::new();
    for wind in [DVec2::new(0.0, 0.1), DVec2::new(0.6, 0.6), DVec2::new(-2.0, 3.0), DVec2::new(6.7, 0.0)] {
        let video = sea(SIZE.0, SIZE.1);
        let off = scene(ReflectionMethod::Off, wind);
        let without = draw(&off, &video, &models);
        let with = draw(&scene(ReflectionMethod::Waves, wind), &video, &models);
        let wanted = composed(&without, &off);
        let hull = off.boats[0].hull.unwrap();
        let (mut count, mut error, mut bias, mut change, mut worst) = (0, 0.0, 0.0, 0.0, 0);
        for y in hull.y + hull.height..SIZE.1 {
            for x in 0..SIZE.0 {
                let n = (y * SIZE.0 + x) as usize;
                let code = |v: f32| i32::from((linear_to_srgb(v.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8);
                for c in 0..3 {
                    let (got, was) = (i32::from(with[4 * n + c]), i32::from(without[4 * n + c]));
                    let want = code(wanted[n][c]);
                    if want != was || got != was {
                        count += 1;
                        error += f64::from((got - want).abs());
                        bias += f64::from(got - want);
                        change += f64::from((want - was).abs());
                        worst = worst.max((got - want).abs());
                    }
                }
            }
        }
        let (error, change) = (error / f64::from(count), change / f64::from(count));
        let bias = bias / f64::from(count);
        println!(
            "wind {wind}: {count} values change by {change:.2} codes; error {error:.2}, bias {bias:.2}, worst {worst}"
        );
        assert!(count > 5000 && change > 2.0, "wind {wind}: {count} values change by {change:.2}");
        // Of some 30 codes of change; the worst stand at the hull's ends, where a column of the layers is several pixels wide.
        failures.extend((error > 1.8 || worst > 62).then(|| format!("wind {wind}: {error:.2}, {worst}")));
    }
    assert!(failures.is_empty(), "{failures:?}");
}

/// Where the boat is far below the horizon's angle, at the picture's edge or in a sea too rough, nothing breaks.
#[test]
fn singular_places_draw() {
    let models = [boat()];
    for (range, bearing, eye, wind) in
        [(5000.0, 0.0, 4.0, 3.0), (40.0, 0.45, 8.0, 3.0), (14.0, 0.0, 1.0, 0.0), (60.0, 0.0, 15.0, 14.0)]
    {
        let mut scene = scene(ReflectionMethod::Waves, DVec2::new(0.0, wind));
        scene.boats.clear();
        scene.camera.position.z = eye;
        add_boat(&mut scene, &models, 0, range, bearing, 0.7);
        if !scene.boats.is_empty() {
            draw(&scene, &sea(SIZE.0, SIZE.1), &models);
        }
    }
}
