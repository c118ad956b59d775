//! The program that shoots: what is recorded.

use std::{
    fs::OpenOptions,
    io::{self, Write},
    os::unix::fs::FileExt,
    path::Path,
    time::Duration,
};

use bowwave_core::{
    model::Zone,
    time::Time,
    world::{
        scenario::Side,
        score::{NotScored, Outcome, ShotRecord},
    },
};
use bowwave_record::{Journal, JournalOptions, Run};
use glam::DVec3;
use rustix::process::{Resource, Rlimit, setrlimit};

pub const FLAG: &str = "--shoot-into";
pub const NAME: &str = "hits.sqlite";
pub const PHASES: u64 = 7;
/// It ends as a crash does: its log is left behind.
pub const PHASE_ABORTED: u64 = 1;
/// The database is damaged before it starts.
const PHASE_DAMAGED: u64 = 3;
/// The database is damaged while it runs.
const PHASE_DAMAGED_INSIDE: u64 = 4;
/// Every eleventh sync fails, and the system forgets what it was to write.
pub const PHASE_SYNCS_FAIL: u64 = 5;
const ROUNDS: u64 = 40;

/// As the gun computer has it, but small, so that everything happens within a few rounds.
pub const OPTIONS: JournalOptions = JournalOptions {
    reserve_bytes: 64 << 10,
    checkpoint_pages: 20,
    own: true,
    end_within: Duration::from_millis(700),
};

/// The round of that number.
pub fn shot(number: u64) -> ShotRecord {
    let time = Time::from_ns(number.cast_signed() * 100_000_000);
    let outcome = match number % 3 {
        0 => {
            let boat = format!("skiff {}", "x".repeat(number as usize % 300));
            Outcome::Hit {
                boat,
                side: Some(Side::Neutral),
                zone: Zone::ALL[0],
                time,
                range_m: 312.25,
                point: DVec3::new(1.5, -0.5, 0.25),
            }
        }
        1 => Outcome::Miss { boat: Some("dhow".to_owned()), miss_m: 2.5, time, range_m: number as f64 },
        _ => Outcome::NotScored { cause: NotScored::CameraStale },
    };
    let muzzle = DVec3::new(0.0, 0.5, 3.0);
    ShotRecord { shot: number, fired: time, muzzle, bore: DVec3::Y, pose_age_ns: -1_500_000, outcome }
}

/// One phase: opens the journal, shoots, and ends in its way.
pub fn run(path: &Path, phase: u64) {
    wait_for_go();
    if phase == PHASE_DAMAGED {
        damage(path);
    }
    let run = Run {
        started_wall_ns: None,
        boot_id: Some("2d1c7b3a-0000-4000-8000-000000000001".to_owned()),
        started: Some(Time::from_ns(phase.cast_signed() * 1_000_000_000)),
        ..Run::default()
    };
    let journal = Journal::open_with(path, &run, &OPTIONS).unwrap();
    let first = phase * 1000 + 1;
    for number in first..first + ROUNDS {
        shoot(&journal, &[number]);
        if phase == PHASE_DAMAGED_INSIDE && number == first + ROUNDS / 2 {
            damage_inside(path);
        }
    }
    // A belt that is faster than the disk.
    let burst: Vec<u64> = (first + ROUNDS..first + 2 * ROUNDS).collect();
    shoot(&journal, &burst);
    if phase == PHASE_ABORTED {
        // Meant to crash: an image of its memory would be taken for a defect's.
        let none = Rlimit { current: Some(0), maximum: Some(0) };
        setrlimit(Resource::Core, none).unwrap();
        std::process::abort();
    }
    journal.set_wall_clock(1_795_000_000_000_000_000, Time::from_ns(9_000_000_000)).unwrap();
    assert_eq!(journal.quarantined().is_some(), matches!(phase, PHASE_DAMAGED | PHASE_DAMAGED_INSIDE));
    journal.finish().unwrap();
}

fn shoot(journal: &Journal, numbers: &[u64]) {
    for number in numbers {
        say(&format!("fired {number}"));
        journal.shot(&shot(*number)).unwrap();
    }
    for number in numbers {
        let committed = journal.commits().recv_timeout(Duration::from_secs(60)).unwrap();
        assert_eq!(committed, *number);
        say(&format!("committed {committed}"));
    }
}

/// Whoever started the program watches it from here on.
pub fn wait_for_go() {
    io::stdin().read_line(&mut String::new()).unwrap();
}

/// One line, one write: it is seen among the calls on files.
pub fn say(line: &str) {
    io::stdout().lock().write_all(format!("{line}\n").as_bytes()).unwrap();
}

/// Damage by a failing disk to all pages but the first.
fn damage(path: &Path) {
    say("damage");
    let file = OpenOptions::new().read(true).write(true).open(path).unwrap();
    let length = file.metadata().unwrap().len();
    assert!(length > 2 * 4096, "{length}");
    file.write_all_at(&vec![0xa5; length as usize - 4096], 4096).unwrap();
    file.sync_all().unwrap();
    // Closing it would give up SQLite's locks, which belong to the process.
    std::mem::forget(file);
}

/// The same under a journal that is open, and has it read its pages again.
fn damage_inside(path: &Path) {
    let other = rusqlite::Connection::open(path).unwrap();
    other.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(())).unwrap();
    damage(path);
    let version: i64 = other.query_row("PRAGMA user_version", [], |row| row.get(0)).unwrap();
    other.execute_batch(&format!("PRAGMA user_version = {version}")).unwrap();
}
