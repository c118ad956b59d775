//! The journal: what was shot is there, and files that are no journal are named and left alone.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a step that fails ends the test")]

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    time::Duration,
};

use bowwave_core::{
    fault::Fault,
    model::Zone,
    time::Time,
    world::{
        scenario::Side,
        score::{NotScored, Outcome, ShotRecord},
        track::{PathPoint, RoundPath, TrackBlock, TrackPose, TrackSample},
    },
};
use bowwave_record::{
    DirtyEnd, Journal, JournalError, JournalOptions, Run, RunDetails, RunSelection, ShotFilter, StoredShot,
    StoredTracks, boot_id, read_runs, read_shots, read_tracks,
};
use glam::DVec3;
use proptest::prelude::*;

fn run() -> Run {
    Run {
        started_wall_ns: Some(1_795_000_000_000_000_000),
        scenario: "three skiffs".to_owned(),
        recording: "default.mcap".to_owned(),
        seed: u64::MAX,
        version: "0.1.0".to_owned(),
        boot_id: Some("2d1c7b3a-0000-4000-8000-000000000001".to_owned()),
        started: Some(Time::from_ns(4_000_000_000)),
        details: Some("{}".to_owned()),
    }
}

fn shot(number: u64) -> ShotRecord {
    let time = Time::from_ns(5_000_000_000 + number.cast_signed() * 100_000_000);
    let outcome = match number % 3 {
        0 => Outcome::Hit {
            boat: "skiff \"one\", red".to_owned(),
            side: Side::ALL.get(number as usize % 3).copied(),
            zone: Zone::ALL[number as usize % 3],
            time,
            range_m: 312.25,
            point: DVec3::new(1.5, -0.5, 0.25),
        },
        1 => Outcome::Miss { boat: Some("dhow".to_owned()), miss_m: 2.5, time, range_m: 300.0 },
        _ => Outcome::NotScored { cause: NotScored::CameraStale },
    };
    ShotRecord {
        shot: number,
        fired: Time::from_ns(5_000_000_000 + number.cast_signed()),
        muzzle: DVec3::new(0.0, 0.5, 3.0),
        bore: DVec3::new(0.0, 1.0, 0.0),
        pose_age_ns: -1_500_000,
        outcome,
    }
}

fn shoot(path: &Path, shots: &[ShotRecord]) -> i64 {
    let journal = Journal::open(path, &run()).unwrap();
    for shot in shots {
        journal.shot(shot).unwrap();
    }
    let acknowledged: Vec<u64> =
        shots.iter().map(|_| journal.commits().recv_timeout(Duration::from_secs(20)).unwrap()).collect();
    assert_eq!(acknowledged, shots.iter().map(|shot| shot.shot).collect::<Vec<_>>());
    assert_eq!(journal.fault(), None);
    let summary = journal.finish().unwrap();
    assert_eq!(summary.committed, shots.len() as u64);
    summary.run
}

fn all(path: &Path) -> Vec<StoredShot> {
    read_shots(path, &ShotFilter::default()).unwrap()
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn sqlite_is_not_older_than_the_wal_reset_fix() {
    assert!(rusqlite::version_number() >= 3_051_003, "{}", rusqlite::version());
}

#[test]
fn runs_and_shots_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let shots: Vec<_> = (1..=300).map(shot).collect();
    let first = shoot(&path, &shots);
    let second = shoot(&path, &shots[..3]);
    assert_eq!((first, second), (1, 2));
    assert_eq!(names(folder.path()), ["hits.db"], "log and index are gone once it is closed");

    let expected: Vec<_> = shots.iter().map(|record| StoredShot { run: 1, record: record.clone() }).collect();
    assert_eq!(all(&path).len(), 303);
    let of = |runs, hits_only| read_shots(&path, &ShotFilter { runs, hits_only }).unwrap();
    assert_eq!(of(RunSelection::Run(1), false), expected);
    assert_eq!(of(RunSelection::Latest, false).len(), 3);
    let hits = of(RunSelection::Latest, true);
    assert_eq!(hits.iter().map(|stored| stored.record.shot).collect::<Vec<_>>(), [3]);

    let runs = read_runs(&path).unwrap();
    assert_eq!(runs.len(), 2);
    assert_eq!(runs[0].run, run());
    assert_eq!((runs[0].shots, runs[0].hits, runs[0].finished), (300, 100, true));

    let error = read_shots(&path, &ShotFilter { runs: RunSelection::Run(7), hits_only: false }).unwrap_err();
    assert!(error.to_string().contains("has no run 7; its runs: 1 to 2"), "{error}");
}

