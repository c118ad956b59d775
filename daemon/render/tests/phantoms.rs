//! The own gun before boats and water: what the camera sees of it stays, and its edge mixes its own light with what is drawn behind.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod common;

use std::sync::Arc;

use bowwave_core::{
    event::{Picture, PixelFormat},
    frame::scene::{Pass, PassDecision, Scene},
    model::Model,
    own_ship::{Phantom, Phantoms},
    water::{ReflectionMethod, ShadowLevel, Water},
};
use common::{assert_clean, at, config, open, sea, submit, testing};
use glam::DVec2;

const SIZE: (u32, u32) = (320, 180);
/// Width of the edge in the picture, pixels: what the pass expects of one 180 pixels high.
const SOFT_PX: f64 = 1.5 * 180.0 / 720.0;
/// Where the bore vanishes.
const BORE: DVec2 = DVec2::new(159.0, 60.0);
/// Code of the gun in the picture.
const GUN: f64 = 36.0;

/// Barrel and sight from the lower border up to before the boat.
fn gun() -> Vec<Phantom> {
    let phantom = |name, corners: &[[f64; 2]]| {
        Phantom::new(name, corners.iter().map(|c| DVec2::from_array(*c)).collect(), SIZE)
    };
    vec![
        phantom("barrel", &[[150.3, 100.0], [169.2, 100.0], [187.7, 180.0], [131.0, 180.0]]),
        phantom("sight", &[[156.4, 75.5], [161.9, 75.5], [163.0, 104.0], [155.1, 104.0]]),
    ]
}

/// Share of a pixel that the gun covers.
fn cover(gun: &[Phantom], x: u32, y: u32) -> f64 {
    let place = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
    let nearest = gun.iter().map(|p| p.distance(place)).fold(f64::INFINITY, f64::min);
    (0.5 - nearest / SOFT_PX).clamp(0.0, 1.0)
}

fn light(code: f64) -> f64 {
    let c = code / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

fn code(light: f64) -> f64 {
    let c = if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
    c * 255.0
}

/// The gun before a picture.
fn before(gun: &[Phantom], picture: &Picture) -> Picture {
    let mut bytes = picture.bytes().to_vec();
    for (i, value) in bytes.iter_mut().enumerate() {
        let pixel = i as u32 / 3;
        let a = cover(gun, pixel % SIZE.0, pixel / SIZE.0);
        *value = code(light(f64::from(*value)) * (1.0 - a) + light(GUN) * a).round() as u8;
    }
    Picture::new(PixelFormat::Rgb, SIZE.0, SIZE.1, Arc::from(bytes)).unwrap()
}

/// A boat with its reflection behind the gun.
fn scene(method: ReflectionMethod) -> (Scene, Vec<Model>) {
    let models = vec![testing::box_model("box", [9.0, 3.0, 2.5], [0.9, 0.85, 0.8])];
    let mut scene = testing::empty_scene(SIZE.0, SIZE.1);
    scene.water = Water { method, shadow: ShadowLevel::Gradual, ..scene.water };
    testing::add_boat(&mut scene, &models, 0, 45.0, 0.0, 1.2);
    scene.passes[Pass::Phantoms as usize] = PassDecision::Run;
    (scene, models)
}

#[test]
fn a_gun_hides_the_boat_behind_it() {
    let gun = gun();
    for method in [ReflectionMethod::Baked, ReflectionMethod::Mirror] {
        let (scene, models) = scene(method);
        let open_sea = sea(SIZE.0, SIZE.1);
        let picture = before(&gun, &open_sea);
        let mut config = config(&scene);
        let (mut renderer, mut completions) = open(&config, &models);
        // The virtual boat as it would be without a gun before it, and over the gun.
        let behind = submit(&mut renderer, &mut completions, &scene, &open_sea);
        let over = submit(&mut renderer, &mut completions, &scene, &picture);
        assert_clean(&renderer);
        drop((renderer, completions));
        config.needs.phantoms = Phantoms { parts: gun.clone().into(), bore: BORE };
        let (mut renderer, mut completions) = open(&config, &models);
        let drawn = submit(&mut renderer, &mut completions, &scene, &picture);
        assert_clean(&renderer);
        let (mut hidden, mut edge, mut worst) = (0, 0, 0.0f64);
        for y in 0..SIZE.1 {
            for x in 0..SIZE.0 {
                let a = cover(&gun, x, y);
                let [is, was, wide] = [&drawn, &over, &behind].map(|frame| at(frame, SIZE.0, x, y));
                if a >= 1.0 {
                    hidden += u32::from(was.iter().any(|c| c.abs_diff(GUN as u8) > 20));
                    assert!(
                        is.iter().all(|c| c.abs_diff(GUN as u8) <= 1),
                        "{method:?} core at {x} {y}: {is:?}"
                    );
                } else if a <= 0.0 {
                    assert_eq!(is, was, "{method:?} beside it at {x} {y}");
                } else if wide != at(open_sea_rgba(&open_sea).as_slice(), SIZE.0, x, y) {
                    edge += 1;
                    for (is, wide) in is.into_iter().zip(wide) {
                        let right = light(f64::from(wide)) * (1.0 - a) + light(GUN) * a;
                        worst = worst.max((light(f64::from(is)) - right).abs());
                    }
                }
            }
        }
        assert!(hidden > 200 && edge > 20, "{method:?}: {hidden} pixels hidden, {edge} on an edge");
        // Reflections are matched to the picture about them, of which the gun is a part: their light differs a little beside it.
        assert!(worst < 0.06, "{method:?}: light of an edge is off by {worst}");
    }
}

/// The bytes of an RGB picture with a fourth for each pixel.
fn open_sea_rgba(picture: &Picture) -> Vec<u8> {
    picture.bytes().chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255]).collect()
}

#[test]
fn a_picture_with_nothing_drawn_on_the_gun_stays_as_it_is() {
    let gun = gun();
    let (mut scene, models) = scene(ReflectionMethod::Off);
    scene.boats.clear();
    for pass in [Pass::Boats, Pass::Shadow, Pass::Mirror, Pass::Water] {
        scene.passes[pass as usize] = scene.passes[Pass::Rounds as usize];
    }
    let picture = before(&gun, &sea(SIZE.0, SIZE.1));
    let mut config = config(&scene);
    config.needs.boats_max = 1;
    let (mut renderer, mut completions) = open(&config, &models);
    let bare = submit(&mut renderer, &mut completions, &scene, &picture);
    drop((renderer, completions));
    config.needs.phantoms = Phantoms { parts: gun.into(), bore: BORE };
    let (mut renderer, mut completions) = open(&config, &models);
    // The first frame of all draws some of them, so that drivers finish compiling.
    submit(&mut renderer, &mut completions, &scene, &picture);
    assert_eq!(submit(&mut renderer, &mut completions, &scene, &picture), bare);
    assert_clean(&renderer);
}
