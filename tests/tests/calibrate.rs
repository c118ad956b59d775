//! Calibration as a maintainer does it: recordings of a simulated sea whose truth is known, and what can be wrong with them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a failed step fails the test")]

use std::{
    fs,
    path::{Path, PathBuf},
    process::Output,
    sync::OnceLock,
};

use bowwave_calibration::{CalibrationFile, history, parse};
use bowwave_core::event::TriggerEdge;
use bowwave_record::{Entry, RecordingReader, RecordingWriter};
use bowwave_tests::{bowwave, by_hand, expect_code, traverse_only};
use glam::{DQuat, DVec3};
use hw_sim::make::{self, Recipe};

struct TestFolder(tempfile::TempDir);

impl TestFolder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}

/// The recording of the movement by hand, made once.
fn recording() -> &'static Path {
    static RECORDING: OnceLock<(TestFolder, PathBuf)> = OnceLock::new();
    let (_, path) = RECORDING.get_or_init(|| {
        let folder = TestFolder::new();
        let path = folder.path("hand.mcap");
        make::make(&by_hand(), &path, &mut |_, _| {}).unwrap();
        (folder, path)
    });
    path
}

/// The recording with every entry changed, and the folder that holds it.
fn changed(mut change: impl FnMut(usize, &mut Entry)) -> (TestFolder, PathBuf) {
    let folder = TestFolder::new();
    let path = folder.path("changed.mcap");
    let reader = RecordingReader::open(recording()).unwrap();
    let mut writer = RecordingWriter::create(&path, reader.properties()).unwrap();
    for (number, entry) in reader.entries().unwrap().enumerate() {
        let mut entry = entry.unwrap();
        change(number, &mut entry);
        writer.write(&entry).unwrap();
    }
    writer.finish().unwrap();
    (folder, path)
}

fn calibrate(task: &str, recording: &Path, further: &[&str]) -> Output {
    bowwave(["calibrate", task, recording.to_str().unwrap()].into_iter().chain(further.iter().copied()))
}

fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn truth() -> CalibrationFile {
    make::calibration(&by_hand())
}

/// Calibrates from `recording` and holds the result against the truth: within three of its own standard deviations.
fn holds(recording: &Path, camera_from_imu: DQuat, time_offset_ns: i64) {
    let folder = TestFolder::new();
    let out = folder.path("new.toml");
    let output = calibrate("extrinsics", recording, &["--out", out.to_str().unwrap()]);
    expect_code(&output, 0);
    let found = CalibrationFile::read(&out).unwrap().calibration;
    let turn = (camera_from_imu * found.camera_from_imu.inverse()).to_scaled_axis();
    let off = (turn / found.camera_from_imu_sigma).abs().max_element();
    assert!(off < 3.0, "{} mrad, stated {}", turn * 1e3, found.camera_from_imu_sigma * 1e3);
    assert!(found.camera_from_imu_sigma.max_element() < 4e-3, "{}", found.camera_from_imu_sigma);
    let late = (found.time_offset_ns - time_offset_ns) as f64;
    let sigma = found.time_offset_sigma_ns as f64;
    // What the map of the unit's clock moves by while it settles is in no deviation.
    assert!(
        late.abs() < 3.0 * sigma.hypot(0.05e6) && sigma < 0.5e6,
        "{} ms +- {}",
        late * 1e-6,
        sigma * 1e-6
    );
}

#[test]
fn the_truth_is_found_from_the_horizon_alone_written_and_restored() {
    let truth = truth().calibration;
    holds(recording(), truth.camera_from_imu, truth.time_offset_ns);
    let folder = TestFolder::new();
    let (file, page) = (folder.path("gun.toml"), folder.path("report.html"));
    let old = bowwave_calibration::to_toml(&make::calibration(&by_hand()));
    fs::write(&file, &old).unwrap();
    let at = file.to_str().unwrap();
    let output =
        calibrate("extrinsics", recording(), &["--calibration", at, "--report", page.to_str().unwrap()]);
    expect_code(&output, 0);
    assert!(told(&output).starts_with("PASS: usable; boats lie within"), "{}", told(&output));
    let written = CalibrationFile::read(&file).unwrap();
    assert!(written.camera_from_imu.how.contains("horizon"), "{:?}", written.camera_from_imu);
    assert_eq!(written.calibration.lens, truth.lens);
    let page = fs::read_to_string(page).unwrap();
    assert!(page.contains("<b>PASS</b>") && page.matches("<svg").count() == 2);
    assert_eq!(history::copies(&file).unwrap().len(), 1);
    expect_code(&bowwave(["calibrate", "restore", at]), 0);
    assert_eq!(fs::read_to_string(&file).unwrap(), old);
    expect_code(&bowwave(["calibrate", "restore", at]), 0);
    assert_eq!(CalibrationFile::read(&file).unwrap(), written);
    let list = bowwave(["calibrate", "restore", at, "--list"]);
    assert_eq!(told(&list).lines().count(), 3, "{}", told(&list));
    expect_code(&bowwave(["calibrate", "restore", at, "--number", "9"]), 1);
}

