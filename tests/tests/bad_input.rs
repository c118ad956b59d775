//! Bad input: one clear line and the right exit code, or ridden out and counted. Nothing panics, nothing recorded is lost.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on has failed")]

use std::{fs, path::Path, process::Command};

use bowwave_record::{Entry, RecordingReader, RecordingWriter};
use bowwave_tests::{bowwave, expect_code, play, said, small_recording};

/// Runs `simulate` and requires a failure whose message has all of `words` in one line.
fn refused(arguments: &[&str], words: &[&str]) {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let recording = small_recording().to_str().expect("a plain path");
    let mut all = vec!["simulate", "--size", "160x96", "--out", out.to_str().expect("a plain path")];
    all.extend(arguments);
    if !arguments.iter().any(|a| a.ends_with(".mcap")) {
        all.push(recording);
    }
    let output = bowwave(all);
    expect_code(&output, 1);
    one_line_with(&said(&output), words);
}

fn one_line_with(said: &str, words: &[&str]) {
    let line =
        said.lines().find(|l| l.starts_with("bowwave: ")).unwrap_or_else(|| panic!("no message: {said}"));
    for word in words {
        assert!(line.contains(word), "'{word}' is missing: {line}");
    }
}

fn file(folder: &Path, name: &str, bytes: &[u8]) -> String {
    let path = folder.join(name);
    fs::write(&path, bytes).expect("a file");
    path.to_str().expect("a plain path").to_owned()
}

#[test]
fn a_truncated_recording_is_played_up_to_the_cut() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = fs::read(small_recording()).expect("the recording");
    let cut = file(folder.path(), "cut.mcap", &whole[..whole.len() * 6 / 10]);
    let out = folder.path().join("out");
    let summary = play(Path::new(&cut), &out, 3, &["--record"]);
    let frames = summary["frames"].as_u64().expect("frames");
    assert!((30..90).contains(&frames), "{frames}");
    // What was kept of it is whole.
    let kept = RecordingReader::open(&out.join("recording.mcap")).expect("a whole recording");
    assert!(kept.entries().expect("entries").all(|e| e.is_ok()));
    assert!(kept.counts().frames >= frames - 1);
}

#[test]
fn foreign_and_empty_recordings_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    refused(
        &[&file(folder.path(), "text.mcap", b"this is no recording, but long enough to be one")],
        &["text.mcap", "MCAP"],
    );
    refused(&[&file(folder.path(), "empty.mcap", b"")], &["empty.mcap"]);
    refused(&["not-there.mcap"], &["not-there.mcap"]);
}

#[test]
fn a_recording_without_pictures_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("blind.mcap");
    let reader = RecordingReader::open(small_recording()).expect("the recording");
    let mut writer = RecordingWriter::create(&path, reader.properties()).expect("a recording");
    for entry in reader.entries().expect("entries") {
        let entry = entry.expect("an entry");
        if !matches!(entry, Entry::Frame(_)) {
            writer.write(&entry).expect("written");
        }
    }
    writer.finish().expect("finished");
    refused(&[path.to_str().expect("a plain path")], &["blind.mcap"]);
}

#[test]
fn device_faults_are_ridden_out_and_counted() {
    let cases = [
        ("frame-other-size@1+0.5", "pictures_wrong_size"),
        ("frame-corrupt@1+0.5", "pictures_undecodable"),
        ("imu-nan@1+0.5", "imu_insane"),
        ("imu-freeze@1+0.6", "imu_frozen"),
        ("line-garbage@1+0.5", "imu_skipped_bytes"),
        ("imu-drop-out@1+0.5", "faults_injected"),
        ("frame-drop-out@1+0.5", "faults_injected"),
    ];
    let folder = tempfile::tempdir().expect("a folder");
    for (fault, counter) in cases {
        let summary = play(small_recording(), &folder.path().join(counter), 0, &["--fault", fault]);
        assert_eq!(summary["frames"], 90, "{fault}");
        assert!(summary["counts"][counter].as_u64() > Some(0), "{fault}: {}", summary["counts"]);
        let scored = summary["hits"].as_u64() <= summary["shots"].as_u64();
        assert!(scored && summary["shots"].as_u64() >= Some(15), "{fault}: {summary}");
        if fault.starts_with("imu-drop") || fault.starts_with("imu-nan") || fault.starts_with("imu-freeze") {
            assert!(summary["not_scored"].as_u64() > Some(0), "{fault}: {summary}");
            assert!(summary["left_out"]["boats: no_pose"].as_u64() > Some(0), "{fault}: {summary}");
        }
        if fault.starts_with("line-garbage") {
            assert_eq!(summary["not_scored"], 0, "garbage between packets must not cost a sample: {summary}");
        }
    }
}

