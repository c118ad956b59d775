//! Scenes at the edge of sense, the ring, and what is refused. The validation layer watches everywhere.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test that cannot go on fails")]

mod common;

use std::{sync::Arc, time::Duration};

use bowwave_core::{
    event::{Picture, PixelFormat},
    frame::scene::{BoatView, Pass, PassDecision, PixelRect, RoundView, Scene},
    geometry::{RigidPose, look},
    model::{Model, ModelId},
    water::{ReflectionMethod, ShadowLevel},
};
use bowwave_render::{DrawRequest, Needs, RenderError, Renderer};
use common::{
    assert_clean, at, config, draw, grey, open, sea, submit,
    testing::{add_boat, add_moving_boat, box_model, empty_scene},
};
use glam::{DQuat, DVec3, Vec3};

const SIZE: (u32, u32) = (320, 180);

fn models() -> Vec<Model> {
    vec![box_model("white", [9.0, 2.6, 1.8], [0.8, 0.8, 0.78])]
}

fn everywhere() -> PixelRect {
    PixelRect { x: 0, y: 0, width: SIZE.0, height: SIZE.1 }
}

/// A boat at a place that no visibility test has passed.
fn forced(position: DVec3, yaw: f64) -> BoatView {
    BoatView {
        boat: 0,
        model: ModelId(0),
        pose: RigidPose { world_from_body: DQuat::from_rotation_z(yaw), position },
        water_level: 0.0,
        hidden_m: 0.0,
        hull: Some(everywhere()),
        reflection: Some(everywhere()),
        wake: None,
        range_m: position.length(),
        haze: 0.0,
        beyond_horizon: false,
    }
}

fn with_boats(boats: Vec<BoatView>) -> Scene {
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    for pass in [Pass::Mirror, Pass::Water, Pass::Boats] {
        scene.passes[pass as usize] = PassDecision::Run;
    }
    scene.boats = boats;
    scene
}

#[test]
fn odd_boats_are_drawn_or_left_out_and_never_break_a_frame() {
    let nan = DVec3::splat(f64::NAN);
    let cases = [
        ("at 5 km", forced(DVec3::new(100.0, 5000.0, 0.0), 0.3)),
        ("at the picture's edge", forced(DVec3::new(-24.0, 40.0, 0.0), 0.3)),
        ("half behind the camera", forced(DVec3::new(0.5, 1.0, 7.0), 1.5)),
        ("behind the camera", forced(DVec3::new(0.0, -50.0, 0.0), 0.3)),
        ("around the camera", forced(DVec3::new(0.0, 0.0, 7.5), 0.3)),
        ("nowhere", forced(nan, 0.3)),
        ("turned by no number", forced(DVec3::new(0.0, 50.0, 0.0), f64::NAN)),
        ("very far", forced(DVec3::new(0.0, 1e9, 0.0), 0.3)),
        ("no such model", BoatView { model: ModelId(99), ..forced(DVec3::new(0.0, 50.0, 0.0), 0.3) }),
        (
            "rectangles off the screen",
            BoatView {
                hull: Some(PixelRect { x: 5000, y: 10, width: 7, height: 7 }),
                reflection: Some(PixelRect { x: u32::MAX, y: u32::MAX, width: 9, height: 9 }),
                ..forced(DVec3::new(0.0, 50.0, 0.0), 0.3)
            },
        ),
    ];
    let (models, picture) = (models(), sea(SIZE.0, SIZE.1));
    for method in [ReflectionMethod::Full, ReflectionMethod::FullAsPublished, ReflectionMethod::Mirror] {
        let mut first = with_boats(vec![cases[0].1.clone()]);
        first.water.method = method;
        let (mut renderer, mut completions) = open(&config(&first), &models);
        for (frame, (name, boat)) in cases.iter().enumerate() {
            let mut scene = with_boats(vec![boat.clone()]);
            scene.water.method = method;
            scene.frame = frame as u64;
            let pixels = submit(&mut renderer, &mut completions, &scene, &picture);
            // The sky's corner is the video's whatever the boat does, unless the camera is inside of it.
            if *name != "around the camera" && *name != "half behind the camera" {
                assert_eq!(at(&pixels, SIZE.0, 2, 2), at_picture(&picture, 2, 2), "{name}, {method:?}");
            }
        }
        assert_clean(&renderer);
    }
}

