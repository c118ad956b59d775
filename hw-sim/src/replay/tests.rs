use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use bowwave_core::{
    ephemeris::Utc,
    event::{CameraFrame, Event, ImuSample, Mark, MarkKind, ShipFix, ShipSample, TriggerEdge},
    geometry::{CameraPose, look},
    time::Time,
};
use bowwave_devices::{clock, nmea::line_of};
use bowwave_record::{Entry, FrameEntry, PoseEntry, Properties, RecordError, RecordingWriter, ShipEntry};
use glam::{DQuat, DVec3};
use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};

use super::{FastReplay, Replay, ReplayError, ReplayOptions, ReplayStats};
use crate::fault::{FaultKind, FaultPlan};

const MS: i64 = 1_000_000;
const START: Time = Time::from_ns(5_000 * MS);
/// One second: 200 samples, 25 pictures, two trigger edges. Pictures arrive 30 ms after their exposure, the last one after
/// the period's end. The unit's clock is 100 ppm fast.
const PERIOD: i64 = 1_000 * MS;
const SIZE: (u32, u32) = (64, 48);

fn jpeg(size: (u32, u32), value: u8) -> Arc<[u8]> {
    let pixels = vec![value; (size.0 * size.1 * 3) as usize];
    let mut bytes = Vec::new();
    JpegEncoder::new(&mut bytes).encode(&pixels, size.0, size.1, ExtendedColorType::Rgb8).expect("encoded");
    bytes.into()
}

fn sample(n: i64) -> ImuSample {
    let since = n * 5 * MS;
    ImuSample {
        arrival: START.plus_ns(since + 2 * MS),
        device_time_ns: 400 * MS + since + since / 10_000,
        rate: DVec3::new(0.001 * n as f64, 0.0, 0.0),
        accel: DVec3::new(0.0, 0.0, -9.81),
        world_from_imu: Some(DQuat::from_rotation_z(0.01 * n as f64)),
    }
}

fn pose(n: i64) -> CameraPose {
    CameraPose { world_from_camera: look(0.01 * n as f64, 0.0, 0.0), position: DVec3::new(0.0, 0.0, 12.0) }
}

fn exposed(n: i64) -> Time {
    START.plus_ns(n * 40 * MS + 15 * MS)
}

fn entries() -> Vec<Entry> {
    let mut entries: Vec<_> = (0..200).map(|n| Entry::Imu(sample(n))).collect();
    for n in 0..25 {
        entries.push(Entry::Truth(PoseEntry { time: exposed(n), pose: pose(n) }));
        entries.push(Entry::Frame(FrameEntry {
            arrival: exposed(n).plus_ns(30 * MS),
            mid_exposure: exposed(n),
            sequence: 100 + n as u32,
            jpeg: jpeg(SIZE, 10 * n as u8),
            is_recoded: false,
        }));
    }
    for (at, pressed) in [(300, true), (420, false)] {
        entries.push(Entry::Trigger(TriggerEdge { time: START.plus_ns(at * MS), pressed }));
    }
    entries.sort_by_key(Entry::time);
    entries
}

fn write(folder: &Path, entries: &[Entry], loop_ns: Option<i64>) -> PathBuf {
    let path = folder.join("test.mcap");
    let properties = Properties {
        calibration_toml: "# of a test".to_owned(),
        loop_ns,
        start: START,
        source: "test".to_owned(),
        picture: SIZE,
        ..Properties::default()
    };
    let mut writer = RecordingWriter::create(&path, &properties).expect("created");
    for entry in entries {
        writer.write(entry).expect("written");
    }
    writer.finish().expect("finished");
    path
}

struct Recording {
    folder: tempfile::TempDir,
    path: PathBuf,
}

fn recording(loop_ns: Option<i64>) -> Recording {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = write(folder.path(), &entries(), loop_ns);
    Recording { folder, path }
}

