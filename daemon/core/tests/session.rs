//! The session at its boundary: events in, scenes and records out.

#![allow(clippy::expect_used, reason = "a test that cannot go on has failed")]

use std::sync::Arc;

use bowwave_core::{
    calibration::{Calibration, TriggerLatency},
    ephemeris::{Place, Utc},
    estimate::attitude::Source,
    event::{CameraFrame, Event, ImuSample, Picture, PixelFormat, ShipFix, Tick, TriggerEdge},
    fault::{Fault, FaultChange},
    frame::scene::{LeftOut, Pass, PassDecision, Status},
    geometry::{Lens, look},
    model::{Model, ModelId, ModelKind, Part, Vertex, Zone},
    own_ship::{OwnShip, Phantom},
    session::{Session, Setup},
    time::Time,
    world::{
        scenario::{Scenario, Side},
        score::{NotScored, Outcome, ShotRecord},
        track::{TRACK_STEP_NS, TrackBlock},
    },
};
use glam::{DQuat, DVec2, DVec3, Vec2, Vec3};

#[path = "session/lights.rs"]
mod lights;
#[path = "session/orders.rs"]
mod orders;
#[path = "session/tracks.rs"]
mod tracks;

const MS: i64 = 1_000_000;

/// A closed box, 8 m long, 3 m wide and 4 m high, 3 m of it above the water; everything is engine.
fn block() -> Model {
    let (low, high) = (Vec3::new(-4.0, -1.5, -1.0), Vec3::new(4.0, 1.5, 3.0));
    let corner = |i: usize| {
        let pick = |bit: usize, l: f32, h: f32| if i & bit == 0 { l } else { h };
        let position = Vec3::new(pick(1, low.x, high.x), pick(2, low.y, high.y), pick(4, low.z, high.z));
        Vertex { position, normal: position.normalize(), uv: Vec2::ZERO, albedo: Vec3::splat(0.5) }
    };
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let indices: Vec<u32> = quads.iter().flat_map(|q| [q[0], q[1], q[2], q[0], q[2], q[3]]).collect();
    Model {
        name: "block".into(),
        kind: ModelKind::Mesh,
        vertices: (0..8).map(corner).collect(),
        parts: vec![Part { zone: Zone::Engine, indices: 0..indices.len() as u32 }],
        indices,
        texture: None,
        waterline: [(-4.0, -1.5), (4.0, -1.5), (4.0, 1.5), (-4.0, 1.5)]
            .map(|(x, y)| DVec2::new(x, y))
            .to_vec(),
        min: low,
        max: high,
    }
}

fn calibration() -> Calibration {
    Calibration {
        time_offset_ns: 4 * MS,
        time_offset_sigma_ns: MS,
        gyro_bias_sigma: DVec3::splat(1e-4),
        ..Calibration::nominal(Lens::pinhole(64, 48, 1.0))
    }
}

const SCENARIO: &str = r#"
name = "One block ahead"
[sea]
beaufort = 0
wind_from_deg = 0
[mount]
eye_height_m = 6.0
[weapon]
rounds_per_minute = 600
belt = 5
dispersion_mrad = 0.0
[[boat]]
name = "block"
model = "block"
side = "hostile"
course = "still"
range_m = 200
bearing_deg = 0
heading_deg = 90
"#;

fn session(text: &str) -> Session {
    session_with(text, calibration())
}

fn session_with(text: &str, calibration: Calibration) -> Session {
    session_on(text, calibration, OwnShip::default())
}

fn session_on(text: &str, calibration: Calibration, own_ship: OwnShip) -> Session {
    let scenario = Scenario::parse(text, "test").expect("the scenario is valid");
    let boats = scenario.boats.len();
    Session::new(Setup {
        scenario,
        calibration,
        models: Arc::new([block()]),
        boat_models: vec![ModelId(0); boats],
        screen: (128, 96),
        video: PixelFormat::Rgb,
        orientation: Source::Auto,
        heading: bowwave_core::estimate::HeadingSettings::default(),
        own_ship,
    })
    .expect("every boat has a model")
}

/// A camera that looks at the block's middle, or swings by `rate` about the vertical.
fn attitude(t_s: f64, rate: f64) -> DQuat {
    let drop = (6.0f64 - 1.2) / 200.0;
    look(rate * t_s, -drop, 0.0)
}

