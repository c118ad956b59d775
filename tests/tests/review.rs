//! `bowwave review`: the page says what journal and score say, and opens in a browser without any other file.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod browser;
mod reviewed;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
    time::Instant,
};

use bowwave_core::{
    time::Time,
    world::{
        score::{Outcome, ShotRecord},
        track::{PathPoint, RoundPath, TrackBlock, TrackPose, TrackSample},
    },
};
use bowwave_record::{BoatDetails, CameraDetails, Journal, Run, RunDetails, RunSelection, read_tracks};
use bowwave_tests::{bowwave, expect_code, program, said, write};
use glam::{DQuat, DVec3};
use serde_json::Value;
use tempfile::TempDir;

/// A run in which a simulated gun fires at a boat, its page, and its score.
struct Reviewed {
    folder: TempDir,
    page: PathBuf,
    score: Value,
}

/// Two boats, of which one lies still and is fired at.
const SCENARIO: &str = r#"
name = "One hulk"
briefing = "One boat lies still, another goes by. Fire at the one that lies still."
[sea]
beaufort = 2
wind_from_deg = 0
[mount]
eye_height_m = 6.0
[weapon]
rounds_per_minute = 500
belt = 100
[[boat]]
name = "hulk <&>"
model = "skiff"
side = "hostile"
course = "still"
range_m = 90
bearing_deg = 4
heading_deg = 70
[[boat]]
name = "passer-by"
model = "dhow"
side = "neutral"
course = "weave"
range_m = 250
bearing_deg = 340
heading_deg = 90
speed_kn = 12
weave_amplitude_m = 20
weave_period_s = 40
"#;

/// Looks about, then fires over and into the hulk.
const SCRIPT: &str = r#"
[[step]]
at_s = 0.5
azimuth_deg = 4
elevation_deg = -1
over_s = 1
act = "report"
[[step]]
at_s = 2
elevation_deg = -3.6
azimuth_deg = 4
over_s = 2
press_s = 3
[[step]]
at_s = 6
azimuth_deg = -8
elevation_deg = -2
over_s = 1.5
act = "neutral"
"#;

fn reviewed() -> &'static Reviewed {
    static RUN: OnceLock<Reviewed> = OnceLock::new();
    RUN.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let (scenario, script) =
            (write(folder.path(), "hulk.toml", SCENARIO), write(folder.path(), "aim.toml", SCRIPT));
        let out = folder.path().join("run").to_str().unwrap().to_owned();
        let played = Command::new(program())
            .env("BOWWAVE_CACHE", folder.path())
            .env_remove("DISPLAY")
            .args([
                "play",
                &scenario,
                "--aim",
                &script,
                "--fast",
                "--headless",
                "--video",
                "--camera",
                "320x180",
                "--size",
                "320x180",
            ])
            .args(["--duration", "9", "--out", &out])
            .output()
            .unwrap();
        expect_code(&played, 0);
        let made = bowwave(["review", &out]);
        expect_code(&made, 0);
        let page = PathBuf::from(String::from_utf8(made.stdout.clone()).unwrap().trim());
        assert_eq!(page, Path::new(&out).join("review-1.html"), "{}", said(&made));
        let score = serde_json::from_slice(&bowwave(["score", &out, "--json"]).stdout).unwrap();
        Reviewed { folder, page, score }
    })
}

/// The value that the page has for each place in the score, and the text that is shown for it.
fn cells(page: &str) -> BTreeMap<&str, (&str, &str)> {
    page.split("data-score=\"")
        .skip(1)
        .filter_map(|rest| {
            let (pointer, rest) = rest.split_once('"')?;
            let (value, rest) = rest.strip_prefix(" data-value=\"")?.split_once("\">")?;
            Some((pointer, (value, rest.split_once('<')?.0)))
        })
        .collect()
}

/// Every number in a JSON value, by its pointer.
fn numbers(value: &Value, pointer: String, found: &mut Vec<(String, Value)>) {
    match value {
        Value::Number(_) => found.push((pointer, value.clone())),
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, v)| numbers(v, format!("{pointer}/{i}"), found))
        }
        Value::Object(map) => map.iter().for_each(|(key, v)| numbers(v, format!("{pointer}/{key}"), found)),
        _ => {}
    }
}