fn options(duration_ms: i64, faults: FaultPlan) -> ReplayOptions {
    ReplayOptions { duration_ns: Some(duration_ms * MS), faults, ..ReplayOptions::default() }
}

/// All events of a fast replay.
fn fast(path: &Path, options: &ReplayOptions) -> (Vec<Event>, ReplayStats) {
    let mut replay = Replay::fast(path, options).expect("opens");
    let mut events = Vec::new();
    replay.collect(Time::from_ns(i64::MAX), &mut events).expect("read");
    assert!(replay.finished());
    (events, replay.stop().expect("stops"))
}

fn samples(events: &[Event]) -> Vec<ImuSample> {
    events.iter().filter_map(|e| if let Event::Imu(s) = e { Some(*s) } else { None }).collect()
}

fn frames(events: &[Event]) -> Vec<&CameraFrame> {
    events.iter().filter_map(|e| if let Event::Frame(f) = e { Some(f) } else { None }).collect()
}

fn triggers(events: &[Event]) -> Vec<TriggerEdge> {
    events.iter().filter_map(|e| if let Event::Trigger(t) = e { Some(*t) } else { None }).collect()
}

/// Ten lines of the ship's heading a second, through north, one of her place and time, and two presses of the operator.
fn with_ship() -> Vec<Entry> {
    let mut entries = entries();
    entries.extend((0..10).map(|n| {
        let sample = ship(n);
        Entry::Ship(ShipEntry { arrival: sample.arrival, sentence: line_of(&sample) })
    }));
    entries.extend(
        [(150, MarkKind::Stow), (850, MarkKind::Landmark)]
            .map(|(ms, kind)| Entry::Mark(Mark { time: START.plus_ns(ms * MS), kind })),
    );
    let fix = Entry::Ship(ShipEntry {
        arrival: START.plus_ns(333 * MS),
        sentence: "$GPRMC,092725.00,A,4717.11437,N,00833.91522,E,0.004,77.52,091202,,,A*5E\r\n".to_owned(),
    });
    entries.push(fix);
    entries.sort_by_key(Entry::time);
    entries
}

fn fixes(events: &[Event]) -> Vec<ShipFix> {
    events.iter().filter_map(|e| if let Event::ShipFix(f) = e { Some(*f) } else { None }).collect()
}

fn ship(n: i64) -> ShipSample {
    let attitude = (n % 3 == 0).then_some(0.01 * n as f64);
    ShipSample {
        arrival: START.plus_ns(n * 100 * MS + 11 * MS),
        heading: Some(((355 + n) as f64).rem_euclid(360.0).to_radians()),
        roll: attitude,
        pitch: attitude,
        heading_sigma: None,
        reduced: false,
    }
}

fn ships(events: &[Event]) -> Vec<ShipSample> {
    events.iter().filter_map(|e| if let Event::Ship(s) = e { Some(*s) } else { None }).collect()
}

fn marks(events: &[Event]) -> Vec<MarkKind> {
    events.iter().filter_map(|e| if let Event::Mark(m) = e { Some(m.kind) } else { None }).collect()
}