/// A wake wherever a boat can be: beside, behind and beneath the camera, far off, turned by no number.
#[test]
fn odd_wakes_never_break_a_frame() {
    let (models, picture) = (models(), sea(SIZE.0, SIZE.1));
    let places = [[40.0, 0.1, 1.5], [3.0, 2.0, 0.2], [9.0, 3.1, 1.0], [5e3, 0.0, 0.1], [80.0, 0.0, f64::NAN]];
    let motions = [[8.0, 0.0], [12.0, 0.8], [0.6, -0.5], [1e3, 0.0]];
    let mut first = empty_scene(SIZE.0, SIZE.1);
    add_moving_boat(&mut first, &models, 0, places[0], motions[0]);
    let (mut renderer, mut completions) = open(&config(&first), &models);
    let still = {
        let mut scene = first.clone();
        scene.boats[0].wake = None;
        submit(&mut renderer, &mut completions, &scene, &picture)
    };
    let mut frame = 0;
    for place in places {
        for motion in motions {
            let mut scene = empty_scene(SIZE.0, SIZE.1);
            add_moving_boat(&mut scene, &models, 0, place, motion);
            let Some(boat) = scene.boats.first().cloned() else { continue };
            // The same wake from below the water, and without the hull that made it.
            let mut below = scene.clone();
            below.camera.position.z = -1.0;
            let mut alone = scene.clone();
            alone.boats = vec![BoatView { hull: None, reflection: None, ..boat }];
            for mut scene in [scene, below, alone] {
                frame += 1;
                scene.frame = frame;
                let pixels = submit(&mut renderer, &mut completions, &scene, &picture);
                if place == places[0] && motion == motions[0] && scene.camera.position.z > 0.0 {
                    assert_ne!(pixels, still, "the wake is drawn");
                }
            }
        }
    }
    assert!(frame > 20, "{frame} frames");
    assert_clean(&renderer);
}

fn at_picture(picture: &Picture, x: u32, y: u32) -> [u8; 3] {
    picture.srgb_at(x, y).map(|c| (c * 255.0).round() as u8)
}

#[test]
fn flat_grey_sea_takes_no_shift_when_mended_and_no_harm_as_printed() {
    let models = models();
    let picture = grey(SIZE.0, SIZE.1, 110);
    let mut mended = empty_scene(SIZE.0, SIZE.1);
    mended.water.shadow = ShadowLevel::None;
    add_boat(&mut mended, &models, 0, 45.0, -0.1, 0.5);
    let mut printed = mended.clone();
    printed.water.method = ReflectionMethod::FullAsPublished;
    let (a, b) = (draw(&mended, &picture, &models), draw(&mended, &picture, &models));
    assert_eq!(a, b, "the same frame twice");
    // Mended: there is a reflection below the hull, and it is the unshifted one: as wide as the hull.
    let changed =
        |pixels: &[u8], y: u32| (0..SIZE.0).filter(|x| at(pixels, SIZE.0, *x, y) != [110; 3]).count();
    let hull = mended.boats[0].hull.unwrap();
    let (at_hull, below) = (changed(&a, hull.y + hull.height / 2), changed(&a, hull.y + hull.height + 2));
    assert!(below > 20 && below <= at_hull + 6, "{below} pixels of reflection below {at_hull} of hull");
    // As printed: 0 / 0. It must not take the frame with it; what it does to the flat patch is the driver's.
    let c = draw(&printed, &picture, &models);
    assert_eq!(at(&c, SIZE.0, 2, 2), [110; 3]);
}

#[test]
fn camera_rolled_by_a_quarter_turn_mirrors_sideways() {
    let models = models();
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    scene.camera.world_from_camera = look(0.0, -0.05, std::f64::consts::FRAC_PI_2);
    scene.water.method = ReflectionMethod::Mirror;
    scene.water.shadow = ShadowLevel::None;
    add_boat(&mut scene, &models, 0, 45.0, 0.0, 0.1);
    let pixels = draw(&scene, &grey(SIZE.0, SIZE.1, 110), &models);
    // Rolled clockwise, down in the world is to the right in the picture.
    let hull = scene.boats[0].hull.unwrap();
    let row = hull.y + hull.height / 2;
    let changed = |x: u32| at(&pixels, SIZE.0, x, row) != [110; 3];
    let right = (0..SIZE.0).rev().find(|x| changed(*x)).unwrap();
    let left = (0..SIZE.0).find(|x| changed(*x)).unwrap();
    assert!(right > hull.x + hull.width + 3, "no reflection right of the hull: {right}");
    assert!(left + 2 >= hull.x, "something left of the hull: {left} {hull:?}");
}