#[test]
fn each_number_of_the_score_is_on_the_page_as_it_is() {
    let run = reviewed();
    let page = fs::read_to_string(&run.page).unwrap();
    let cells = cells(&page);
    let mut all = Vec::new();
    numbers(&run.score, String::new(), &mut all);
    assert!(all.len() > 40, "{}", run.score);
    let mut missing = Vec::new();
    for (pointer, value) in &all {
        // Numbers of rounds are those of the table's rows.
        if pointer.ends_with("/shot") {
            assert!(page.contains(&format!("data-shot=\"{value}\"")), "round {value}");
            continue;
        }
        match cells.get(pointer.as_str()) {
            Some((exact, shown)) => {
                assert_eq!(*exact, value.to_string(), "{pointer}");
                let digits = shown.split_once('.').map_or(0, |(_, digits)| digits.len());
                let rounded = format!("{:.digits$}", value.as_f64().unwrap());
                assert_eq!(*shown, rounded, "{pointer}");
            }
            None => missing.push(pointer),
        }
    }
    assert!(missing.is_empty(), "not on the page: {missing:?}");
    for pointer in cells.keys() {
        assert!(run.score.pointer(pointer).is_some(), "{pointer} is no number of the score");
    }
}

#[test]
fn a_page_needs_no_other_file_and_what_is_not_there_is_named() {
    let run = reviewed();
    let page = fs::read_to_string(&run.page).unwrap();
    assert!(page.contains("default-src &apos;none&apos;") || page.contains("default-src 'none'"));
    assert!(!page.contains("<link") && !page.contains(" src="), "nothing is loaded");
    assert!(page.len() < 30_000_000, "{} bytes", page.len());
    let whole = read_tracks(&run.page.with_file_name("hits.sqlite"), RunSelection::Latest).unwrap();
    assert!(whole.missing == 0 && whole.tracks.samples.len() > 150, "{}", whole.tracks.samples.len());
    let none = bowwave(["review", run.folder.path().join("run").to_str().unwrap(), "--run", "7"]);
    expect_code(&none, 1);
    assert!(said(&none).contains("run 7"), "{}", said(&none));
    let nowhere = bowwave(["review", "no/such/folder"]);
    expect_code(&nowhere, 1);
    assert!(said(&nowhere).contains("no journal at no/such/folder"), "{}", said(&nowhere));
}

/// The cubic through four places at equal times (Catmull and Rom 1974).
fn cubic([a, b, c, d]: [DVec3; 4], part: f64) -> DVec3 {
    let (from, to) = ((c - a) / 2.0, (d - b) / 2.0);
    hermite([b, from, c, to], part)
}

/// The cubic from a place with a slope to another.
fn hermite([a, from, b, to]: [DVec3; 4], s: f64) -> DVec3 {
    let (s2, s3) = (s * s, s * s * s);
    a * (2.0 * s3 - 3.0 * s2 + 1.0) + from * (s3 - 2.0 * s2 + s) + b * (3.0 * s2 - 2.0 * s3) + to * (s3 - s2)
}

fn vector([x, y, z]: [f32; 3]) -> DVec3 {
    DVec3::new(x.into(), y.into(), z.into())
}

fn listed(value: &Value) -> Vec<f64> {
    value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}

/// Boats, gun and rounds in the view that is moved, against the journal: at samples, and between them.
#[test]
fn a_browser_shows_boats_and_rounds_where_the_journal_has_them() {
    let run = reviewed();
    let Some(browser) = browser::Browser::open(&run.page) else { return };
    let journal = run.page.with_file_name("hits.sqlite");
    let tracks = read_tracks(&journal, RunSelection::Latest).unwrap().tracks;
    let first = tracks.samples[0].time_ns;
    browser.run("bowwave.view.setMode('above', null)");
    let mut compared = 0;
    for around in tracks.samples.windows(4).step_by(13) {
        for part in [0.0, 0.4] {
            let time_s = (around[1].time_ns - first) as f64 * 1e-9 + 0.05 * part;
            browser.run(&format!("bowwave.clock.set({time_s})"));
            for boat in 0..2 {
                let poses: [TrackPose; 4] = std::array::from_fn(|i| around[i].boats[boat].unwrap());
                let truth = cubic(poses.map(|pose| vector(pose.position)), part);
                let turn = |pose: TrackPose| DQuat::from_array(pose.attitude.map(f64::from));
                let attitude = turn(poses[1]).slerp(turn(poses[2]), part);
                let drawn = listed(&browser.run(&format!("return bowwave.view.drawnAt({boat})")));
                let place = DVec3::from_slice(&drawn);
                assert!(place.distance(truth) < 0.01, "boat {boat} at {time_s} s: {place} {truth}");
                let is = DQuat::from_slice(&drawn[3..]).normalize();
                assert!(
                    is.angle_between(attitude.normalize()) < 1e-3,
                    "boat {boat} at {time_s} s: {is} {attitude}"
                );
                compared += 1;
            }
        }
    }
    assert!(compared > 40, "{compared}");
    rounds_are_where_they_flew(&browser, &tracks);
    gun_looks_where_it_looked(&browser, &tracks);
}