#[test]
fn a_ships_lines_and_presses_come_back_in_both_modes() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = write(folder.path(), &with_ship(), Some(PERIOD));
    let (events, stats) = fast(&path, &options(2_000, FaultPlan::default()));
    assert!(events.is_sorted_by_key(Event::arrival));
    let near = |a: f64, b: f64| (a - b).abs() < 1e-10;
    for (n, got) in (0..20).zip(ships(&events)) {
        let sent = ship(n % 10);
        assert_eq!(got.arrival.ns_since(sent.arrival), n / 10 * PERIOD);
        assert!(near(got.heading.expect("told"), sent.heading.expect("told")), "{got:?}");
        assert_eq!(got.roll.is_some(), sent.roll.is_some());
    }
    assert_eq!((ships(&events).len(), stats.ship.packets, stats.ship.bad_crc), (20, 22, 0));
    let told: Vec<_> = fixes(&events).iter().map(|fix| (fix.utc, fix.place.is_some())).collect();
    assert_eq!(told, [(Utc::of_day(2002, 12, 9, 34_045.0), true); 2]);
    assert_eq!(marks(&events), [MarkKind::Stow, MarkKind::Landmark, MarkKind::Stow, MarkKind::Landmark]);

    let mut replay = Replay::realtime(&path, &options(1_000, FaultPlan::default())).expect("opens");
    let (mut live, origin) = (Vec::new(), replay.origin());
    while !replay.finished() {
        replay.collect(Time::MIN, &mut live).expect("read");
        clock::sleep_until(clock::now().plus_ns(5 * MS));
    }
    let stats = replay.stop().expect("stops");
    let got = ships(&live);
    assert_eq!((got.len(), fixes(&live).len(), stats.ship.packets), (10, 1, 11));
    for (n, got) in (0..).zip(&got) {
        assert!(near(got.heading.expect("told"), ship(n).heading.expect("told")));
        let late = got.arrival.ns_since(origin) - ship(n).arrival.ns_since(START);
        assert!((0..500 * MS).contains(&late), "{late}");
    }
    assert_eq!(marks(&live), [MarkKind::Stow, MarkKind::Landmark]);
}

/// Everything about an event that a session could depend on.
fn print(event: &Event) -> String {
    match event {
        Event::Frame(f) => format!("{} {} {} {:?}", f.arrival, f.mid_exposure, f.sequence, f.picture.bytes()),
        other => format!("{other:?}"),
    }
}

#[test]
fn a_fast_replay_gives_what_was_recorded_in_order_of_arrival() {
    let recording = recording(None);
    let (events, stats) = fast(&recording.path, &ReplayOptions::default());
    assert!(events.is_sorted_by_key(Event::arrival));
    let got = samples(&events);
    assert_eq!(got.len(), 200);
    for (n, got) in got.iter().enumerate() {
        let sent = sample(n as i64);
        assert_eq!((got.arrival, got.device_time_ns), (sent.arrival, sent.device_time_ns));
        assert!(got.rate.abs_diff_eq(sent.rate, 1e-7) && got.accel.abs_diff_eq(sent.accel, 1e-6));
        let (a, b) = (got.world_from_imu.expect("sent"), sent.world_from_imu.expect("made"));
        assert!(a.angle_between(b) < 1e-6);
    }
    let got = frames(&events);
    assert_eq!(got.len(), 25);
    for (n, frame) in (0..).zip(&got) {
        assert_eq!((frame.mid_exposure, frame.sequence), (exposed(n), 100 + n as u32));
        assert!(frame.picture.bytes().iter().all(|v| v.abs_diff(10 * n as u8) <= 3));
    }
    assert_eq!(triggers(&events).iter().map(|t| t.pressed).collect::<Vec<_>>(), [true, false]);
    assert_eq!((stats.frames.decoded, stats.imu.samples, stats.triggers, stats.rounds), (25, 200, 2, 1));
    assert_eq!((stats.faults, stats.imu.skipped_bytes, stats.imu_unsendable), (0, 0, 0));
}

#[test]
fn fetching_in_steps_gives_the_same_events_each_no_later_than_asked() {
    let recording = recording(Some(PERIOD));
    let plan = FaultPlan::new(3).with(FaultKind::LineGarbage, 0, PERIOD).with(
        FaultKind::FrameCorrupt,
        0,
        PERIOD / 4,
    );
    let options = options(2_500, plan);
    let (whole, _) = fast(&recording.path, &options);
    let mut replay = FastReplay::open(&recording.path, &options).expect("opens");
    let mut stepped = Vec::new();
    let mut until = START;
    while !replay.finished() {
        let before = stepped.len();
        replay.next_until(until, &mut stepped).expect("read");
        assert!(stepped[before..].iter().all(|e| e.arrival() <= until));
        until = until.plus_ns(33_333_333);
    }
    assert!(whole.len() > 500);
    assert_eq!(stepped.iter().map(print).collect::<Vec<_>>(), whole.iter().map(print).collect::<Vec<_>>());
}

