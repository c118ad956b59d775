//! Trigger latency and boresight as a maintainer measures them, by the commands and by the wizard, held against the truth of a recording: a
//! gun that is aimed anew at a tag of a board for each of five dry shots, and points elsewhere between them.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that cannot go on has failed")]

use std::{
    fs,
    io::Write as _,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::{Arc, OnceLock},
};

use bowwave_calibration::{CalibrationFile, history, simulated::Random, target::Target, to_toml};
use bowwave_core::{event::TriggerEdge, time::secs_to_ns};
use bowwave_record::{Entry, FrameEntry, Properties, RecordingWriter};
use bowwave_tests::{bowwave, expect_code, program};
use glam::{DVec2, DVec3};
use hw_sim::make::{self, Burst, GunMotion, ImuRecipe, Jolt, Recipe, START, ShipMotion, imu_samples};
use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};
use precision::target::draw::{BoardShot, TrueLens, draw};

/// The board, and the tag at which the bore is aimed.
const BOARD: &str = "2x2:600";
const TAG: usize = 3;
/// Where the barrel points: right of and below the camera's axis, radians; and how far a pull is off that.
const BORE: DVec2 = DVec2::new(0.021, -0.013);
const SCATTER: f64 = 0.4e-3;
/// From the muzzle to the mark, metres: near, so that camera and barrel see it by tens of milliradians apart.
const AHEAD_M: f64 = 9.0;
/// How late a round is.
const LATE_S: f64 = 0.0274;
/// The aim is held for so long before and after a pull, seconds.
const HELD_S: f64 = 0.25;
/// How well the mean of five pulls is found: a twentieth of a pixel.
const BORE_OFF: f64 = 0.1e-3;
/// How well a latency is: half of what lies between two readings of the unit.
const LATE_OFF_S: f64 = 2.5e-3;

fn recipe() -> Recipe {
    let pull = |i: u32| Burst { start_s: 1.7013 + 2.0 * f64::from(i), length_s: 0.2 };
    Recipe {
        width: 640,
        height: 360,
        duration_s: 12.0,
        ship: ShipMotion::default(),
        gun: GunMotion::default(),
        imu: ImuRecipe {
            jolt: Some(Jolt { latency_s: LATE_S, spread_s: 0.6e-3, peak: 40.0 }),
            ..ImuRecipe::default()
        },
        trigger: (0..5).map(pull).collect(),
        ..Recipe::default()
    }
}

/// From the camera to the mark when the bore is off by that, camera's axes, metres.
fn mark(off: DVec2) -> DVec3 {
    let at = BORE + off;
    make::calibration(&recipe()).calibration.muzzle_in_camera
        + DVec3::new(at.x.tan(), at.y.tan(), 1.0) * AHEAD_M
}

/// The picture of a camera that sees the tag's middle there.
fn picture(mark: DVec3, lens: &TrueLens, directions: &[DVec3], seed: u64) -> Arc<[u8]> {
    let target: Target = BOARD.parse().unwrap();
    let frontal = BoardShot::frontal(mark.z);
    let [low, _, high, _] = target.corners(TAG);
    let middle = target.size_m() / 2.0 - target.tag_m() * target.spacing();
    let aside = frontal.camera_from_board * (middle - 0.5 * (low + high)).extend(0.0);
    let shown = BoardShot { middle: mark + aside, seed, ..frontal };
    let drawn = draw(&target, lens, directions, &shown);
    let mut jpeg = Vec::new();
    let (width, height) = (drawn.size.0 as u32, drawn.size.1 as u32);
    JpegEncoder::new_with_quality(&mut jpeg, 95)
        .encode(&drawn.grey, width, height, ExtendedColorType::L8)
        .unwrap();
    jpeg.into()
}

/// Writes it as camera, unit and line would have it recorded.
fn record(to: &Path) {
    let recipe = recipe();
    let lens = recipe.lens();
    let numbers = [lens.focal.x, lens.focal.y, lens.centre.x, lens.centre.y, 0.0, 0.0, 0.0, 0.0];
    let lens = TrueLens { size: (640, 360), numbers, fisheye: false };
    let directions = lens.directions();
    let mut random = Random::new(11);
    let mut aims: Vec<DVec2> =
        recipe.trigger.iter().map(|_| DVec2::new(random.gauss(), random.gauss()) * SCATTER).collect();
    // The barrel is where their mean says: of that there is a truth.
    let mean = aims.iter().sum::<DVec2>() / aims.len() as f64;
    aims.iter_mut().for_each(|aim| *aim -= mean);
    let aimed: Vec<_> =
        (0..).zip(&aims).map(|(seed, aim)| picture(mark(*aim), &lens, &directions, seed)).collect();
    let away = picture(mark(DVec2::new(0.03, 0.01)), &lens, &directions, 99);
    let mut entries: Vec<Entry> = imu_samples(&recipe, START).into_iter().map(Entry::Imu).collect();
    for burst in &recipe.trigger {
        for (at_s, pressed) in [(burst.start_s, true), (burst.start_s + burst.length_s, false)] {
            entries.push(Entry::Trigger(TriggerEdge { time: START.plus_ns(secs_to_ns(at_s)), pressed }));
        }
    }
    for sequence in 0..recipe.frames() {
        let stamp_ns = recipe.frame_stamp_ns(sequence);
        let exposed_s = stamp_ns as f64 * 1e-9 + recipe.exposure_delay_s();
        let near = |burst: &Burst| (exposed_s - burst.start_s - LATE_S).abs() < HELD_S;
        let jpeg = recipe.trigger.iter().position(near).map_or(&away, |pull| &aimed[pull]).clone();
        let stamp = START.plus_ns(stamp_ns);
        entries.push(Entry::Frame(FrameEntry {
            arrival: stamp.plus_ns(recipe.camera.latency_ns[0]),
            mid_exposure: stamp,
            sequence,
            jpeg,
            is_recoded: false,
        }));
    }
    entries.sort_by_key(Entry::time);
    let properties = Properties {
        calibration_toml: to_toml(&make::calibration(&recipe)),
        scenario_toml: None,
        loop_ns: None,
        start: START,
        source: "five dry shots at a board".to_owned(),
        picture: (recipe.width, recipe.height),
        camera_info: None,
        extra: [("eye_height_m".to_owned(), "5".to_owned())].into(),
    };
    let mut writer = RecordingWriter::create(to, &properties).unwrap();
    entries.iter().for_each(|entry| writer.write(entry).unwrap());
    writer.finish().unwrap();
}

