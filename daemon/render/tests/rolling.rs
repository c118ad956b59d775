//! Boats fall on the rows of a rolling shutter: what is drawn against the host's own projection.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a step that fails fails the test"
)]

mod common;

use bowwave_core::{
    frame::scene::Scene,
    geometry::{Distortion, Lens},
};
use common::{draw, testing};
use glam::{DVec2, DVec3};

const SIZE: (u32, u32) = (640, 360);

/// A box 60 m off near the picture's lower edge, seen while the camera turns by `turn` within one picture.
fn scene(models: &[bowwave_core::model::Model], turn: DVec3, distortion: Distortion) -> Scene {
    let mut scene = testing::empty_scene(SIZE.0, SIZE.1);
    scene.camera.world_from_camera = bowwave_core::geometry::look(0.0, 0.1, 0.2);
    scene.water.method = bowwave_core::water::ReflectionMethod::Off;
    scene.water.shadow = bowwave_core::water::ShadowLevel::None;
    scene.lens = Lens { distortion, ..scene.lens }.read_while(turn);
    testing::add_boat(&mut scene, models, 0, 60.0, 0.1, 0.7);
    scene
}

/// From and to of the pixels that differ.
fn span(a: &[u8], b: &[u8]) -> (DVec2, DVec2) {
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for (i, (a, b)) in a.chunks_exact(4).zip(b.chunks_exact(4)).enumerate() {
        if a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > 12) {
            let p = DVec2::new((i % SIZE.0 as usize) as f64, (i / SIZE.0 as usize) as f64);
            (low, high) = (low.min(p), high.max(p + 1.0));
        }
    }
    (low, high)
}

#[test]
fn boats_are_drawn_on_the_rows_that_see_them() {
    let models = [testing::box_model("box", [6.0, 2.0, 2.5], [0.9, 0.1, 0.1])];
    let rate = 40f64.to_radians() * 0.03;
    let bent = Distortion::radial_tangential(DVec2::new(-0.15, 0.02), DVec2::new(0.002, -0.001));
    let cases = [
        (DVec3::ZERO, bent),
        (DVec3::Y * rate, bent),
        (DVec3::X * rate, bent),
        (DVec3::X * -rate, Distortion::None),
        (DVec3::new(0.6, 0.6, 0.5) * rate, bent),
        (DVec3::Y * rate, Distortion::fisheye([-0.05, 0.01, -0.003, 0.0])),
    ];
    for (turn, distortion) in cases {
        let scene = scene(&models, turn, distortion);
        let picture = common::grey(SIZE.0, SIZE.1, 90);
        let mut empty = scene.clone();
        empty.boats.clear();
        empty.passes = testing::empty_scene(SIZE.0, SIZE.1).passes;
        let drawn = draw(&scene, &picture, &models);
        let (low, high) = span(&drawn, &draw(&empty, &picture, &models));
        let boat = &scene.boats[0];
        let (min, max) = (models[0].min.as_dvec3(), models[0].max.as_dvec3());
        let corners = (0..8).map(|i| {
            let pick = |bit: usize, a: f64, b: f64| if i & bit == 0 { a } else { b };
            DVec3::new(
                pick(1, min.x, max.x),
                pick(2, min.y, max.y),
                pick(4, boat.water_level.max(0.0), max.z),
            )
        });
        let project =
            |lens: &Lens, p: DVec3| lens.project(scene.camera.to_camera(boat.pose.to_world(p))).unwrap();
        let (mut from, mut to) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let global = Lens { row_turn: DVec3::ZERO, ..scene.lens };
        let mut moved = 0.0f64;
        for corner in corners {
            let p = project(&scene.lens, corner);
            (from, to) = (from.min(p), to.max(p));
            moved = moved.max(p.distance(project(&global, corner)));
        }
        let off = (low - from).abs().max((high - to).abs()).max_element();
        // The outermost pixels of a pointed corner are hardly covered.
        assert!(off < 1.6, "{turn}: drawn {low} to {high}, expected {from} to {to}");
        assert_eq!(moved > 2.0, turn != DVec3::ZERO, "{turn} moves the boat by {moved} px");
    }
}
