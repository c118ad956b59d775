//! Each built-in scenario plays, and replays to the same records, scenes and score.

#![allow(clippy::expect_used, reason = "a test that cannot go on has failed")]

use bowwave_tests::{bowwave, expect_code, play, small_recording};
use serde_json::Value;

fn json(output: &std::process::Output) -> Value {
    expect_code(output, 0);
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn each_built_in_scenario_plays_and_replays_to_the_same_score() {
    for (name, _) in bowwave_core::world::scenario::BUILT_IN {
        let out = tempfile::tempdir().expect("a folder");
        let path = |file: &str| out.path().join(file).to_string_lossy().into_owned();
        let further = ["--scenario", name, "--frames", "45", "--record"];
        let summary = play(small_recording(), out.path(), 0, &further);
        assert_eq!(summary["frames"].as_u64(), Some(45), "{name}");
        let replayed = json(&bowwave(["replay", &path("recording.mcap"), "--json"]));
        assert_eq!(replayed["same"], Value::Bool(true), "{name}: {replayed}");
        let mut scored = json(&bowwave(["score", &path(""), "--json"]));
        scored.as_object_mut().expect("a sheet").remove("explained");
        assert_eq!(scored, replayed["score"], "{name}");
        assert!(scored["points"].is_number(), "{name}: {scored}");
    }
}
