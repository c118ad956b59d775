//! Small pictures of every pass and method against committed ones. `BOWWAVE_BLESS=1` writes them anew: look at them then.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod common;

use std::{path::PathBuf, sync::Arc};

use bowwave_core::{
    estimate::light::Light,
    event::{Picture, PixelFormat},
    fault::Fault,
    frame::{
        fires::Burning,
        lamps::LampView,
        scene::{LightView, Pass, PassDecision, RoundView, Scene, Status},
        searchlight::SearchlightView,
    },
    geometry::{Distortion, look},
    guide::{Cell, Coverage, Gauge, Guide, Rating},
    model::{Model, ModelKind, Texture, Zone},
    sea::BeaufortForce,
    sky::SkyLobes,
    water::{ReflectionMethod, ShadowLevel},
    world::searchlight::SearchlightSpec,
};
use common::{
    draw, sea,
    testing::{add_boat, add_moving_boat, box_model, empty_scene},
};
use glam::{DVec2, DVec3, Vec3};

const SIZE: (u32, u32) = (320, 180);
/// Another version of the software driver may round and cover otherwise: a pixel in two hundred may be off by more than this
/// many codes, none may bring the mean beyond a quarter of a code.
const CODES: i32 = 3;
const SHARE: f64 = 0.005;
/// The same for a GPU, which filters textures with fewer bits.
const SHARE_GPU: f64 = 0.01;
const MEAN: f64 = 0.25;

fn models() -> Vec<Model> {
    vec![
        box_model("white", [9.0, 2.6, 1.8], [0.8, 0.8, 0.78]),
        box_model("red", [5.0, 2.0, 1.2], [0.5, 0.06, 0.04]),
    ]
}

fn boats(method: ReflectionMethod, shadow: ShadowLevel, force: u8) -> Scene {
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    scene.water.method = method;
    scene.water.shadow = shadow;
    scene.water.force = BeaufortForce::new(force).unwrap();
    add_boat(&mut scene, &models(), 0, 45.0, -0.12, 0.5);
    add_boat(&mut scene, &models(), 1, 42.0, 0.14, 2.4);
    scene
}

fn check(name: &str, scene: &Scene, models: &[Model]) {
    check_on(name, scene, &sea(scene.lens.width, scene.lens.height), models);
}

fn check_on(name: &str, scene: &Scene, picture: &Picture, models: &[Model]) {
    let size = (scene.lens.width, scene.lens.height);
    let pixels = draw(scene, picture, models);
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{name}.png"));
    if std::env::var_os("BOWWAVE_BLESS").is_some() {
        image::save_buffer(&path, &pixels, size.0, size.1, image::ExtendedColorType::Rgba8).unwrap();
        return;
    }
    let golden = image::open(&path)
        .unwrap_or_else(|e| panic!("{}: {e}; make it with BOWWAVE_BLESS=1", path.display()));
    let golden = golden.to_rgba8();
    assert_eq!(golden.dimensions(), size);
    let differences = pixels
        .chunks_exact(4)
        .zip(golden.as_raw().chunks_exact(4))
        .map(|(a, b)| (0..3).map(|i| (i32::from(a[i]) - i32::from(b[i])).abs()).max().unwrap());
    let (mut off, mut sum) = (0_u32, 0.0);
    for d in differences {
        off += u32::from(d > CODES);
        sum += f64::from(d);
    }
    let count = f64::from(size.0 * size.1);
    let (share, mean) = (f64::from(off) / count, sum / count);
    let most = if std::env::var_os(common::TEST_GPU).is_some() { SHARE_GPU } else { SHARE };
    if share > most || mean > MEAN {
        let seen = std::env::temp_dir().join(format!("{name}.png"));
        image::save_buffer(&seen, &pixels, size.0, size.1, image::ExtendedColorType::Rgba8).unwrap();
        panic!(
            "{name}: {off} pixels off by more than {CODES} codes, mean {mean:.2}; drawn: {}",
            seen.display()
        );
    }
}

#[test]
fn display_shows_every_state() {
    let states = [
        ("ready", Status::Ready),
        ("hit", Status::Hit { zone: Zone::Engine }),
        ("neutral_hit", Status::NeutralHit { zone: Zone::Helm }),
        ("miss", Status::Miss),
        ("not_scored", Status::NotScored { cause: "POSE OLD", action: "Hold still" }),
        ("fault", Status::Fault { cause: "NO CAMERA", action: "Check its plug" }),
    ];
    for (name, status) in states {
        let mut scene = empty_scene(SIZE.0, SIZE.1);
        scene.hud.neutral_hits = u32::from(matches!(status, Status::NeutralHit { .. }));
        scene.hud.status = status;
        check(&format!("hud_{name}"), &scene, &[]);
    }
}