#[test]
fn a_gpu_that_is_not_there_is_named() {
    refused(&["--gpu", "no such gpu"], &["no such gpu", "llvmpipe"]);
    let output = bowwave(["doctor", "--gpu", "no such gpu"]);
    expect_code(&output, 1);
}

#[test]
fn devices_that_are_not_there_are_named() {
    for (arguments, words) in [
        (["--camera", "/dev/video99"], "/dev/video99"),
        (["--imu", "/dev/ttyUSB99"], "/dev/ttyUSB99"),
        (["--trigger", "/dev/gpiochip99:4"], "/dev/gpiochip99"),
        (["--trigger", "nothing"], "CHIP:LINE"),
    ] {
        let output = bowwave(["doctor"].into_iter().chain(arguments));
        expect_code(&output, 1);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let line = text.lines().find(|l| l.starts_with("FAILED")).unwrap_or_else(|| panic!("{text}"));
        assert!(line.contains(words), "{line}");
    }
}

#[test]
fn mistakes_in_files_are_named_by_line_and_column() {
    let folder = tempfile::tempdir().expect("a folder");
    let config = file(folder.path(), "config.toml", b"[screen]\nsise = \"640x480\"\n");
    refused(&["--config", &config], &["config.toml:2:1", "sise"]);
    let scenario = file(folder.path(), "scenario.toml", b"name = \"x\"\n[sea]\nbeaufort = 13\n");
    refused(&["--scenario", &scenario], &["scenario.toml:3:", "beaufort", "13"]);
    let calibration = file(folder.path(), "calibration.toml", b"made = \"2026-01-01\"\nlens = 3\n");
    refused(&["--calibration", &calibration], &["calibration.toml:2:"]);
}

#[test]
fn a_calibration_for_another_picture_size_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let properties = RecordingReader::open(small_recording()).expect("a recording").properties().clone();
    let text = properties.calibration_toml.as_str();
    let (width, height) = properties.picture;
    let of_size = format!("[{width}, {height}]");
    assert!(text.contains(&of_size), "{of_size} {text}");
    let other = text.replace(&of_size, &format!("[{}, {}]", 2 * width, 2 * height));
    let other = file(folder.path(), "other.toml", other.as_bytes());
    for further in [&["--frames", "5"][..], &[]] {
        refused(
            &[&["--calibration", other.as_str()], further].concat(),
            &["is for pictures of", &format!("{width}x{height}"), "calibration of its camera"],
        );
    }
}

#[test]
fn a_summary_that_cannot_be_written_is_told_and_takes_no_round_along() {
    let out = tempfile::tempdir().expect("a folder");
    std::fs::create_dir_all(out.path().join("summary.json/in-the-way")).expect("a folder in its place");
    let (out, recording) = (out.path().to_str().expect("a plain path"), small_recording());
    let recording = recording.to_str().expect("a plain path");
    let output = bowwave(["simulate", "--size", "160x96", "--print-commits", "--out", out, recording]);
    expect_code(&output, 1);
    one_line_with(&said(&output), &["summary.json", "check the disk"]);
    let committed = String::from_utf8_lossy(&output.stdout).matches("committed ").count();
    let hits = bowwave(["hits", out, "--json"]);
    expect_code(&hits, 0);
    let rows: Vec<serde_json::Value> = serde_json::from_slice(&hits.stdout).expect("JSON");
    assert!(committed > 0 && rows.len() == committed, "{} rows of {committed}", rows.len());
}