struct DeviceStream {
    rate: f64,
    imu: std::ops::Range<i64>,
    frames: std::ops::Range<i64>,
    faults: Vec<FaultChange>,
}

/// Steps a session over `seconds`; `stream` says in which milliseconds devices report.
fn play(
    session: &mut Session,
    seconds: f64,
    stream: &DeviceStream,
    edges: &[TriggerEdge],
    mut each: impl FnMut(&Session, Option<Status>, [PassDecision; Pass::COUNT], &[ShotRecord]),
) {
    let mut sent_imu = 0;
    let mut sent_frame = 0;
    let mut sent_edge = 0;
    for tick in 1..=(seconds * 30.0) as i64 {
        let now = Time::from_ns(tick * 1_000_000_000 / 30);
        let mut events = Vec::new();
        while sent_imu * 5 * MS + MS / 2 <= now.ns() {
            let ms = sent_imu * 5;
            if stream.imu.contains(&ms) {
                let t = ms as f64 * 1e-3;
                events.push(Event::Imu(ImuSample {
                    arrival: Time::from_ns(ms * MS + MS / 2),
                    device_time_ns: ms * MS,
                    rate: DVec3::new(1e-9 * ms as f64, stream.rate, 0.0),
                    accel: attitude(t, stream.rate).inverse() * DVec3::Z * 9.81,
                    world_from_imu: Some(attitude(t, stream.rate)),
                }));
            }
            sent_imu += 1;
        }
        while sent_frame * 1_000_000_000 / 30 + 20 * MS <= now.ns() {
            let mid = sent_frame * 1_000_000_000 / 30;
            if stream.frames.contains(&(mid / MS)) {
                let bytes = vec![120u8; 64 * 48 * 3].into();
                events.push(Event::Frame(CameraFrame {
                    arrival: Time::from_ns(mid + 20 * MS),
                    mid_exposure: Time::from_ns(mid),
                    sequence: sent_frame as u32,
                    picture: Picture::new(PixelFormat::Rgb, 64, 48, bytes).expect("a picture"),
                    jpeg: None,
                }));
            }
            sent_frame += 1;
        }
        while edges.get(sent_edge).is_some_and(|e| e.time <= now) {
            events.push(Event::Trigger(edges[sent_edge]));
            sent_edge += 1;
        }
        let before = now.plus_ns(-1_000_000_000 / 30);
        let due = stream.faults.iter().filter(|f| f.time > before && f.time <= now);
        events.extend(due.cloned().map(Event::Fault));
        events.sort_by_key(Event::arrival);
        events.iter().for_each(|event| session.event(event));
        let step = session.tick(Tick::at(now));
        let records = step.records.to_vec();
        let (status, passes) = match &step.view {
            v if !v.blind => (Some(v.scene.hud.status.clone()), v.scene.passes),
            _ => (None, [PassDecision::LeftOut(LeftOut::NoPose); Pass::COUNT]),
        };
        each(session, status, passes, &records);
    }
}

fn burst(from_ms: i64, to_ms: i64) -> [TriggerEdge; 2] {
    [
        TriggerEdge { time: Time::from_ns(from_ms * MS), pressed: true },
        TriggerEdge { time: Time::from_ns(to_ms * MS), pressed: false },
    ]
}

const ALL: DeviceStream =
    DeviceStream { rate: 0.0, imu: 0..i64::MAX, frames: 0..i64::MAX, faults: Vec::new() };

#[test]
fn rounds_at_the_block_strike_it() {
    let mut s = session(SCENARIO);
    let mut records = Vec::new();
    let mut states = Vec::new();
    play(&mut s, 3.0, &ALL, &burst(500, 750), |_, status, passes, r| {
        records.extend_from_slice(r);
        states.extend(status);
        assert_eq!(passes[Pass::Video as usize], PassDecision::Run);
    });
    assert_eq!(records.len(), 3, "rounds at 500, 600 and 700 ms");
    for (i, record) in records.iter().enumerate() {
        assert_eq!(record.shot, i as u64 + 1);
        assert_eq!(record.fired.ns(), (500 + 100 * i as i64) * MS);
        let Outcome::Hit { boat, zone, range_m, time, .. } = &record.outcome else { panic!("{record:?}") };
        assert_eq!((boat.as_str(), *zone), ("block", Zone::Engine));
        assert!((197.0..201.0).contains(range_m), "{range_m}");
        let flight = time.secs_since(record.fired);
        assert!((0.2..0.3).contains(&flight), "{flight}");
    }
    assert!(
        states.contains(&Status::Hit { zone: Zone::Engine })
            && matches!(states.last(), Some(Status::NotChecked { .. }))
    );
    assert_eq!(s.score(), (3, 3));
}

