//! The camera's noise on boats: as strong as asked for by brightness and colour, another in each frame, on nothing but boats.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod common;

use bowwave_core::{
    colour::srgb_to_linear,
    estimate::light::{CameraNoise, SeenNoise},
    frame::scene::{LeftOut, Pass, PassDecision, Scene},
    geometry::{RigidPose, look},
    sky::SkyLobes,
};
use bowwave_render::DrawRequest;
use common::{
    assert_clean, config, grey, open, submit,
    testing::{add_boat_in, box_model, empty_scene},
};
use glam::{DQuat, DVec3, Vec3};

const SIZE: (u32, u32) = (320, 180);

fn seen(noise: CameraNoise, picture: u32, width: u32) -> SeenNoise {
    SeenNoise { noise, picture, width }
}

/// A wall of albedo 0.5 that fills the middle of the picture.
fn wall(light: f32, noise: Option<CameraNoise>) -> (Scene, [bowwave_core::model::Model; 1]) {
    let models = [box_model("box", [30.0, 3.0, 30.0], [0.5; 3])];
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    scene.camera.world_from_camera = look(0.0, 0.0, 0.0);
    (scene.light.sun, scene.light.sky) = (Vec3::ZERO, Vec3::splat(light));
    (scene.light.sea, scene.light.horizon) = (Vec3::splat(light), Vec3::splat(light));
    scene.light.dome = SkyLobes::even(Vec3::splat(light));
    let pose = RigidPose { world_from_body: DQuat::IDENTITY, position: DVec3::new(0.0, 60.0, 0.0) };
    add_boat_in(&mut scene, &models, 0, pose);
    for pass in [Pass::Mirror, Pass::Water, Pass::Hud, Pass::Shadow] {
        scene.passes[pass as usize] = PassDecision::LeftOut(LeftOut::ReflectionOff);
    }
    scene.passes[Pass::Noise as usize] = PassDecision::Run;
    scene.noise = noise.map(|noise| seen(noise, 0, SIZE.0));
    (scene, models)
}

/// Linear light of pixels on the wall, above the water.
fn on_wall(pixels: &[u8]) -> Vec<Vec3> {
    let at = |x: u32, y: u32| {
        let i = ((y * SIZE.0 + x) * 4) as usize;
        Vec3::from([0, 1, 2].map(|c| srgb_to_linear(f32::from(pixels[i + c]) / 255.0)))
    };
    (70..84).flat_map(|y| (140..180).map(move |x| (x, y))).map(|(x, y)| at(x, y)).collect()
}

fn mean(values: impl ExactSizeIterator<Item = Vec3>) -> Vec3 {
    let count = values.len() as f32;
    values.sum::<Vec3>() / count
}

#[test]
fn boats_get_the_noise_that_is_asked_for() {
    let noise = CameraNoise {
        read: Vec3::new(4e-4, 2e-4, 6e-4),
        shot: Vec3::new(1e-3, 8e-4, 2e-3),
        together: Vec3::new(0.7, 0.5, 0.45),
        paired: 0.0,
    };
    let picture = grey(SIZE.0, SIZE.1, 60);
    for light in [0.2, 0.8] {
        let ((scene, models), (bare, _)) = (wall(light, Some(noise)), wall(light, None));
        let (mut renderer, mut done) = open(&config(&scene), &models);
        let mut without = bare;
        without.passes[Pass::Noise as usize] = PassDecision::LeftOut(LeftOut::NoiseUnseen);
        let clean = mean(on_wall(&submit(&mut renderer, &mut done, &without, &picture)).into_iter());
        let (mut pixels, mut first) = (Vec::new(), Vec::new());
        let of = |n: u32| Scene { noise: Some(seen(noise, n, SIZE.0)), ..scene.clone() };
        for n in 0..8 {
            let drawn = submit(&mut renderer, &mut done, &of(n), &picture);
            pixels.extend(on_wall(&drawn));
            if n == 0 {
                first = drawn;
                continue;
            }
            assert_ne!(on_wall(&drawn), on_wall(&first), "picture {n} has the noise of the first");
            // Beside the boat lies the video alone.
            assert_eq!(drawn[..4 * 20], first[..4 * 20]);
        }
        let again = submit(&mut renderer, &mut done, &of(0), &picture);
        assert_eq!(again, first, "the same picture has the same noise");
        assert_clean(&renderer);
        let middle = mean(pixels.iter().copied());
        assert!((middle / clean - 1.0).abs().max_element() < 0.02, "{light}: {middle} for {clean}");
        let square = |p: &Vec3| (*p - middle) * (*p - middle);
        let deviation = mean(pixels.iter().map(square)).map(f32::sqrt);
        let off = (deviation / noise.deviation(clean) - 1.0).abs().max_element();
        let product = |p: &Vec3| {
            let Vec3 { x: r, y: g, z: b } = (*p - middle) / deviation;
            Vec3::new(g * r, g * b, r * b)
        };
        let together = mean(pixels.iter().map(product));
        println!("light {light}: deviations {off:.3} off, together {together}");
        assert!(off < 0.05, "{light}: {deviation} for {}", noise.deviation(clean));
        assert!((together - noise.together).abs().max_element() < 0.06, "{together}");
    }
}

#[test]
fn pairs_of_pixels_share_the_noise_of_their_colour() {
    let noise =
        CameraNoise { read: Vec3::splat(1e-3), shot: Vec3::ZERO, together: Vec3::splat(0.6), paired: 1.0 };
    let (scene, models) = wall(0.6, Some(noise));
    let (mut renderer, mut done) = open(&config(&scene), &models);
    let drawn = on_wall(&submit(&mut renderer, &mut done, &scene, &grey(SIZE.0, SIZE.1, 60)));
    // Of blue, what goes with green is each pixel's own.
    let middle = mean(drawn.iter().copied());
    let colour = |p: &Vec3| (p.z - middle.z) - 0.6 * (p.y - middle.y);
    let (mut product, mut square) = (0.0, 0.0);
    for pair in drawn.chunks_exact(2) {
        let [a, b] = [&pair[0], &pair[1]].map(colour);
        (product, square) = (product + a * b, square + 0.5 * (a * a + b * b));
    }
    assert!(product / square > 0.9, "{}", product / square);
}

#[test]
fn grain_is_as_large_as_the_pictures_pixels() {
    let noise = CameraNoise { read: Vec3::splat(1e-3), shot: Vec3::ZERO, together: Vec3::ZERO, paired: 0.0 };
    let (mut scene, models) = wall(0.6, Some(noise));
    scene.noise = Some(seen(noise, 0, SIZE.0 / 2));
    let (mut renderer, mut done) = open(&config(&scene), &models);
    let drawn = on_wall(&submit(&mut renderer, &mut done, &scene, &grey(SIZE.0, SIZE.1, 60)));
    assert!(drawn.chunks_exact(2).all(|pair| pair[0] == pair[1]));
    let own = drawn.chunks_exact(4).filter(|four| four[0] != four[2]).count();
    assert!(own > drawn.len() / 5, "{own}");
}

#[test]
fn noise_that_was_not_prepared_for_is_refused() {
    let (scene, models) = wall(0.6, None);
    let mut config = config(&scene);
    config.needs.noise = false;
    let (mut renderer, _) = open(&config, &models);
    let picture = grey(SIZE.0, SIZE.1, 60);
    let refused = renderer.submit(DrawRequest::new(&scene, &picture, true)).unwrap_err();
    assert!(refused.to_string().contains("the camera's noise"), "{refused}");
}
