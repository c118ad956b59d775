//! Instructors work with the page.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod support;

use std::time::{Duration, Instant};

use bowwave_core::{
    act::Act,
    engagement::Engagement,
    model::Zone,
    order::Order,
    side::Side,
    time::Time,
    world::score::{Outcome, ShotRecord},
};
use bowwave_link::ToDaemon;
use bowwave_record::{Journal, Run, RunSelection};
use bowwave_review::ScoredRun;
use serde_json::json;
use support::{Page, Server, memory_mb, trainer::FakeTrainer};

fn in_control(server: &Server, token: &str) -> (String, Page) {
    let cookie = server.login(token);
    let mut page = server.page(Some(&cookie));
    page.say(r#"{"kind":"take_control"}"#);
    page.wait_for("control", |news| news["is_own"] == true);
    (cookie, page)
}

fn wait_until(what: &str, test: impl Fn() -> bool) {
    let begun = Instant::now();
    while !test() {
        assert!(begun.elapsed() < Duration::from_secs(20), "{what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn only_who_has_control_orders_and_all_are_shown_who() {
    let server = Server::start();
    let boris = server.tokens.add("boris").unwrap();
    std::thread::sleep(Duration::from_millis(1300));
    let free = r#"{"kind":"order","order":{"order":"rules","rules":"free"}}"#;
    let mut watcher = server.page(None);
    watcher.wait_for("link", |news| news["joined"] == true);
    watcher.say(r#"{"kind":"take_control"}"#);
    assert!(watcher.wait("refused")["words"].as_str().unwrap().contains("log in"));
    watcher.say(free);
    watcher.wait("refused");

    let (_, mut anna) = in_control(&server, &server.anna);
    watcher.wait_for("control", |news| news["holder"] == "anna" && news["is_own"] == false);
    anna.say(free);
    anna.say(r#"{"kind":"act","act":{"identify":"hostile"}}"#);
    anna.wait_for("status", |news| news["status"]["rules"] == "free");
    let trainer = server.trainer.as_ref().unwrap();
    wait_until("the call arrives", || {
        trainer.received().iter().any(|message| matches!(message, ToDaemon::Act { act: Act::Identify(_) }))
    });

    let (_, mut boris) = in_control(&server, &boris);
    anna.wait_for("notice", |news| news["words"] == "boris took control from anna");
    anna.wait_for("control", |news| news["holder"] == "boris" && news["is_own"] == false);
    anna.say(r#"{"kind":"order","order":{"order":"stoppage"}}"#);
    assert!(anna.wait("refused")["words"].as_str().unwrap().contains("boris has control"));
    boris.say(r#"{"kind":"hand_back"}"#);
    watcher.wait_for("control", |news| news["holder"].is_null());
    let rules = Order::Rules { rules: Engagement::Free };
    let received = trainer.received();
    assert_eq!(
        received.iter().filter(|message| **message == ToDaemon::Order { order: rules.clone() }).count(),
        1
    );
    assert!(!received.contains(&ToDaemon::Order { order: Order::Stoppage }));
}

#[test]
fn scenarios_are_saved_started_and_reset() {
    let server = Server::start();
    let (cookie, mut page) = in_control(&server, &server.anna);
    page.wait_for("link", |news| news["joined"] == true);
    let cookie = Some(cookie.as_str());
    page.say(r#"{"kind":"reset"}"#);
    assert!(page.wait("refused")["words"].as_str().unwrap().contains("start one"));
    let text = server.ask("GET", "/api/scenarios/built-in/dusk-patrol", cookie, "").body;
    assert_eq!(server.ask("PUT", "/api/scenarios/own/mine", cookie, &text).status, 200);
    assert_eq!(server.ask("PUT", "/api/scenarios/built-in/mine", cookie, &text).status, 403);
    assert_eq!(server.ask("PUT", "/api/scenarios/own/other", cookie, "boat = 1").status, 422);
    let list = server.ask("GET", "/api/scenarios", cookie, "").body;
    assert!(list.contains(r#""name":"mine","origin":"own","title":"Dusk patrol""#), "{list}");
    let checked = server.ask("POST", "/api/check", cookie, "seed = \"x\"\n").body;
    assert!(checked.contains(r#""line":1"#), "{checked}");

    let started = server.ask("POST", "/api/start/night/mine", cookie, &text);
    assert!(started.status == 200 && started.body.contains("-20 degrees, not -3"), "{}", started.body);
    let first = page.wait_for("status", |news| news["status"]["scenario"] == "Dusk patrol");
    assert_eq!(first["status"]["is_paused"], true);
    assert_eq!(server.ask("POST", "/api/start/noon/mine", cookie, &text).status, 404);
    assert_eq!(server.ask("POST", "/api/start/night/mine", cookie, "boat = 1").status, 422);
    let session = first["status"]["session"].as_u64().unwrap();
    page.say(r#"{"kind":"reset"}"#);
    page.wait_for("status", |news| news["status"]["session"].as_u64() == Some(session + 1));
    page.say(r#"{"kind":"stand_by"}"#);
    page.wait_for("status", |news| news["status"]["stands_by"] == true);
    let join = json!({"kind": "order", "order": {"order": "join", "boat": "none", "at": null}});
    page.say(&join.to_string());
    page.wait_for("notice", |news| news["words"].as_str().unwrap().contains("the trainer refuses"));

    let watcher = server.page(None);
    for (method, path) in [("PUT", "/api/scenarios/own/mine"), ("POST", "/api/start/night/mine")] {
        assert_eq!(server.ask(method, path, None, &text).status, 401);
        let other = server.login(&server.anna);
        assert_eq!(server.ask(method, path, Some(&other), &text).status, 403, "a session without control");
    }
    drop(watcher);
}

#[test]
fn pictures_come_to_many_watchers_and_a_slow_one_holds_nobody_up() {
    let server = Server::start();
    let wants = r#"{"kind":"pictures","on":true}"#;
    let trainer = server.trainer.as_ref().unwrap();
    let mut first = server.page(None);
    first.wait_for("link", |news| news["joined"] == true);
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(trainer.pictures(), 0, "nobody looks");
    // One asks and never says that it has drawn.
    let mut slow = server.page(None);
    slow.say(wants);
    let mut pages: Vec<Page> = (0..10).map(|_| server.page(None)).collect();
    let begun = Instant::now();
    let threads: Vec<_> = pages
        .drain(..)
        .map(|mut page| {
            std::thread::spawn(move || {
                let (mut ages, mut last) = (Vec::new(), 0);
                page.say(wants);
                while begun.elapsed() < Duration::from_secs(4) {
                    let (age_us, frame, jpeg) = page.picture();
                    assert!(frame > last && jpeg.starts_with(&[0xff, 0xd8]));
                    last = frame;
                    ages.push(age_us);
                    page.say(&json!({"kind": "drawn", "frame": frame}).to_string());
                }
                ages
            })
        })
        .collect();
    std::thread::sleep(Duration::from_secs(3));
    let memory = memory_mb();
    let mut ages: Vec<u64> = threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect();
    ages.sort_unstable();
    let at = |share: f64| ages[(ages.len() as f64 * share) as usize] as f64 / 1e3;
    println!(
        "{} pictures to 10 watchers in 4 s; age median {:.1} ms, p95 {:.1} ms; {memory} MB with trainer and watchers",
        ages.len(),
        at(0.5),
        at(0.95)
    );
    assert!(ages.len() > 100, "{} pictures", ages.len());
    assert!(at(0.5) < 500.0);
    let taken = trainer.pictures();
    std::thread::sleep(Duration::from_millis(500));
    assert!(trainer.pictures() <= taken + 2, "nobody looks any longer");
    drop(slow);
}

#[test]
fn a_trainer_that_is_started_again_is_joined_again() {
    let mut server = Server::start();
    let mut page = server.page(None);
    page.wait("status");
    server.trainer = None;
    page.wait_for("link", |news| news["joined"] == false);
    let (_, mut anna) = in_control(&server, &server.anna);
    anna.say(r#"{"kind":"order","order":{"order":"pause"}}"#);
    assert!(anna.wait("refused")["words"].as_str().unwrap().contains("trainer is lost"));
    server.trainer = Some(FakeTrainer::start(&server.socket, None).unwrap());
    page.wait_for("link", |news| news["joined"] == true);
    page.wait("status");
}

#[test]
fn control_lapses_where_its_holder_is_gone() {
    let server = Server::with(true, |options| options.limits.control_lapses = Duration::from_millis(1500));
    let mut watcher = server.page(None);
    let (_, mut anna) = in_control(&server, &server.anna);
    watcher.wait_for("control", |news| news["holder"] == "anna");
    std::thread::sleep(Duration::from_secs(3));
    anna.say(r#"{"kind":"order","order":{"order":"pause"}}"#);
    anna.wait_for("status", |news| news["status"]["is_paused"] == true);
    drop(anna);
    watcher.wait_for("notice", |news| news["words"] == "anna is gone: nobody has control");
    watcher.wait_for("control", |news| news["holder"].is_null());
}

#[test]
fn errors_of_the_journal_are_words() {
    let mut server = Server::with(false, |_| {});
    let journal = server.folder.path().join("missing.sqlite");
    let cookie = server.login(&server.anna);
    let runs = server.ask("GET", "/api/runs", Some(&cookie), "");
    assert!(runs.status == 404 && runs.body.contains("no journal"), "{}", runs.body);
    server.trainer = Some(FakeTrainer::start(&server.socket, Some(&journal)).unwrap());
    let mut page = server.page(Some(&cookie));
    let score = page
        .wait_for("score", |news| news["error"].as_str().is_some_and(|e| e.contains("there is no journal")));
    assert!(score["score"].is_null());
    for path in ["/api/runs", "/review/1"] {
        let answer = server.ask("GET", path, Some(&cookie), "");
        assert!(answer.status == 404 && answer.body.contains("no journal"), "{path} {}", answer.body);
        assert_eq!(server.ask("GET", path, None, "").status, 401);
    }
}

#[test]
fn score_runs_and_reviews_are_those_of_the_journal() {
    let mut server = Server::with(false, |_| {});
    let path = server.folder.path().join("hits.sqlite");
    let run = Run { scenario: "first".to_owned(), ..Run::default() };
    Journal::open(&path, &run).unwrap().finish().unwrap();
    let run = Run { scenario: "second".to_owned(), ..run };
    let journal = Journal::open(&path, &run).unwrap();
    let time = Time::from_ns(5_000_000_000);
    let (range_m, point) = (300.0, Default::default());
    let outcome = Outcome::Hit {
        boat: "skiff".to_owned(),
        side: Some(Side::Hostile),
        zone: Zone::Helm,
        time,
        range_m,
        point,
    };
    let (muzzle, bore) = (Default::default(), Default::default());
    let shot = ShotRecord { shot: 1, fired: time, muzzle, bore, pose_age_ns: 0, outcome };
    journal.shot(&shot).unwrap();
    server.trainer = Some(FakeTrainer::start(&server.socket, Some(&path)).unwrap());
    // The trainer still has it open.
    let mut page = server.page(None);
    let score = page.wait_for("score", |news| news["score"]["rounds"]["hits"] == 1);
    let expected = ScoredRun::read(&path, RunSelection::Latest).unwrap();
    assert_eq!(score["score"], serde_json::to_value(&expected.sheet).unwrap());
    assert_eq!((score["run"].as_i64(), score["finished"].as_bool()), (Some(2), Some(false)));
    let status = page.wait("status");
    assert!(status["status"]["journal"].is_null(), "no path for everybody");

    let cookie = server.login(&server.anna);
    let runs = server.ask("GET", "/api/runs", Some(&cookie), "").body;
    let runs: serde_json::Value = serde_json::from_str(&runs).unwrap();
    let list = runs["runs"].as_array().unwrap();
    assert_eq!(
        (list.len(), &list[0]["scenario"], &list[1]["scenario"]),
        (2, &json!("second"), &json!("first"))
    );
    let review = server.ask("GET", "/review/2", Some(&cookie), "");
    assert!(review.status == 200 && review.body.contains("<title>second - run 2</title>"));
    assert!(review.head.contains("content-security-policy: sandbox allow-scripts; default-src 'none'"));
    let missing = server.ask("GET", "/review/3", Some(&cookie), "");
    assert!(missing.status == 404 && missing.body.contains('3'), "{}", missing.body);
    journal.finish().unwrap();
    page.wait_for("score", |news| news["finished"] == true);
}
