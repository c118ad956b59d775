//! `kill -9` at random moments of a run that shoots at full speed: every round whose commit was reported is in the journal,
//! none twice.
//!
//! The test starts itself again as the program that shoots. `BOWWAVE_KILLS` says how often (20 unless told).

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

use std::{
    collections::BTreeSet,
    env,
    io::{Read, Write},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::Duration,
};

use bowwave_core::{
    model::Zone,
    time::Time,
    world::{
        scenario::Side,
        score::{Outcome, ShotRecord},
    },
};
use bowwave_record::{Journal, JournalError, Run, RunSelection, ShotFilter, read_runs, read_shots};
use glam::DVec3;

const SHOOT: &str = "--shoot-into";

fn main() {
    let arguments: Vec<_> = env::args_os().collect();
    if let [_, flag, path] = &arguments[..]
        && flag == SHOOT
    {
        return shoot(Path::new(path));
    }
    // What else a test runner may pass (filters, --nocapture) changes nothing here; --list has nothing to say.
    if arguments.iter().any(|argument| argument == "--list") {
        return;
    }
    let kills =
        env::var("BOWWAVE_KILLS").ok().map_or(20, |text| text.parse().expect("BOWWAVE_KILLS is a number"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let mut reported = 0;
    let mut stored = 0;
    for kill in 0..kills {
        let (run, numbers) = shoot_and_kill(&path, kill);
        let (found, hits) = check(&path, run, &numbers);
        reported += hits;
        stored += found;
    }
    assert!(reported > 0, "no shot was ever reported committed");
    assert_eq!(
        read_shots(&path, &ShotFilter::default()).unwrap().len(),
        stored,
        "an earlier run has changed"
    );
    assert!(read_runs(&path).unwrap().iter().all(|run| !run.finished));
    println!(
        "{kills} kills: {reported} shots reported committed, all there, none twice; {stored} in the journal"
    );
}

/// Shoots for ever; prints the run, then the number of each round once it is committed.
fn shoot(path: &Path) {
    let journal = Journal::open(path, &Run::default()).unwrap();
    assert_eq!(journal.quarantined(), None, "a killed run left a damaged journal");
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}", journal.run()).unwrap();
    out.flush().unwrap();
    let mut number = 1;
    loop {
        match journal.shot(&shot(number)) {
            Ok(()) => number += 1,
            Err(JournalError::QueueFull { .. }) => std::thread::sleep(Duration::from_micros(200)),
            Err(error) => panic!("{error}"),
        }
        for committed in journal.commits().try_iter() {
            writeln!(out, "{committed}").unwrap();
        }
        out.flush().unwrap();
    }
}

fn shot(number: u64) -> ShotRecord {
    let time = Time::from_ns(number.cast_signed() * 1_000);
    ShotRecord {
        shot: number,
        fired: time,
        muzzle: DVec3::new(0.0, 0.5, 3.0),
        bore: DVec3::Y,
        pose_age_ns: 0,
        outcome: Outcome::Hit {
            boat: "skiff".to_owned(),
            side: Some(Side::Hostile),
            zone: Zone::Engine,
            time,
            range_m: 300.0,
            point: DVec3::ZERO,
        },
    }
}

/// Runs the shooting program for a while that differs each time, kills it, and gives its run and what it had reported.
fn shoot_and_kill(path: &PathBuf, kill: u64) -> (i64, Vec<u64>) {
    let mut child = Command::new(env::current_exe().unwrap())
        .arg(SHOOT)
        .arg(path)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut out = child.stdout.take().unwrap();
    // The pipe is emptied meanwhile, so that printing never holds the shooting up.
    let reader = std::thread::spawn(move || {
        let mut text = String::new();
        out.read_to_string(&mut text).map(|_| text)
    });
    // Spread over 5 to 124 ms by the golden ratio, with the scheduler's own randomness on top.
    let spread = (kill as f64 * 0.618_033_988_749_895).fract();
    std::thread::sleep(Duration::from_micros(5_000 + (spread * 119_000.0) as u64));
    // On Unix this is SIGKILL.
    child.kill().unwrap();
    let status = child.wait().unwrap();
    assert!(!status.success() && status.code().is_none(), "it ended by itself: {status}");
    let text = reader.join().unwrap().unwrap();
    // A line without its end was cut by the kill.
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    let mut lines = whole.lines().map(|line| line.parse::<u64>().unwrap());
    let run = lines.next().map_or(0, u64::cast_signed);
    (run, lines.collect())
}

/// How many rounds of the run are in the journal, and how many of them had been reported.
fn check(path: &Path, run: i64, reported: &[u64]) -> (usize, usize) {
    if run == 0 {
        // Killed before it could say which run it was; it may have begun one all the same.
        assert!(reported.is_empty());
        return (0, 0);
    }
    let filter = ShotFilter { runs: RunSelection::Run(run), hits_only: false };
    let shots = read_shots(path, &filter).unwrap();
    let numbers: BTreeSet<u64> = shots.iter().map(|stored| stored.record.shot).collect();
    assert_eq!(numbers.len(), shots.len(), "run {run}: a shot is there twice");
    for number in reported {
        assert!(numbers.contains(number), "run {run}: shot {number} was reported committed and is not there");
    }
    for stored in &shots {
        assert_eq!(stored.record, shot(stored.record.shot), "run {run}: another shot than was fired");
    }
    let distinct: BTreeSet<u64> = reported.iter().copied().collect();
    assert_eq!(distinct.len(), reported.len(), "run {run}: a shot was reported twice");
    // Rounds are committed in order: no gap.
    assert_eq!(numbers.last().copied().unwrap_or(0), numbers.len() as u64, "run {run}: a gap");
    (shots.len(), reported.len())
}
