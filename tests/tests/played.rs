//! `bowwave play`: a scenario on a simulated gun that a script, a simulated gunner or somebody with a mouse aims.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on has failed")]

use std::{
    fs,
    path::Path,
    process::{Command, Output},
    sync::LazyLock,
};

use bowwave_tests::{expect_code, program, said, write};
use serde_json::Value;

/// Turns to the hulk, which lies 12 degrees to port, and fires at it.
const SCRIPT: &str = r#"
[[step]]
at_s = 0.2
azimuth_deg = -20
elevation_deg = -6

[[step]]
at_s = 1
azimuth_deg = 5
elevation_deg = 2
over_s = 1.5
act = "report"

[[step]]
at_s = 2.6
azimuth_deg = 0
elevation_deg = -1
over_s = 0.5
press_s = 1.5
"#;

/// The seas that the tests make, once.
static CACHE: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder");
    // Made before two tests would make the same one side by side.
    let settings = ["--fast", "--headless", "--camera", "160x96", "--size", "160x96", "--frames", "1"];
    let out = folder.path().join("first");
    let made = command(folder.path())
        .args(["first-target", "--aim", "expert", "--out", plain(&out)])
        .args(settings)
        .output()
        .expect("the program runs");
    expect_code(&made, 0);
    folder
});

fn command(cache: &Path) -> Command {
    let mut command = Command::new(program());
    command.arg("play").env("BOWWAVE_CACHE", cache).env_remove("DISPLAY");
    command
}

fn play<'a>(arguments: impl IntoIterator<Item = &'a str>) -> Output {
    command(CACHE.path()).args(arguments).output().expect("the program runs")
}

fn plain(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

/// A short run of a small camera.
fn small(aim: &str, out: &Path) -> Value {
    small_of("first-target", aim, out)
}

fn small_of(scenario: &str, aim: &str, out: &Path) -> Value {
    let settings = [
        "--fast",
        "--headless",
        "--camera",
        "160x96",
        "--size",
        "160x96",
        "--duration",
        "5",
        "--record",
        "--json",
    ];
    let output = play([scenario, "--aim", aim, "--out", plain(out)].into_iter().chain(settings));
    expect_code(&output, 0);
    serde_json::from_slice(&output.stdout).expect("JSON on standard output")
}

#[test]
fn the_same_script_plays_the_same_and_replays_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let script = folder.path().join("aim.toml");
    fs::write(&script, SCRIPT).expect("a file");
    let [a, b] = ["a", "b"].map(|name| small(plain(&script), &folder.path().join(name)));
    for key in ["records_digest", "scenes_digest", "frames_sha256", "shots", "registration_px"] {
        assert_eq!(a[key], b[key], "{key}");
    }
    assert!(a["shots"].as_u64() >= Some(8), "{}", a["shots"]);
    // An eighth of a full picture's error: the unit's own.
    assert!(a["registration_px"]["p99"].as_f64() < Some(0.25), "{}", a["registration_px"]);
    let recording = |name: &str| folder.path().join(name).join("recording.mcap");
    assert!(fs::read(recording("a")).expect("read") == fs::read(recording("b")).expect("read"));
    let again = bowwave_tests::bowwave(["replay", plain(&recording("a"))]);
    expect_code(&again, 0);
    assert!(said(&again).contains("records and scenes are the same in 150 ticks"), "{}", said(&again));
}

#[test]
fn a_boat_that_somebody_drives_sails_as_told_and_replays_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str, text: &str| write(folder.path(), name, text);
    let target = include_str!("../../daemon/core/scenarios/first-target.toml");
    let scenario = file("driven.toml", &target.replace("\"anchored\"", "\"driven\""));
    let orders = "[[step]]\nat_s = 0.5\nact = \"ahead\"\n[[step]]\nat_s = 0.6\nact = \"ahead\"\n[[step]]\nat_s = 0.7\nact = \"starboard\"\n";
    let (driven, left) =
        (file("driven-orders.toml", orders), file("none.toml", "[[step]]\nat_s = 0.5\nact = \"safe\"\n"));
    let [a, b] = [driven, left].map(|script| {
        let out = folder.path().join(Path::new(&script).file_stem().expect("a name"));
        (small_of(&scenario, &script, &out), out)
    });
    assert_ne!(a.0["scenes_digest"], b.0["scenes_digest"], "it sails");
    let [a, b] = [a, b].map(|(_, out)| out.join("recording.mcap"));
    let again = bowwave_tests::bowwave(["replay", plain(&a)]);
    expect_code(&again, 0);
    assert!(said(&again).contains("records and scenes are the same in 150 ticks"), "{}", said(&again));
    let chart = folder.path().join("run.svg");
    expect_code(&bowwave_tests::bowwave(["replay", plain(&a), "--chart", plain(&chart)]), 0);
    let svg = fs::read_to_string(&chart).expect("a chart");
    assert!(svg.contains("as it was sailed, with 0 strikes of rounds") && svg.contains("hulk"), "{svg}");
    let with_itself = bowwave_tests::bowwave(["replay", plain(&a), "--against", plain(&a)]);
    expect_code(&with_itself, 0);
    let apart = bowwave_tests::bowwave(["replay", plain(&a), "--against", plain(&b), "--json"]);
    expect_code(&apart, 1);
    let found: Value = serde_json::from_slice(&apart.stdout).expect("JSON on standard output");
    assert_eq!(found["settings"], Value::Array(Vec::new()), "{found}");
    assert_eq!(found["input"]["kinds"], serde_json::json!(["act", "act"]), "{found}");
    assert!(found["input"]["at_s"].as_f64().is_some_and(|s| (0.3..0.7).contains(&s)), "{found}");
    assert!(said(&apart).contains("s on: another act"), "{}", said(&apart));
}

#[test]
fn a_simulated_gunner_aims_by_what_the_trainer_shows() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let settings = ["--fast", "--headless", "--camera", "160x96", "--size", "160x96", "--duration", "20"];
    let output = play(["first-target", "--aim", "expert", "--out", plain(&out)].into_iter().chain(settings));
    expect_code(&output, 0);
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    // The briefing before, the score after.
    assert!(printed.contains("A hulk lies at anchor") && printed.contains("1 of 1 stopped"), "{printed}");
}

#[test]
fn what_cannot_be_played_says_why_before_a_sea_is_made() {
    let folder = tempfile::tempdir().expect("a folder");
    let script = folder.path().join("aim.toml");
    fs::write(&script, "[[step]]\nat_s = 1\nact = \"shout\"\n").expect("a file");
    for (arguments, says) in [
        (vec!["first-target", "--headless"], "let a simulated gunner"),
        (vec!["first-target", "--fast"], "needs a window and a clock"),
        (vec!["first-target", "--aim", "nobody", "--headless"], "--aim takes mouse, novice, trained, expert"),
        (vec!["first-target", "--aim", plain(&script), "--headless"], "aim.toml:3"),
        (vec!["no-such-scenario", "--aim", "expert", "--headless"], "name a file, or one of"),
        (
            vec!["first-target", "--aim", "expert", "--headless", "--duration", "1", "--stills", "99"],
            "frames 0 to 29",
        ),
    ] {
        let out = folder.path().join("out");
        let output = play(arguments.iter().copied().chain(["--out", plain(&out)]));
        expect_code(&output, 1);
        assert!(said(&output).contains(says), "{arguments:?}: {}", said(&output));
        assert!(!said(&output).contains("making the sea"), "{arguments:?}");
    }
}
