//! Recordings that are whole: what goes in comes out, in order.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod support;

use std::{fs, sync::Arc};

use bowwave_core::{
    ephemeris::{Place, Utc},
    event::{ImuSample, Mark, MarkKind, Picture, PixelFormat, ShipFix, ShipSample, Tick, TriggerEdge},
    fault::{Change, Fault, FaultChange},
    geometry::CameraPose,
    time::Time,
};
use bowwave_record::{
    Entry, FaultEntry, FrameEntry, PictureEntry, PoseEntry, Properties, RecordError, RecordingReader,
    RecordingWriter, ShipEntry, TickEntry,
};
use glam::{DQuat, DVec3};
use proptest::prelude::*;
use support::{at, frame, imu, properties, read, session, sorted, truth, write};

#[test]
fn a_session_comes_back_with_its_properties() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let entries = session(90, 50_000);
    write(&path, &properties(), &entries);
    let reader = RecordingReader::open(&path).unwrap();
    assert_eq!(*reader.properties(), properties());
    assert_eq!(reader.cut_at(), None);
    let counts = reader.counts();
    assert_eq!(
        (counts.frames, counts.imu, counts.truths, counts.poses, counts.triggers),
        (90, 270, 90, 90, 6)
    );
    let (found, error) = read(&reader);
    assert!(error.is_none(), "{error:?}");
    let expected = sorted(&entries);
    assert_eq!(found.len(), expected.len());
    assert!(found == expected);
    assert_eq!(reader.duration_ns(), expected[expected.len() - 1].time().ns_since(expected[0].time()));
    assert_eq!(reader.first(), expected[0].time());
}

#[test]
fn properties_may_be_sparse() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let sparse = Properties { picture: (2, 2), ..Properties::default() };
    write(&path, &sparse, &[frame(1000, 0, 10)]);
    assert_eq!(*RecordingReader::open(&path).unwrap().properties(), sparse);
}

#[test]
fn a_measurement_that_is_no_number_is_kept_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let broken = ImuSample {
        arrival: at(5),
        device_time_ns: -3,
        rate: DVec3::new(f64::NAN, f64::INFINITY, 0.0),
        accel: DVec3::ZERO,
        world_from_imu: Some(DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0)),
    };
    write(&path, &properties(), &[Entry::Imu(broken), frame(6, 0, 10)]);
    let (entries, error) = read(&RecordingReader::open(&path).unwrap());
    assert!(error.is_none());
    let Entry::Imu(found) = &entries[0] else { panic!("{:?}", entries[0]) };
    assert!(found.rate.x.is_nan() && found.rate.y == f64::INFINITY && !found.is_finite());
    assert_eq!(found.device_time_ns, -3);
    assert!(found.world_from_imu.unwrap().x.is_nan());
}

#[test]
fn what_cannot_be_recorded_is_refused_and_the_rest_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut writer = RecordingWriter::create(&path, &properties()).unwrap();
    let bad_pose = PoseEntry {
        time: at(1),
        pose: CameraPose { world_from_camera: DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0), position: DVec3::ZERO },
    };
    let bad_clock = ImuSample { device_time_ns: i64::MAX, ..imu_sample() };
    let empty = FrameEntry {
        arrival: at(1),
        mid_exposure: at(1),
        sequence: 0,
        jpeg: Arc::from(&[][..]),
        is_recoded: false,
    };
    let huge = FrameEntry { jpeg: Arc::from(vec![0; (32 << 20) + 1]), ..empty.clone() };
    for (entry, expected) in [
        (frame(-5, 0, 10), "begin later"),
        (Entry::Truth(bad_pose), "unit quaternion"),
        (Entry::Imu(bad_clock), "device's clock"),
        (Entry::Frame(empty), "0 bytes"),
        (Entry::Frame(huge), "lower the camera's quality"),
    ] {
        let error = writer.write(&entry).unwrap_err();
        assert!(
            matches!(error, RecordError::Entry { .. }) && error.to_string().contains(expected),
            "{error}"
        );
    }
    writer.write(&frame(1000, 0, 10)).unwrap();
    writer.write(&imu(500)).unwrap();
    writer.finish().unwrap();
    let (entries, error) = read(&RecordingReader::open(&path).unwrap());
    assert!(error.is_none());
    assert_eq!(entries, [imu(500), frame(1000, 0, 10)]);
}

