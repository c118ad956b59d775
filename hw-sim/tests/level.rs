//! A session that fuses rates and specific force levels itself by the horizon in the pictures of a made recording.

use std::sync::Arc;

use bowwave_core::{
    attitude::Source,
    event::PixelFormat,
    scenario::Scenario,
    session::{Session, Setup},
};
use glam::DVec3;
use hw_sim::{
    make::{GunMotion, Periodic, Recipe, make},
    replay::{Replay, ReplayOptions},
};

const FRAME_NS: i64 = 100_000_000;

/// A gun that traverses by 17 degrees and back and looks a little down.
fn recipe() -> Recipe {
    Recipe {
        width: 480,
        height: 270,
        frame_rate_hz: 10.0,
        gun: GunMotion {
            traverse: Periodic::new(0.7, &[(2, 0.15, 0.3)]),
            elevation: Periodic::new(-0.05, &[(5, 0.02, 0.1)]),
        },
        trigger: Vec::new(),
        ..Recipe::default()
    }
}

#[test]
fn up_comes_from_the_horizon_in_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("level.mcap");
    make(&recipe(), &path, &mut |_, _| {}).unwrap();
    let (seconds, settled) = (60, 25);
    let options = ReplayOptions {
        duration_ns: Some((seconds + 1) * 1_000_000_000),
        looped: true,
        ..ReplayOptions::default()
    };
    let mut replay = Replay::fast(&path, &options).unwrap();
    let calibration = bowwave_calibration::parse(&replay.properties().calibration_toml, "recording").unwrap();
    let lens = calibration.calibration.lens;
    let scenario = format!("[mount]\neye_height_m = {:?}\n", recipe().eye_height_m);
    let mut session = Session::new(Setup {
        scenario: Scenario::parse(&scenario, "test").unwrap(),
        calibration: calibration.calibration,
        models: Arc::new([]),
        boat_models: Vec::new(),
        screen: (lens.width, lens.height),
        video: PixelFormat::Rgb,
        orientation: Source::Fused,
    })
    .unwrap();
    let mut events = Vec::new();
    let (mut sum, mut worst, mut count) = (0.0, 0.0f64, 0.0);
    for frame in 1..=seconds * 10 {
        let time = replay.origin().plus_ns(frame * FRAME_NS);
        events.clear();
        replay.collect(time, &mut events).unwrap();
        let Some(view) = session.step(&events, time).view else { continue };
        let truth = replay.truth_at(view.mid_exposure).unwrap().world_from_camera;
        if view.pose_known && frame > settled * 10 {
            let found = view.scene.camera.world_from_camera;
            let off = (found * (truth.inverse() * DVec3::Z)).truncate().length().to_degrees();
            sum += off * off;
            worst = worst.max(off);
            count += 1.0;
        }
    }
    replay.stop().unwrap();
    let horizons = session.sensor_counts().horizons;
    let rms = (sum / f64::max(count, 1.0)).sqrt();
    println!("up errs by {rms:.3} deg rms, {worst:.3} at worst, over {count} pictures; {horizons:?}");
    assert!(count > 300.0 && horizons.taken > 450 && horizons.refused < 20, "{count} pictures; {horizons:?}");
    assert!(rms < 0.08 && worst < 0.2, "{rms:.3} deg rms, {worst:.3} at worst");
}
