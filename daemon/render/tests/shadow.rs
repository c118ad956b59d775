//! The sun's shadows on boats, where they can be worked out: a convex boat has none on itself, and one boat's edge is where its light ends on
//! another. Against rays on real models they are measured in tests/precision.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod common;

use bowwave_core::{
    frame::scene::{LeftOut, Pass, PassDecision, Scene},
    geometry::{RigidPose, look},
    sky::SkyLobes,
};
use common::{
    assert_clean, at, config, draw, grey, open, submit,
    testing::{add_boat_in, add_moving_boat, box_model, empty_scene},
};
use glam::{DQuat, DVec3, Vec3};

const SIZE: (u32, u32) = (320, 180);

/// A scene over black water that the sun alone lights.
fn sunlit_scene(sun: DVec3) -> Scene {
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    scene.camera.world_from_camera = look(0.0, -0.1, 0.0);
    scene.light.sun_direction = sun.normalize();
    scene.light.sun = Vec3::ONE;
    (scene.light.sky, scene.light.sea, scene.light.horizon) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
    scene.light.dome = SkyLobes::even(Vec3::ZERO);
    scene
}

fn boats_only(scene: &mut Scene) {
    for pass in [Pass::Mirror, Pass::Water, Pass::Hud] {
        scene.passes[pass as usize] = PassDecision::LeftOut(LeftOut::ReflectionOff);
    }
}

#[test]
fn a_convex_boat_never_shades_itself() {
    let models = [box_model("box", [9.0, 2.6, 1.8], [0.9; 3])];
    let picture = grey(SIZE.0, SIZE.1, 0);
    // All round, from the horizon to overhead; along the view and against it.
    let suns = (0..12).map(|n| {
        let (sin, cos) = (f64::from(n) * 1.9).sin_cos();
        DVec3::new(sin, cos, [0.0, 0.02, 0.3, 1.2, 40.0][n as usize % 5])
    });
    for sun in suns.chain([DVec3::Z, DVec3::NEG_Y, DVec3::Y]) {
        let mut scene = sunlit_scene(sun);
        let turn = DQuat::from_rotation_z(0.7) * DQuat::from_rotation_x(0.1);
        let pose = RigidPose { world_from_body: turn, position: DVec3::new(0.0, 40.0, 0.0) };
        add_boat_in(&mut scene, &models, 0, pose);
        boats_only(&mut scene);
        let shaded = draw(&scene, &picture, &models);
        scene.passes[Pass::Shadow as usize] = PassDecision::LeftOut(LeftOut::NoSun);
        let bare = draw(&scene, &picture, &models);
        // A pixel of an edge is looked up at its middle, which may lie beyond the surface.
        let pixels = shaded.chunks_exact(4).zip(bare.chunks_exact(4));
        let off = pixels.filter(|(a, b)| (0..3).any(|i| a[i].abs_diff(b[i]) > 3)).count();
        let lit = bare.chunks_exact(4).filter(|p| p[1] > 10).count();
        assert!(off * 50 <= lit, "{sun}: {off} pixels of {lit} differ");
    }
}

#[test]
fn a_boats_light_ends_where_another_stands_before_the_sun() {
    let models =
        [box_model("wall", [30.0, 2.0, 6.0], [0.9; 3]), box_model("sign", [30.0, 2.0, 8.0], [0.9; 3])];
    // The sun stands behind the eye. The eye, 14 m up, looks over a wall of 6 m at 30 m at a sign at 40 m.
    for tangent in [0.1_f64, 0.2] {
        let mut scene = sunlit_scene(DVec3::new(0.0, -1.0, tangent));
        let upright =
            |x: f64, y: f64| RigidPose { world_from_body: DQuat::IDENTITY, position: DVec3::new(x, y, 0.0) };
        scene.camera.position.z = 14.0;
        scene.camera.world_from_camera = look(0.0, -0.25, 0.0);
        add_boat_in(&mut scene, &models, 0, upright(0.0, 30.0));
        add_boat_in(&mut scene, &models, 1, upright(0.0, 40.0));
        boats_only(&mut scene);
        let pixels = draw(&scene, &grey(SIZE.0, SIZE.1, 0), &models);
        // The wall's far edge, 31 m away, to the sign's near face, 39 m away.
        let edge = 6.0 - 8.0 * tangent;
        let code = |z: f64| {
            let place = scene.camera.to_camera(DVec3::new(0.3, 39.0, z));
            let pixel = scene.lens.project(place).unwrap();
            at(&pixels, SIZE.0, pixel.x as u32, pixel.y as u32)[1]
        };
        let texel_m = 39.0 / scene.lens.focal.x;
        assert!(code(edge + 2.5 * texel_m) > 100, "lit above {edge} m: {}", code(edge + 2.5 * texel_m));
        assert!(code(edge - 2.5 * texel_m) < 10, "dark below {edge} m: {}", code(edge - 2.5 * texel_m));
    }
}