/// The recording, made once.
fn recording() -> &'static str {
    static RECORDING: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let (_, path) = RECORDING.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("shots.mcap");
        record(&path);
        (folder, path)
    });
    path.to_str().unwrap()
}

fn range() -> String {
    mark(DVec2::ZERO).length().to_string()
}

/// Runs the wizard on the recording: the task is named, its pulls end it, Enter saves and goes on, q ends.
fn wizard(task: &str, file: &Path) -> String {
    let range = range();
    let mut child = Command::new(program())
        .args(["calibrate", "wizard", task, "--replay", recording(), "--fast", "--target", BOARD])
        .args(["--tag", &TAG.to_string(), "--range", &range, "--calibration", file.to_str().unwrap()])
        .env_remove("RUST_LOG")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(b"\n\nq\n").unwrap();
    let output = child.wait_with_output().unwrap();
    expect_code(&output, 0);
    String::from_utf8(output.stdout).unwrap()
}

/// Runs the command of the same name.
fn command(task: &str, file: &Path, further: &[&str]) {
    let arguments = ["calibrate", task, recording(), "--calibration", file.to_str().unwrap()];
    expect_code(&bowwave(arguments.into_iter().chain(further.iter().copied())), 0);
}

/// Two files with the calibration as it is before, and the folder that they are in.
fn files() -> (tempfile::TempDir, [PathBuf; 2]) {
    let folder = tempfile::tempdir().unwrap();
    let files = ["command.toml", "wizard.toml"].map(|name| folder.path().join(name));
    files.iter().for_each(|file| fs::write(file, to_toml(&make::calibration(&recipe()))).unwrap());
    (folder, files)
}

#[test]
fn the_latency_of_five_dry_shots_is_the_true_one() {
    let (_folder, [by_command, by_wizard]) = files();
    command("trigger", &by_command, &[]);
    let said = wizard("trigger", &by_wizard);
    for words in ["-> Cock the gun, hold it still", "   PASS\n   rounds leave", "-> Saved; press Enter"] {
        assert!(said.contains(words), "'{words}' is missing:\n{said}");
    }
    for file in [&by_command, &by_wizard] {
        let found = CalibrationFile::read(file).unwrap().calibration.trigger.unwrap();
        let (late_s, sigma_s) = (found.latency_ns as f64 * 1e-9, found.sigma_ns as f64 * 1e-9);
        println!("{}: {:.2} +- {:.2} ms of {:.2}", file.display(), late_s * 1e3, sigma_s * 1e3, LATE_S * 1e3);
        assert!((late_s - LATE_S).abs() < LATE_OFF_S.min(3.0 * sigma_s) && sigma_s < 2e-3, "{found:?}");
        assert_eq!(history::copies(file).unwrap().len(), 1);
    }
}

#[test]
fn the_boresight_of_five_pulls_at_a_tag_is_the_true_one() {
    let (_folder, files) = files();
    for file in &files {
        // The picture of a pull is that of the round's leaving.
        command("trigger", file, &[]);
    }
    let [by_command, by_wizard] = &files;
    command("boresight", by_command, &["--target", BOARD, "--tag", &TAG.to_string(), "--range", &range()]);
    let said = wizard("boresight", by_wizard);
    for words in ["-> Aim the bore at the mark anew", "   PASS\n   ", "-> Saved; press Enter"] {
        assert!(said.contains(words), "'{words}' is missing:\n{said}");
    }
    for file in [by_command, by_wizard] {
        let found = CalibrationFile::read(file).unwrap().calibration;
        let off = found.boresight - BORE;
        println!("{}: off by {} mrad, stated {:.2}", file.display(), off * 1e3, found.boresight_sigma * 1e3);
        assert!(off.length() < BORE_OFF, "{off}");
        assert!(off.abs().max_element() < 3.0 * found.boresight_sigma && found.boresight_sigma < 2e-3);
        assert_eq!(history::copies(file).unwrap().len(), 2);
    }
    // Without its parallax the barrel would be somewhere else.
    let muzzle = make::calibration(&recipe()).calibration.muzzle_in_camera;
    assert!(muzzle.truncate().length() / AHEAD_M > 10.0 * BORE_OFF);
}