#[test]
fn a_stale_calibration_is_found_out_and_a_good_one_is_not() {
    let folder = TestFolder::new();
    let file = folder.path("gun.toml");
    let at = file.to_str().unwrap();
    // A horizon does not tell how the unit drifts about the vertical: what it tells agrees, and no more is said.
    let output = calibrate("check", recording(), &[]);
    expect_code(&output, 3);
    let says = told(&output);
    assert!(says.starts_with("CANNOT TELL: not told by this recording: "), "{says}");
    assert!(says.contains("what it tells agrees") && !says.contains("WRONG"), "{says}");
    assert!(says.lines().any(|l| l.trim().starts_with("roll ") && l.contains("agrees: ")), "{says}");
    let turned = |turn: DVec3, late_ns: i64| {
        let mut file = truth();
        let c = &mut file.calibration;
        c.camera_from_imu = DQuat::from_scaled_axis(turn) * c.camera_from_imu;
        c.time_offset_ns += late_ns;
        file
    };
    for (turn, late_ns, says) in [
        (DVec3::Y * 0.015, 0, "traverse is off by"),
        (DVec3::ZERO, 8_000_000, "time offset is off by"),
        (DVec3::X * std::f64::consts::PI, 0, "elevation is off by"),
    ] {
        fs::write(&file, bowwave_calibration::to_toml(&turned(turn, late_ns))).unwrap();
        let output = calibrate("check", recording(), &["--calibration", at]);
        expect_code(&output, 1);
        let told = told(&output);
        assert!(told.starts_with("STALE: ") && told.contains(says), "{told}");
    }
}

/// What `calibrate check` says of a recording, and ends with.
fn check_says(path: &Path, code: i32) -> String {
    let output = calibrate("check", path, &[]);
    expect_code(&output, code);
    told(&output)
}

#[test]
fn traverse_alone_is_refused_with_what_is_missing_and_checks_nothing() {
    let folder = TestFolder::new();
    let path = folder.path("traverse.mcap");
    make::make(&traverse_only(), &path, &mut |_, _| {}).unwrap();
    let out = folder.path("new.toml");
    let output = calibrate("extrinsics", &path, &["--accept-poor", "--out", out.to_str().unwrap()]);
    expect_code(&output, 1);
    let said = told(&output);
    assert!(said.starts_with("FAIL: ") && said.contains("missing: "), "{said}");
    assert!(!out.exists());
    let said = check_says(&path, 3);
    assert!(said.starts_with("CANNOT TELL: "), "{said}");
}

#[test]
fn mounted_upside_down_and_half_a_second_late() {
    let truth = truth().calibration;
    let half_turn = DQuat::from_rotation_z(std::f64::consts::PI);
    let (_folder, path) = changed(|_, entry| match entry {
        Entry::Imu(sample) => {
            (sample.rate, sample.accel) = (half_turn * sample.rate, half_turn * sample.accel);
        }
        // Stamps half a second early.
        Entry::Frame(frame) => frame.mid_exposure = frame.mid_exposure.plus_ns(-500_000_000),
        _ => {}
    });
    holds(&path, truth.camera_from_imu * half_turn.inverse(), truth.time_offset_ns + 500_000_000);
}

#[test]
fn a_wrong_stamp_flag_comes_out_as_offset_and_as_stale() {
    let truth = truth().calibration;
    // The exposure's begin instead of its middle.
    let (_folder, path) = changed(|_, entry| {
        if let Entry::Frame(frame) = entry {
            frame.mid_exposure = frame.mid_exposure.plus_ns(-8_000_000);
        }
    });
    holds(&path, truth.camera_from_imu, truth.time_offset_ns + 8_000_000);
    let said = check_says(&path, 1);
    assert!(said.contains("8.0"), "{said}");
}

#[test]
fn stamps_that_repeat_and_run_backwards_do_no_harm() {
    let truth = truth().calibration;
    let (_folder, path) = changed(|number, entry| match entry {
        Entry::Frame(frame) if frame.sequence % 17 == 3 => {
            frame.mid_exposure = frame.mid_exposure.plus_ns(-250_000_000);
        }
        Entry::Imu(sample) if number % 301 == 5 => sample.device_time_ns -= 5_000_000,
        _ => {}
    });
    holds(&path, truth.camera_from_imu, truth.time_offset_ns);
}

#[test]
fn mirrored_axes_are_refused_and_stale() {
    let (_folder, path) = changed(|_, entry| {
        if let Entry::Imu(sample) = entry {
            // A rate is an axial vector: mirrored wiring reverses one axis of both.
            sample.rate.y = -sample.rate.y;
            sample.accel.y = -sample.accel.y;
        }
    });
    // By its former name, which still does it and says what it is called now.
    let output = calibrate("imu", &path, &[]);
    expect_code(&output, 1);
    let warned = String::from_utf8_lossy(&output.stderr);
    assert!(warned.contains("`calibrate imu` is now called extrinsics"), "{warned}");
    let said = told(&output);
    assert!(said.starts_with("FAIL: "), "{said}");
    let output = calibrate("check", &path, &[]);
    expect_code(&output, 1);
    assert!(told(&output).starts_with("STALE: "), "{}", told(&output));
}

