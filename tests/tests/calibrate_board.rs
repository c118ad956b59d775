//! Camera and inertial unit calibrated from a recording in which both are moved by hand before the board, through the program; and with a
//! camera that reads its rows one after another.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::{collections::BTreeMap, path::Path};

use bowwave_calibration::{CalibrationFile, to_toml};
use bowwave_core::geometry::rotation_vector;
use bowwave_record::{Entry, FrameEntry, Properties, RecordingWriter};
use bowwave_tests::{bowwave, expect_code};
use glam::DQuat;
use hw_sim::make::{self, CameraRecipe, GunMotion, Periodic, Recipe, ShipMotion};
use image::codecs::jpeg::JpegEncoder;
use precision::target::{moved::MovedBoard, shots::board};

/// How long a camera's picture takes to reach the host.
const LATE_S: f64 = 0.02;

/// A file that knows the lens and nothing of the mounting.
fn lens_alone(moved: &MovedBoard) -> CalibrationFile {
    let mut file = make::calibration(&Recipe::default());
    file.calibration.lens = moved.lens();
    file.calibration.camera_from_imu = DQuat::IDENTITY;
    file.calibration.time_offset_ns = 0;
    file
}

/// Writes what was moved as a camera and a unit would record it.
fn record(moved: &MovedBoard, to: &Path) {
    let properties = Properties {
        calibration_toml: to_toml(&lens_alone(moved)),
        scenario_toml: None,
        loop_ns: None,
        start: bowwave_calibration::simulated::Recipe::EPOCH,
        source: "a board".to_owned(),
        picture: (moved.lens.size.0 as u32, moved.lens.size.1 as u32),
        camera_info: None,
        extra: BTreeMap::from([("eye_height_m".to_owned(), "5".to_owned())]),
    };
    let mut entries: Vec<Entry> = moved.samples().into_iter().map(Entry::Imu).collect();
    for (sequence, taken) in (0..).zip(moved.pictures().unwrap()) {
        let mut jpeg = Vec::new();
        let picture = &taken.picture;
        JpegEncoder::new_with_quality(&mut jpeg, 95)
            .encode(picture.bytes(), picture.width(), picture.height(), image::ExtendedColorType::Rgb8)
            .unwrap();
        let arrival = taken.stamp.plus_secs(LATE_S);
        entries.push(Entry::Frame(FrameEntry {
            arrival,
            mid_exposure: taken.stamp,
            sequence,
            jpeg: jpeg.into(),
            is_recoded: false,
        }));
    }
    entries.sort_by_key(Entry::time);
    let mut writer = RecordingWriter::create(to, &properties).unwrap();
    entries.iter().for_each(|entry| writer.write(entry).unwrap());
    writer.finish().unwrap();
}

/// Rotation's error in milliradians, the offset's in milliseconds, and both in stated standard deviations.
fn errors(found: &CalibrationFile, camera_from_imu: DQuat, offset_s: f64) -> [(f64, f64); 2] {
    let c = &found.calibration;
    let turn = rotation_vector(camera_from_imu * c.camera_from_imu.inverse());
    let late = c.time_offset_ns as f64 * 1e-9 - offset_s;
    let sigmas = (turn / c.camera_from_imu_sigma).abs().max_element();
    [(turn.length() * 1e3, sigmas), (late.abs() * 1e3, late.abs() / (c.time_offset_sigma_ns as f64 * 1e-9))]
}