/// A computer that stood still for a while hands its inputs on late, after a tick.
#[test]
fn what_a_pause_held_up_keeps_its_time_and_its_place_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let [path, recovered] = ["a.mcap", "b.mcap"].map(|name| folder.path().join(name));
    let held_up: Vec<Entry> = (1..40).map(|n| imu(1000 + 100 * n)).collect();
    let all = [vec![frame(1000, 0, 10), frame(5000, 1, 10)], held_up, vec![frame(5010, 2, 10)]].concat();
    write(&path, &properties(), &all);
    bowwave_record::recover(&path, &recovered).unwrap();
    for path in [path, recovered] {
        let reader = RecordingReader::open(&path).unwrap();
        let as_written: Vec<Entry> = reader.entries_as_written().unwrap().map(Result::unwrap).collect();
        assert_eq!(as_written, all);
        let (by_time, error) = read(&reader);
        assert!(error.is_none(), "{error:?}");
        assert_eq!(by_time, sorted(&all), "what is late too comes by its own time among what is late");
    }
}

fn imu_sample() -> ImuSample {
    match imu(7) {
        Entry::Imu(sample) => sample,
        _ => unreachable!(),
    }
}

#[test]
fn nothing_is_overwritten_unless_asked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    write(&path, &properties(), &[frame(1000, 0, 10)]);
    let before = fs::read(&path).unwrap();
    let error = RecordingWriter::create(&path, &properties()).err().unwrap();
    assert!(matches!(error, RecordError::Exists { .. }), "{error}");
    assert_eq!(fs::read(&path).unwrap(), before);
    let mut writer = RecordingWriter::replace(&path, &properties()).unwrap();
    writer.write(&frame(2000, 7, 10)).unwrap();
    writer.finish().unwrap();
    let (entries, _) = read(&RecordingReader::open(&path).unwrap());
    assert_eq!(entries, [frame(2000, 7, 10)]);
}

#[test]
fn a_folder_that_is_not_there_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("no/such/a.mcap");
    let error = RecordingWriter::create(&path, &properties()).err().unwrap().to_string();
    assert!(error.contains("no/such/a.mcap") && error.contains("make the folder"), "{error}");
    let error = RecordingReader::open(&path).unwrap_err();
    assert!(matches!(error, RecordError::Open { .. }), "{error}");
    let error = RecordingReader::open(folder.path()).unwrap_err();
    assert!(matches!(error, RecordError::Open { .. }), "{error}");
}

#[test]
fn the_same_entries_make_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a.mcap"), folder.path().join("b.mcap"));
    let entries = session(10, 100);
    write(&a, &properties(), &entries);
    write(&b, &properties(), &entries);
    assert!(fs::read(a).unwrap() == fs::read(b).unwrap());
}

#[test]
fn what_is_being_recorded_is_on_the_disk_within_a_second() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut writer = RecordingWriter::create(&path, &properties()).unwrap();
    for entry in sorted(&session(120, 3000)) {
        writer.write(&entry).unwrap();
        // As after kill -9: what the file has at this moment.
        let newest = entry.time();
        if newest.ns_since(at(1000)) < 1_000_000_000 {
            continue;
        }
        let copy = folder.path().join("copy.mcap");
        fs::copy(&path, &copy).unwrap();
        let reader = RecordingReader::open(&copy).unwrap();
        let (entries, error) = read(&reader);
        assert!(matches!(error, Some(RecordError::Truncated { .. })));
        let lost_ns = newest.ns_since(entries[entries.len() - 1].time());
        assert!(lost_ns <= 1_000_000_000, "{lost_ns} ns lost");
        if newest.ns_since(at(1000)) > 2_000_000_000 {
            break;
        }
    }
}

fn pose() -> impl Strategy<Value = CameraPose> {
    (prop::array::uniform4(-1.0..1.0_f64), prop::array::uniform3(-1e6..1e6_f64)).prop_filter_map(
        "no rotation",
        |(q, p)| {
            let q = DQuat::from_array(q);
            (q.length() > 1e-3)
                .then(|| CameraPose { world_from_camera: q.normalize(), position: DVec3::from_array(p) })
        },
    )
}

fn entry(ms: i64) -> impl Strategy<Value = Entry> {
    let time = Time::from_ns(ms * 1_000_000);
    let vector = || {
        prop::array::uniform3(any::<f64>().prop_filter("NaN", |v| !v.is_nan())).prop_map(DVec3::from_array)
    };
    prop_oneof![
        (vector(), vector(), -1_000_000_000_i64..1_000_000_000_000_000_000, prop::option::of(pose()))
            .prop_map(move |(rate, accel, device_time_ns, pose)| Entry::Imu(ImuSample {
                arrival: time,
                device_time_ns,
                rate,
                accel,
                world_from_imu: pose.map(|p| p.world_from_camera),
            })),
        (
            -1_000_000_000_i64..1_000_000_000_000_000_000,
            any::<u32>(),
            prop::collection::vec(any::<u8>(), 1..3000)
        )
            .prop_map(move |(mid, sequence, bytes)| Entry::Frame(FrameEntry {
                arrival: time,
                mid_exposure: Time::from_ns(mid),
                sequence,
                jpeg: Arc::from(bytes),
                is_recoded: false
            })),
        any::<bool>().prop_map(move |pressed| Entry::Trigger(TriggerEdge { time, pressed })),
        "[ -~]{1,80}\r\n".prop_map(move |sentence| Entry::Ship(ShipEntry { arrival: time, sentence })),
        prop_oneof![Just(MarkKind::Stow), Just(MarkKind::Landmark)]
            .prop_map(move |kind| Entry::Mark(Mark { time, kind })),
        pose().prop_map(move |pose| Entry::Truth(PoseEntry { time, pose })),
        pose().prop_map(move |pose| Entry::Pose(PoseEntry { time, pose })),
        inputs(time),
    ]
}