fn rounds_are_where_they_flew(browser: &browser::Browser, tracks: &TrackBlock) {
    for path in tracks.rounds.iter().step_by(3) {
        let [a, b] = [path.points[0], path.points[1]];
        let span = f64::from(b.after_s - a.after_s);
        let slopes =
            [vector(a.position), vector(a.velocity) * span, vector(b.position), vector(b.velocity) * span];
        for part in [0.0, 0.5, 1.0] {
            let round = format!("bowwave.run.rounds.find((r) => r.shot === {})", path.shot);
            let after_s = f64::from(a.after_s) + span * part;
            let at = DVec3::from_slice(&listed(
                &browser.run(&format!("return {round}.at({round}.fired_s + {after_s})")),
            ));
            assert!(at.distance(hermite(slopes, part)) < 0.01, "round {} {part}: {at}", path.shot);
        }
    }
    assert!(!tracks.rounds.is_empty());
}

/// The gun's view looks along the camera's axis, with its up.
fn gun_looks_where_it_looked(browser: &browser::Browser, tracks: &TrackBlock) {
    let sample = &tracks.samples[tracks.samples.len() / 2];
    let time_s = (sample.time_ns - tracks.samples[0].time_ns) as f64 * 1e-9;
    browser.run(&format!("bowwave.clock.set({time_s}); bowwave.view.setMode('gun', null)"));
    let camera = sample.camera.unwrap();
    let attitude = DQuat::from_array(camera.attitude.map(f64::from));
    let elements = listed(&browser.run("return [...bowwave.view.camera.matrixWorld.elements]"));
    let column = |i: usize| DVec3::from_slice(&elements[4 * i..]);
    for (drawn, truth) in [
        (-column(2), attitude * DVec3::Z),
        (column(1), attitude * DVec3::NEG_Y),
        (column(3), vector(camera.position)),
    ] {
        assert!(drawn.distance(truth) < 1e-3, "{drawn} {truth}");
    }
}

#[test]
fn a_browser_scrubs_plays_steps_and_moves_without_an_error() {
    let run = reviewed();
    let Some(browser) = browser::Browser::open(&run.page) else { return };
    assert!(browser.number("return bowwave.view === null ? 0 : 1") == 1.0, "WebGL draws");
    browser.keys("body", "\u{e014}"); // right arrow
    let first = browser.number("return bowwave.clock.now_s");
    browser.keys("body", "\u{e014}");
    assert!(browser.number("return bowwave.clock.now_s") > first, "the next event");
    browser.run("document.getElementById('time').value = 5; document.getElementById('time').dispatchEvent(new Event('input'))");
    assert_eq!(browser.text("#now"), "5.0 s");
    browser.click("#play");
    assert_eq!(browser.text("#play"), "Pause");
    browser.wait("return bowwave.clock.now_s > 5.2");
    browser.click("#play");
    for mode in ["above", "free", "gun"] {
        browser.click(&format!("[data-view={mode}]"));
        assert_eq!(browser.text(&format!("[data-view={mode}][aria-pressed=true]")).to_lowercase(), mode);
    }
    // Keys move the viewpoint.
    browser.click("[data-view=free]");
    let eye = || {
        let from = "bowwave.view.camera.position.clone().sub(bowwave.view.controls.target)";
        DVec3::from_slice(&listed(&browser.run(&format!("return {from}.toArray()"))))
    };
    let before = eye();
    browser.keys("#view", "\u{e012}"); // left arrow
    let turned = eye();
    let bearing = |v: DVec3| v.y.atan2(v.x);
    let by_deg = (bearing(turned) - bearing(before)).to_degrees();
    assert!(
        (by_deg - 5.0).abs() < 0.1 && (turned.length() - before.length()).abs() < 0.01,
        "{before} {turned}"
    );
    browser.keys("#view", "+");
    assert!((eye().length() / before.length() - 0.87).abs() < 0.01, "{}", eye());
    // An event that is not shown is not where the time stands.
    browser.click("#show-plain");
    browser.click("#show-rounds");
    let hidden = "return [...document.querySelectorAll('#events tr[aria-current=true]')].filter((row) => row.hidden).length";
    assert_eq!(browser.number(hidden), 0.0);
    browser.click("#show-plain");
    let shown = browser.number("return document.querySelectorAll('#events tr[aria-current=true]').length");
    assert_eq!(shown, 1.0);
    let errors = browser.errors();
    assert!(errors.is_empty(), "{errors:?}");
}