#[test]
fn a_boat_throws_its_shadow_onto_the_foam_behind_it() {
    let models = [box_model("box", [8.0, 2.4, 1.5], [0.3; 3])];
    // Under way to the right at 45 m, seen from 12 m up; the sun as high ahead of it as astern, and lower, and higher.
    let picture = grey(SIZE.0 * 2, SIZE.1 * 2, 90);
    for tangent in [0.15_f64, 0.3, 0.6] {
        let drawn = |ahead: f64| {
            let mut scene = empty_scene(SIZE.0 * 2, SIZE.1 * 2);
            (scene.camera.position.z, scene.camera.world_from_camera) = (12.0, look(-0.15, -0.26, 0.0));
            scene.light.sun_direction = DVec3::new(ahead, 0.0, tangent).normalize();
            (scene.light.sun, scene.light.sky) = (Vec3::splat(0.5), Vec3::splat(0.25));
            add_moving_boat(&mut scene, &models, 0, [45.0, 0.0, 0.0], [7.0, 0.0]);
            for pass in [Pass::Mirror, Pass::Water, Pass::Hud] {
                scene.passes[pass as usize] = PassDecision::LeftOut(LeftOut::ReflectionOff);
            }
            (draw(&scene, &picture, &models), scene)
        };
        let ((shaded, scene), (lit, _)) = (drawn(1.0), drawn(-1.0));
        // Each pixel's code in the middle of the mixed water, so many metres behind the stern.
        let codes = |behind: f64| {
            let place = DVec3::new(-4.0 - behind, 45.0, 0.0);
            let pixel = scene.lens.project(scene.camera.to_camera(place)).unwrap();
            [&shaded, &lit].map(|p| at(p, SIZE.0 * 2, pixel.x as u32, pixel.y as u32)[1])
        };
        let reach = 1.5 / tangent;
        let steps = |from: f64, to: f64| (0..9).map(move |i| from + (to - from) * f64::from(i) / 8.0);
        let (mut within, mut beyond) = ((0, 0), 0);
        for [dark, bright] in steps(0.15 * reach, 0.8 * reach).map(codes) {
            within = (within.0 + u32::from(dark), within.1 + u32::from(bright));
        }
        for [dark, bright] in steps(1.25 * reach, 1.25 * reach + 3.0).map(codes) {
            beyond = beyond.max(dark.abs_diff(bright));
        }
        assert!(beyond <= 1, "no shadow beyond {reach:.1} m, {beyond} codes");
        assert!(within.0 * 20 < within.1 * 19, "a shadow up to {reach:.1} m: {within:?}");
    }
}

#[test]
fn a_boats_light_is_the_same_whatever_was_drawn_before() {
    let skiff = bowwave_models::resolve("skiff", std::path::Path::new(".")).unwrap();
    let models = [skiff, box_model("box", [14.0, 12.0, 9.0], [0.5; 3])];
    let picture = grey(SIZE.0, SIZE.1, 90);
    // Far boats are a few pixels long: some of their triangles are thinner than a step of the rasteriser's grid.
    let far = |n: u32| {
        let n = f64::from(n);
        let mut scene = sunlit_scene(DVec3::new((1.3 * n).sin(), (1.3 * n).cos(), 0.1 + (0.07 * n) % 1.0));
        let turn = DQuat::from_rotation_z(0.37 * n) * DQuat::from_rotation_x(0.1 * (0.9 * n).sin());
        let position = DVec3::new((1.7 * n) % 9.0 - 4.0, 60.0 + (7.3 * n) % 400.0, 0.0);
        add_boat_in(&mut scene, &models, 0, RigidPose { world_from_body: turn, position });
        boats_only(&mut scene);
        scene
    };
    // Their places in the map lie about the far one's, full of what is nearer to the sun.
    let near = || {
        let mut scene = sunlit_scene(DVec3::new(0.7, -0.5, 0.6));
        for x in [-20.0, 0.0, 20.0] {
            let position = DVec3::new(x, 60.0, 0.0);
            add_boat_in(&mut scene, &models, 1, RigidPose { world_from_body: DQuat::IDENTITY, position });
        }
        boats_only(&mut scene);
        scene
    };
    let (mut used, mut used_done) = open(&config(&near()), &models);
    let (mut fresh, mut fresh_done) = open(&config(&near()), &models);
    let mut differ: Vec<u32> = Vec::new();
    // Of six thousand frames, those about the ones in which it matters.
    for n in (860..900).chain(2860..2980).chain(3880..3910) {
        submit(&mut used, &mut used_done, &near(), &picture);
        let after = submit(&mut used, &mut used_done, &far(n), &picture);
        let pixels = submit(&mut fresh, &mut fresh_done, &far(n), &picture);
        if pixels != after {
            differ.push(n);
        }
    }
    assert!(differ.is_empty(), "frames that differ: {differ:?}");
    assert_clean(&used);
}
