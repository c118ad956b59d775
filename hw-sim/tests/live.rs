//! The simulated gun that somebody aims: the same script gives the same events, the pictures show where the gun points, and a panorama that is
//! damaged says so.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    fs,
    path::{Path, PathBuf},
    sync::LazyLock,
    thread,
    time::Duration,
};

use bowwave_core::{
    act::Act,
    event::{CameraFrame, Event},
    time::NS_PER_S,
    world::scenario::{BUILT_IN, Scenario},
};
use glam::{DVec2, DVec3};
use hw_sim::{
    live::{Hands, Live, LiveOptions, Script, calibration},
    panorama::{self, Panorama, PanoramaRecipe},
    replay::ReplayError,
};

const SCRIPT: &str = r#"
[[step]]
at_s = 0
azimuth_deg = -5
elevation_deg = -3

[[step]]
at_s = 0.5
azimuth_deg = 12
over_s = 1
act = "report"

[[step]]
at_s = 1.8
press_s = 0.4
"#;

/// A small sea that is made once for all tests.
static SEA: LazyLock<(tempfile::TempDir, PanoramaRecipe, PathBuf)> = LazyLock::new(|| {
    let (_, text) = BUILT_IN.into_iter().find(|(name, _)| *name == "first-target").unwrap();
    let mut recipe = PanoramaRecipe::of_scenario(&Scenario::parse(text, "test").unwrap(), (320, 180));
    recipe.recipe.frame_rate_hz = 10.0;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sea.panorama");
    panorama::make(&recipe, &path, &mut |_, _| {}).unwrap();
    (folder, recipe, path)
});

fn start(script: Option<&str>, hands: Hands, realtime: bool) -> Live {
    let (_, recipe, panorama) = &*SEA;
    let script = script.map(|text| Script::parse(text, "script").unwrap());
    Live::start(LiveOptions { recipe, panorama, hands, script, realtime, is_coded: false }).unwrap()
}

/// Events of the first seconds without a clock.
fn played(seconds: i64) -> (Live, Vec<Event>) {
    let mut live = start(Some(SCRIPT), Hands::default(), false);
    let mut events = Vec::new();
    for tick in 0..30 * seconds {
        live.collect(live.origin().plus_ns(tick * NS_PER_S / 30), &mut events).unwrap();
    }
    (live, events)
}

fn frames(events: &[Event]) -> Vec<&CameraFrame> {
    events
        .iter()
        .filter_map(|event| if let Event::Frame(frame) = event { Some(frame) } else { None })
        .collect()
}

#[test]
fn the_same_script_gives_the_same_events() {
    let ((_, a), (_, b)) = (played(3), played(3));
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(&b) {
        match (a, b) {
            (Event::Frame(a), Event::Frame(b)) => {
                assert_eq!((a.arrival, a.mid_exposure, a.sequence), (b.arrival, b.mid_exposure, b.sequence));
                assert!(a.picture.bytes() == b.picture.bytes(), "picture {}", a.sequence);
            }
            (a, b) => assert_eq!(format!("{a:?}"), format!("{b:?}")),
        }
    }
    assert!(a.windows(2).all(|pair| pair[0].arrival() <= pair[1].arrival()));
    let samples = a.iter().filter(|event| matches!(event, Event::Imu(_))).count();
    assert!((590..=600).contains(&samples), "{samples}");
    assert!((28..=30).contains(&frames(&a).len()));
    let edges: Vec<bool> = a
        .iter()
        .filter_map(|event| if let Event::Trigger(edge) = event { Some(edge.pressed) } else { None })
        .collect();
    assert_eq!(edges, [true, false]);
    assert!(a.iter().any(|event| matches!(event, Event::Act(act) if act.act == Act::Report)));
}

/// Row of the horizon in a column, within ten of `about`: where the picture darkens most downwards.
fn horizon_row(frame: &CameraFrame, column: usize, about: f64) -> f64 {
    let (width, height) = (frame.picture.width() as usize, frame.picture.height() as usize);
    let light = |row: usize| -> i32 {
        (column - 3..column + 4).map(|x| i32::from(frame.picture.bytes()[3 * (row * width + x) + 1])).sum()
    };
    let rows = (about as usize).saturating_sub(10).max(2)..(about as usize + 10).min(height - 2);
    rows.max_by_key(|row| light(row - 1) - light(*row)).unwrap() as f64
}

