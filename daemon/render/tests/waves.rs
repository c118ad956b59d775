//! What the GPU draws of light thrown back by waves, against `core::reflection::compose` on the processor.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod common;

use bowwave_core::{
    colour::{linear_to_srgb, srgb_to_linear},
    estimate::light::SeaTones,
    frame::{
        reflection::{
            BANDS, Billboard, HullFoot, Lobes, ReflectionTable, ReflectionView, compose, water_light,
        },
        scene::{Pass, PassDecision, Scene},
    },
    water::{ReflectionMethod, ShadowLevel},
};
use common::{
    draw, sea,
    testing::{add_boat, box_model, empty_scene},
};
use glam::{DQuat, DVec2, DVec3, Vec3, Vec4};
use shaders_spirv::interface::LOBE_COLUMNS;

const SIZE: (u32, u32) = (640, 360);
const BOX: [f32; 3] = [8.0, 2.4, 1.6];
const RANGE_M: f64 = 45.0;

/// A box broadside on, in light that has no direction, so that its picture is one colour.
fn scene(method: ReflectionMethod, wind: DVec2, roll: f64) -> Scene {
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    scene.camera.world_from_camera *= DQuat::from_rotation_z(roll);
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

/// A box of one colour between two positions across as the GPU holds it: on a board that overhangs it, in columns of two pixels or more.
fn billboard(left: f64, right: f64, light: Vec4) -> Billboard {
    let overhang = 0.12 * (right - left) + 2.0;
    let (first, board) = (left - overhang, right - left + 2.0 * overhang);
    let columns = (board / 2.0).ceil().clamp(12.0, f64::from(LOBE_COLUMNS));
    let pitch = board / columns;
    // Share of a column that the box covers.
    let share = |column: f64| {
        let from = first + column * pitch;
        ((from + pitch).min(right) - from.max(left)).max(0.0) / pitch
    };
    let columns = (0..columns as usize).map(|c| [light * share(c as f64) as f32; BANDS]).collect();
    Billboard { first, pitch, columns }
}

/// The processor's picture over `before`, and which of its pixels lie under the hull's or over the whole water line.
fn composed(before: &[u8], scene: &Scene) -> (Vec<Vec3>, Vec<bool>) {
    let linear = |p: &[u8]| Vec3::from_array([0, 1, 2].map(|c| srgb_to_linear(f32::from(p[c]) / 255.0)));
    let mut picture: Vec<Vec3> = before.chunks_exact(4).map(linear).collect();
    let project = |p: DVec3| scene.lens.project(scene.camera.to_camera(p)).unwrap();
    let level = scene.boats[0].water_level;
    let foot = scene.boats[0].pose.position.with_z(level);
    let anchor = project(foot);
    let lift = 0.002 * scene.boats[0].range_m;
    let dropped = project(foot - DVec3::Z * lift) - anchor;
    let down = dropped.normalize();
    // The near side of the box: pixels right of the anchor and below it.
    let side = |x: f64| {
        let at = project(DVec3::new(x, foot.y - f64::from(BOX[1]) / 2.0, level)) - anchor;
        DVec2::new(at.dot(-down.perp()), at.dot(down))
    };
    let (left, right) = (side(-4.0), side(4.0));
    let eye_m = scene.camera.position.z - level;
    let focal_px = dropped.length() / lift * RANGE_M;
    let place = HullFoot {
        anchor,
        down,
        first: left.x,
        pitch: (right.x - left.x) / 31.0,
        line: (0..32).map(|i| left.y + (right.y - left.y) * f64::from(i) / 31.0).collect(),
        eye_m,
        tangent: eye_m / RANGE_M,
        focal_px,
        foot_px: 3.0,
    };
    let light = (scene.light.sky * Vec3::new(0.1, 0.05, 0.02)).extend(1.0);
    let billboard = billboard(left.x, right.x, light);
    let wind_to_view = scene.wind.x.atan2(scene.wind.y);
    let seen = ReflectionView {
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
    let lobes = Lobes::of(&ReflectionTable::baked().sea(scene.wind.length()), &seen);
    compose(&mut picture, SIZE.0 as usize, &place, &billboard, &lobes, &scene.tones);
    let hidden = (0..picture.len()).map(|n| {
        let at = DVec2::new((n % SIZE.0 as usize) as f64, (n / SIZE.0 as usize) as f64) + 0.5 - anchor;
        let (across, below) = (at.dot(-down.perp()), at.dot(down));
        let t = ((across - left.x) / (right.x - left.x)).clamp(0.0, 1.0);
        below < left.y + (right.y - left.y) * t + 0.5
    });
    (picture, hidden.collect())
}

#[test]
fn the_gpu_draws_what_the_processor_draws() {
    let models = [boat()];
    let mut failures = Vec::new();
    let cases = [
        (DVec2::new(0.0, 0.1), 0.0),
        (DVec2::new(0.6, 0.6), 0.0),
        (DVec2::new(-2.0, 3.0), 0.0),
        (DVec2::new(6.7, 0.0), 0.0),
        // With a tilted head strips are no longer rows and columns of pixels, and must still meet.
        (DVec2::new(0.6, 0.6), 0.3),
        (DVec2::new(6.7, 0.0), -0.7),
    ];
    for (wind, roll) in cases {
        let video = sea(SIZE.0, SIZE.1);
        let off = scene(ReflectionMethod::Off, wind, roll);
        let without = draw(&off, &video, &models);
        let with = draw(&scene(ReflectionMethod::Baked, wind, roll), &video, &models);
        let (wanted, hidden) = composed(&without, &off);
        let (mut count, mut error, mut bias, mut change, mut worst, mut missed) = (0, 0.0, 0.0, 0.0, 0, 0);
        for n in (0..wanted.len()).filter(|n| !hidden[*n]) {
            let code = |v: f32| i32::from((linear_to_srgb(v.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8);
            for c in 0..3 {
                let (got, was) = (i32::from(with[4 * n + c]), i32::from(without[4 * n + c]));
                let want = code(wanted[n][c]);
                if want != was || got != was {
                    count += 1;
                    missed += i32::from(got == was && (want - was).abs() > 8);
                    error += f64::from((got - want).abs());
                    bias += f64::from(got - want);
                    change += f64::from((want - was).abs());
                    worst = worst.max((got - want).abs());
                }
            }
        }
        let (error, change) = (error / f64::from(count), change / f64::from(count));
        let bias = bias / f64::from(count);
        println!(
            "wind {wind}, roll {roll}: {count} values change by {change:.2} codes; error {error:.2}, bias {bias:.2}, worst {worst}, \
             missed {missed}"
        );
        assert!(count > 5000 && change > 2.0, "wind {wind}: {count} values change by {change:.2}");
        // Of some 30 codes of change; the worst stand at the hull's ends, where a column of the layers is several pixels wide. Where
        // strips end on the side of others a pixel whose middle lies on the seam can be missed: three values.
        let wrong = error > 1.5 || worst > 28 || missed > 6;
        failures.extend(wrong.then(|| format!("wind {wind}, roll {roll}: {error:.2}, {worst}, {missed}")));
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
        let mut scene = scene(ReflectionMethod::Baked, DVec2::new(0.0, wind), 0.0);
        scene.boats.clear();
        scene.camera.position.z = eye;
        add_boat(&mut scene, &models, 0, range, bearing, 0.7);
        if !scene.boats.is_empty() {
            draw(&scene, &sea(SIZE.0, SIZE.1), &models);
        }
    }
}
