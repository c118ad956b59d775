//! Failures that need smaller bounds than the defaults.

use std::{fs, time::Duration};

use bowwave_core::{
    time::Time,
    world::score::{NotScored, Outcome, ShotRecord},
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

fn impatient(pages_max: Option<u32>) -> JournalSettings {
    let retry = Duration::from_millis(5);
    JournalSettings {
        pages_max,
        held_max: 2000,
        retry_first: retry,
        retry_max: retry,
        ..JournalSettings::from(&JournalOptions {
            end_within: Duration::from_millis(50),
            ..JournalOptions::default()
        })
    }
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
    let journal = Journal::start(&path, &Run::default(), impatient(Some(12))).unwrap();
    for number in 1..=1500 {
        wait_for(|| journal.shot(&shot(number)).ok());
    }
    let fault = wait_for(|| journal.fault());
    assert_eq!(fault.fault, Fault::DiskFull);
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
    for line in side.lines().skip(1) {
        let row: serde_json::Value = serde_json::from_str(line).unwrap();
        numbers.push(row["shot"].as_u64().unwrap());
    }
    assert_eq!(side.lines().count(), 1 + unwritten.rows.len());
    assert_eq!(numbers, (1..=1500).collect::<Vec<_>>());
    assert!(!read_runs(&path).unwrap()[0].finished);
}

#[test]
fn more_than_may_be_held_is_refused_not_lost() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let journal = Journal::start(&path, &Run::default(), impatient(Some(8))).unwrap();
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
    let journal = Journal::start(&path, &Run::default(), impatient(None)).unwrap();
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

#[test]
fn a_database_damaged_while_in_use_is_put_aside_and_this_runs_rounds_written_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    // A cache of a few pages, and a log that is emptied at once: SQLite has to read what was damaged.
    let options = JournalOptions { checkpoint_pages: 1, ..JournalOptions::default() };
    let settings = JournalSettings { pages_cached: Some(2), options, ..impatient(None) };
    let run = Run { scenario: "three skiffs".to_owned(), ..Run::default() };
    let journal = Journal::start(&path, &run, settings).unwrap();
    let shoot = |from: u64, to: u64| {
        for number in from..=to {
            wait_for(|| journal.shot(&shot(number)).ok());
            assert_eq!(journal.commits().recv_timeout(Duration::from_secs(10)).ok(), Some(number));
        }
    };
    shoot(1, 300);
    let length = fs::metadata(&path).unwrap().len();
    let file = fs::OpenOptions::new().write(true).open(&path).unwrap();
    std::os::unix::fs::FileExt::write_all_at(&file, &vec![0xa5; length as usize - 4096], 4096).unwrap();
    let begun = std::time::Instant::now();
    shoot(301, 320);
    assert!(begun.elapsed() < Duration::from_secs(2), "{:?}", begun.elapsed());
    let quarantine = journal.quarantined().unwrap();
    assert_eq!(quarantine.kept_as, Some(folder.path().join("hits.db.corrupt-1")));
    assert_eq!(quarantine.rounds_left_there, 0);
    assert!(quarantine.reason.contains("malformed"), "{}", quarantine.reason);
    wait_for(|| journal.fault().is_none().then_some(()));
    let id = journal.run();
    assert_eq!(journal.finish().unwrap().committed, 320);
    let stored = read_shots(&path, &ShotFilter::default()).unwrap();
    let expected: Vec<_> = (1..=320).map(|number| StoredShot { run: id, record: shot(number) }).collect();
    assert_eq!(stored, expected);
    let runs = read_runs(&path).unwrap();
    assert_eq!((runs.len(), runs[0].run.clone(), runs[0].finished), (1, run, true));
}

#[test]
fn a_quarantine_that_was_interrupted_is_ended() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    for step in 0..3 {
        fs::write(&path, b"SQLite format 3\0 and nothing of use").unwrap();
        fs::write(open::with_suffix(&path, "-wal"), b"its log").unwrap();
        let journal = Journal::open(&folder.path().join("other.db"), &Run::default()).unwrap();
        journal.finish().unwrap();
        fs::rename(folder.path().join("other.db"), open::with_suffix(&path, ".fresh")).unwrap();
        let aside = open::with_suffix(&path, &format!(".corrupt-{}", step + 1));
        if step >= 1 {
            fs::rename(open::with_suffix(&path, "-wal"), open::with_suffix(&aside, "-wal")).unwrap();
        }
        if step >= 2 {
            fs::rename(&path, &aside).unwrap();
        }
        let journal = Journal::open(&path, &Run::default()).unwrap();
        assert_eq!(journal.quarantined().unwrap().kept_as.as_ref(), Some(&aside));
        assert_eq!(journal.run(), 2, "the fresh one's first run was there already");
        journal.finish().unwrap();
        assert!(!open::with_suffix(&path, ".fresh").exists());
        assert_eq!(fs::read(open::with_suffix(&aside, "-wal")).unwrap(), b"its log");
    }
}