/// Ten minutes with seven boats and 300 rounds, as a journal without a run.
fn long_run(folder: &Path) -> PathBuf {
    let names = ["skiff", "rhib", "dhow", "frigate", "skiff", "rhib", "dhow"];
    let boat = |(i, model): (usize, &&str)| BoatDetails {
        name: format!("{model}-{i}"),
        side: if i < 4 { "hostile" } else { "neutral" }.to_owned(),
        model: (*model).to_owned(),
        ..BoatDetails::default()
    };
    let details = RunDetails {
        boats: names.iter().enumerate().map(boat).collect(),
        eye_height_m: 6.0,
        camera: CameraDetails {
            size: [1280, 720],
            focal: [1100.0; 2],
            centre: [640.0, 360.0],
            bore: [0.0, 0.0, 1.0],
        },
        ..RunDetails::default()
    };
    let path = folder.join("hits.sqlite");
    let run = Run { details: Some(details.to_json()), scenario: "ten minutes".to_owned(), ..Run::default() };
    let journal = Journal::open(&path, &run).unwrap();
    for second in 0..600u32 {
        let block = block_of(second, names.len());
        while journal.tracks(u64::from(second) + 1, block.clone()).is_err() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        if let Some(path) = block.rounds.first() {
            let fired = Time::from_ns(path.fired_ns);
            let outcome =
                Outcome::Miss { boat: Some("skiff-0".to_owned()), miss_m: 2.0, time: fired, range_m: 300.0 };
            let shot = path.shot;
            journal
                .shot(&ShotRecord {
                    shot,
                    fired,
                    muzzle: DVec3::Z * 6.0,
                    bore: DVec3::Y,
                    pose_age_ns: 0,
                    outcome,
                })
                .unwrap();
        }
    }
    journal.finish().unwrap();
    path
}

/// A second of boats on circles; a round every other second.
fn block_of(second: u32, boats: usize) -> TrackBlock {
    let pose = |boat: usize, time_s: f32| {
        let (far, turn) = (120.0 + 40.0 * boat as f32, 0.05 * time_s + boat as f32);
        let position = [far * turn.sin(), far * turn.cos(), 0.2 * (time_s + boat as f32).sin()];
        Some(TrackPose { position, attitude: [0.0, 0.0, (turn / 2.0).sin(), (turn / 2.0).cos()] })
    };
    let sample = |k: u32| {
        let number = second * 20 + k;
        let time_s = number as f32 / 20.0;
        let boats = (0..boats).map(|boat| pose(boat, time_s)).collect();
        TrackSample { time_ns: i64::from(number) * 50_000_000, camera: pose(0, time_s), boats }
    };
    let point = |k: u32| PathPoint {
        after_s: 0.1 * k as f32,
        position: [0.0, 80.0 * k as f32, 5.0],
        velocity: [0.0, 800.0, 0.0],
    };
    let path = RoundPath {
        shot: u64::from(second / 2 + 1),
        fired_ns: i64::from(second) * 1_000_000_000,
        points: (0..20).map(point).collect(),
    };
    let rounds = if second.is_multiple_of(2) { vec![path] } else { Vec::new() };
    TrackBlock { samples: (0..20).map(sample).collect(), rounds }
}