#[test]
fn a_number_that_is_none_is_kept_as_such() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let outcome =
        Outcome::Miss { boat: None, miss_m: f64::NAN, time: Time::from_ns(-1), range_m: f64::INFINITY };
    let odd = ShotRecord { muzzle: DVec3::new(f64::NAN, 1.0, 2.0), outcome, ..shot(1) };
    shoot(&path, std::slice::from_ref(&odd));
    let stored = &all(&path)[0];
    assert!(stored.record.muzzle.x.is_nan() && stored.record.muzzle.z == 2.0);
    let Outcome::Miss { boat: None, miss_m, range_m, .. } = stored.record.outcome else {
        panic!("{:?}", stored.record.outcome)
    };
    assert!(miss_m.is_nan() && range_m == f64::INFINITY);
    assert_eq!(stored.to_json()["miss_m"], serde_json::Value::Null);
    assert_eq!(stored.to_json()["muzzle_m"][0], serde_json::Value::Null);
}

#[test]
fn a_number_used_twice_is_reported_and_kept_beside() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let journal = Journal::open(&path, &run()).unwrap();
    journal.shot(&shot(1)).unwrap();
    // The very same again is no other round.
    journal.shot(&shot(1)).unwrap();
    journal.shot(&ShotRecord { shot: 1, ..shot(2) }).unwrap();
    journal.shot(&ShotRecord { shot: u64::MAX, ..shot(4) }).unwrap();
    journal.shot(&shot(3)).unwrap();
    let error = journal.finish().unwrap_err();
    let JournalError::Unwritten(unwritten) = error else { panic!("{error}") };
    assert_eq!(unwritten.rows.len(), 2);
    assert!(unwritten.cause.contains("taken by another shot"), "{}", unwritten.cause);
    assert_eq!(names(folder.path()), ["hits.db", "hits.db.unwritten-1.jsonl"]);
    assert_eq!(all(&path).iter().map(|stored| stored.record.clone()).collect::<Vec<_>>(), [shot(1), shot(3)]);
}

#[test]
fn cells_and_json_say_the_same() {
    let stored = StoredShot { run: 4, record: shot(3) };
    let cells: Vec<_> = StoredShot::COLUMNS.into_iter().zip(stored.cells()).collect();
    let cell = |name: &str| &cells.iter().find(|(column, _)| *column == name).unwrap().1;
    assert_eq!(cell("fired_s"), "5.000000003");
    assert_eq!(cell("time_s"), "5.300000000");
    assert_eq!(cell("boat"), "skiff \"one\", red");
    assert_eq!((cell("zone").as_str(), cell("cause").as_str()), ("hull", ""));
    assert_eq!((cell("point_y_m").as_str(), cell("pose_age_ms").as_str()), ("-0.5", "-1.5"));
    let json = stored.to_json();
    assert_eq!(json["fired_ns"], 5_000_000_003_i64);
    assert_eq!(json["range_m"], 312.25);
    assert_eq!(json["cause"], serde_json::Value::Null);
}