/// As on the gun's own display.
#[test]
fn faults_and_warnings_on_a_seven_inch_display() {
    let state = |fault: Fault| (fault.cause(), fault.action());
    let not_scored = |(cause, action)| Status::NotScored { cause, action };
    let broken = |(cause, action)| Status::Fault { cause, action };
    for (name, status, warning) in [
        ("warning", Status::Ready, Some(Fault::Thermal)),
        ("warning_long", Status::Hit { zone: Zone::Hull }, Some(Fault::CamBandwidth)),
        ("not_scored", not_scored(state(Fault::ImuBaud)), Some(Fault::DiskFull)),
        ("fault", broken(state(Fault::NotInert)), None),
        ("safe_mode", broken(state(Fault::CrashLoop)), None),
    ] {
        let mut scene = empty_scene(800, 480);
        scene.hud.status = status;
        scene.hud.warning = warning;
        check(&format!("display_{name}"), &scene, &[]);
    }
}

/// The pages that guide a maintainer, as on the gun's own display.
#[test]
fn calibration_pages_on_a_seven_inch_display() {
    let gauge = |name, value: &str, share, rating| Gauge { name, value: value.to_owned(), share, rating };
    let rated = |rating| Some(rating);
    let moving = Guide {
        title: "Calibrate: inertial unit to camera".to_owned(),
        says: "Elevate the gun up and down".to_owned(),
        problem: Some("ONLY TRAVERSE SO FAR".to_owned()),
        gauges: vec![
            gauge("elevation", "1.9 mrad, 0.9 m at 500 m", 0.86, rated(Rating::Usable)),
            gauge("traverse", "31.0 mrad, 15.5 m at 500 m", 0.25, rated(Rating::Poor)),
            gauge("roll", "0.6 mrad, 0.3 m at 500 m", 1.0, rated(Rating::Good)),
            gauge("time offset", "not known yet", 0.0, None),
        ],
        lines: vec!["32 s, horizon in 84 % of the pictures".to_owned()],
        keys: "Enter or trigger: result   b: back   q: end",
        ..Guide::default()
    };
    let cells = (0..48).map(|i| {
        if i % 8 > 5 {
            Cell::Empty
        } else if i < 10 {
            Cell::Few
        } else {
            Cell::Many
        }
    });
    let lens = Guide {
        title: "Calibrate: camera lens".to_owned(),
        says: "Take pictures with the board in the upper right corner of the picture".to_owned(),
        gauges: vec![
            gauge("parts seen", "75 % of 75 %", 1.0, rated(Rating::Good)),
            gauge("pictures", "7 of 12", 0.58, None),
        ],
        coverage: Some(Coverage { columns: 8, cells: cells.collect(), picture: (1280, 720) }),
        lines: vec!["board fills 12 to 55 % of the picture".to_owned()],
        keys: "Enter or trigger: result   b: back   q: end",
        ..Guide::default()
    };
    let passed = Guide {
        says: "Press Enter to save; what is replaced is kept".to_owned(),
        passed: Some(true),
        problem: None,
        gauges: vec![
            gauge("elevation", "1.9 mrad, 0.9 m at 500 m", 0.86, rated(Rating::Usable)),
            gauge("traverse", "0.3 mrad, 0.1 m at 500 m", 1.0, rated(Rating::Good)),
            gauge("roll", "0.6 mrad, 0.3 m at 500 m", 1.0, rated(Rating::Good)),
            gauge("time offset", "0.12 ms", 1.0, rated(Rating::Good)),
        ],
        lines: vec![
            "PASS: usable; boats lie within 1.90 mrad (0.95 m at 500 m) (one standard deviation), in time within 0.12 ms".to_owned(),
        ],
        keys: "Enter or trigger: save   b: gather more   q: end",
        ..moving.clone()
    };
    for (name, guide) in [("moving", moving), ("lens", lens), ("passed", passed)] {
        let mut scene = empty_scene(800, 480);
        scene.guide = Some(Arc::new(guide));
        check(&format!("calibrate_{name}"), &scene, &[]);
    }
}

#[test]
fn every_way_to_mirror() {
    for method in ReflectionMethod::ALL {
        let name = format!("water_{}", method.name());
        check(&name, &boats(method, ShadowLevel::Gradual, 1), &models());
    }
}

#[test]
fn sea_states_and_shadows() {
    for force in [0, 2, 4] {
        let scene = boats(ReflectionMethod::Full, ShadowLevel::None, force);
        check(&format!("full_force_{force}"), &scene, &models());
    }
    check("full_strong_shadow", &boats(ReflectionMethod::Full, ShadowLevel::Strong, 1), &models());
    check(
        "full_as_published_strong_shadow",
        &boats(ReflectionMethod::FullAsPublished, ShadowLevel::Strong, 1),
        &models(),
    );
}

