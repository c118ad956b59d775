//! `bowwave review`: the page says what journal and score say, and opens in a browser without any other file.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod browser;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

use bowwave_record::{RunSelection, read_tracks};
use bowwave_tests::{bowwave, expect_code, program, said, write};
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

/// The value that the page has for each place in the score.
fn cells(page: &str) -> BTreeMap<&str, &str> {
    page.split("data-score=\"")
        .skip(1)
        .filter_map(|rest| {
            let (pointer, rest) = rest.split_once('"')?;
            let value =
                rest.strip_prefix(" data-value=\"").and_then(|rest| rest.split_once('"')).map(|(v, _)| v);
            Some((pointer, value?))
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
            Some(shown) => assert_eq!(*shown, value.to_string(), "{pointer}"),
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

/// Places of a boat and of a round in the view that is moved, against the journal.
#[test]
fn a_browser_shows_boats_and_rounds_where_the_journal_has_them() {
    let run = reviewed();
    let Some(browser) = browser::Browser::open(&run.page) else { return };
    let journal = run.page.with_file_name("hits.sqlite");
    let tracks = read_tracks(&journal, RunSelection::Latest).unwrap().tracks;
    let begin = browser.number("return bowwave.run.times[0]");
    assert!(begin.abs() < 1e-9, "{begin}");
    let first = tracks.samples[0].time_ns;
    let mut compared = 0;
    for sample in tracks.samples.iter().step_by(17) {
        let time_s = (sample.time_ns - first) as f64 * 1e-9;
        browser.run(&format!("bowwave.clock.set({time_s}); bowwave.view.setMode('above', null)"));
        for (boat, pose) in sample.boats.iter().enumerate() {
            let Some(pose) = pose else { continue };
            for (axis, truth) in pose.position.iter().enumerate() {
                let drawn = browser.number(&format!("return bowwave.view.drawnAt({boat})[{axis}]"));
                assert!(
                    (drawn - f64::from(*truth)).abs() < 0.01,
                    "boat {boat} at {time_s} s: {drawn} {truth}"
                );
                compared += 1;
            }
        }
    }
    assert!(compared > 30, "{compared}");
    for (i, path) in tracks.rounds.iter().enumerate().step_by(3) {
        let [a, b] = [&path.points[0], &path.points[1]];
        let round = format!("bowwave.run.rounds.find((r) => r.shot === {})", path.shot);
        for point in [a, b] {
            let at = format!("{round}.at({round}.fired_s + {})", point.after_s);
            for (axis, truth) in point.position.iter().enumerate() {
                let drawn = browser.number(&format!("return {at}[{axis}]"));
                assert!((drawn - f64::from(*truth)).abs() < 0.01, "round {i}: {drawn} {truth}");
            }
        }
    }
    assert!(!tracks.rounds.is_empty());
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
    // What a drag moves is the viewpoint.
    browser.click("[data-view=free]");
    let before = browser.number("return bowwave.view.camera.position.x + bowwave.view.camera.position.y");
    browser.run("const c = document.getElementById('view'); c.focus(); for (const t of ['keydown']) c.dispatchEvent(new KeyboardEvent(t, {code: 'ArrowLeft', bubbles: true}))");
    let moved = browser.number("return bowwave.view.camera.position.x + bowwave.view.camera.position.y");
    assert!((moved - before).abs() > 1e-6, "{before} {moved}");
    let shown = browser.number("return document.querySelectorAll('#events tr[aria-current=true]').length");
    assert_eq!(shown, 1.0);
    let errors = browser.errors();
    assert!(errors.is_empty(), "{errors:?}");
}