/// What only a session's own recording holds.
fn inputs(time: Time) -> impl Strategy<Value = Entry> {
    let stamp = || (-1_000_000_000_i64..1_000_000_000_000_000_000).prop_map(Time::from_ns);
    let number = || prop::option::of(-10.0..10.0_f64);
    let fault = (0..Fault::COUNT).prop_map(|i| Fault::ALL[i]);
    let change = prop_oneof![
        "\\PC{0,200}".prop_map(|cause| Change::Raised { cause }),
        Just(Change::Cleared),
        "\\PC{0,200}".prop_map(|cause| Change::Noted { cause }),
    ];
    let layout = prop_oneof![Just(PixelFormat::Yuyv), Just(PixelFormat::Nv12), Just(PixelFormat::Rgb)];
    prop_oneof![
        (stamp(), any::<[u64; 3]>()).prop_map(move |(shown, [inputs, records, scenes])| {
            Entry::Tick(TickEntry { tick: Tick { time, shown }, inputs, records, scenes })
        }),
        (stamp(), fault, change).prop_map(move |(own, fault, change)| {
            Entry::Fault(FaultEntry { logged: time, change: FaultChange { time: own, fault, change } })
        }),
        (number(), number(), number(), number(), any::<bool>()).prop_map(
            move |(heading, roll, pitch, heading_sigma, reduced)| {
                Entry::ShipValues(ShipSample { arrival: time, heading, roll, pitch, heading_sigma, reduced })
            }
        ),
        (prop::option::of((-90.0..=90.0, -180.0..=180.0)), prop::option::of(0i64..32_503_679_000_000))
            .prop_map(move |(place, ms)| {
                let place = place.and_then(|(latitude, longitude)| Place::new(latitude, longitude));
                Entry::ShipFix(ShipFix { arrival: time, place, utc: ms.and_then(Utc::from_ms) })
            }),
        (stamp(), any::<u32>(), layout, 1..5_u32, 1..5_u32, any::<u8>()).prop_map(
            move |(mid_exposure, sequence, format, w, h, first)| {
                let (width, height) = (2 * w, 2 * h);
                let bytes: Vec<u8> =
                    (0..format.byte_len(width, height)).map(|i| first.wrapping_add(i as u8)).collect();
                let picture = Picture::new(format, width, height, bytes.into()).unwrap();
                Entry::Picture(PictureEntry { arrival: time, mid_exposure, sequence, picture })
            }
        ),
    ]
}

/// Times that jump back by up to so many milliseconds from a slowly rising base.
fn entries(back_ms: i64) -> impl Strategy<Value = Vec<Entry>> {
    prop::collection::vec((0..40_i64, 0..back_ms), 1..120).prop_flat_map(move |steps| {
        let mut base = 1000 + back_ms;
        steps
            .into_iter()
            .map(|(step, back)| {
                base += step;
                entry(base - back)
            })
            .collect::<Vec<_>>()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn any_entries_come_back_in_order(entries in entries(250)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let mut all = vec![Entry::Truth(truth(1000)), frame(1000, 0, 5)];
        all.extend(entries);
        write(&path, &properties(), &all);
        let reader = RecordingReader::open(&path).unwrap();
        let (found, error) = read(&reader);
        prop_assert!(error.is_none(), "{:?}", error);
        prop_assert_eq!(found, sorted(&all));
        let as_written: Vec<Entry> = reader.entries_as_written().unwrap().map(Result::unwrap).collect();
        prop_assert_eq!(as_written, all);
    }

    #[test]
    fn entries_of_any_age_come_back(entries in entries(4000)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let all = [vec![frame(1000, 0, 5)], entries].concat();
        write(&path, &properties(), &all);
        let reader = RecordingReader::open(&path).unwrap();
        let as_written: Vec<Entry> = reader.entries_as_written().unwrap().map(Result::unwrap).collect();
        prop_assert_eq!(&as_written, &all);
        let (found, error) = read(&reader);
        prop_assert!(error.is_none(), "{:?}", error);
        let kept = |entries: &[Entry]| sorted(entries).iter().map(|e| format!("{e:?}")).collect::<Vec<_>>();
        let (mut found, mut all) = (kept(&found), kept(&all));
        found.sort();
        all.sort();
        prop_assert_eq!(found, all);
    }
}
