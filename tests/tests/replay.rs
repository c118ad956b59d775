//! The same inputs give the same outputs.

use bowwave_tests::{play, small_recording};

#[test]
fn two_fast_runs_are_equal_to_the_byte() {
    let folder = tempfile::tempdir().expect("a folder");
    let [a, b] =
        ["a", "b"].map(|name| play(small_recording(), &folder.path().join(name), 0, &["--validation"]));
    for key in [
        "records_digest",
        "frames_sha256",
        "frames",
        "shots",
        "hits",
        "passes",
        "left_out",
        "registration_px",
    ] {
        assert_eq!(a[key], b[key], "{key}");
    }
    assert_eq!(a["frames"], 90);
    assert!(a["shots"].as_u64() >= Some(15), "{}", a["shots"]);
    let rms = a["registration_px"]["rms"].as_f64().expect("truth");
    // 160 px wide: an eighth of the default recording's error.
    assert!(rms < 0.25, "{rms}");
}

#[test]
fn another_seed_gives_other_records() {
    let folder = tempfile::tempdir().expect("a folder");
    let [a, b] =
        ["1", "2"].map(|seed| play(small_recording(), &folder.path().join(seed), 0, &["--seed", seed]));
    assert_ne!(a["records_digest"], b["records_digest"]);
    assert_eq!((&a["seed"], &b["seed"]), (&1.into(), &2.into()));
}

#[test]
fn what_was_recorded_plays_again_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = play(small_recording(), &folder.path().join("first"), 0, &["--record"]);
    let kept = folder.path().join("first/recording.mcap");
    let second = play(&kept, &folder.path().join("second"), 0, &[]);
    // The last picture of the original comes after the last frame was drawn, so it was not kept.
    let frames = |v: &serde_json::Value| v["frames"].as_u64().expect("frames");
    assert!(frames(&first) - frames(&second) <= 1, "{} and {}", frames(&first), frames(&second));
    assert_eq!(first["hits"], second["hits"]);
    assert_eq!(first["registration_px"]["rms"], second["registration_px"]["rms"]);
}

#[test]
fn real_time_goes_through_the_serial_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let arguments = ["simulate", "--realtime", "--size", "160x96", "--duration", "3", "--json", "--out"];
    let recording = small_recording().to_str().expect("a plain path");
    let output =
        bowwave_tests::bowwave(arguments.into_iter().chain([out.to_str().expect("a plain path"), recording]));
    bowwave_tests::expect_code(&output, 0);
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON on standard output");
    let shown =
        summary["frames"].as_u64().expect("frames") + summary["missed_deadlines"].as_u64().expect("a clock");
    assert!(shown >= 60, "{summary}");
    assert!(summary["counts"]["imu_samples"].as_u64() >= Some(350), "{summary}");
    assert!(summary["registration_px"]["frames"].as_u64() >= Some(40), "{summary}");
}
