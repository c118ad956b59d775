//! Several runs on one page.

use std::{fs, path::Path};

use bowwave_core::{
    time::Time,
    world::score::{Outcome, ShotRecord},
};
use bowwave_record::{Journal, Run};
use bowwave_tests::{bowwave, expect_code, said};
use glam::DVec3;
use serde_json::Value;

use crate::{browser::Browser, numbers, reviewed};

/// Appends a run with so many rounds to a journal.
fn append(journal: &Path, scenario: &str, started_wall_ns: Option<i64>, rounds: u64) {
    let run = Run { scenario: scenario.to_owned(), started_wall_ns, ..Run::default() };
    let journal = Journal::open(journal, &run).unwrap();
    for shot in 1..=rounds {
        let fired = Time::from_ns(shot as i64 * 1_000_000_000);
        let outcome = Outcome::Miss { boat: None, miss_m: 9.0, time: fired, range_m: 300.0 };
        let (muzzle, bore) = (DVec3::Z * 6.0, DVec3::Y);
        journal.shot(&ShotRecord { shot, fired, muzzle, bore, pose_age_ns: 0, outcome }).unwrap();
    }
    journal.finish().unwrap();
}

/// Cells of the page: run, place in its score, value and text.
fn cells(page: &str) -> Vec<(usize, &str, &str, &str)> {
    page.split("data-run=\"")
        .skip(1)
        .filter_map(|rest| {
            let (run, rest) = rest.split_once("\" data-score=\"")?;
            let (pointer, rest) = rest.split_once('"')?;
            let (value, rest) = rest.strip_prefix(" data-value=\"")?.split_once("\">")?;
            Some((run.parse().ok()?, pointer, value, rest.split_once('<')?.0))
        })
        .collect()
}

fn score(journal: &str, run: &str) -> Value {
    serde_json::from_slice(&bowwave(["score", journal, "--run", run, "--json"]).stdout).unwrap()
}

#[test]
fn each_number_of_several_runs_is_that_of_their_scores() {
    let run = reviewed();
    let folder = tempfile::tempdir().unwrap();
    let other = folder.path().join("hits.sqlite");
    append(&other, "<First>", None, 3);
    append(&other, "Second", Some(1_000_000_000_000_000_000), 5);
    // Its clock was set back.
    append(&other, "Third", Some(900_000_000_000_000_000), 4);
    let (one, other) = (run.page.parent().unwrap().to_str().unwrap(), other.to_str().unwrap());
    let path = folder.path().join("several.html");
    let made = bowwave(["review", other, one, "--all-runs", "--out", path.to_str().unwrap()]);
    expect_code(&made, 0);
    let page = fs::read_to_string(&path).unwrap();
    // The clock of the first was not set: its journal's next run stands for it.
    let scores = [score(other, "1"), score(other, "2"), score(other, "3"), run.score.clone()];
    assert!(page.find("&lt;First&gt;</td>") < page.find("Second</td>"), "their order");
    assert!(page.find("Second</td>") < page.find("Third</td>"), "their order");
    assert!(page.find("Third</td>") < page.find("One hulk</td>"), "their order");
    let shown = cells(&page);
    assert!(shown.len() > 60, "{}", shown.len());
    for (run, pointer, value, text) in &shown {
        let number = scores[*run].pointer(pointer).unwrap();
        assert_eq!(number.to_string(), *value, "run {run}: {pointer}");
        let digits = text.split_once('.').map_or(0, |(_, digits)| digits.len());
        assert_eq!(format!("{:.digits$}", number.as_f64().unwrap()), *text, "run {run}: {pointer}");
    }
    for (run, score) in scores.iter().enumerate() {
        let mut all = Vec::new();
        numbers(score, String::new(), &mut all);
        let of_run = |pointer: &str| shown.iter().any(|(i, at, ..)| *i == run && *at == pointer);
        // Boats, breaches and single rounds are on the run's own page; parts of points are measured by the most.
        let is_elsewhere = |at: &str| {
            ["/boats", "/breaches", "/explained", "/version"].iter().any(|part| at.starts_with(part))
                || at.ends_with("/of")
                || at.contains("/mean_mrad")
        };
        let missing: Vec<_> = all.iter().filter(|(at, _)| !is_elsewhere(at) && !of_run(at)).collect();
        assert!(missing.is_empty(), "run {run}: {missing:?}");
    }
    assert!(page.contains("of different scenarios") && page.contains("clock was not set"), "what differs");
}

#[test]
fn a_browser_shows_several_runs_and_hides_one() {
    let run = reviewed();
    let folder = tempfile::tempdir().unwrap();
    let other = folder.path().join("hits.sqlite");
    append(&other, "Other", None, 2);
    let one = run.page.parent().unwrap().to_str().unwrap();
    let path = folder.path().join("several.html");
    expect_code(&bowwave(["review", one, other.to_str().unwrap(), "--out", path.to_str().unwrap()]), 0);
    let Some(browser) = Browser::open(&path) else { return };
    let drawn = "return document.querySelectorAll('.misses .plot .run-0 path').length";
    let score = &run.score["explained"];
    let aimed = score.as_array().unwrap().iter().filter(|round| round["was_aimed"] == true).count();
    assert!(browser.number(drawn) > 0.6 * aimed as f64, "{aimed}");
    browser.keys("[data-run-shown='0']", " ");
    let display = "return getComputedStyle(document.querySelector('.misses .plot .run-0')).display";
    assert_eq!(browser.run(display), "none");
    browser.run("const theme = document.getElementById('theme'); theme.value = 'night'; theme.dispatchEvent(new Event('change'))");
    assert_eq!(browser.run("return document.documentElement.dataset.obcTheme"), "night");
    browser.click("#run-1 a");
    browser.wait("return location.pathname.endsWith('/review-1.html') && typeof bowwave === 'object'");
    assert!(browser.errors().is_empty());
}

#[test]
fn what_cannot_be_compared_is_said() {
    let run = reviewed();
    let folder = tempfile::tempdir().unwrap();
    let other = folder.path().join("hits.sqlite");
    append(&other, "Other", None, 2);
    let (one, other) = (run.page.parent().unwrap().to_str().unwrap(), other.to_str().unwrap());
    for (arguments, words) in [
        (vec!["review", one, other, "--format", "csv"], "--format csv is of one run, and 2 are named"),
        (vec!["review", one, other, "--run", "1"], "--run names runs of one journal, and 2 are named"),
        (vec!["review", other, "--run", "1,7"], "run 7"),
    ] {
        let refused = bowwave(arguments);
        expect_code(&refused, 1);
        assert!(said(&refused).contains(words), "{}", said(&refused));
    }
}
