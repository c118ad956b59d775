//! Recordings: any bytes as a file that is opened, read to its end and recovered.

use std::{
    fs,
    path::{Path, PathBuf},
};

use bowwave_core::time::Time;
use bowwave_record::{Counts, Entry, RecordError, RecordingReader, recover};
use tempfile::TempDir;

/// Entries end, in order, within memory that the file's length bounds; what recovery saves is a whole recording.
pub fn run(input: &[u8]) {
    let folder = folder();
    let path = folder.path().join("recording.mcap");
    fs::write(&path, input).expect("a file");
    let limit = memory_bytes(input.len());
    super::memory::within(limit, || match RecordingReader::open(&path) {
        Err(error) => check_error(&error, &path),
        Ok(reader) => drop(read(&reader)),
    });
    let out = folder.path().join("recovered.mcap");
    super::memory::within(limit, || match recover(&path, &out) {
        Err(error) => check_error(&error, &path),
        Ok(report) => check_recovered(&out, report.saved),
    });
}

/// A chunk, its message and the entries that wait for older ones, each in a buffer that may be half empty.
const fn memory_bytes(file_bytes: usize) -> usize {
    (4 << 20) + 64 * file_bytes
}

/// A new folder, in memory where the system has such a place: it is made thousands of times a second.
fn folder() -> TempDir {
    let shared = PathBuf::from("/dev/shm");
    let parent = if shared.is_dir() { shared } else { std::env::temp_dir() };
    tempfile::Builder::new().prefix("bowwave-fuzz-").tempdir_in(parent).expect("a folder")
}

/// What is in it, and what was wrong at its end.
fn read(reader: &RecordingReader) -> (Counts, Option<RecordError>) {
    let mut counts = Counts::default();
    let mut last = Time::MIN;
    let entries = match reader.entries() {
        Ok(entries) => entries,
        Err(error) => return (counts, Some(error)),
    };
    for entry in entries {
        match entry {
            Ok(entry) => {
                assert!(entry.time() >= last, "{:?} behind {last:?}", entry.time());
                last = entry.time();
                check_entry(&entry);
                count(&mut counts, &entry);
            }
            Err(error) => {
                check_error(&error, reader.path());
                return (counts, Some(error));
            }
        }
    }
    (counts, None)
}

fn check_entry(entry: &Entry) {
    match entry {
        Entry::Frame(frame) => assert!(!frame.jpeg.is_empty(), "a picture without bytes: {frame:?}"),
        Entry::Truth(pose) | Entry::Pose(pose) => {
            let pose = &pose.pose;
            assert!(pose.position.is_finite(), "{pose:?}");
            assert!((pose.world_from_camera.length() - 1.0).abs() < 1e-3, "no rotation: {pose:?}");
        }
        // The inertial unit's values are kept as they were measured; the session judges them.
        Entry::Imu(_)
        | Entry::Trigger(_)
        | Entry::Mark(_)
        | Entry::Act(_)
        | Entry::Order(_)
        | Entry::ShipFix(_)
        | Entry::Fault(_)
        | Entry::Tick(_) => {}
        Entry::Picture(raw) => assert!(!raw.picture.bytes().is_empty(), "a picture without pixels: {raw:?}"),
        Entry::ShipValues(ship) => {
            let numbers = [ship.heading, ship.roll, ship.pitch, ship.heading_sigma];
            assert!(numbers.into_iter().flatten().all(f64::is_finite), "{ship:?}");
        }
        Entry::Ship(line) => assert!(line.sentence.is_ascii() && !line.sentence.is_empty(), "{line:?}"),
    }
}

fn count(counts: &mut Counts, entry: &Entry) {
    *match entry {
        Entry::Imu(_) => &mut counts.imu,
        Entry::Frame(_) | Entry::Picture(_) => &mut counts.frames,
        Entry::Trigger(_) => &mut counts.triggers,
        Entry::Ship(_) => &mut counts.ship,
        Entry::Mark(_) => &mut counts.marks,
        Entry::Act(_) => &mut counts.acts,
        Entry::Order(_) => &mut counts.orders,
        Entry::Truth(_) => &mut counts.truths,
        Entry::Pose(_) => &mut counts.poses,
        Entry::ShipValues(_) => &mut counts.ship_values,
        Entry::ShipFix(_) => &mut counts.ship_fixes,
        Entry::Fault(_) => &mut counts.faults,
        Entry::Tick(_) => &mut counts.ticks,
    } += 1;
}

fn check_error(error: &RecordError, path: &Path) {
    let text = error.to_string();
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    assert!(text.contains(name), "an error that names no file: {text}");
}

fn check_recovered(out: &Path, saved: Counts) {
    match RecordingReader::open(out) {
        Ok(reader) => {
            assert_eq!(reader.cut_at(), None, "what was recovered is cut");
            assert_eq!(reader.counts(), saved, "the index of what was recovered");
            let (counts, error) = read(&reader);
            assert!(error.is_none(), "what was recovered is damaged: {error:?}");
            assert_eq!(counts, saved, "what was recovered");
        }
        Err(RecordError::NoFrames { .. }) => assert_eq!(saved.frames, 0),
        Err(error) => panic!("what was recovered does not open: {error}"),
    }
}