fn calibrated(recording: &Path, further: &[&str], out: &Path) -> CalibrationFile {
    let arguments = ["calibrate", "extrinsics", recording.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let output = bowwave(arguments.into_iter().chain(further.iter().copied()));
    expect_code(&output, 0);
    println!("{}", String::from_utf8_lossy(&output.stdout));
    CalibrationFile::read(out).unwrap()
}

/// The goals of a minute by hand, in ten seconds: what the board tells is no worse for that than they ask.
#[test]
fn a_board_moved_by_hand_tells_rotation_and_offset_within_the_goals() {
    let folder = tempfile::tempdir().unwrap();
    let target = board().to_string();
    for (seed, readout_s) in [(1, 0.0), (2, 0.03)] {
        let [path, out] = ["mcap", "toml"].map(|kind| folder.path().join(format!("board-{seed}.{kind}")));
        let mut moved = MovedBoard::by_hand(board(), 9.0, 12.0, seed);
        moved.recipe.readout_s = readout_s;
        record(&moved, &path);
        let found = calibrated(&path, &["--target", &target], &out);
        let [(mrad, by_mrad), (ms, by_ms)] =
            errors(&found, moved.recipe.camera_from_imu, moved.recipe.offset_s);
        println!("{mrad:.3} mrad ({by_mrad:.1} sigma), {ms:.4} ms ({by_ms:.1} sigma)");
        assert!(found.camera_from_imu.how.contains("board"), "{:?}", found.camera_from_imu);
        assert!(mrad < 0.75 && by_mrad < 3.0, "{mrad} mrad, {by_mrad} sigma");
        // The map of the unit's clock moves while it settles, by what is in no deviation.
        assert!(ms < 0.15 + 5.0 * readout_s && by_ms < 4.5, "{ms} ms, {by_ms} sigma");
        // Nobody said how long the picture is read: the board did.
        let read_s = found.calibration.readout_ns as f64 * 1e-9;
        assert!((read_s - readout_s).abs() < 1e-3, "{read_s}");
        assert_eq!(found.shutter.is_some(), readout_s > 0.0);
    }
}

/// A sea seen by a camera in the hand that reads its rows for 30 ms: the horizon's ends are seen at different times.
#[test]
fn a_rolling_shutter_is_taken_into_account_at_the_horizon() {
    let recipe = Recipe {
        width: 320,
        height: 180,
        frame_rate_hz: 10.0,
        ship: ShipMotion {
            roll: Periodic::new(0.0, &[(4, 0.16, 0.0), (11, 0.1, 1.0)]),
            ..ShipMotion::default()
        },
        gun: GunMotion {
            traverse: Periodic::new(0.0, &[(3, 0.12, 0.5), (9, 0.08, 2.0)]),
            elevation: Periodic::new(0.0, &[(5, 0.06, 1.5), (19, 0.04, 0.2)]),
        },
        trigger: Vec::new(),
        camera: CameraRecipe { readout_ns: 30_000_000, ..CameraRecipe::default() },
        ..Recipe::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let (path, file) = (folder.path().join("sea.mcap"), folder.path().join("gun.toml"));
    make::make(&recipe, &path, &mut |_, _| {}).unwrap();
    let truth = make::calibration(&recipe);
    let mut mrad = [0.0; 2];
    for (mrad, shutter) in mrad.iter_mut().zip([truth.shutter.clone(), None]) {
        let mut begun = truth.clone();
        begun.calibration.readout_ns = if shutter.is_some() { truth.calibration.readout_ns } else { 0 };
        begun.calibration.readout_sigma_ns =
            if shutter.is_some() { truth.calibration.readout_sigma_ns } else { 0 };
        begun.shutter = shutter;
        begun.write(&file).unwrap();
        let given = ["--calibration", file.to_str().unwrap(), "--accept-poor"];
        let arguments = ["calibrate", "extrinsics", path.to_str().unwrap()];
        bowwave(arguments.into_iter().chain(given));
        let found = CalibrationFile::read(&file).unwrap();
        let offset_s = truth.calibration.time_offset_ns as f64 * 1e-9;
        let [(off, sigmas), (ms, _)] = errors(&found, truth.calibration.camera_from_imu, offset_s);
        println!("{off:.3} mrad ({sigmas:.1} sigma), {ms:.4} ms, {:?}", found.shutter);
        *mrad = off;
    }
    assert!(mrad[0] < 4.0 && mrad[0] < 0.7 * mrad[1], "{mrad:?}");
}
