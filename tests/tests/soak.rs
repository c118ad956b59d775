//! Hours of training with a fault every half minute: nothing leaks, every fault is ridden out, every round is kept.
//! `BOWWAVE_SOAK_HOURS` says how many hours of simulated time; without it, a few minutes.

use bowwave_record::journal::{RunSelection, ShotFilter, read_shots};
use bowwave_tests::{bowwave, expect_code, play, small_recipe};
use hw_sim::make::{self, Burst, Recipe};

const SCENARIO: &str = include_str!("../data/soak.toml");

#[test]
fn hours_with_a_fault_every_half_minute() {
    let hours: f64 =
        std::env::var("BOWWAVE_SOAK_HOURS").map_or(0.1, |text| text.parse().expect("hours as a number"));
    let folder = tempfile::tempdir().expect("a folder");
    let recording = folder.path().join("soak.mcap");
    let trigger = vec![Burst { start_s: 1.0, length_s: 1.5 }];
    let recipe = Recipe { duration_s: 12.0, trigger, ..small_recipe() };
    make::make(&recipe, &recording, &mut |_, _| {}).expect("the recording is made");
    let scenario = folder.path().join("soak.toml");
    std::fs::write(&scenario, SCENARIO).expect("written");
    let out = folder.path().join("out");
    let seconds = (hours * 3600.0).round();
    let arguments = [
        "--duration",
        &seconds.to_string(),
        "--fault-every",
        "30",
        "--seed",
        "7",
        "--scenario",
        scenario.to_str().expect("a plain path"),
    ];
    // Pictures of hours fill a disk: a run of minutes is recorded and must come out the same from its recording.
    let records = hours <= 0.5;
    let further: Vec<&str> = arguments.into_iter().chain(records.then_some("--record")).collect();
    let summary = play(&recording, &out, 0, &further);
    if records {
        let replayed =
            bowwave(["replay".as_ref(), out.join("recording.mcap").as_os_str(), "--json".as_ref()]);
        expect_code(&replayed, 0);
        let replayed: serde_json::Value = serde_json::from_slice(&replayed.stdout).expect("JSON");
        for key in ["records_digest", "scenes_digest"] {
            assert_eq!(replayed[key], summary[key], "{key}");
        }
    }
    println!("{}", serde_json::to_string_pretty(&summary).expect("JSON"));

    let count = |name: &str| summary["counts"][name].as_u64().expect(name);
    assert_eq!(summary["frames"].as_f64(), Some(seconds * 30.0));
    assert!(count("faults_judged") as f64 >= seconds / 30.0 - 2.0, "{}", count("faults_judged"));
    assert_eq!(count("faults_recovered"), count("faults_judged"), "every fault is ridden out");
    assert!(count("faults_to_be_seen") > 0);
    assert_eq!(count("faults_seen"), count("faults_to_be_seen"), "every fault that matters is told");

    let memory = |key: &str| summary["memory"][key].as_f64().expect(key);
    let (early, late) = (memory("early_mb"), memory("late_mb"));
    assert!(late <= early * 1.05, "memory grew from {early} to {late} MB");

    let journal = out.join("hits.sqlite");
    let mut numbers = Vec::new();
    let filter = ShotFilter { runs: RunSelection::Latest, hits_only: false };
    let kept = read_shots(&journal, &filter).expect("the journal opens");
    for shot in kept {
        numbers.push(shot.record.shot);
    }
    let shots = summary["shots"].as_u64().expect("shots");
    assert!(shots as f64 >= seconds / 12.0 * 10.0, "{shots}");
    assert_eq!(numbers, (1..=shots).collect::<Vec<_>>(), "each round once, none missing");
}