#[test]
fn wakes_of_a_straight_and_of_a_turning_boat() {
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    scene.water.method = ReflectionMethod::Baked;
    add_moving_boat(&mut scene, &models(), 0, [45.0, -0.12, 2.9], [5.0, 0.0]);
    add_moving_boat(&mut scene, &models(), 1, [32.0, 0.12, 1.2], [7.0, 0.3]);
    check("wakes", &scene, &models());
}

#[test]
fn rolled_camera_with_a_bent_lens() {
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    scene.camera.world_from_camera = look(0.0, -0.05, 0.5);
    scene.lens.distortion = Distortion::radial_tangential(DVec2::new(-0.25, 0.06), DVec2::new(0.002, -0.001));
    add_boat(&mut scene, &models(), 0, 40.0, -0.05, 0.5);
    check("rolled", &scene, &models());
}

#[test]
fn tracer_splash_and_strike_before_and_behind_a_hull() {
    let mut scene = boats(ReflectionMethod::Full, ShadowLevel::Gradual, 1);
    let boat = scene.boats[0].pose.position;
    scene.rounds = vec![
        RoundView::Splash {
            at: boat + DVec3::new(1.0, 5.0, 0.0),
            height_m: 4.0,
            radius_m: 0.9,
            opacity: 1.0,
        },
        RoundView::Splash {
            at: boat - DVec3::new(1.5, 5.0, 0.0),
            height_m: 2.5,
            radius_m: 0.8,
            opacity: 0.9,
        },
        RoundView::Strike { at: boat + DVec3::new(2.0, -1.4, 1.5), radius_m: 0.8, opacity: 1.0 },
        RoundView::Tracer {
            from: DVec3::new(1.0, 8.0, 7.5),
            to: DVec3::new(-1.0, 30.0, 5.0),
            radiance: Vec3::new(4.0, 1.2, 0.5),
        },
    ];
    scene.passes[Pass::Rounds as usize] = PassDecision::Run;
    check("rounds", &scene, &models());
}

/// The sea by night.
fn dark_sea() -> Picture {
    let bytes: Vec<u8> = sea(SIZE.0, SIZE.1).bytes().iter().map(|code| code / 8).collect();
    Picture::new(PixelFormat::Rgb, SIZE.0, SIZE.1, Arc::from(bytes)).unwrap()
}

fn dark(scene: &mut Scene) {
    let Light { sun, sky, horizon, sea, .. } = &mut scene.light;
    for light in [sun, sky, horizon, sea] {
        *light *= 0.02;
    }
    scene.light.dome = SkyLobes::even(scene.light.sky);
}

/// By night: a masthead light and a sidelight, one that the hull hides, and the light of a boat that mirrors it by waves.
#[test]
fn lights_before_and_behind_a_hull_and_in_the_sea() {
    for (name, method) in [("lights", ReflectionMethod::Baked), ("lights_full", ReflectionMethod::Full)] {
        let mut scene = boats(method, ShadowLevel::None, 1);
        dark(&mut scene);
        let pose = scene.boats[0].pose;
        let light = |boat, place: DVec3, colour: Vec3| LightView {
            boat: Some(boat),
            at: pose.to_world(place),
            light: colour * 3e-4,
        };
        scene.lights = vec![
            light(0, DVec3::new(0.0, 0.0, 1.8), Vec3::new(1.35, 0.95, 0.45)),
            light(0, DVec3::new(2.0, -1.4, 1.5), Vec3::new(0.0, 1.32, 0.78)),
            light(0, DVec3::new(2.0, 1.4, 1.0), Vec3::new(4.7, 0.0, 0.0)),
        ];
        scene.passes[Pass::Lights as usize] = PassDecision::Run;
        check_on(name, &scene, &dark_sea(), &models());
    }
}

/// By night a beam from above lights two boats, the air before them and the sea between, and what hulls hide of the sea stays dark.
#[test]
fn a_searchlight_on_boats_sea_and_air() {
    for (name, method) in
        [("searchlight", ReflectionMethod::Baked), ("searchlight_full", ReflectionMethod::Full)]
    {
        let mut scene = boats(method, ShadowLevel::None, 1);
        dark(&mut scene);
        let spec = SearchlightSpec { candela: 200_000.0, beam: 0.25, is_on: true };
        let towards = scene.camera.to_camera(scene.boats[0].pose.position).normalize();
        scene.searchlight = Some(SearchlightView::new(&spec, towards, 40.0, 2_000.0));
        scene.passes[Pass::Lamplight as usize] = PassDecision::Run;
        check_on(name, &scene, &dark_sea(), &models());
    }
}