#[test]
fn what_lies_at_the_programs_own_path_was_a_journal() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.sqlite");
    let garbage = [0xa5; 8192];
    fs::write(&path, garbage).unwrap();
    let options = JournalOptions { own: true, ..JournalOptions::default() };
    let journal = Journal::open_with(&path, &run(), &options).unwrap();
    let aside = journal.quarantined().unwrap();
    assert!(aside.reason.contains("no database"), "{}", aside.reason);
    assert_eq!(fs::read(aside.kept_as.unwrap()).unwrap(), garbage);
    journal.shot(&shot(1)).unwrap();
    journal.finish().unwrap();
    assert_eq!(read_shots(&path, &ShotFilter::default()).unwrap().len(), 1);
}

#[test]
fn what_is_no_journal_is_named_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("holiday.mp4");
    fs::write(&path, b"\0\0\0 ftypisom and so on").unwrap();
    let error = Journal::open(&path, &run()).err().unwrap();
    assert!(matches!(error, JournalError::NotADatabase { .. }), "{error}");
    assert!(matches!(read_shots(&path, &ShotFilter::default()), Err(JournalError::NotADatabase { .. })));
    assert_eq!(fs::read(&path).unwrap(), b"\0\0\0 ftypisom and so on");

    let path = folder.path().join("other.db");
    rusqlite::Connection::open(&path).unwrap().execute_batch("CREATE TABLE a (b)").unwrap();
    let error = Journal::open(&path, &run()).err().unwrap();
    assert!(matches!(error, JournalError::ForeignDatabase { .. }), "{error}");
    assert!(matches!(read_runs(&path), Err(JournalError::ForeignDatabase { .. })));

    let path = folder.path().join("newer.db");
    shoot(&path, &[shot(1)]);
    rusqlite::Connection::open(&path).unwrap().execute_batch("PRAGMA user_version = 6").unwrap();
    let error = Journal::open(&path, &run()).err().unwrap();
    assert!(matches!(error, JournalError::Newer { found: 6, supported: 5, .. }), "{error}");
    assert!(matches!(read_runs(&path), Err(JournalError::Newer { .. })));

    let error = Journal::open(folder.path(), &run()).err().unwrap();
    assert!(error.to_string().contains(folder.path().to_str().unwrap()), "{error}");
    assert!(matches!(read_runs(folder.path()), Err(JournalError::NotADatabase { .. })));
    let missing = folder.path().join("no/such/hits.db");
    let error = Journal::open(&missing, &run()).err().unwrap();
    assert!(matches!(error, JournalError::Open { .. }), "{error}");
    assert!(matches!(read_runs(&missing), Err(JournalError::Missing { .. })));
    assert!(!names(folder.path()).iter().any(|name| name.contains("corrupt")));
}

#[test]
fn a_journal_that_another_process_holds_is_named_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    shoot(&path, &[shot(1)]);
    let other = rusqlite::Connection::open(&path).unwrap();
    other
        .execute_batch("PRAGMA locking_mode = EXCLUSIVE; BEGIN IMMEDIATE; DELETE FROM shots WHERE 0;")
        .unwrap();
    let error = Journal::open(&path, &run()).err().unwrap();
    assert!(matches!(error, JournalError::Locked { .. }), "{error}");
}

/// A journal of 2000 rounds, as bytes.
fn large(folder: &Path) -> (PathBuf, Vec<u8>) {
    let path = folder.join("hits.db");
    shoot(&path, &(1..=2000).map(shot).collect::<Vec<_>>());
    let bytes = fs::read(&path).unwrap();
    assert!(bytes.len() > 8 * 4096);
    (path, bytes)
}