#[test]
fn pictures_show_where_the_gun_points() {
    let (live, events) = played(2);
    let lens = calibration(&SEA.1).calibration.lens;
    let mut checked = 0;
    for frame in frames(&events) {
        let pose = live.truth_at(frame.mid_exposure).unwrap();
        for column in [40, 110, 250] {
            // The horizon's dip of 8 m: 1.6 mrad.
            let row = (0..1800)
                .map(|row| f64::from(row) * 0.1)
                .find(|row| {
                    let d = pose.world_from_camera * lens.unproject(DVec2::new(column as f64 + 0.5, *row));
                    d.z / d.x.hypot(d.y) < -0.0016
                })
                .unwrap();
            let seen = horizon_row(frame, column, row);
            assert!((seen - row).abs() < 1.2, "{seen} {row} in picture {}", frame.sequence);
            checked += 1;
        }
    }
    assert!(checked >= 50);
    let last = live.truth_at(frames(&events).last().unwrap().mid_exposure).unwrap();
    let forward = last.world_from_camera * DVec3::Z;
    assert!((forward.x.atan2(forward.y).to_degrees() - 12.0).abs() < 0.3);
}

#[test]
fn in_real_time_hands_turn_the_gun_and_every_wire_carries_its_share() {
    let hands = Hands::default();
    let mut live = start(None, hands.clone(), true);
    let mut events = Vec::new();
    // As long as it takes: how fast this computer is, is no matter of this test.
    for round in 0..200 {
        thread::sleep(Duration::from_millis(20));
        live.collect(live.origin(), &mut events).unwrap();
        if round == 10 {
            hands.turn(DVec2::new(0.2, 0.02));
            hands.press(true);
        }
        if frames(&events).len() >= 20 && round > 80 {
            break;
        }
    }
    let shown = frames(&events);
    assert!(shown.len() >= 3, "{}", shown.len());
    assert!(events.iter().any(|event| matches!(event, Event::Trigger(edge) if edge.pressed)));
    assert!(events.iter().filter(|event| matches!(event, Event::Imu(_))).count() > 100);
    let last = live.truth_at(shown.last().unwrap().mid_exposure).unwrap();
    let azimuth = |pose: bowwave_core::geometry::CameraPose| {
        let forward = pose.world_from_camera * DVec3::Z;
        forward.x.atan2(forward.y)
    };
    // Where it began, it looked to the north.
    assert!((azimuth(last) - 0.2).abs() < 0.05, "{}", azimuth(last));
    live.stop().unwrap();
}

/// The sea with its bytes changed.
fn changed(name: &str, change: impl FnOnce(&mut Vec<u8>)) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = fs::read(&SEA.2).unwrap();
    change(&mut bytes);
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    (folder, path)
}

#[test]
fn a_damaged_panorama_says_so_and_what_to_do() {
    let says = |path: &Path| match Panorama::open(path) {
        Ok(_) => panic!("{} is taken for whole", path.display()),
        Err(e) => e.to_string(),
    };
    for (name, change) in [
        ("empty", Box::new(|b: &mut Vec<u8>| b.clear()) as Box<dyn FnOnce(&mut Vec<u8>)>),
        ("other", Box::new(|b| b[..8].copy_from_slice(b"RIFFxxxx"))),
        ("short", Box::new(|b| b.truncate(b.len() / 2))),
        ("long header", Box::new(|b| b[8..12].fill(0xff))),
        ("header", Box::new(|b| b[20] = b'}')),
        (
            "index",
            Box::new(|b| {
                let at = b.len() - 30;
                b[at] = 0xff
            }),
        ),
        (
            "sky",
            Box::new(|b| {
                let from = 12 + u32::from_le_bytes(b[8..12].try_into().unwrap()) as usize;
                b[from..from + 400].fill(7)
            }),
        ),
    ] {
        let (_folder, path) = changed(name, change);
        let said = says(&path);
        assert!(said.contains("remove it, and it is made again"), "{name}: {said}");
    }
    assert!(says(Path::new("/no/such/sea")).contains("cannot open it"));
    // A tile of the sea shows only when it is looked at.
    let (_folder, path) = changed("tile", |bytes| {
        let (from, to) = (bytes.len() / 3, bytes.len() / 3 * 2);
        bytes[from..to].fill(0x55);
    });
    let mut panorama = Panorama::open(&path).unwrap();
    let error = panorama.show(panorama.frames() / 2, [-0.2, 0.2]).unwrap_err();
    assert!(ReplayError::from(error).to_string().contains("remove it"));
}
