//! A run follows from its inputs alone: its recording, stepped again, gives the same records and the same scenes.
//! `BOWWAVE_REPLAYED_MINUTES` says how many minutes of simulated time each of twelve runs lasts; without it, a quarter of one.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on has failed")]

use std::path::Path;

use bowwave_tests::{bowwave, expect_code, play, small_recording};
use serde_json::Value;

/// Steps a session through the recording of a run and compares with the run's summary.
fn replay(out: &Path, summary: &Value) -> Value {
    let recording = out.join("recording.mcap");
    let output = bowwave(["replay".as_ref(), recording.as_os_str(), "--json".as_ref()]);
    expect_code(&output, 0);
    let replayed: Value = serde_json::from_slice(&output.stdout).expect("JSON on standard output");
    for key in ["records_digest", "scenes_digest", "shots", "hits"] {
        assert_eq!(replayed[key], summary[key], "{key} of {}", out.display());
    }
    assert_eq!((&replayed["same"], &replayed["missing"]), (&true.into(), &0.into()), "{replayed}");
    replayed
}

#[test]
fn twelve_runs_with_faults_come_out_the_same() {
    let minutes: f64 = std::env::var("BOWWAVE_REPLAYED_MINUTES")
        .map_or(0.25, |text| text.parse().expect("minutes as a number"));
    let seconds = (minutes * 60.0).round().to_string();
    let folder = tempfile::tempdir().expect("a folder");
    let mut digests = Vec::new();
    for seed in 1..=12 {
        let out = folder.path().join(seed.to_string());
        let seed = seed.to_string();
        let arguments = ["--record", "--duration", &seconds, "--fault-every", "5", "--seed", &seed];
        let summary = play(small_recording(), &out, 0, &arguments);
        assert!(summary["counts"]["faults_injected"].as_u64() > Some(0), "{summary}");
        let replayed = replay(&out, &summary);
        assert_eq!(replayed["ticks"], summary["frames"]);
        println!("seed {seed}: {} ticks, scenes {}", replayed["ticks"], replayed["scenes_digest"]);
        digests.push(replayed["scenes_digest"].clone());
        std::fs::remove_dir_all(&out).expect("the folder was there");
    }
    digests.sort_by_key(Value::to_string);
    digests.dedup();
    assert_eq!(digests.len(), 12, "runs of different seeds differ");
}

/// In real time, which picture meets which tick is chance; the recording tells.
#[test]
fn a_run_in_real_time_comes_out_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let arguments = ["simulate", "--realtime", "--size", "160x96", "--duration", "4", "--record", "--fault"];
    let further = ["frame-drop-out@1.5+0.7", "--json", "--out", out.to_str().expect("a plain path")];
    let recording = small_recording().to_str().expect("a plain path");
    let output = bowwave(arguments.into_iter().chain(further).chain([recording]));
    expect_code(&output, 0);
    let summary = serde_json::from_slice(&output.stdout).expect("JSON on standard output");
    replay(&out, &summary);
}

#[test]
fn a_recording_that_lacks_inputs_or_ticks_says_so() {
    // Made by the simulator's maker: no session was stepped with it.
    let output = bowwave(["replay".as_ref(), small_recording().as_os_str()]);
    expect_code(&output, 1);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("holds no ticks") && said.contains("bowwave simulate"), "{said}");

    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    play(small_recording(), &out, 0, &["--record"]);
    let whole = out.join("recording.mcap");
    let thinned = folder.path().join("thinned.mcap");
    leave_out(&whole, &thinned, |n| n == 300);
    let output = bowwave(["replay".as_ref(), thinned.as_os_str()]);
    expect_code(&output, 3);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("1 inputs are missing"), "{said}");
}

#[test]
fn a_run_with_the_ships_place_and_time_comes_out_the_same() {
    use bowwave_record::{Entry, RecordingReader, RecordingWriter, ShipEntry};
    // The sun is far down, and the moon is full and high.
    const LINES: [&str; 2] =
        ["$GPGGA,,5406.000,N,00754.000,E,1,,,,,,,,*5D\r\n", "$GPZDA,220000.00,24,11,2026,,*66\r\n"];
    let folder = tempfile::tempdir().expect("a folder");
    let at_sea = folder.path().join("at-sea.mcap");
    let reader = RecordingReader::open(small_recording()).expect("a recording");
    let mut writer = RecordingWriter::create(&at_sea, reader.properties()).expect("a new file");
    for (n, entry) in reader.entries().expect("entries").enumerate() {
        let entry = entry.expect("an entry");
        if n == 100 {
            for sentence in LINES {
                let line = ShipEntry { arrival: entry.time(), sentence: sentence.to_owned() };
                writer.write(&Entry::Ship(line)).expect("written");
            }
        }
        writer.write(&entry).expect("written");
    }
    writer.finish().expect("finished");
    let out = folder.path().join("out");
    let summary = play(&at_sea, &out, 0, &["--record"]);
    let sun = &summary["sun"];
    assert_eq!(sun["source"], "ship", "{sun}");
    assert!(sun["elevation_deg"].as_f64() < Some(-10.0), "{sun}");
    let moon = &sun["moonlight"];
    assert!(moon["elevation_deg"].as_f64() > Some(50.0) && moon["lit"].as_f64() > Some(0.95), "{sun}");
    replay(&out, &summary);
}

/// Writes a recording again without some of its measurements.
fn leave_out(from: &Path, to: &Path, is_left_out: impl Fn(usize) -> bool) {
    use bowwave_record::{Entry, RecordingReader, RecordingWriter};
    let reader = RecordingReader::open(from).expect("a recording");
    let mut writer = RecordingWriter::create(to, reader.properties()).expect("a new file");
    let mut measurements = 0;
    for entry in reader.entries_as_written().expect("entries") {
        let entry = entry.expect("an entry");
        if matches!(entry, Entry::Imu(_)) {
            measurements += 1;
            if is_left_out(measurements) {
                continue;
            }
        }
        writer.write(&entry).expect("written");
    }
    writer.finish().expect("finished");
}