#[test]
fn nearer_boats_hide_farther_ones_in_whatever_order_they_come() {
    let models =
        [box_model("white", [9.0, 2.6, 1.8], [0.8; 3]), box_model("black", [9.0, 2.6, 6.0], [0.0; 3])];
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    add_boat(&mut scene, &models, 0, 40.0, 0.0, 0.1);
    add_boat(&mut scene, &models, 1, 50.0, 0.0, 0.1);
    let far_first = draw(&scene, &sea(SIZE.0, SIZE.1), &models);
    scene.passes[Pass::Water as usize] =
        PassDecision::LeftOut(bowwave_core::frame::scene::LeftOut::ReflectionOff);
    let hulls = draw(&scene, &sea(SIZE.0, SIZE.1), &models);
    scene.boats.reverse();
    assert_eq!(draw(&scene, &sea(SIZE.0, SIZE.1), &models), hulls, "depth decides, not order");
    let near = scene.boats.iter().find(|b| b.model == ModelId(0)).unwrap().hull.unwrap();
    let centre = at(&far_first, SIZE.0, near.x + near.width / 2, near.y + near.height * 2 / 3);
    assert!(centre[0] > 120, "the near white boat stands before the far black one: {centre:?}");
}

#[test]
fn rounds_hide_behind_hulls_that_are_nearer() {
    let models = [box_model("grey", [9.0, 2.6, 3.0], [0.2; 3])];
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    scene.water.method = ReflectionMethod::Off;
    scene.water.shadow = ShadowLevel::None;
    add_boat(&mut scene, &models, 0, 40.0, 0.0, 0.05);
    let without = draw(&scene, &sea(SIZE.0, SIZE.1), &models);
    let boat = scene.boats[0].pose.position;
    let hull = scene.boats[0].hull.unwrap();
    let (x, y) = (hull.x + hull.width / 2, hull.y + hull.height * 2 / 3);
    for (offset, seen) in [(6.0, false), (-6.0, true)] {
        let splash = RoundView::Splash {
            at: boat + DVec3::new(0.0, offset, 0.0),
            height_m: 4.5,
            radius_m: 1.0,
            opacity: 1.0,
        };
        scene.rounds = vec![splash];
        scene.passes[Pass::Rounds as usize] = PassDecision::Run;
        let with = draw(&scene, &sea(SIZE.0, SIZE.1), &models);
        let changed = at(&with, SIZE.0, x, y) != at(&without, SIZE.0, x, y);
        assert_eq!(changed, seen, "a splash {offset} m behind the hull");
    }
    scene.boats.clear();
    scene.passes[Pass::Boats as usize] = PassDecision::LeftOut(bowwave_core::frame::scene::LeftOut::NoBoats);
    scene.passes[Pass::Water as usize] = PassDecision::LeftOut(bowwave_core::frame::scene::LeftOut::NoBoats);
    let radiance = Vec3::splat(5.0);
    scene.rounds.push(RoundView::Tracer {
        from: DVec3::new(f64::NAN, 5.0, 5.0),
        to: DVec3::Y * 90.0,
        radiance,
    });
    draw(&scene, &sea(SIZE.0, SIZE.1), &models);
}

#[test]
fn same_frames_twice_are_equal_and_pictures_may_change_their_shape() {
    let models = models();
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    add_boat(&mut scene, &models, 0, 45.0, -0.1, 0.5);
    let pictures = [sea(SIZE.0, SIZE.1), grey(SIZE.0, SIZE.1, 90), sea(200, 150), sea(SIZE.0, SIZE.1)];
    let run = || {
        let (mut renderer, mut completions) = open(&config(&scene), &models);
        let mut frames = Vec::new();
        for (n, picture) in pictures.iter().enumerate() {
            let mut scene = scene.clone();
            scene.frame = n as u64;
            frames.push(submit(&mut renderer, &mut completions, &scene, picture));
        }
        // The last picture again, without its bytes.
        let odd = Picture::new(PixelFormat::Nv12, 4, 4, Arc::from(vec![0; 24])).unwrap();
        renderer.submit(DrawRequest::new(&scene, &odd, false)).unwrap();
        frames.push(completions.wait_next(Duration::from_secs(20)).unwrap().unwrap().rgba().to_vec());
        assert_clean(&renderer);
        frames
    };
    let (first, second) = (run(), run());
    assert_eq!(first, second);
    assert_eq!(first[0], first[3]);
    assert_eq!(first[3], first[4], "the picture was not new");
    assert_ne!(first[0], first[1]);
}

/// One frame in so many is timed.
const EVERY: u64 = 4;