#[test]
fn a_struck_neutral_is_told_and_no_hit() {
    let mut s = session(&SCENARIO.replace("\"hostile\"", "\"neutral\""));
    let (mut states, mut sides) = (Vec::new(), Vec::new());
    play(&mut s, 3.0, &ALL, &burst(500, 750), |_, status, _, records| {
        states.extend(status);
        sides.extend(records.iter().map(|r| match &r.outcome {
            Outcome::Hit { side, .. } => *side,
            other => panic!("{other:?}"),
        }));
    });
    assert_eq!(sides, [Some(Side::Neutral); 3]);
    assert!(states.contains(&Status::NeutralHit { zone: Zone::Engine }), "{states:?}");
    assert!(!states.iter().any(|s| matches!(s, Status::Hit { .. })), "{states:?}");
    assert_eq!((s.score(), s.hud().hits, s.hud().neutral_hits), ((3, 0), 0, 3));
}

#[test]
fn rounds_leave_as_late_as_the_trigger_is() {
    for latency_ms in [-30, 45] {
        let trigger = Some(TriggerLatency { latency_ns: latency_ms * MS, sigma_ns: MS });
        let mut s = session_with(SCENARIO, Calibration { trigger, ..calibration() });
        let mut fired = Vec::new();
        play(&mut s, 3.0, &ALL, &burst(500, 750), |_, _, _, r| {
            fired.extend(r.iter().map(|r| r.fired.ns() / MS));
        });
        assert_eq!(fired, [500, 600, 700].map(|ms| ms + latency_ms));
    }
}

#[test]
fn the_pose_is_the_one_at_the_pictures_mid_exposure() {
    let mut s = session(SCENARIO);
    let rate = 0.7;
    let mut checked = 0;
    let mut sent = 0i64;
    for tick in 1..60i64 {
        let now = Time::from_ns(tick * 33 * MS);
        let mut events = Vec::new();
        while sent * 5 * MS <= now.ns() {
            let t = sent as f64 * 5e-3;
            events.push(Event::Imu(ImuSample {
                arrival: Time::from_ns(sent * 5 * MS),
                device_time_ns: sent * 5 * MS,
                rate: DVec3::new(0.0, rate, 1e-9 * sent as f64),
                accel: attitude(t, rate).inverse() * DVec3::Z * 9.81,
                world_from_imu: Some(attitude(t, rate)),
            }));
            sent += 1;
        }
        let mid = now.plus_ns(-21 * MS);
        let picture =
            Picture::new(PixelFormat::Rgb, 64, 48, vec![9u8; 64 * 48 * 3].into()).expect("a picture");
        events.push(Event::Frame(CameraFrame {
            arrival: now,
            mid_exposure: mid,
            sequence: 0,
            picture,
            jpeg: None,
        }));
        events.iter().for_each(|event| s.event(event));
        let step = s.tick(Tick::at(now));
        if let Some(view) = Some(step.view).filter(|v| v.pose_known) {
            // The calibrated offset moves the exposure by 4 ms on the inertial unit's clock.
            let truth = attitude(mid.plus_ns(4 * MS).ns() as f64 * 1e-9, rate);
            assert!(view.scene.camera.world_from_camera.angle_between(truth) < 1e-6);
            checked += 1;
        }
    }
    assert!(checked > 50);
}

/// Records of a run, and what its last tick with a picture showed and did with the boats.
fn ended(
    seconds: f64,
    stream: &DeviceStream,
    trigger: &[TriggerEdge],
) -> (Vec<ShotRecord>, Option<(Status, PassDecision)>) {
    let mut records = Vec::new();
    let mut last = None;
    play(&mut session(SCENARIO), seconds, stream, trigger, |_, status, passes, r| {
        records.extend_from_slice(r);
        last = status.map(|s| (s, passes[Pass::Boats as usize]));
    });
    (records, last)
}