#[test]
fn a_damaged_journal_is_put_aside_and_a_fresh_one_begun() {
    let folder = tempfile::tempdir().unwrap();
    let (path, bytes) = large(folder.path());
    let mut count = 0;
    for damage in [
        |bytes: &mut Vec<u8>| bytes[4096 * 2..4096 * 5].fill(0xa5),
        |bytes: &mut Vec<u8>| bytes[..4096].fill(0),
        |bytes: &mut Vec<u8>| bytes[16..200].fill(0xff),
        |bytes: &mut Vec<u8>| bytes.truncate(4096 * 4 + 100),
        |bytes: &mut Vec<u8>| bytes.truncate(16),
        |bytes: &mut Vec<u8>| bytes.fill(0),
    ] {
        let mut damaged = bytes.clone();
        damage(&mut damaged);
        fs::write(&path, &damaged).unwrap();
        fs::write(folder.path().join("hits.db-wal"), b"left behind").unwrap();
        count += 1;
        let journal = Journal::open(&path, &run()).unwrap();
        let aside = folder.path().join(format!("hits.db.corrupt-{count}"));
        assert_eq!(journal.quarantined().unwrap().kept_as, Some(aside.clone()));
        assert!(fs::read(&aside).unwrap() == damaged, "kept as it was");
        journal.shot(&shot(1)).unwrap();
        assert_eq!(journal.finish().unwrap().committed, 1);
        assert_eq!(all(&path).len(), 1);
    }
}

/// Version 1 of the tables, as the first Bowwave made them.
const VERSION_1: &str = "
CREATE TABLE runs (
    id INTEGER PRIMARY KEY AUTOINCREMENT, started_wall_ns INTEGER, scenario TEXT NOT NULL, recording TEXT NOT NULL,
    seed TEXT NOT NULL, version TEXT NOT NULL, finished INTEGER NOT NULL DEFAULT 0 CHECK (finished IN (0, 1))
) STRICT;
CREATE TABLE shots (
    run INTEGER NOT NULL REFERENCES runs (id), shot INTEGER NOT NULL, fired_ns INTEGER NOT NULL,
    muzzle_x_m REAL, muzzle_y_m REAL, muzzle_z_m REAL, bore_x REAL, bore_y REAL, bore_z REAL,
    pose_age_ns INTEGER NOT NULL, outcome TEXT NOT NULL CHECK (outcome IN ('hit', 'miss', 'not_scored')),
    boat TEXT CHECK (boat IS NOT NULL OR outcome <> 'hit'),
    zone TEXT CHECK ((zone IS NOT NULL) = (outcome = 'hit')),
    time_ns INTEGER CHECK ((time_ns IS NOT NULL) = (outcome <> 'not_scored')),
    range_m REAL, point_x_m REAL, point_y_m REAL, point_z_m REAL, miss_m REAL,
    cause TEXT CHECK ((cause IS NOT NULL) = (outcome = 'not_scored')),
    PRIMARY KEY (run, shot)
) STRICT, WITHOUT ROWID;
INSERT INTO runs (scenario, recording, seed, version, finished) VALUES ('one skiff', '', '7', '0.0.9', 1);
INSERT INTO shots (run, shot, fired_ns, pose_age_ns, outcome, cause) VALUES (1, 1, 5, 6, 'not_scored', 'imu_stale');
PRAGMA application_id = 1112495959; PRAGMA user_version = 1;";

#[test]
fn a_journal_of_the_first_version_is_read_and_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    rusqlite::Connection::open(&path).unwrap().execute_batch(VERSION_1).unwrap();
    let runs = read_runs(&path).unwrap();
    assert_eq!((runs[0].run.scenario.as_str(), runs[0].run.boot_id.as_ref()), ("one skiff", None));
    assert_eq!(all(&path).len(), 1, "as it is");
    assert_eq!(shoot(&path, &[shot(1)]), 2);
    let runs = read_runs(&path).unwrap();
    assert_eq!((runs[0].run.seed, runs[0].shots, &runs[1].run), (7, 1, &run()));
    assert_eq!(all(&path).len(), 2);
}

