//! kill -9 at random moments of a shooting run: every round that was reported committed is there, none twice.
//!
//! 20 kills; `BOWWAVE_KILLS=200` for more.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on has failed")]

use std::{
    collections::BTreeMap,
    io::{BufRead, BufReader},
    path::Path,
    process::{Command, Stdio},
    thread,
    time::Duration,
};

use bowwave_tests::{bowwave, expect_code, program, small_recording};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A gun that fires a hundred times a second, so that a kill meets a transaction.
const SCENARIO: &str = include_str!("../data/kill.toml");

/// Runs until `kill_after` the first commit; gives the numbers that were reported.
fn shoot(scenario: &Path, out: &Path, kill_after: Duration) -> Vec<u64> {
    let mut child = Command::new(program())
        .args(["simulate", "--fast", "--size", "64x64", "--print-commits", "--duration", "600"])
        .arg("--scenario")
        .arg(scenario)
        .arg("--out")
        .arg(out)
        .arg(small_recording())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program runs");
    let mut lines = BufReader::new(child.stdout.take().expect("a pipe")).lines();
    let number = |line: &str| line.strip_prefix("committed ").and_then(|n| n.parse().ok());
    let first = lines.next().expect("it commits before it ends").expect("text");
    let mut numbers: Vec<u64> = vec![number(&first).unwrap_or_else(|| panic!("{first}"))];
    // The moment must not depend on when lines come: a killer of its own.
    let killer = thread::spawn(move || {
        thread::sleep(kill_after);
        child.kill().expect("killed");
        child.wait().expect("reaped")
    });
    // A line that was cut by the kill was not a report.
    numbers.extend(lines.map_while(Result::ok).filter_map(|l| number(&l)));
    killer.join().expect("the killer");
    numbers
}

#[test]
fn no_committed_round_is_lost_and_none_is_invented() {
    let kills: u64 = std::env::var("BOWWAVE_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(20);
    let folder = tempfile::tempdir().expect("a folder");
    let scenario = folder.path().join("shooting.toml");
    std::fs::write(&scenario, SCENARIO).expect("a file");
    let out = folder.path().join("out");
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let (mut reported, mut stored) = (0, 0);
    for kill in 1..=kills {
        let committed = shoot(&scenario, &out, Duration::from_micros(random.random_range(0..600_000)));
        let run = kill.to_string();
        let output = bowwave(["hits", out.to_str().expect("a plain path"), "--json", "--run", &run]);
        expect_code(&output, 0);
        let rows: Vec<serde_json::Value> = serde_json::from_slice(&output.stdout).expect("JSON");
        let mut seen: BTreeMap<u64, u32> = BTreeMap::new();
        for row in &rows {
            *seen.entry(row["shot"].as_u64().expect("a number")).or_default() += 1;
        }
        assert!(seen.values().all(|n| *n == 1), "kill {kill}: a round is there twice");
        for shot in &committed {
            // A line may have been cut in its number: then a shorter number was read, which was committed before.
            assert!(
                seen.contains_key(shot),
                "kill {kill}: round {shot} was reported committed and is not there"
            );
        }
        reported += committed.len();
        stored += rows.len();
    }
    println!(
        "{kills} kills: {reported} rounds reported committed, {stored} in the journal, none lost, none twice"
    );
}