#[test]
fn a_run_that_is_interrupted_keeps_what_there_was_and_says_so() {
    let out = tempfile::tempdir().expect("a folder");
    let mut child = Command::new(bowwave_tests::program())
        .args(["simulate", "--realtime", "--size", "64x64", "--duration", "600", "--print-commits"])
        .arg("--out")
        .arg(out.path())
        .arg(small_recording())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("the program runs");
    let mut first = String::new();
    std::io::BufRead::read_line(
        &mut std::io::BufReader::new(child.stdout.as_mut().expect("a pipe")),
        &mut first,
    )
    .expect("a line");
    assert!(first.starts_with("committed "), "{first}");
    let id = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(id, rustix::process::Signal::INT).expect("a signal");
    let output = child.wait_with_output().expect("it ends");
    expect_code(&output, 3);
    assert!(said(&output).contains("interrupted after "), "{}", said(&output));
    let summary: serde_json::Value =
        serde_json::from_slice(&fs::read(out.path().join("summary.json")).expect("a summary")).expect("JSON");
    assert!(summary["frames"].as_u64().is_some_and(|frames| (1..18_000).contains(&frames)), "{summary}");
}

#[test]
fn frames_beyond_the_end_and_faults_too_close_are_refused() {
    refused(&["--frames", "5", "--stills", "4,5"], &["--stills 5", "frames 0 to 4"]);
    let output = bowwave(["simulate", "--fault-every", "1"]);
    expect_code(&output, 2);
    assert!(said(&output).contains("5 to 86400"), "{}", said(&output));
}

#[test]
fn a_run_that_ends_before_its_scenario_says_so_and_calls_no_latency_a_frames_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let run = |lasts_s: u32| {
        let scenario = file(
            folder.path(),
            "scenario.toml",
            format!("name = \"long\"\nduration_s = {lasts_s}\n").as_bytes(),
        );
        let recording = small_recording().to_str().expect("a plain path");
        let mut arguments = vec!["simulate", recording, "--fast", "--size", "160x96", "--frames", "30"];
        arguments.extend(["--scenario", &scenario, "--out", out.to_str().expect("a plain path")]);
        let output = bowwave(arguments);
        expect_code(&output, 0);
        said(&output)
    };
    let said = run(40);
    assert!(said.contains("this run ends after 1.0 s, the scenario after 40 s (--duration 40"), "{said}");
    assert!(said.contains("frame latency") && !said.contains("frame time"), "{said}");
    let said = run(1);
    assert!(!said.contains("the scenario lasts"), "{said}");
}

#[test]
fn a_model_without_its_parts_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    // One triangle in the plane of the keel, in a mesh called "blob".
    let positions: Vec<u8> =
        [0f32, -1.0, 0.0, 0.0, 1.0, 1.0, 0.5, 1.0, -1.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    fs::write(folder.path().join("blob.bin"), &positions).expect("a file");
    let json = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"name":"blob"}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"byteLength":36,"uri":"blob.bin"}],
        "bufferViews":[{"buffer":0,"byteLength":36}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,-1,-1],"max":[0.5,1,1]}]}"#;
    file(folder.path(), "blob.gltf", json.as_bytes());
    let scenario = file(folder.path(), "scenario.toml", include_bytes!("../data/model_without_parts.toml"));
    refused(&["--scenario", &scenario], &["blob-1", "blob.gltf", "engine", "helm"]);
}

#[test]
fn a_boat_inside_the_camera_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenario =
        file(folder.path(), "scenario.toml", include_bytes!("../data/boat_inside_the_camera.toml"));
    refused(&["--scenario", &scenario], &["scenario.toml:", "skiff-1", "camera"]);
}

#[test]
fn wrong_arguments_are_usage_errors() {
    for arguments in [
        vec!["simulate", "--size", "0x0"],
        vec!["simulate", "--fast", "--realtime"],
        vec!["nonsense"],
        vec![],
    ] {
        expect_code(&bowwave(arguments), 2);
    }
    let output = bowwave(["simulate", "--frames", "0"]);
    expect_code(&output, 2);
}

#[test]
fn hits_without_a_journal_says_where_it_looked() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = bowwave(["hits", folder.path().to_str().expect("a plain path")]);
    expect_code(&output, 1);
    one_line_with(&said(&output), &["hits.sqlite"]);
}