/// A boat burns by day, before and behind its own hull, and at night, when the flames are far brighter than the picture's white.
#[test]
fn a_boat_burns() {
    for (name, white_cd_m2) in [("fire", 20_000.0), ("fire_at_night", 20.0)] {
        let mut scene = boats(ReflectionMethod::Baked, ShadowLevel::None, 1);
        let picture = if white_cd_m2 < 100.0 { dark_sea() } else { sea(SIZE.0, SIZE.1) };
        if white_cd_m2 < 100.0 {
            dark(&mut scene);
        }
        let eye = scene.camera.position;
        let wind = DVec2::new(3.0, -1.0);
        let burning = Burning { boat: 0, since_s: 0.0, wind, eye, visibility_m: 10_000.0, white_cd_m2 };
        let at = scene.boats[0].pose.position + DVec3::Z;
        burning.puffs(40.0, |_| Some(at), &mut scene.rounds);
        scene.rounds.sort_by(|a, b| b.place().distance(eye).total_cmp(&a.place().distance(eye)));
        scene.passes[Pass::Rounds as usize] = PassDecision::Run;
        check_on(name, &scene, &picture, &models());
    }
}

/// By night a flare behind the boats, and then a fire on one of them, light boats, their mirror images, the sea and the air.
#[test]
fn a_flare_and_a_fire_light_what_is_around_them() {
    for (name, white_cd_m2) in [("flare", 4.0), ("firelight", 20.0)] {
        let mut scene = boats(ReflectionMethod::Baked, ShadowLevel::None, 1);
        dark(&mut scene);
        let eye = scene.camera.position;
        let pose = scene.boats[0].pose;
        let extinction_per_m = 3.912 / 5_000.0;
        if name == "flare" {
            let strength = Vec3::splat((80_000.0 / white_cd_m2) as f32);
            let lamp =
                LampView { at: DVec3::new(30.0, 180.0, 90.0), strength, extinction_per_m, is_high: true };
            scene.lamps = vec![lamp];
        } else {
            let (wind, since_s) = (DVec2::new(3.0, -1.0), 0.0);
            let burning = Burning { boat: 0, since_s, wind, eye, visibility_m: 5_000.0, white_cd_m2 };
            let at = pose.position + DVec3::Z;
            burning.puffs(40.0, |_| Some(at), &mut scene.rounds);
            scene.rounds.sort_by(|a, b| b.place().distance(eye).total_cmp(&a.place().distance(eye)));
            scene.passes[Pass::Rounds as usize] = PassDecision::Run;
            let strength = Burning::colour() * (burning.candela(40.0) / white_cd_m2) as f32;
            let at = at + DVec3::Z * (0.5 * burning.flame_height_m(40.0));
            scene.lamps = vec![LampView { at, strength, extinction_per_m, is_high: false }];
        }
        scene.passes[Pass::Lamplight as usize] = PassDecision::Run;
        check_on(name, &scene, &dark_sea(), &models());
    }
}

#[test]
fn a_picture_stands_for_a_boat() {
    // A disc on nothing: its edge and its transparency both show.
    let (width, height) = (64, 64);
    let mut rgba = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let d = f32::hypot(x as f32 - 31.5, y as f32 - 31.5);
            rgba.extend([230, (x * 4) as u8, 60, if d < 30.0 { 255 } else { 0 }]);
        }
    }
    let mut quad = box_model("picture", [8.0, 0.0, 6.0], [1.0; 3]);
    quad.kind = ModelKind::Quad;
    // Of the box, the face towards -y alone: a picture has one.
    let face = quad.vertices.iter().position(|v| v.normal.y < -0.5).unwrap() as u32;
    quad.indices.retain(|i| (face..face + 4).contains(i));
    for v in &mut quad.vertices {
        v.uv = glam::Vec2::new(v.position.x / 8.0 + 0.5, 1.0 - (v.position.z + 0.4) / 6.4);
    }
    quad.parts[0].indices = 0..6;
    quad.texture = Some(Texture { width, height, rgba });
    let models = [quad];
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    add_boat(&mut scene, &models, 0, 40.0, 0.03, 1.0);
    check("picture", &scene, &models);
}

#[test]
fn far_boats_sink_into_haze_and_beneath_the_horizon() {
    let models = [box_model("tall", [60.0, 12.0, 25.0], [0.3, 0.3, 0.35])];
    let mut scene = empty_scene(SIZE.0, SIZE.1);
    scene.lens.focal *= 12.0;
    scene.camera.position.z = 3.0;
    scene.camera.world_from_camera = look(0.0, 0.0, 0.0);
    add_boat(&mut scene, &models, 0, 15_000.0, 0.005, 0.8);
    add_boat(&mut scene, &models, 0, 6_000.0, -0.012, 0.8);
    for boat in &mut scene.boats {
        boat.haze = (boat.range_m / 20_000.0) as f32;
    }
    assert!(scene.boats[0].beyond_horizon && !scene.boats[1].beyond_horizon);
    check("far", &scene, &models);
}