#[test]
fn without_orientation_no_boat_is_drawn_and_no_round_is_scored() {
    let (records, last) = ended(2.0, &DeviceStream { imu: 0..1000, ..ALL }, &burst(1500, 1650));
    assert_eq!(records.len(), 2);
    for r in &records {
        assert_eq!(r.outcome, Outcome::NotScored { cause: NotScored::ImuStale });
        assert!(r.pose_age_ns > 400 * MS);
    }
    let (status, boats) = last.expect("pictures kept coming");
    assert!(matches!(status, Status::NotScored { cause: "IMU LOST", .. }), "{status:?}");
    assert_eq!(boats, PassDecision::LeftOut(LeftOut::NoPose));
}

#[test]
fn without_pictures_no_round_is_scored() {
    let (records, last) = ended(2.5, &DeviceStream { frames: 0..1000, ..ALL }, &burst(1500, 1550));
    let causes: Vec<_> = records.iter().map(|r| &r.outcome).collect();
    assert_eq!(causes, [&Outcome::NotScored { cause: NotScored::CameraStale }]);
    assert!(matches!(last, Some((Status::NotScored { cause: "CAMERA LOST", .. }, _))), "{last:?}");
}

#[test]
fn the_same_events_give_the_same_records_however_they_are_cut() {
    let run = || {
        let mut s = session(&SCENARIO.replace("dispersion_mrad = 0.0", "dispersion_mrad = 4.0"));
        let mut all = String::new();
        play(&mut s, 3.0, &DeviceStream { rate: 0.02, ..ALL }, &burst(300, 900), |_, _, _, r| {
            all += &format!("{r:?}")
        });
        all
    };
    let first = run();
    assert!(first.contains("Miss") && first == run());
}

#[test]
fn rounds_in_the_air_at_the_end_are_recorded() {
    let mut s = session(&SCENARIO.replace("range_m = 200", "range_m = 2000"));
    let mut during = 0;
    play(&mut s, 1.0, &ALL, &burst(800, 850), |_, _, _, r| during += r.len());
    assert_eq!(during, 0);
    let left = s.finish().0.to_vec();
    assert_eq!(left.len(), 1);
    assert!(matches!(left[0].outcome, Outcome::Miss { .. }), "{left:?}");
}

#[test]
fn an_empty_scenario_is_video_and_display() {
    let text: String = SCENARIO.split("[[boat]]").next().expect("text").to_owned();
    let mut s = session(&text);
    let mut frames = 0;
    play(&mut s, 1.0, &ALL, &[], |_, status, passes, _| {
        if status.is_some() {
            frames += 1;
            assert_eq!(passes[Pass::Boats as usize], PassDecision::LeftOut(LeftOut::NoBoats));
            assert_eq!(passes[Pass::Mirror as usize], PassDecision::LeftOut(LeftOut::NoBoats));
            assert_eq!(passes[Pass::Hud as usize], PassDecision::Run);
        }
    });
    assert!(frames > 25);
}

#[test]
fn a_rehearsal_has_everything_in_view() {
    let moving = SCENARIO.replace("\"still\"", "\"straight\"\nspeed_kn = 10\nlights = \"rules\"");
    let lens = calibration().lens;
    let barrel =
        Phantom::new("", vec![DVec2::ZERO, DVec2::X * 9.0, DVec2::Y * 9.0], (lens.width, lens.height));
    let own_ship = OwnShip::new(vec![barrel], lens.centre, &[], (lens.width, lens.height));
    let scene = session_on(&format!("{moving}\n[searchlight]\n"), calibration(), own_ship).rehearsal();
    for pass in Pass::ALL {
        let runs = scene.passes[pass as usize];
        // The sea of this scenario is calm and nothing in it is switched off.
        assert_eq!(runs, PassDecision::Run, "{pass:?}");
    }
    // A round of each kind: splash, strike, tracer, smoke, flame.
    assert_eq!((scene.boats.len(), scene.lights.len(), scene.rounds.len()), (1, 1, 5));
    // A boat that lies still leaves no wake.
    let still = session(SCENARIO).rehearsal();
    assert_eq!(still.passes[Pass::Wake as usize], PassDecision::LeftOut(LeftOut::NoBoatMoves));
}