/// The recording with `count` pulls of the trigger, 1.5 s apart; the gun jolts `late_s` after each by `jolt` m/s^2.
fn with_pulls(to: &Path, count: usize, late_s: f64, jolt: f64) {
    let reader = RecordingReader::open(recording()).unwrap();
    let mut writer = RecordingWriter::create(to, reader.properties()).unwrap();
    let pulls: Vec<_> = (0..count).map(|i| reader.first().plus_secs(1.0003 + 1.5 * i as f64)).collect();
    let mut left = pulls.iter().flat_map(|p| [(*p, true), (p.plus_secs(0.2), false)]).peekable();
    for entry in reader.entries().unwrap() {
        let mut entry = entry.unwrap();
        while let Some((time, pressed)) = left.next_if(|(time, _)| *time <= entry.time()) {
            writer.write(&Entry::Trigger(TriggerEdge { time, pressed })).unwrap();
        }
        if let Entry::Imu(sample) = &mut entry {
            for pull in &pulls {
                let since = sample.arrival.secs_since(*pull) - late_s;
                if since > 0.0 {
                    sample.accel.x += jolt * (-since / 0.04).exp() * (300.0 * since).cos();
                }
            }
        }
        writer.write(&entry).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn dry_shots_tell_the_triggers_latency() {
    let folder = TestFolder::new();
    let (path, out) = (folder.path("dry.mcap"), folder.path("gun.toml"));
    with_pulls(&path, 8, 0.023, 40.0);
    // Where nothing stood nothing is said to be kept; the second time it is.
    for is_kept in [false, true] {
        let output = calibrate("trigger", &path, &["--out", out.to_str().unwrap()]);
        expect_code(&output, 0);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains(" written") && said.contains("is kept") == is_kept, "{said}");
    }
    let found = CalibrationFile::read(&out).unwrap().calibration.trigger.unwrap();
    let off = (found.latency_ns - 23_000_000) as f64;
    assert!(off.abs() < 3.0 * found.sigma_ns as f64 && found.sigma_ns < 3_000_000, "{found:?}");
    let still = folder.path("still.mcap");
    with_pulls(&still, 8, 0.023, 0.0);
    let output = calibrate("trigger", &still, &[]);
    expect_code(&output, 1);
    assert!(told(&output).starts_with("FAIL: a jolt stands out after"), "{}", told(&output));
}

#[test]
fn pulls_at_a_mark_tell_the_boresight_with_its_parallax() {
    let folder = TestFolder::new();
    let (path, out) = (folder.path("aimed.mcap"), folder.path("gun.toml"));
    with_pulls(&path, 3, 0.0, 0.0);
    let marks = ["--mark", "141.2,80.1", "--mark", "141.6,79.7", "--mark", "141.1,80.2"];
    let further = ["--range", "50", "--out", out.to_str().unwrap()];
    let output = calibrate("boresight", &path, &[&marks[..], &further].concat());
    expect_code(&output, 0);
    let found = CalibrationFile::read(&out).unwrap().calibration;
    let hit = found.lens.unproject(glam::DVec2::new(141.3, 80.0)) * 50.0 - found.muzzle_in_camera;
    let expected = glam::DVec2::new((hit.x / hit.z).atan(), (hit.y / hit.z).atan());
    assert!(found.boresight.distance(expected) < 1e-4, "{} {expected}", found.boresight);
    assert!(found.boresight_sigma > 1e-3 && found.boresight_sigma < 4e-3, "{}", found.boresight_sigma);
    // A mark for each pull, or none of them is used.
    expect_code(&calibrate("boresight", &path, &[&marks[..4], &further].concat()), 1);
    expect_code(&calibrate("boresight", &path, &["--range", "50"]), 2);
}

#[test]
fn what_cannot_be_looked_at_says_why() {
    let folder = TestFolder::new();
    let path = folder.path("absent.mcap");
    let output = calibrate("check", &path, &[]);
    expect_code(&output, 1);
    let output = calibrate("check", recording(), &["--eye-height", "-3"]);
    expect_code(&output, 2);
    // The lens of another camera.
    let file = folder.path("other.toml");
    let other = make::calibration(&Recipe { width: 640, height: 360, ..by_hand() });
    fs::write(&file, bowwave_calibration::to_toml(&other)).unwrap();
    assert!(parse(&fs::read_to_string(&file).unwrap(), "other").is_ok());
    let output = calibrate("check", recording(), &["--calibration", file.to_str().unwrap()]);
    expect_code(&output, 1);
    let said = bowwave_tests::said(&output);
    assert!(said.contains("640x360") && said.contains("256x144"), "{said}");
}