#[test]
fn a_loop_has_no_seam() {
    let recording = recording(Some(PERIOD));
    let (events, stats) = fast(&recording.path, &options(10_000, FaultPlan::default()));
    assert!(events.is_sorted_by_key(Event::arrival));
    assert_eq!(stats.rounds, 10);
    let imu = samples(&events);
    assert_eq!(imu.len(), 2_000);
    // The recorded unit's clock is exactly 100 ppm fast and its line never late: steps go on to the nanosecond of rounding.
    for pair in imu.windows(2) {
        assert_eq!(pair[1].arrival.ns_since(pair[0].arrival), 5 * MS);
        let step = pair[1].device_time_ns - pair[0].device_time_ns;
        assert!((step - 5_000_500).abs() <= 1, "{step}");
    }
    let frames = frames(&events);
    // The last picture of the last round arrives after the end.
    assert_eq!(frames.len(), 249);
    for (n, frame) in frames.iter().enumerate() {
        assert_eq!(frame.sequence, 100 + n as u32);
        assert_eq!(frame.mid_exposure, exposed(n as i64));
        assert!(frame.picture.bytes()[0].abs_diff(10 * (n % 25) as u8) <= 3);
    }
    let edges: Vec<_> = triggers(&events).iter().map(|t| t.time.ns_since(START) / MS).collect();
    assert_eq!(edges[..4], [300, 420, 1_300, 1_420]);
    assert_eq!(edges.len(), 20);
}

#[test]
fn truth_is_known_for_every_frame_of_every_round() {
    let recording = recording(Some(PERIOD));
    let mut replay = Replay::fast(&recording.path, &options(3_000, FaultPlan::default())).expect("opens");
    let mut events = Vec::new();
    let mut until = replay.origin();
    let mut seen = 0;
    while !replay.finished() {
        replay.collect(until, &mut events).expect("read");
        until = until.plus_ns(20 * MS);
        for frame in frames(&events) {
            let n = i64::from(frame.sequence - 100) % 25;
            assert_eq!(replay.truth_at(frame.mid_exposure), Some(pose(n)));
            assert_eq!(replay.truth_at(frame.mid_exposure.plus_ns(MS)), None);
            seen += 1;
        }
        events.clear();
    }
    assert_eq!(seen, 74);
}

#[test]
fn a_recording_may_be_played_once_though_it_loops() {
    let recording = recording(Some(PERIOD));
    let (events, _) = fast(&recording.path, &ReplayOptions { looped: false, ..ReplayOptions::default() });
    assert_eq!((samples(&events).len(), frames(&events).len()), (200, 25));
}

#[test]
fn each_fault_does_what_it_says_while_it_lasts() {
    let recording = recording(None);
    let with =
        |kind| fast(&recording.path, &options(2_000, FaultPlan::new(9).with(kind, 200 * MS, 300 * MS)));
    let during = |t: Time| (200 * MS..500 * MS).contains(&t.ns_since(START));

    let (events, stats) = with(FaultKind::ImuDropOut);
    assert_eq!((samples(&events).len(), stats.faults), (140, 60));
    assert!(!samples(&events).iter().any(|s| during(s.arrival)));

    let (events, stats) = with(FaultKind::ImuFreeze);
    let frozen: Vec<_> = samples(&events).into_iter().filter(|s| during(s.arrival)).collect();
    assert_eq!((frozen.len(), stats.faults), (60, 60));
    assert!(frozen.iter().all(|s| s.rate == frozen[0].rate && s.world_from_imu == frozen[0].world_from_imu));
    assert!(frozen.windows(2).all(|p| p[1].device_time_ns > p[0].device_time_ns));
    assert!(samples(&events)[199].rate.x > 0.19, "it recovers");

    let (events, stats) = with(FaultKind::ImuNan);
    assert_eq!((samples(&events).len(), stats.imu.not_finite), (140, 60));

    let (events, stats) = with(FaultKind::LineGarbage);
    assert_eq!((samples(&events).len(), stats.faults), (200, 60), "no packet is lost");
    assert!(stats.imu.skipped_bytes >= 60);

    let (events, stats) = with(FaultKind::FrameDropOut);
    assert_eq!((frames(&events).len(), stats.faults), (17, 8));
    assert!(!frames(&events).iter().any(|f| during(f.arrival)));

    let (events, stats) = with(FaultKind::FrameOtherSize);
    assert_eq!((frames(&events).len(), stats.frames.other_size), (17, 8));
    assert!(frames(&events).iter().all(|f| (f.picture.width(), f.picture.height()) == SIZE));

    let (events, stats) = with(FaultKind::FrameCorrupt);
    assert_eq!((frames(&events).len(), stats.frames.undecodable), (17, 8));
}

