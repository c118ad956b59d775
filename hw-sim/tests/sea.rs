//! The sea of a made recording is found by a session that only gets its pictures, its inertial unit and its calibration.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{path::Path, sync::Arc};

use bowwave_core::{
    estimate::{SeaReport, attitude::Source, sea::SeaSource},
    event::{PixelFormat, Tick},
    sea::BeaufortForce,
    session::{Session, Setup},
    world::scenario::Scenario,
};
use glam::DVec2;
use hw_sim::{
    make::{GunMotion, Periodic, Recipe, make},
    replay::{Replay, ReplayOptions},
};

const FRAME_NS: i64 = 100_000_000;

/// A moderate breeze from ahead on the left, seen from a gun that points northwards and is held as steadily as hands do.
fn recipe() -> Recipe {
    let gun = |mean: f64, cycles| Periodic::new(f64::to_radians(mean), &[(cycles, 0.004, 0.3)]);
    Recipe {
        width: 384,
        height: 216,
        frame_rate_hz: 10.0,
        beaufort: BeaufortForce::new(4).unwrap(),
        swell: None,
        eye_height_m: 10.0,
        gun: GunMotion { traverse: gun(42.0, 9), elevation: gun(-8.0, 11) },
        trigger: Vec::new(),
        ..Recipe::default()
    }
}

const SCENARIO: &str =
    "[sea]\nsource = \"video\"\nbeaufort = 1\nwind_from_deg = 90\n[mount]\neye_height_m = 10.0\n";

/// Plays the recording round and round; what is known every second.
fn watched(path: &Path, seconds: i64, scenario: &str) -> Vec<(SeaReport, DVec2, bool)> {
    let options = ReplayOptions {
        duration_ns: Some((seconds + 1) * 1_000_000_000),
        looped: true,
        ..ReplayOptions::default()
    };
    let mut replay = Replay::fast(path, &options).unwrap();
    let calibration = bowwave_calibration::parse(&replay.properties().calibration_toml, "recording").unwrap();
    let lens = calibration.calibration.lens;
    let mut session = Session::new(Setup {
        scenario: Scenario::parse(scenario, "test").unwrap(),
        calibration: calibration.calibration,
        models: Arc::new([]),
        boat_models: Vec::new(),
        screen: (lens.width, lens.height),
        video: PixelFormat::Rgb,
        orientation: Source::Auto,
        heading: bowwave_core::estimate::HeadingSettings::default(),
        own_ship: None,
    })
    .unwrap();
    let (mut events, mut known) = (Vec::new(), Vec::new());
    for frame in 1..=seconds * 10 {
        let time = replay.origin().plus_ns(frame * FRAME_NS);
        events.clear();
        replay.collect(time, &mut events).unwrap();
        events.iter().for_each(|event| session.event(event));
        let view = session.tick(Tick::at(time)).view;
        let drawn = (!view.blind).then(|| (view.scene.wind, view.scene.hud.sea.is_some()));
        if let (0, Some((wind, told)), Some(sea)) = (frame % 10, drawn, session.sea()) {
            known.push((sea, wind, told));
        }
    }
    replay.stop().unwrap();
    known
}

#[test]
fn the_sea_in_the_video_is_found_drawn_and_the_same_in_every_replay() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sea.mcap");
    let recipe = recipe();
    make(&recipe, &path, &mut |_, _| {}).unwrap();

    let known = watched(&path, 75, SCENARIO);
    assert_eq!(watched(&path, 75, SCENARIO), known, "a session is a pure function of its inputs");
    let early = known.iter().find(|(sea, ..)| sea.in_use.source == SeaSource::Assumed).unwrap();
    assert!(early.2 && early.1.distance(DVec2::new(-0.836, 0.0)) < 1e-9, "force 1 from the east: {early:?}");

    let (sea, wind, _) = known.last().unwrap();
    let said = format!("{sea:?} of {} m", recipe.significant_height_m());
    assert_eq!(sea.in_use.source, SeaSource::Measured, "{said}");
    assert!(sea.estimates >= 2, "{said}");
    let conditions = sea.in_use.conditions;
    assert!((conditions.significant_height_m / recipe.significant_height_m() - 1.0).abs() < 0.4, "{said}");
    let turn = (conditions.from_rad - recipe.wind_from).sin().abs();
    assert!(
        turn < 25f64.to_radians().sin() && (conditions.from_rad - recipe.wind_from).cos() > 0.0,
        "{said}"
    );
    // Reflections are drawn with the wind of these waves, which come from ahead on the left.
    let from = -wind.normalize();
    assert!(wind.length() > 2.0 && from.x < 0.0 && from.y > 0.0, "{wind}; {said}");
    assert!((wind.length() - sea.wind_m_s).abs() < 1e-9, "{wind}; {said}");
}

#[test]
fn a_sea_given_by_the_operator_is_not_watched() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("short.mcap");
    make(&Recipe { duration_s: 2.0, ..recipe() }, &path, &mut |_, _| {}).unwrap();
    assert!(watched(&path, 2, &SCENARIO.replace("video", "scenario")).is_empty());
}