#[test]
fn wall_times_are_filled_in_for_this_boot_only() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let second = 1_000_000_000;
    let begun = |boot: &str, at_s: i64, wall: Option<i64>| Run {
        started_wall_ns: wall,
        boot_id: Some(boot.to_owned()),
        started: Some(Time::from_ns(at_s * second)),
        ..run()
    };
    for run in [begun("one", 10, None), begun("two", 20, None), begun("two", 30, Some(5))] {
        Journal::open(&path, &run).unwrap().finish().unwrap();
    }
    let journal = Journal::open(&path, &begun("two", 40, None)).unwrap();
    assert_eq!(journal.previous(), None);
    let wall_ns = 1_795_000_000 * second;
    journal.set_wall_clock(wall_ns, Time::from_ns(100 * second)).unwrap();
    journal.finish().unwrap();
    let walls: Vec<_> = read_runs(&path).unwrap().iter().map(|stored| stored.run.started_wall_ns).collect();
    assert_eq!(walls, [None, Some(wall_ns - 80 * second), Some(5), Some(wall_ns - 60 * second)]);
}

#[test]
fn a_run_that_was_cut_off_is_told_with_its_boot() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    shoot(&path, &[shot(1)]);
    rusqlite::Connection::open(&path).unwrap().execute_batch("UPDATE runs SET finished = 0").unwrap();
    for (boot, end) in [("one", DirtyEnd::PowerCut), ("none", DirtyEnd::Unknown), ("same", DirtyEnd::Crash)] {
        let boot_id = match boot {
            "same" => run().boot_id,
            "none" => None,
            other => Some(other.to_owned()),
        };
        let journal = Journal::open(&path, &Run { boot_id, ..run() }).unwrap();
        let previous = journal.previous().unwrap();
        assert_eq!((previous.run, &previous.boot_id, previous.end), (1, &run().boot_id, end));
        drop(journal);
        rusqlite::Connection::open(&path).unwrap().execute_batch("DELETE FROM runs WHERE id > 1").unwrap();
    }
    assert!(boot_id().is_some_and(|id| id.len() == 36));
}

#[test]
fn space_that_was_kept_takes_rounds_when_the_disk_is_full() {
    let folder = tempfile::tempdir().unwrap();
    let Some(disk) = SmallJournalDisk::mount(folder.path(), "4m") else { return };
    let path = disk.0.join("hits.db");
    let options = JournalOptions { reserve_bytes: 512 << 10, ..JournalOptions::default() };
    let journal = Journal::open_with(&path, &run(), &options).unwrap();
    let commit = |numbers: std::ops::RangeInclusive<u64>| {
        for number in numbers {
            journal.shot(&shot(number)).unwrap();
            assert_eq!(journal.commits().recv_timeout(Duration::from_secs(20)).ok(), Some(number));
        }
    };
    commit(1..=1);
    let reserve = disk.0.join("hits.db.reserve");
    assert_eq!(fs::metadata(&reserve).unwrap().len(), 512 << 10);
    assert_eq!(journal.fault(), None);
    let _ = fs::write(disk.0.join("rest"), vec![1; 8 << 20]);
    commit(2..=40);
    assert!(!reserve.exists());
    let told = (0..400).find_map(|_| {
        std::thread::sleep(Duration::from_millis(10));
        journal.fault().filter(|fault| fault.waiting == 0)
    });
    let fault = told.unwrap();
    assert_eq!(fault.fault, Fault::DiskFull);
    assert!(fault.message.contains("shots are still written"), "{}", fault.message);
    fs::remove_file(disk.0.join("rest")).unwrap();
    let over = (0..1000).any(|_| {
        std::thread::sleep(Duration::from_millis(10));
        journal.fault().is_none() && reserve.exists()
    });
    assert!(over, "{:?}", journal.fault());
    assert_eq!(journal.finish().unwrap().committed, 40);
    assert_eq!(all(&path).len(), 40);
}