/// The outcomes of the rounds of three bursts, and the states that were shown in half a second around the middle one.
fn with_fault(fault: Fault) -> (Vec<Outcome>, Vec<Status>, Vec<Option<Fault>>) {
    let mut s = session(SCENARIO);
    let at = |ms: i64| Time::from_ns(ms * MS);
    let faults = vec![FaultChange::raised(at(1200), fault, "test"), FaultChange::cleared(at(2200), fault)];
    let edges = [burst(500, 550), burst(1500, 1550), burst(2500, 2550)].concat();
    let (mut outcomes, mut states, mut warnings, mut tick) = (Vec::new(), Vec::new(), Vec::new(), 0);
    play(&mut s, 4.0, &DeviceStream { faults, ..ALL }, &edges, |s, status, _, r| {
        outcomes.extend(r.iter().map(|r| r.outcome.clone()));
        tick += 1;
        if (40..60).contains(&tick) {
            states.extend(status);
            warnings.push(s.hud().warning);
        }
    });
    (outcomes, states, warnings)
}

#[test]
fn a_gun_that_is_not_inert_fires_nothing_and_says_so() {
    let (outcomes, states, _) = with_fault(Fault::NotInert);
    assert_eq!(outcomes.len(), 2, "the burst in between fired nothing: {outcomes:?}");
    assert!(outcomes.iter().all(|o| matches!(o, Outcome::Hit { .. })));
    let said = Status::Fault { cause: "NOT ARMED: GUN NOT INERT", action: "FIT THE INERT PLUG" };
    assert!(states.iter().all(|s| *s == said), "{states:?}");
}

#[test]
fn a_round_fired_while_a_device_is_lost_is_recorded_with_the_reason() {
    let (outcomes, states, _) = with_fault(Fault::CamBusy);
    assert_eq!(outcomes.len(), 3);
    let cause = NotScored::Fault(Fault::CamBusy);
    assert!(outcomes.contains(&Outcome::NotScored { cause }), "{outcomes:?}");
    assert_eq!(NotScored::from_name(cause.name()), Some(cause));
    assert!(
        states.iter().all(|s| matches!(s, Status::NotScored { cause: "CAMERA IN USE", .. })),
        "{states:?}"
    );
}

#[test]
fn a_warning_is_shown_and_everything_is_scored() {
    let (outcomes, states, warnings) = with_fault(Fault::DiskFull);
    assert_eq!(outcomes.iter().filter(|o| matches!(o, Outcome::Hit { .. })).count(), 3);
    assert!(states.iter().all(|s| matches!(s, Status::NotChecked { .. } | Status::Hit { .. })), "{states:?}");
    assert!(warnings.iter().all(|w| *w == Some(Fault::DiskFull)));
}

#[test]
fn a_hot_computer_draws_no_reflection() {
    let water = |faults: Vec<FaultChange>| {
        let mut s = session(SCENARIO);
        let mut last = None;
        play(&mut s, 1.0, &DeviceStream { faults, ..ALL }, &[], |_, _, passes, _| last = Some(passes));
        last.map(|passes| (passes[Pass::Water as usize], passes[Pass::Boats as usize]))
    };
    let cool = water(Vec::new());
    let hot = water(vec![FaultChange::raised(Time::from_ns(MS), Fault::Thermal, "test")]);
    assert_eq!(hot.map(|h| h.1), Some(PassDecision::Run));
    assert_eq!(cool, Some((PassDecision::Run, PassDecision::Run)));
    assert_eq!(hot.map(|h| h.0), Some(PassDecision::LeftOut(LeftOut::NoReflectionInView)));
}

#[test]
fn a_busy_computer_leaves_out_the_water_of_far_boats_then_of_all() {
    let second = SCENARIO.split("[[boat]]").nth(1).map_or("", |boat| boat);
    let second = second
        .replace("\"block\"\nmodel", "\"far\"\nmodel")
        .replace("200", "400")
        .replace("bearing_deg = 0", "bearing_deg = 3");
    let two = format!("{SCENARIO}\n[[boat]]{second}");
    let mirrored = |faults: &[Fault]| {
        let mut s = session(&two);
        let raised = |f: &Fault| FaultChange::raised(Time::from_ns(MS), *f, "test");
        let faults = faults.iter().map(raised).collect();
        play(&mut s, 1.0, &DeviceStream { faults, ..ALL }, &[], |_, _, _, _| {});
        let view = s.tick(Tick::at(Time::from_ns(1_010 * MS))).view;
        view.scene.boats.iter().map(|b| (b.boat, b.reflection.is_some())).collect::<Vec<_>>()
    };
    assert_eq!(mirrored(&[]), [(1, true), (0, true)]);
    assert_eq!(mirrored(&[Fault::LoadUnseen]), [(1, true), (0, true)]);
    assert_eq!(mirrored(&[Fault::LoadFar]), [(1, false), (0, true)]);
    assert_eq!(mirrored(&[Fault::LoadFar, Fault::LoadWater]), [(1, false), (0, false)]);
}