/// Ten minutes stay small and are interactive. The times are printed, since a test judges none.
#[test]
fn ten_minutes_with_seven_boats_and_300_rounds_stay_small() {
    let folder = tempfile::tempdir().unwrap();
    let journal = long_run(folder.path());
    let begun = Instant::now();
    expect_code(&bowwave(["review", journal.to_str().unwrap()]), 0);
    let made_s = begun.elapsed().as_secs_f64();
    let page = folder.path().join("review-1.html");
    let bytes = fs::metadata(&page).unwrap().len();
    println!("made in {made_s:.2} s, {:.1} MB", bytes as f64 / 1e6);
    assert!(bytes < 30_000_000, "{bytes} bytes");
    let Some(browser) = browser::Browser::open(&page) else { return };
    assert_eq!(browser.number("return document.querySelectorAll('#rounds tr').length"), 300.0);
    assert_eq!(browser.number("return bowwave.run.times.length"), 12000.0);
    let ready_s = browser.number("return performance.getEntriesByName('interactive')[0].startTime") / 1e3;
    let scrub = "const from = performance.now(); for (let i = 0; i < 60; i++) bowwave.clock.set(i * 10); return performance.now() - from";
    let scrub_ms = browser.number(scrub) / 60.0;
    println!("interactive after {ready_s:.2} s, {scrub_ms:.1} ms for each place that is scrubbed to");
    assert!(browser.errors().is_empty());
}

/// The places and attitudes that an ACMI file gives the object of that name, with their times.
fn acmi_places(text: &str, name: &str) -> Vec<(f64, Vec<f64>)> {
    let (mut time_s, mut id, mut places) = (0.0, None, Vec::new());
    for line in text.lines() {
        if let Some(time) = line.strip_prefix('#') {
            time_s = time.parse().unwrap();
            continue;
        }
        let Some((object, properties)) = line.split_once(",T=") else { continue };
        let (place, rest) = properties.split_once(',').unwrap_or((properties, ""));
        if rest.split(',').any(|property| property == format!("Name={name}")) {
            id = Some(object.to_owned());
        }
        if id.as_deref() == Some(object) {
            places.push((time_s, place.split('|').map(|number| number.parse().unwrap()).collect()));
        }
    }
    places
}

#[test]
fn other_programs_get_the_same_places() {
    let run = reviewed();
    let folder = run.page.parent().unwrap().to_str().unwrap();
    let made = |format: &str| {
        let output = bowwave(["review", folder, "--format", format]);
        expect_code(&output, 0);
        fs::read_to_string(String::from_utf8(output.stdout).unwrap().trim()).unwrap()
    };
    let tracks = read_tracks(&run.page.with_file_name("hits.sqlite"), RunSelection::Latest).unwrap().tracks;
    let acmi = made("acmi");
    assert!(
        acmi.starts_with("FileType=text/acmi/tacview\nFileVersion=2.2\n0,ReferenceTime=20"),
        "{acmi:.200}"
    );
    let places = acmi_places(&acmi, "passer-by");
    assert_eq!(places.len(), tracks.samples.len());
    for (sample, (time_s, place)) in tracks.samples.iter().zip(&places) {
        let pose = sample.boats[1].unwrap();
        let at = DVec3::new(place[0] * 111_319.491, place[1] * 110_574.276, place[2]);
        assert!(at.distance(vector(pose.position)) < 0.01, "{time_s}: {at}");
        // Attitude put together again: heading clockwise, pitch with the bow up, roll with starboard down.
        let [roll, pitch, heading] = [place[3], place[4], place[5]].map(f64::to_radians);
        let turn = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2 - heading)
            * DQuat::from_rotation_y(-pitch)
            * DQuat::from_rotation_x(roll);
        let truth = DQuat::from_array(pose.attitude.map(f64::from)).normalize();
        assert!(turn.angle_between(truth) < 2e-3, "{time_s}: {turn} {truth}");
    }
    assert_eq!(acmi.matches("Type=Projectile+Bullet").count(), tracks.rounds.len());
    let lines: Vec<Value> = made("jsonl").lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let csv = made("csv");
    assert_eq!(csv.lines().count(), lines.len() + 1);
    assert!(csv.starts_with("time_s,kind,name,east_m,north_m,up_m,qx,qy,qz,qw,words\n"), "{csv:.100}");
    let boats = lines.iter().filter(|line| line["kind"] == "boat" && line["name"] == "hulk <&>");
    assert_eq!(boats.count(), tracks.samples.len());
    let rounds: usize = tracks.rounds.iter().map(|path| path.points.len()).sum();
    assert_eq!(lines.iter().filter(|line| line["kind"] == "round").count(), rounds);
    let again = bowwave(["review", folder, "--format", "csv", "--out", run.page.to_str().unwrap()]);
    expect_code(&again, 1);
    assert!(said(&again).contains("is there already"), "{}", said(&again));
}
