//! What earlier versions have recorded stays readable.

#![allow(clippy::expect_used, reason = "a test that cannot go on has failed")]

use std::{fs, path::PathBuf};

use bowwave_tests::{bowwave, expect_code, play, root};
use serde_json::Value;

fn kept(name: &str) -> PathBuf {
    root().join("tests/data/kept").join(name)
}

fn json(arguments: &[&str]) -> Value {
    let output = bowwave(arguments);
    expect_code(&output, 0);
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// A folder as the earlier program left it.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fs::copy(kept("tables-3.sqlite"), folder.path().join("hits.sqlite")).expect("a copy");
    folder
}

#[test]
fn a_journal_without_events_is_read_scored_without_points_and_brought_up_to_date_by_the_next_run() {
    let folder = folder();
    let path = folder.path().to_string_lossy().into_owned();
    let rounds = |arguments: &[&str]| {
        json(&[&["hits", &path, "--json"], arguments].concat()).as_array().expect("rounds").clone()
    };
    let before = rounds(&[]);
    assert_eq!(before.len(), 19);
    let score = json(&["score", &path, "--json"]);
    assert!(score["points"].is_null() && score["rounds"]["fired"] == 19, "{score}");

    play(&kept("recording-0.1.mcap"), folder.path(), 0, &[]);
    assert_eq!(rounds(&["--run", "1"]), before, "the earlier run is as it was");
    assert!(json(&["score", &path, "--json"])["points"].is_number());
    assert!(json(&["score", &path, "--run", "1", "--json"])["points"].is_null());
}

#[test]
fn a_recording_plays_to_the_rounds_of_its_run() {
    let out = tempfile::tempdir().expect("a folder");
    let summary = play(&kept("recording-0.1.mcap"), out.path(), 0, &[]);
    assert_eq!(summary["shots"], 19, "{summary}");
}