#[test]
fn before_the_first_picture_a_black_one_says_what_is_wrong() {
    let mut s = session(SCENARIO);
    let view = s.tick(Tick::at(Time::from_ns(MS))).view;
    assert!(view.blind);
    assert!(matches!(view.scene.hud.status, Status::NotScored { cause: "NO CAMERA YET", .. }));
    assert!(view.scene.boats.is_empty() && view.picture.bytes().iter().all(|b| *b == 0));
}

#[test]
fn the_ships_place_and_time_put_the_sun_where_it_stands() {
    let fix = |text: &str| {
        let mut s = session(text);
        let (place, utc) = (Place::new(54.1, 7.9), Utc::of_day(2026, 6, 1, 12.0 * 3600.0));
        s.event(&Event::ShipFix(ShipFix { arrival: Time::from_ns(MS), place, utc }));
        let mut said = Vec::new();
        let mut sun = DVec3::ZERO;
        for tick in 1..30 {
            let now = Time::from_ns(tick * 33 * MS);
            feed(&mut s, now);
            let answer = s.tick(Tick::at(now));
            sun = answer.view.scene.light.sun_direction;
            said.extend(answer.notes.iter().map(|note| (note.warning, note.text.clone())));
        }
        let elevation = sun.z.asin().to_degrees();
        (elevation, said.into_iter().find(|(_, text)| text.contains("place and time")).expect("it is told"))
    };
    let (elevation, (warning, text)) = fix(SCENARIO);
    assert!((elevation - 57.4).abs() < 0.5 && !warning, "{elevation} {text}");
    assert!(
        text.contains(
            "57 above the horizon by the ship's place and time (54.100 N 7.900 E, 2026-06-01 12:00 UTC)"
        ),
        "{text}"
    );
    // A scenario with a sun of its own keeps that, and the contradiction is told.
    let (elevation, (warning, text)) = fix(&format!("{SCENARIO}[light]\nsun_elevation_deg = 5\n"));
    assert!((elevation - 5.0).abs() < 1e-6 && warning, "{elevation} {text}");
    assert!(text.contains("source = \"ship\""), "{text}");
}

/// An orientation and a picture at `now`.
fn feed(session: &mut Session, now: Time) {
    feed_late(session, now, MS);
}

/// The same with a picture that was exposed so many nanoseconds before.
fn feed_late(session: &mut Session, now: Time, late_ns: i64) {
    session.event(&Event::Imu(ImuSample {
        arrival: now,
        device_time_ns: now.ns(),
        rate: DVec3::new(1e-12 * now.ns() as f64, 0.0, 0.0),
        accel: attitude(0.0, 0.0).inverse() * DVec3::Z * 9.81,
        world_from_imu: Some(attitude(0.0, 0.0)),
    }));
    let picture = Picture::new(PixelFormat::Rgb, 64, 48, vec![120u8; 64 * 48 * 3].into()).expect("a picture");
    session.event(&Event::Frame(CameraFrame {
        arrival: now,
        mid_exposure: now.plus_ns(-late_ns),
        sequence: (now.ns() / MS) as u32,
        picture,
        jpeg: None,
    }));
}

#[test]
fn the_same_inputs_give_the_same_digests_and_others_do_not() {
    let run = |rate: f64, fault_ms: i64| {
        let mut s = session(SCENARIO);
        let faults = vec![
            FaultChange::raised(Time::from_ns(fault_ms * MS), Fault::CamCorrupt, "a"),
            FaultChange::cleared(Time::from_ns((fault_ms + 400) * MS), Fault::CamCorrupt),
        ];
        play(&mut s, 2.0, &DeviceStream { rate, faults, ..ALL }, &burst(500, 750), |_, _, _, _| {});
        s.finish();
        s.digest()
    };
    let first = run(0.0, 800);
    assert_eq!(run(0.0, 800), first);
    let other_rate = run(1e-6, 800);
    assert_ne!((other_rate.records, other_rate.scenes), (first.records, first.scenes));
    // A warning changes what is shown and nothing that is scored.
    let other_fault = run(0.0, 900);
    assert_eq!(other_fault.records, first.records);
    assert_ne!(other_fault.scenes, first.scenes);
}