#[test]
fn what_a_cut_leaves_of_a_database_just_being_made_is_no_damage() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    fs::write(&path, vec![0; 4096]).unwrap();
    fs::write(open::with_suffix(&path, "-journal"), b"").unwrap();
    let journal = Journal::open(&path, &Run::default()).unwrap();
    assert_eq!((journal.quarantined(), journal.run()), (None, 1));
    journal.finish().unwrap();
    // With a log there may have been rounds.
    fs::write(&path, vec![0; 4096]).unwrap();
    fs::write(open::with_suffix(&path, "-wal"), b"something").unwrap();
    let journal = Journal::open(&path, &Run::default()).unwrap();
    assert!(journal.quarantined().is_some());
}

#[test]
fn a_log_that_was_left_behind_is_put_onto_the_disk_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let settings = impatient(None);
    let (connection, _) = open::connect(&path, &settings).unwrap();
    schema::begin_run(&connection, None, &Run::default()).unwrap();
    open::keep_log(&connection);
    drop(connection);
    let log = open::with_suffix(&path, "-wal");
    let before = fs::read(&log).unwrap();
    assert!(before.len() > 4096);
    let changed = fs::metadata(&log).unwrap().modified().unwrap();
    std::thread::sleep(Duration::from_millis(20));
    let (connection, _) = open::connect(&path, &settings).unwrap();
    assert_eq!(fs::read(&log).unwrap(), before);
    assert!(fs::metadata(&log).unwrap().modified().unwrap() > changed, "it was not written");
    let runs: i64 = connection.query_row("SELECT count(*) FROM runs", [], |row| row.get(0)).unwrap();
    assert_eq!(runs, 1);
}

/// Rounds of all runs that are in the journal, with their run's scenario.
fn all_of(path: &Path) -> Vec<(String, u64)> {
    let runs = read_runs(path).unwrap();
    let scenario = |id| runs.iter().find(|run| run.id == id).unwrap().run.scenario.clone();
    let shots = read_shots(path, &ShotFilter { runs: RunSelection::All, hits_only: false }).unwrap();
    shots.into_iter().map(|stored| (scenario(stored.run), stored.record.shot)).collect()
}

#[test]
fn what_was_put_beside_the_journal_is_taken_in_by_the_next_run_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let run = Run { scenario: "first".to_owned(), seed: u64::MAX, ..Run::default() };
    let journal = Journal::start(&path, &run, impatient(Some(12))).unwrap();
    for number in 1..=1500 {
        wait_for(|| journal.shot(&shot(number)).ok());
    }
    // With rounds that the queue had no room for.
    let error = journal.finish_with((1501..=1600).map(shot)).unwrap_err();
    assert!(matches!(error, JournalError::Unwritten(_)), "{error}");
    assert_eq!(side_files(&path).unwrap().len(), 1);
    for _ in 0..2 {
        let journal = Journal::open(&path, &Run { scenario: "second".to_owned(), ..Run::default() }).unwrap();
        journal.finish().unwrap();
        assert!(side_files(&path).unwrap().is_empty());
        let expected: Vec<_> = (1..=1600).map(|number| ("first".to_owned(), number)).collect();
        assert_eq!(all_of(&path), expected);
    }
    assert!(folder.path().join("hits.db.taken-1.jsonl").exists());
}

#[test]
fn a_side_file_of_another_database_becomes_a_run_of_its_own_and_bad_lines_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let old = Run { scenario: "old".to_owned(), ..Run::default() };
    let unwritten = put_aside(&path, &old, (1..=3).map(shot), Duration::from_secs(5));
    // As an earlier version left it, with a line that a power cut tore.
    let row = StoredShot { run: 7, record: shot(9) }.to_json();
    fs::write(folder.path().join("hits.db.unwritten-7.jsonl"), format!("{row}\n{{\"run\": 7, \"sh")).unwrap();
    Journal::open(&path, &Run { scenario: "new".to_owned(), ..Run::default() }).unwrap().finish().unwrap();
    let expected = [("old", 1), ("old", 2), ("old", 3), ("", 9)];
    assert_eq!(all_of(&path), expected.map(|(scenario, shot)| (scenario.to_owned(), shot)));
    assert!(!unwritten.side_file.unwrap().exists());
    assert_eq!(side_files(&path).unwrap(), [folder.path().join("hits.db.refused-7.jsonl")]);
}

