//! Helpers of the recordings' tests.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use bowwave_core::{
    event::{ImuSample, TriggerEdge},
    geometry::{CameraPose, Lens},
    time::Time,
};
use bowwave_record::{
    CameraInfo, Entry, FrameEntry, PoseEntry, Properties, RecordError, RecordingReader, RecordingWriter,
};
use glam::{DQuat, DVec3};

pub fn at(ms: i64) -> Time {
    Time::from_ns(ms * 1_000_000)
}

pub fn properties() -> Properties {
    Properties {
        calibration_toml: "[lens]\nwidth = 1280\n".to_owned(),
        scenario_toml: Some("name = \"three skiffs\"\n".to_owned()),
        loop_ns: Some(20_000_000_000),
        start: at(1000),
        source: "a test".to_owned(),
        picture: (1280, 720),
        camera_info: Some(CameraInfo::from_lens(&Lens::pinhole(1280, 720, 1.0))),
        extra: BTreeMap::from([("sea".to_owned(), "Beaufort 3".to_owned())]),
    }
}

/// Bytes with a JPEG's first and last marker.
pub fn jpeg(bytes: usize, seed: u8) -> Arc<[u8]> {
    let mut jpeg = vec![0xff, 0xd8, 0xff, 0xe0];
    jpeg.extend((0..bytes).map(|i| (i as u8).wrapping_mul(31) ^ seed));
    jpeg.extend([0xff, 0xd9]);
    Arc::from(jpeg)
}

pub fn frame(ms: i64, sequence: u32, bytes: usize) -> Entry {
    Entry::Frame(FrameEntry {
        arrival: at(ms),
        mid_exposure: at(ms - 12),
        sequence,
        jpeg: jpeg(bytes, sequence as u8),
        is_recoded: false,
    })
}

pub fn imu(ms: i64) -> Entry {
    let t = ms as f64;
    Entry::Imu(ImuSample {
        arrival: at(ms),
        device_time_ns: ms * 1_000_100 - 77,
        rate: DVec3::new(0.01 * t.sin(), -0.02, 0.003),
        accel: DVec3::new(0.1, -0.2, -9.81),
        world_from_imu: (ms % 2 == 0).then(|| DQuat::from_rotation_z(0.001 * t)),
    })
}

pub fn truth(ms: i64) -> PoseEntry {
    let pose = CameraPose {
        world_from_camera: DQuat::from_rotation_x(0.001 * ms as f64),
        position: DVec3::new(0.0, 0.0, 3.5),
    };
    PoseEntry { time: at(ms), pose }
}

/// `frames` frames at 30 Hz, with a measurement every 10 ms, truth, used poses, and two trigger edges.
pub fn session(frames: u32, jpeg_bytes: usize) -> Vec<Entry> {
    let mut entries = Vec::new();
    for i in 0..frames {
        let ms = 1000 + i64::from(i) * 100 / 3;
        for k in 0..3 {
            entries.push(imu(ms + k * 10));
        }
        entries.push(Entry::Truth(truth(ms + 8)));
        entries.push(frame(ms + 20, i, jpeg_bytes));
        entries.push(Entry::Pose(truth(ms + 8)));
        if i % 15 == 7 {
            entries.push(Entry::Trigger(TriggerEdge { time: at(ms + 30), pressed: i % 30 == 7 }));
        }
    }
    entries
}

pub fn write(path: &Path, properties: &Properties, entries: &[Entry]) {
    let mut writer = RecordingWriter::create(path, properties).unwrap();
    for entry in entries {
        writer.write(entry).unwrap();
    }
    let summary = writer.finish().unwrap();
    assert_eq!(summary.counts.total(), entries.len() as u64);
    assert_eq!(summary.bytes, std::fs::metadata(path).unwrap().len());
}

/// Entries by time, equal ones in their order: what a reader has to give.
pub fn sorted(entries: &[Entry]) -> Vec<Entry> {
    let mut sorted = entries.to_vec();
    sorted.sort_by_key(Entry::time);
    sorted
}

/// All entries before the first error, and that error.
pub fn read(reader: &RecordingReader) -> (Vec<Entry>, Option<RecordError>) {
    let mut entries = Vec::new();
    for entry in reader.entries().unwrap() {
        match entry {
            Ok(entry) => entries.push(entry),
            Err(error) => return (entries, Some(error)),
        }
    }
    (entries, None)
}
