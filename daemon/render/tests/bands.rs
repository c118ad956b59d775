//! Light that fades slowly over a dark picture: no band of one code may be seen in it.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod common;

use bowwave_core::frame::{
    lamps::LampView,
    scene::{LeftOut, Pass, PassDecision},
};
use common::{
    at, draw, grey,
    testing::{box_model, empty_scene},
};
use glam::{DVec3, Vec3};

const SIZE: (u32, u32) = (640, 360);

/// The longest run of one code of green along a row, over all rows of the sky in which the light is a few codes.
fn longest_run(picture: &[u8]) -> u32 {
    let mut longest = 0;
    for y in 20..SIZE.1 / 2 - 20 {
        let mut run = 0;
        for x in 1..SIZE.0 {
            let code = at(picture, SIZE.0, x, y)[1];
            run = if code == at(picture, SIZE.0, x - 1, y)[1] && (1..=40).contains(&code) {
                run + 1
            } else {
                0
            };
            longest = longest.max(run);
        }
    }
    longest
}

#[test]
fn a_flares_glow_in_black_air_has_no_bands() {
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    scene.light.sun = Vec3::ZERO;
    let lamp = LampView {
        at: DVec3::new(60.0, 700.0, 150.0),
        strength: Vec3::splat(5_000.0),
        extinction_per_m: 3.912 / 5_000.0,
        is_high: true,
    };
    scene.lamps = vec![lamp];
    scene.passes[Pass::Lamplight as usize] = PassDecision::Run;
    scene.passes[Pass::Hud as usize] = PassDecision::LeftOut(LeftOut::ReflectionOff);
    let models = [box_model("box", [9.0, 2.6, 1.8], [0.9; 3])];
    let picture = draw(&scene, &grey(SIZE.0, SIZE.1, 0), &models);
    let lit = (0..SIZE.0).filter(|x| at(&picture, SIZE.0, *x, 60)[1] > 1).count();
    let run = longest_run(&picture);
    println!("{lit} pixels of a row are lit; the longest run of one code is {run}");
    if let Ok(path) = std::env::var("BOWWAVE_SHOW") {
        image::save_buffer(path, &picture, SIZE.0, SIZE.1, image::ColorType::Rgba8).unwrap();
    }
    assert!(lit > 300, "{lit} lit");
    assert!(run < 24, "a band of {run} pixels");
}