#[test]
fn a_disk_that_fills_up_loses_nothing_and_is_used_again_once_there_is_space() {
    let folder = tempfile::tempdir().unwrap();
    let Some(disk) = SmallJournalDisk::mount(folder.path(), "300k") else { return };
    let path = disk.0.join("hits.db");
    let ballast = disk.0.join("ballast");
    let journal = Journal::open(&path, &run()).unwrap();
    fs::write(&ballast, vec![1; 64 << 10]).unwrap();
    let _ = fs::write(disk.0.join("rest"), vec![1; 1 << 20]);
    for number in 1..=3000 {
        journal.shot(&shot(number)).unwrap();
    }
    let fault = (0..400).find_map(|_| {
        std::thread::sleep(Duration::from_millis(10));
        journal.fault()
    });
    let fault = fault.unwrap();
    assert!(fault.message.contains("is full") || fault.message.contains("failed"), "{}", fault.message);
    // Fewer than all are acknowledged, and those are there.
    let early = journal.commits().try_iter().count();
    assert!(early < 3000);
    fs::remove_file(disk.0.join("rest")).unwrap();
    fs::remove_file(&ballast).unwrap();
    for _ in early..1000 {
        journal.commits().recv_timeout(Duration::from_secs(20)).unwrap();
    }
    match journal.finish() {
        Ok(summary) => assert_eq!(summary.committed, 3000),
        // 300 KiB may be too little for all: then the rest is carried by the error.
        Err(JournalError::Unwritten(unwritten)) => {
            assert_eq!(unwritten.committed + unwritten.rows.len() as u64, 3000);
            assert_eq!(all(&path).len() as u64, unwritten.committed);
        }
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn a_disk_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let Some(disk) = SmallJournalDisk::mount(folder.path(), "1m") else { return };
    let path = disk.0.join("hits of #1?.db");
    shoot(&path, &[shot(1)]);
    disk.remount_read_only();
    let error = Journal::open(&path, &run()).err().unwrap();
    assert!(matches!(error, JournalError::ReadOnly { .. }), "{error}");
    assert_eq!(all(&path).len(), 1, "it can still be read");
}

/// A file system of its own in memory; only root can make one.
struct SmallJournalDisk(PathBuf);

impl SmallJournalDisk {
    fn mount(folder: &Path, size: &str) -> Option<Self> {
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &format!("size={size}"), "tmpfs"])
            .arg(folder)
            .output()
            .is_ok_and(|output| output.status.success());
        if !mounted {
            eprintln!("skipped: no permission to mount a small disk");
        }
        mounted.then(|| Self(folder.to_path_buf()))
    }

    fn remount_read_only(&self) {
        let status = Command::new("mount").args(["-o", "remount,ro"]).arg(&self.0).status().unwrap();
        assert!(status.success());
    }
}

impl Drop for SmallJournalDisk {
    fn drop(&mut self) {
        let unmounted = Command::new("umount").arg(&self.0).status();
        assert!(unmounted.is_ok_and(|status| status.success()));
    }
}

fn number() -> impl Strategy<Value = f64> {
    any::<f64>().prop_filter("NaN", |v| !v.is_nan())
}

