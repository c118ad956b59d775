//! Failures that need smaller bounds than the defaults.

use std::{fs, time::Duration};

use bowwave_core::{
    score::{NotScored, Outcome, ShotRecord},
    time::Time,
};
use glam::DVec3;
use rusqlite::Connection;

use super::*;

fn shot(number: u64) -> ShotRecord {
    ShotRecord {
        shot: number,
        fired: Time::from_ns(number.cast_signed() * 1_000_000),
        muzzle: DVec3::new(0.1, 0.2, 3.0),
        bore: DVec3::Y,
        pose_age_ns: -5,
        outcome: Outcome::NotScored { cause: NotScored::ImuStale },
    }
}

fn impatient(pages_max: Option<u32>) -> Settings {
    let retry = Duration::from_millis(5);
    Settings { pages_max, held_max: 2000, retry_first: retry, retry_max: retry, finish_attempts: 3 }
}

fn wait_for<T>(mut ask: impl FnMut() -> Option<T>) -> T {
    for _ in 0..2000 {
        if let Some(answer) = ask() {
            return answer;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    panic!("nothing happened within 10 s");
}

#[test]
fn what_a_full_database_cannot_take_is_put_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let journal = Journal::open_with(&path, &Run::default(), impatient(Some(12))).unwrap();
    for number in 1..=1500 {
        wait_for(|| journal.shot(&shot(number)).ok());
    }
    let fault = wait_for(|| journal.fault());
    assert!(fault.message.contains("is full; free some space"), "{}", fault.message);
    assert!(fault.waiting > 0);
    let acknowledged: Vec<u64> = journal.commits().try_iter().collect();
    let error = journal.finish().unwrap_err();
    let JournalError::Unwritten(unwritten) = &error else { panic!("{error}") };
    assert!(error.to_string().contains("is full") && error.to_string().contains("they are in"), "{error}");
    assert_eq!(unwritten.committed, acknowledged.len() as u64);
    // Each round is in the database or in the file, none in both.
    let mut numbers: Vec<u64> =
        read_shots(&path, &ShotFilter::default()).unwrap().iter().map(|stored| stored.record.shot).collect();
    assert_eq!(numbers, acknowledged);
    let side = fs::read_to_string(unwritten.side_file.as_ref().unwrap()).unwrap();
    for line in side.lines() {
        let row: serde_json::Value = serde_json::from_str(line).unwrap();
        numbers.push(row["shot"].as_u64().unwrap());
    }
    assert_eq!(side.lines().count(), unwritten.rows.len());
    assert_eq!(numbers, (1..=1500).collect::<Vec<_>>());
    assert!(!read_runs(&path).unwrap()[0].finished);
}

#[test]
fn more_than_may_be_held_is_refused_not_lost() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let journal = Journal::open_with(&path, &Run::default(), impatient(Some(8))).unwrap();
    let mut taken = 0;
    let refused = (1..=20_000)
        .map(|number| {
            // The thread needs its time to take rounds out of the queue.
            if number % 1000 == 0 {
                std::thread::sleep(Duration::from_millis(5));
            }
            journal.shot(&shot(number)).map(|()| taken += 1)
        })
        .find_map(Result::err)
        .unwrap();
    assert!(matches!(refused, JournalError::QueueFull { .. }), "{refused}");
    let error = journal.finish().unwrap_err();
    let JournalError::Unwritten(unwritten) = error else { panic!("{error}") };
    assert_eq!(unwritten.committed + unwritten.rows.len() as u64, taken);
}

#[test]
fn a_locked_database_is_written_once_it_is_free() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let journal = Journal::open_with(&path, &Run::default(), impatient(None)).unwrap();
    let other = Connection::open(&path).unwrap();
    other.execute_batch("BEGIN IMMEDIATE").unwrap();
    journal.shot(&shot(1)).unwrap();
    let fault = wait_for(|| journal.fault());
    assert!(fault.message.contains("locked by another process"), "{}", fault.message);
    assert_eq!(journal.commits().try_recv().ok(), None);
    other.execute_batch("ROLLBACK").unwrap();
    assert_eq!(journal.commits().recv_timeout(Duration::from_secs(10)).ok(), Some(1));
    wait_for(|| journal.fault().is_none().then_some(()));
    let summary = journal.finish().unwrap();
    assert_eq!(summary.committed, 1);
    assert!(read_runs(&path).unwrap()[0].finished);
}
