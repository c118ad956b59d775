//! The sea of a made recording is found by a session that only gets its pictures, its inertial unit and its calibration.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use std::path::Path;

use bowwave_core::{
    estimate::{SeaReport, attitude::Source, sea::SeaSource},
    sea::BeaufortForce,
};
use common::Played;
use glam::DVec2;
use hw_sim::make::{GunMotion, Periodic, Recipe, make};

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
    let mut played = Played::open(path, seconds);
    let mut session = played.session(scenario, Source::Auto, None);
    let mut known = Vec::new();
    played.play(
        &mut session,
        |_| (),
        |frame, session, tick, _| {
            let view = session.tick(tick).view;
            let drawn = (!view.blind).then(|| (view.scene.wind, view.scene.hud.sea.is_some()));
            if let (0, Some((wind, told)), Some(sea)) = (frame % 10, drawn, session.sea()) {
                known.push((sea, wind, told));
            }
        },
    );
    played.replay.stop().unwrap();
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
