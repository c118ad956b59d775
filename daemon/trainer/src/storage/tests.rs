use std::path::Path;

use super::*;
use bowwave_core::world::{
    score::{NotScored, Outcome},
    track::TrackSample,
};

use bowwave_record::{RunSelection, ShotFilter, read_shots, read_tracks};
use glam::DVec3;

fn round(shot: u64) -> ShotRecord {
    ShotRecord {
        shot,
        fired: now(),
        muzzle: DVec3::ZERO,
        bore: DVec3::Y,
        pose_age_ns: 0,
        outcome: Outcome::NotScored { cause: NotScored::ImuStale },
    }
}

fn options(folder: &Path) -> StorageOptions {
    let run = Run {
        started_wall_ns: None,
        scenario: "a".to_owned(),
        recording: String::new(),
        seed: 1,
        version: "0".to_owned(),
        boot_id: None,
        started: Some(now()),
        details: None,
    };
    StorageOptions {
        folder: folder.to_owned(),
        run,
        journal: JournalOptions::default(),
        recording: None,
        strict: false,
        print_commits: false,
    }
}

/// A data folder that is not there at the start, as behind a disk that failed.
#[test]
fn rounds_wait_in_memory_until_the_journal_can_be_opened() {
    let base = tempfile::tempdir().unwrap();
    let folder = base.path().join("data");
    let mut storage = Storage::open(options(&folder), &mut Vec::new()).unwrap();
    let (mut faults, mut events) = (FaultLog::new(None), Vec::new());
    storage.rounds(&[round(1), round(2)]);
    storage.poll(&mut faults, &mut events).unwrap();
    let (fault, why) = storage.broken().unwrap();
    assert!(why.contains("2 rounds wait"), "{why}");
    assert!(faults.warnings().any(|f| f == fault), "the LCD tells");

    std::fs::create_dir_all(&folder).unwrap();
    let until = now().plus_secs(20.0);
    while storage.broken().is_some() && now() < until {
        storage.poll(&mut faults, &mut events).unwrap();
        thread::sleep(Duration::from_millis(20));
    }
    storage.rounds(&[round(3)]);
    storage.poll(&mut faults, &mut events).unwrap();
    assert_eq!(faults.warnings().count(), 0);
    assert_eq!(storage.finish().1.len(), 0);
    let stored = read_shots(&folder.join(JOURNAL), &ShotFilter::default()).unwrap();
    assert_eq!(stored.iter().map(|s| s.record.shot).collect::<Vec<_>>(), [1, 2, 3]);
}

#[test]
fn rounds_beyond_what_memory_holds_are_lines_of_the_log() {
    let base = tempfile::tempdir().unwrap();
    let mut storage = Storage::open(options(&base.path().join("absent")), &mut Vec::new()).unwrap();
    storage.waiting = (1..ROUNDS_WAITING_MAX as u64).map(round).collect();
    let last = [7, 8, 9].map(round);
    let rest = storage.keep(&last);
    assert_eq!((storage.waiting.len(), rest), (ROUNDS_WAITING_MAX, &last[1..]));
    let line = StoredShot::line(0, rest[0].clone());
    assert!(line.contains("\"shot\":8"), "{line}");
    storage.waiting.clear();
}

#[test]
fn rounds_of_a_journal_that_never_opened_are_put_aside_and_taken_in_by_the_next_run() {
    let base = tempfile::tempdir().unwrap();
    let journal = base.path().join(JOURNAL);
    std::fs::create_dir(&journal).unwrap();
    let mut storage = Storage::open(options(base.path()), &mut Vec::new()).unwrap();
    storage.rounds(&[round(1), round(2)]);
    let (_, wrong) = storage.finish();
    assert!(wrong.len() == 1 && wrong[0].to_string().contains("unwritten-0.jsonl"), "{wrong:?}");
    std::fs::remove_dir(&journal).unwrap();
    let mut storage = Storage::open(options(base.path()), &mut Vec::new()).unwrap();
    storage.rounds(&[round(1)]);
    assert_eq!(storage.finish().1.len(), 0);
    let stored = read_shots(&journal, &ShotFilter { runs: RunSelection::All, hits_only: false }).unwrap();
    let numbers: Vec<_> = stored.iter().map(|s| (s.run, s.record.shot)).collect();
    assert_eq!(numbers, [(1, 1), (1, 2), (2, 1)]);
}

#[test]
fn a_recording_whose_disk_does_not_answer_holds_neither_a_frame_nor_the_end() {
    let base = tempfile::tempdir().unwrap();
    let mut options = options(base.path());
    options.journal.end_within = Duration::from_millis(200);
    let mut storage = Storage::open(options, &mut Vec::new()).unwrap();
    storage.recorder = Some(Recorder::hung());
    storage.rounds(&[round(1)]);
    // As on a disk that is nearly full.
    storage.space = SpaceWatch::new(base.path(), u64::MAX, 1);
    let (mut faults, mut events) = (FaultLog::new(None), Vec::new());
    storage.poll(&mut faults, &mut events).unwrap();
    assert!(faults.warnings().any(|fault| fault == Fault::DiskFull));
    assert!(storage.recorder.is_none() && storage.closed.is_some());
    assert_eq!(storage.finish().1.len(), 0);
    let stored = read_shots(&base.path().join(JOURNAL), &ShotFilter::default()).unwrap();
    assert_eq!(stored.len(), 1);
}

#[test]
fn strict_storage_refuses_what_cannot_be_opened() {
    let base = tempfile::tempdir().unwrap();
    let strict = StorageOptions { strict: true, ..options(&base.path().join("absent")) };
    assert!(Storage::open(strict, &mut Vec::new()).is_err());
}

/// Tracks that came before the journal was open are in it, in their order, and so is the last block, which is not full.
#[test]
fn tracks_wait_for_the_journal_too() {
    let base = tempfile::tempdir().unwrap();
    let folder = base.path().join("data");
    let mut storage = Storage::open(options(&folder), &mut Vec::new()).unwrap();
    let sample = |i: i64| TrackSample { time_ns: i, camera: None, boats: Vec::new() };
    let mut all = TrackBlock::default();
    for i in 0..25 {
        let one = TrackBlock { samples: vec![sample(i)], rounds: Vec::new() };
        storage.take(&[], &[], &one);
        all.append(&one);
    }
    let (mut faults, mut events) = (FaultLog::new(None), Vec::new());
    storage.poll(&mut faults, &mut events).unwrap();
    std::fs::create_dir_all(&folder).unwrap();
    let until = now().plus_secs(20.0);
    while storage.broken().is_some() && now() < until {
        storage.poll(&mut faults, &mut events).unwrap();
        thread::sleep(Duration::from_millis(20));
    }
    let (_, wrong) = storage.finish();
    assert!(wrong.is_empty(), "{wrong:?}");
    let stored = read_tracks(&folder.join(JOURNAL), RunSelection::Latest).unwrap();
    assert_eq!((stored.tracks, stored.missing), (all, 0));
}