#[test]
fn ring_hands_out_frames_in_order_while_the_reader_lags_and_ends_cleanly() {
    let scene = empty_scene(SIZE.0, SIZE.1);
    let picture = sea(SIZE.0, SIZE.1);
    let (mut renderer, mut completions) = open(&config(&scene), &[]);
    renderer.time_every(EVERY);
    let reader = std::thread::spawn(move || {
        let mut seen = Vec::new();
        let mut held = None;
        while !completions.is_over() {
            if let Some(frame) = completions.wait_next(Duration::from_millis(500)).unwrap() {
                seen.push(frame.frame);
                assert_eq!(frame.size(), SIZE);
                assert_eq!(frame.rgba().len(), (SIZE.0 * SIZE.1 * 4) as usize);
                let timed = frame.frame % EVERY == 0;
                assert_eq!(frame.frame_ms.is_some_and(|ms| ms > 0.0), timed);
                assert_eq!(frame.passes_ms[Pass::Video as usize].is_some(), timed);
                assert!(frame.passes_ms[Pass::Boats as usize].is_none());
                // One frame is always kept: the ring must do with the other slot.
                held = Some(frame);
            }
        }
        drop(held);
        seen
    });
    let mut waits = 0;
    for n in 0..40 {
        let mut scene = scene.clone();
        scene.frame = n;
        waits += u32::from(renderer.submit(DrawRequest::new(&scene, &picture, n % 3 == 0)).unwrap());
    }
    assert_clean(&renderer);
    drop(renderer);
    assert_eq!(reader.join().unwrap(), (0..40).collect::<Vec<_>>());
    assert!(waits > 0, "forty frames cannot fit a ring of two");
}

#[test]
fn renderer_goes_on_without_a_reader() {
    let scene = empty_scene(SIZE.0, SIZE.1);
    let (mut renderer, completions) = open(&config(&scene), &[]);
    drop(completions);
    for _ in 0..7 {
        renderer.submit(DrawRequest::new(&scene, &sea(SIZE.0, SIZE.1), true)).unwrap();
    }
    assert_clean(&renderer);
}

#[test]
fn what_is_not_needed_is_not_allocated_and_asking_for_it_is_an_error() {
    let models = models();
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    let bytes = |renderer: &Renderer| renderer.memory().iter().map(|(_, bytes)| bytes).sum::<u64>();
    let (bare, _completions) = open(&config(&scene), &models);
    let names: Vec<_> = bare.memory().into_iter().map(|(name, _)| name).collect();
    assert!(
        !names.iter().any(|n| n.contains("boat") || n.contains("mirror") || n.contains("reflection")),
        "{names:?}"
    );
    add_boat(&mut scene, &models, 0, 45.0, -0.1, 0.5);
    let (full, _completions) = open(&config(&scene), &models);
    assert!(bytes(&full) > 2 * bytes(&bare));
    let mut no_reflections = config(&scene);
    no_reflections.needs = Needs { waters: vec![], ..no_reflections.needs };
    let (mut dry, _completions) = open(&no_reflections, &models);
    assert!(bytes(&dry) < bytes(&full));
    let error = dry.submit(DrawRequest::new(&scene, &sea(SIZE.0, SIZE.1), true)).unwrap_err();
    assert_eq!(error, RenderError::NotPrepared { what: "another way to mirror" });
    let mut other = empty_scene(SIZE.0 + 2, SIZE.1);
    other.frame = 1;
    assert!(matches!(
        dry.submit(DrawRequest::new(&other, &sea(8, 8), true)),
        Err(RenderError::NotPrepared { .. })
    ));
}

#[test]
fn a_gpu_that_is_not_there_and_unusable_sizes_are_one_clear_line() {
    let scene = empty_scene(SIZE.0, SIZE.1);
    let mut wrong = config(&scene);
    wrong.device = Some("Voodoo 3".to_owned());
    let Err(error) = Renderer::new(&wrong, &[]) else { panic!("there is no such GPU") };
    let text = error.to_string();
    let devices = bowwave_render::devices().unwrap();
    let named = devices.iter().all(|device| text.contains(&device.name));
    assert!(text.contains("Voodoo 3") && named && !text.contains('\n'), "{text}");
    for (width, height) in [(0, 0), (8, 480), (640, 1_000_000)] {
        let wrong = bowwave_render::RenderConfig { width, height, ..config(&scene) };
        let Err(error) = Renderer::new(&wrong, &[]) else { panic!("no such size") };
        assert!(matches!(error, RenderError::Size { .. }), "{error}");
    }
    let mut model = models();
    model[0].indices[0] = 1_000_000;
    let mut with_boat = config(&scene);
    with_boat.needs.boats_max = 1;
    let Err(error) = Renderer::new(&with_boat, &model) else { panic!("no such corner") };
    assert!(error.to_string().contains("corner 1000000"), "{error}");
    assert!(devices.iter().any(|d| d.software) || std::env::var_os(common::TEST_GPU).is_some());
}