#[test]
fn a_journal_that_is_deleted_or_moved_is_noticed_before_a_round_is_acknowledged() {
    for parts in [&["", "-wal", "-shm"][..], &[""], &["-wal"]] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hits.db");
        let journal = Journal::start(&path, &Run::default(), impatient(None)).unwrap();
        for number in 1..=20 {
            journal.shot(&shot(number)).unwrap();
            assert_eq!(journal.commits().recv_timeout(Duration::from_secs(10)).ok(), Some(number));
            if number == 10 {
                parts.iter().for_each(|part| fs::remove_file(open::with_suffix(&path, part)).unwrap());
            }
        }
        assert!(journal.quarantined().unwrap().reason.contains("deleted, moved or replaced"), "{parts:?}");
        assert_eq!(journal.finish().unwrap().committed, 20);
        let expected: Vec<_> = (1..=20).map(|number| (String::new(), number)).collect();
        assert_eq!(all_of(&path), expected, "{parts:?}");
    }
}

#[test]
fn the_end_of_a_journal_whose_folder_is_gone_is_quick_and_tells_each_round() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("data/hits.db");
    fs::create_dir(path.parent().unwrap()).unwrap();
    let journal = Journal::start(&path, &Run::default(), impatient(None)).unwrap();
    journal.shot(&shot(1)).unwrap();
    journal.commits().recv_timeout(Duration::from_secs(10)).unwrap();
    fs::remove_dir_all(path.parent().unwrap()).unwrap();
    let begun = std::time::Instant::now();
    let error = journal.finish_with([shot(2)]).unwrap_err();
    assert!(begun.elapsed() < Duration::from_secs(1), "{:?}", begun.elapsed());
    let JournalError::Unwritten(unwritten) = error else { panic!("{error}") };
    assert_eq!((unwritten.rows.len(), unwritten.in_doubt, unwritten.side_file), (2, 1, None));
}

/// The thread ends as it should; that it broke down is all that is made up.
#[test]
fn rounds_of_a_thread_that_broke_down_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.sqlite");
    let mut journal = Journal::open(&path, &Run::default()).unwrap();
    (journal.queue, journal.open) = (None, None);
    journal.thread.take().unwrap().join().unwrap();
    journal.ended = bounded(0).1;
    journal.thread = Some(std::thread::spawn(|| {}));
    let (queue, queued) = bounded(1);
    queue.send(JournalMessage::Shot(shot(2))).unwrap();
    journal.queued = queued;
    Pending::of(&journal.pending).held.push_back(shot(1));
    let Err(JournalError::Unwritten(unwritten)) = journal.finish_with([shot(3)]) else {
        panic!("nothing is missing")
    };
    assert!(unwritten.to_string().contains("broke down"), "{unwritten}");
    assert_eq!(unwritten.rows, [1, 3, 2].map(|number| StoredShot::line(unwritten.run, shot(number))));
}

#[test]
fn a_locked_journal_ends_in_time_with_its_rounds_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let options = JournalOptions { end_within: Duration::from_millis(700), ..JournalOptions::default() };
    // As every run of a gun: by the time of its beginning it is known again, also where its thread writes its rounds after all.
    let run = Run { started: Some(Time::from_ns(5)), ..Run::default() };
    let journal = Journal::open_with(&path, &run, &options).unwrap();
    let other = Connection::open(&path).unwrap();
    other.execute_batch("BEGIN IMMEDIATE").unwrap();
    journal.shot(&shot(1)).unwrap();
    assert_eq!(wait_for(|| journal.fault()).fault, Fault::DbLocked);
    let begun = std::time::Instant::now();
    let error = journal.finish_with([shot(2)]).unwrap_err();
    assert!(begun.elapsed() < Duration::from_millis(1500), "{:?}", begun.elapsed());
    assert!(error.to_string().contains("2 shots could not be written"), "{error}");
    other.execute_batch("ROLLBACK").unwrap();
    Journal::open(&path, &Run::default()).unwrap().finish().unwrap();
    assert_eq!(all_of(&path).len(), 2);
}

#[test]
fn a_folder_has_one_journal_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hits.db");
    let journal = Journal::open(&path, &Run::default()).unwrap();
    let error = Journal::open(&path, &Run::default()).err().unwrap();
    assert!(matches!(error, JournalError::InUse { .. }) && error.fault() == Fault::DbLocked, "{error}");
    journal.finish().unwrap();
    Journal::open(&path, &Run::default()).unwrap().finish().unwrap();
}

#[test]
fn a_database_that_only_calls_itself_a_journal_is_put_aside() {
    let strange = [
        "DROP TABLE shots; CREATE TABLE shots (a)",
        "CREATE TRIGGER t AFTER INSERT ON shots BEGIN DELETE FROM shots; END",
    ];
    for sql in strange {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hits.db");
        Journal::open(&path, &Run::default()).unwrap().finish().unwrap();
        Connection::open(&path).unwrap().execute_batch(sql).unwrap();
        let journal = Journal::open(&path, &Run::default()).unwrap();
        let reason = journal.quarantined().unwrap().reason;
        assert!(reason.contains("shots has no column") || reason.contains("trigger t"), "{reason}");
        journal.shot(&shot(1)).unwrap();
        assert_eq!(journal.finish().unwrap().committed, 1);
        assert_eq!(all_of(&path).len(), 1);
    }
}