#[test]
fn hits_names_files_of_rounds_that_the_journal_does_not_have() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    play(small_recording(), &out, 0, &["--frames", "20"]);
    file(&out, "hits.sqlite.unwritten-7.jsonl", b"{}\n");
    let output = bowwave(["hits", out.to_str().expect("a plain path")]);
    expect_code(&output, 0);
    let said = said(&output);
    assert!(said.contains("hits.sqlite.unwritten-7.jsonl has rounds that the journal does not"), "{said}");
}

/// Nobody ever writes into the pipe: a command that opened it to read would wait for ever.
#[test]
fn a_named_pipe_in_the_place_of_a_file_holds_no_command_up() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    for name in ["p.mcap", "p.toml", "p.sqlite", "p.mp4", "p.yaml", "p.glb"] {
        assert!(Command::new("mkfifo").arg(path(name)).status().expect("mkfifo").success());
    }
    let boat = b"[[boat]]\nname = \"a\"\nmodel = \"p.glb\"\ncourse = \"still\"\nbearing_deg = 0\nrange_m = 200\nheading_deg = 90\n";
    let boat = file(folder.path(), "boat.toml", boat);
    let recording = small_recording().to_str().expect("a plain path");
    let [mcap, toml, sqlite, mp4, yaml] = ["p.mcap", "p.toml", "p.sqlite", "p.mp4", "p.yaml"].map(path);
    let (out, made) = (path("out"), path("made.mcap"));
    let commands: [&[&str]; 14] = [
        &["simulate", &mcap, "--out", &out],
        &["simulate", recording, "--scenario", &toml, "--out", &out],
        &["simulate", recording, "--calibration", &toml, "--out", &out],
        &["replay", &mcap],
        &["hits", &sqlite],
        &["plan", &toml],
        &["plan", &boat],
        &["calibrate", "check", &mcap],
        &["calibrate", "check", recording, "--calibration", &toml],
        &["calibrate", "extrinsics", &mcap],
        &["calibrate", "intrinsics", &mcap],
        &["calibrate", "board", "--target", &yaml],
        &["import", &mp4, "--out", &made],
        &["doctor", "--config", &toml],
    ];
    for command in commands {
        let output = Command::new("timeout").arg("30").arg(bowwave_tests::program()).args(command).output();
        let output = output.expect("timeout runs");
        let code = output.status.code();
        assert!(matches!(code, Some(1 | 2)), "{command:?}: {code:?}, {}", said(&output));
    }
}

/// A file system of a given size; `None`, said so, where this user may not mount one.
struct SmallVolume(tempfile::TempDir);

impl SmallVolume {
    fn new(kilobytes: u32) -> Option<Self> {
        let folder = tempfile::tempdir().expect("a folder");
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &format!("size={kilobytes}k"), "tmpfs"])
            .arg(folder.path())
            .output()
            .is_ok_and(|o| o.status.success());
        if !mounted {
            eprintln!("skipped: a small file system can be mounted by root only");
            return None;
        }
        Some(Self(folder))
    }
}

impl Drop for SmallVolume {
    fn drop(&mut self) {
        let unmounted = Command::new("umount").arg("-l").arg(self.0.path()).status();
        assert!(unmounted.is_ok_and(|s| s.success()), "the small file system stays mounted");
    }
}

#[test]
fn a_full_disk_loses_no_round() {
    let Some(disk) = SmallVolume::new(600) else { return };
    let out = disk.0.path().join("out");
    let recording = small_recording().to_str().expect("a plain path");
    let out_text = out.to_str().expect("a plain path");
    let output = bowwave([
        "simulate",
        recording,
        "--fast",
        "--size",
        "160x96",
        "--record",
        "--print-commits",
        "--out",
        out_text,
    ]);
    let said = said(&output);
    assert!(!said.contains("panicked"), "{said}");
    assert!(matches!(output.status.code(), Some(1 | 3)), "{said}");
    assert!(said.contains("space") || said.contains("full"), "it must say what is wrong: {said}");
    // Every round that was reported committed is in the journal.
    let committed =
        String::from_utf8_lossy(&output.stdout).lines().filter(|l| l.starts_with("committed ")).count();
    let hits = bowwave(["hits", out_text, "--json"]);
    expect_code(&hits, 0);
    let rows: Vec<serde_json::Value> = serde_json::from_slice(&hits.stdout).expect("JSON");
    assert!(rows.len() >= committed, "{} rows of {committed} reported", rows.len());
}