#[test]
fn a_recording_that_was_cut_short_plays_up_to_there_and_then_says_so() {
    let recording = recording(Some(PERIOD));
    let bytes = std::fs::read(&recording.path).expect("read");
    let cut = recording.folder.path().join("cut.mcap");
    std::fs::write(&cut, &bytes[..bytes.len() * 3 / 4]).expect("written");
    for mode in [Replay::fast, Replay::realtime] {
        let mut replay = mode(&cut, &ReplayOptions::default()).expect("opens");
        let mut events = Vec::new();
        let error = loop {
            match replay.collect(Time::from_ns(i64::MAX), &mut events) {
                Ok(()) => clock::sleep_until(clock::now().plus_ns(5 * MS)),
                Err(error) => break error,
            }
        };
        assert!(matches!(error, ReplayError::Recording(RecordError::Truncated { .. })), "{error}");
        replay.collect(Time::from_ns(i64::MAX), &mut events).expect("said once");
        assert!(replay.finished());
        assert!(frames(&events).len() > 5 && frames(&events).len() < 25, "{}", frames(&events).len());
        replay.stop().expect("stops");
    }
}

#[test]
fn what_cannot_be_replayed_is_refused_in_words() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let absent = Replay::fast(&folder.path().join("absent.mcap"), &ReplayOptions::default()).err();
    assert!(matches!(absent, Some(ReplayError::Recording(RecordError::Open { .. }))));
    let blind: Vec<_> = entries().into_iter().filter(|e| !matches!(e, Entry::Frame(_))).collect();
    let path = write(folder.path(), &blind, None);
    let refused = Replay::realtime(&path, &ReplayOptions::default()).err();
    assert!(matches!(refused, Some(ReplayError::Recording(RecordError::NoFrames { .. }))));
    std::fs::remove_file(&path).expect("removed");
    let path = write(folder.path(), &entries(), Some(50 * MS));
    let refused = Replay::fast(&path, &ReplayOptions::default()).err().expect("no such loop").to_string();
    assert!(refused.contains("repeats every 0.050 s") && refused.contains("without looping"), "{refused}");
}