fn vector() -> impl Strategy<Value = DVec3> {
    (number(), number(), number()).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

// SQLite's own text ends at a zero.
fn text() -> impl Strategy<Value = String> {
    prop::collection::vec(any::<char>().prop_filter("no zero", |c| *c != '\0'), 0..20)
        .prop_map(String::from_iter)
}

fn outcome() -> impl Strategy<Value = Outcome> {
    let time = || any::<i64>().prop_map(Time::from_ns);
    prop_oneof![
        (text(), 0..3_usize, time(), number(), vector()).prop_map(|(boat, zone, time, range_m, point)| {
            Outcome::Hit {
                boat,
                side: Side::ALL.get(zone).copied(),
                zone: Zone::ALL[zone],
                time,
                range_m,
                point,
            }
        }),
        (prop::option::of(text()), number(), time(), number())
            .prop_map(|(boat, miss_m, time, range_m)| Outcome::Miss { boat, miss_m, time, range_m }),
        prop_oneof![Just(NotScored::ImuStale), Just(NotScored::CameraStale)]
            .prop_map(|cause| Outcome::NotScored { cause }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn any_shots_come_back(
        shots in prop::collection::vec((any::<i64>(), vector(), vector(), any::<i64>(), outcome()), 1..40)
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hits.db");
        let shots: Vec<ShotRecord> = shots
            .into_iter()
            .zip(1..)
            .map(|((fired, muzzle, bore, pose_age_ns, outcome), shot)| {
                ShotRecord { shot, fired: Time::from_ns(fired), muzzle, bore, pose_age_ns, outcome }
            })
            .collect();
        shoot(&path, &shots);
        let found: Vec<ShotRecord> = all(&path).into_iter().map(|stored| stored.record).collect();
        prop_assert_eq!(found, shots);
    }
}

fn block(second: i64) -> TrackBlock {
    let pose = |x: f32| TrackPose { position: [x, 200.5, -0.25], attitude: [0.0, 0.0, 0.0, 1.0] };
    let sample = |i: i64| TrackSample {
        time_ns: second * 1_000_000_000 + i * 100_000_000,
        camera: (i != 3).then(|| pose(0.0)),
        boats: vec![Some(pose(i as f32)), None],
    };
    let point = PathPoint { after_s: 0.1, position: [1.0, 80.0, 5.5], velocity: [0.0, 800.0, -1.0] };
    let path = RoundPath { shot: second.cast_unsigned(), fired_ns: second, points: vec![point; 3] };
    TrackBlock { samples: (0..10).map(sample).collect(), rounds: vec![path] }
}

#[test]
fn tracks_come_back_as_they_were_and_gaps_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let journal = Journal::open(&path, &run()).unwrap();
    let mut expected = TrackBlock::default();
    for second in [1, 2, 5] {
        journal.tracks(second, block(second.cast_signed())).unwrap();
        expected.append(&block(second.cast_signed()));
    }
    journal.finish().unwrap();
    let stored = read_tracks(&path, RunSelection::Latest).unwrap();
    assert_eq!((&stored.tracks, stored.missing), (&expected, 2));
    assert_eq!(read_runs(&path).unwrap()[0].run.details.as_deref(), Some("{}"));
    // So is what is missing before the first that there is.
    let late = Journal::open(&path, &run()).unwrap();
    late.tracks(4, block(4)).unwrap();
    late.finish().unwrap();
    assert_eq!(read_tracks(&path, RunSelection::Latest).unwrap().missing, 3);
    // One that is damaged is a gap, and the others stay.
    rusqlite::Connection::open(&path)
        .unwrap()
        .execute("UPDATE tracks SET block = x'93ff00' WHERE run = 1 AND number = 2", [])
        .unwrap();
    let damaged = read_tracks(&path, RunSelection::Run(1)).unwrap();
    assert_eq!((damaged.tracks.samples.len(), damaged.missing), (20, 3));
    // A run that has none.
    Journal::open(&path, &run()).unwrap().finish().unwrap();
    assert_eq!(read_tracks(&path, RunSelection::Latest).unwrap(), StoredTracks::default());
}

#[test]
fn details_of_runs_are_read_by_versions_that_know_less_or_more() {
    let known = RunDetails { keep_off_m: 200.0, ..RunDetails::default() };
    assert_eq!(RunDetails::from_json(&known.to_json()), Some(known.clone()));
    let later = r#"{"keep_off_m": 200.0, "of_a_later_version": [1]}"#;
    assert_eq!(RunDetails::from_json(later), Some(known));
    for none in ["", "7", "{\"boats\": 3}"] {
        assert_eq!(RunDetails::from_json(none), None, "{none}");
    }
}