/// The whole way: pseudo-terminal, serial code, queues, the host's clock; over the seam of a loop.
#[test]
fn in_real_time_everything_arrives_at_its_time_through_the_serial_code() {
    let recording = recording(Some(PERIOD));
    let before = clock::now();
    let mut replay = Replay::realtime(&recording.path, &options(1_300, FaultPlan::default())).expect("opens");
    let shift = replay.origin().ns_since(START);
    assert!((0..200 * MS).contains(&replay.origin().ns_since(before)));
    let mut events = Vec::new();
    let mut last = Time::MIN;
    while !replay.finished() {
        let from = events.len();
        replay.collect(Time::MIN, &mut events).expect("runs");
        assert!(events[from..].is_sorted_by_key(Event::arrival));
        assert!(events[from..].iter().all(|e| e.arrival() <= clock::now()));
        last = events.last().map_or(last, Event::arrival);
        clock::sleep_until(clock::now().plus_ns(5 * MS));
    }
    for frame in frames(&events) {
        assert_eq!(replay.truth_at(frame.mid_exposure), Some(pose(i64::from(frame.sequence - 100) % 25)));
    }
    let stats = replay.stop().expect("stops");
    let imu = samples(&events);
    assert_eq!(imu.len(), 260);
    let mut delays: Vec<_> =
        (0..).zip(&imu).map(|(n, s)| s.arrival.ns_since(sample(n).arrival) - shift).collect();
    delays.sort_unstable();
    assert!(delays[0] >= 0, "no byte arrives before it was sent");
    // Generous, for a computer that is busy with other tests.
    assert!(delays[130] < 20 * MS, "median delay {} ns", delays[130]);
    for (n, got) in (0..).zip(&imu) {
        assert!((got.device_time_ns - sample(n).device_time_ns).abs() <= 1, "the unit's clock is its own");
    }
    let frames = frames(&events);
    assert_eq!(frames.len(), 32);
    for (n, frame) in (0..).zip(&frames) {
        assert_eq!(frame.mid_exposure, exposed(n).plus_ns(shift));
        let delay = frame.arrival.ns_since(exposed(n).plus_ns(30 * MS + shift));
        assert!((0..150 * MS).contains(&delay), "{delay} ns");
    }
    let edges: Vec<_> = triggers(&events).iter().map(|t| t.time.ns_since(START) - shift).collect();
    assert_eq!(edges, [300 * MS, 420 * MS]);
    eprintln!("delay of samples: median {} us, 99 % {} us", delays[130] / 1_000, delays[257] / 1_000);
    assert_eq!((stats.frames.decoded, stats.frames_late, stats.frames_overwritten), (32, 0, 0));
    assert_eq!((stats.imu.samples, stats.imu_overflow, stats.line_lost_bytes), (260, 0, 0));
}

/// Nobody fetches: memory stays bounded, the newest remain, and the replay can be stopped at any time.
#[test]
fn in_real_time_the_newest_pictures_win() {
    let recording = recording(Some(PERIOD));
    let mut replay = Replay::realtime(&recording.path, &ReplayOptions::default()).expect("opens");
    clock::sleep_until(replay.origin().plus_ns(600 * MS));
    let mut events = Vec::new();
    replay.collect(Time::MIN, &mut events).expect("runs");
    let frames = frames(&events);
    assert!((3..=5).contains(&frames.len()), "{}", frames.len());
    assert!(frames[0].sequence >= 108, "{}", frames[0].sequence);
    assert!(frames.windows(2).all(|p| p[1].sequence == p[0].sequence + 1));
    assert!(!replay.finished());
    let stopping = clock::now();
    let stats = replay.stop().expect("stops");
    assert!(clock::now().ns_since(stopping) < 500 * MS);
    assert!(stats.frames_overwritten >= 8, "{stats:?}");
}

/// Faults reach the serial code as bytes.
#[test]
fn in_real_time_faults_are_ridden_out() {
    let recording = recording(None);
    let plan = FaultPlan::new(4)
        .with(FaultKind::LineGarbage, 0, 2 * PERIOD)
        .with(FaultKind::ImuNan, 100 * MS, 100 * MS)
        .with(FaultKind::FrameCorrupt, 100 * MS, 200 * MS);
    let mut replay = Replay::realtime(&recording.path, &options(500, plan)).expect("opens");
    let mut events = Vec::new();
    while !replay.finished() {
        replay.collect(Time::MIN, &mut events).expect("runs");
        clock::sleep_until(clock::now().plus_ns(5 * MS));
    }
    let stats = replay.stop().expect("stops");
    assert_eq!((samples(&events).len(), stats.imu.not_finite), (80, 20));
    assert_eq!((frames(&events).len() as u64 + stats.frames.undecodable, stats.frames.undecodable), (12, 5));
    assert!(stats.imu.skipped_bytes > 100);
}
