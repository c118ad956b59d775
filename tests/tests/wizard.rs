//! The guided calibration as a maintainer meets it: on recordings whose truth is known, by keys in a pipe and on a terminal.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

use std::{
    fs::{self, File},
    io::{BufRead as _, BufReader, Read as _, Write as _},
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    sync::OnceLock,
};

use bowwave_calibration::{CalibrationFile, history, to_toml};
use bowwave_core::time::Time;
use bowwave_record::{Entry, FrameEntry, Properties, RecordingWriter};
use bowwave_tests::{bowwave, by_hand, expect_code, program, traverse_only};
use hw_sim::make::{self, Recipe};
use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};
use precision::target::{
    draw::{TrueLens, draw},
    shots::{board, held},
};
use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
};

fn made(recipe: &Recipe, name: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    make::make(recipe, &path, &mut |_, _| {}).unwrap();
    (folder, path)
}

/// The recording of the movement by hand, made once.
fn recording() -> &'static Path {
    static RECORDING: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    &RECORDING.get_or_init(|| made(&by_hand(), "hand.mcap")).1
}

fn command(recording: &Path, further: &[&str]) -> Command {
    let mut command = Command::new(program());
    command.args(["calibrate", "wizard", "--replay", recording.to_str().unwrap(), "--fast"]).args(further);
    command.env_remove("RUST_LOG").stderr(Stdio::piped());
    command
}

/// Runs the wizard with lines for keys.
fn wizard(recording: &Path, keys: &str, further: &[&str]) -> Output {
    let mut child =
        command(recording, further).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("it starts");
    child.stdin.take().unwrap().write_all(keys.as_bytes()).unwrap();
    child.wait_with_output().unwrap()
}

fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn a_good_movement_passes_and_is_saved_as_the_recordings_own_command_does() {
    let folder = tempfile::tempdir().unwrap();
    let (file, other) = (folder.path().join("gun.toml"), folder.path().join("other.toml"));
    let page = folder.path().join("report.html");
    for path in [&file, &other] {
        fs::write(path, to_toml(&make::calibration(&by_hand()))).unwrap();
    }
    let further = ["--calibration", file.to_str().unwrap(), "--report", page.to_str().unwrap()];
    // Camera and unit, begin, save, on.
    let output = wizard(recording(), "2\n\n\n\n", &further);
    expect_code(&output, 0);
    let said = told(&output);
    for words in [
        "== Calibrate\n",
        "> 2 inertial unit to camera",
        "-> Swing the gun left and right, up and down, the horizon in view",
        "horizon in ",
        " mrad, ",
        " m at 500 m usable",
        "   PASS\n   usable; boats lie within",
        "-> Press Enter to save; what is replaced is kept",
        "-> Saved; press Enter",
    ] {
        assert!(said.contains(words), "'{words}' is missing:\n{said}");
    }
    let recorded = recording().to_str().unwrap();
    expect_code(&bowwave(["calibrate", "extrinsics", recorded, "--calibration", other.to_str().unwrap()]), 0);
    assert_eq!(CalibrationFile::read(&file).unwrap(), CalibrationFile::read(&other).unwrap());
    assert_eq!(history::copies(&file).unwrap().len(), 1);
    assert!(fs::read_to_string(&page).unwrap().contains("<b>PASS</b>"));
    // The same recording and keys say the same.
    fs::write(&file, to_toml(&make::calibration(&by_hand()))).unwrap();
    assert_eq!(told(&wizard(recording(), "2\n\n\n\n", &further)), said);
}

#[test]
fn traverse_only_names_what_is_missing_and_saves_nothing() {
    let (folder, path) = made(&traverse_only(), "traverse.mcap");
    let out = folder.path().join("new.toml");
    let output = wizard(&path, "\n\n\n", &["extrinsics", "--out", out.to_str().unwrap()]);
    expect_code(&output, 1);
    let said = told(&output);
    for words in [
        "!! ONLY TRAVERSE SO FAR",
        "-> Elevate the gun up and down",
        "   FAIL\n",
        "the movement that was missing: elevation (up and down)",
    ] {
        assert!(said.contains(words), "'{words}' is missing:\n{said}");
    }
    assert!(!said.contains("usable") && !said.contains(": good") && !out.exists(), "{said}");
}

/// A small camera before which the board is held in many ways, for two pictures each time.
#[test]
fn the_lens_is_found_from_a_board_that_is_led_over_the_picture() {
    const LENS: TrueLens = TrueLens {
        size: (640, 360),
        numbers: [450.0, 452.0, 327.0, 176.0, -0.19, 0.05, 6e-4, -9e-4],
        fisheye: false,
    };
    let folder = tempfile::tempdir().unwrap();
    let (path, out) = (folder.path().join("board.mcap"), folder.path().join("new.toml"));
    let begun = make::calibration(&Recipe { width: 640, height: 360, ..Recipe::default() });
    let properties = Properties {
        calibration_toml: to_toml(&begun),
        scenario_toml: None,
        loop_ns: None,
        start: Time::from_ns(0),
        source: "test".to_owned(),
        picture: (640, 360),
        camera_info: None,
        extra: [("eye_height_m".to_owned(), "8".to_owned())].into(),
    };
    let mut writer = RecordingWriter::create(&path, &properties).unwrap();
    let directions = LENS.directions();
    let mut sequence = 0;
    for shot in held(&LENS, &board(), 18, 0.7, 3) {
        let drawn = draw(&board(), &LENS, &directions, &shot);
        let mut jpeg = Vec::new();
        JpegEncoder::new_with_quality(&mut jpeg, 95)
            .encode(&drawn.grey, 640, 360, ExtendedColorType::L8)
            .unwrap();
        for _ in 0..2 {
            let time = Time::from_ns(i64::from(sequence) * 100_000_000);
            let jpeg = jpeg.clone().into();
            let entry = FrameEntry { arrival: time, mid_exposure: time, sequence, jpeg, is_recoded: false };
            writer.write(&Entry::Frame(entry)).unwrap();
            sequence += 1;
        }
    }
    writer.finish().unwrap();
    let target = board().to_string();
    let further = ["intrinsics", "--target", &target, "--out", out.to_str().unwrap()];
    let output = wizard(&path, "\n\n\n", &further);
    expect_code(&output, 0);
    let said = told(&output);
    for words in [
        "!! HOLD THE BOARD STILL",
        "   seen in ",
        "pictures: 12 of 12 good",
        "   PASS\n   the lens is",
        "-> Saved",
    ] {
        assert!(said.contains(words), "'{words}' is missing:\n{said}");
    }
    let found = CalibrationFile::read(&out).unwrap().calibration;
    let off = (found.lens.focal - glam::DVec2::new(450.0, 452.0)).abs().max_element();
    assert!(off < 4.0 * found.focal_sigma_px && found.focal_sigma_px < 1.0, "{:?}", found.lens);
}

/// On a computer without any of the devices.
#[test]
fn devices_that_are_not_there_are_said_and_what_was_gathered_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("bowwave.toml");
    fs::write(folder.path().join("gun.toml"), to_toml(&make::calibration(&by_hand()))).unwrap();
    fs::write(
        &config,
        "[screen]\noutput = \"none\"\n[camera]\ndevice = \"/dev/absent\"\n[imu]\ndevice = \"/dev/absent\"\n\
         [files]\ncalibration = \"gun.toml\"\ndata = \"data\"\n",
    )
    .unwrap();
    let mut child = Command::new(program())
        .args(["calibrate", "wizard", "extrinsics", "--config", config.to_str().unwrap()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
    let lost = lines.find(|line| line.starts_with("!! "));
    assert!(lost.as_ref().is_some_and(|l| l.contains("LOST: CHECK THE ")), "{lost:?}");
    child.stdin.take().unwrap().write_all(b"q\n").unwrap();
    assert_eq!(lines.last().as_deref(), Some("-> Ended"));
    let output = child.wait_with_output().unwrap();
    expect_code(&output, 1);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let kept =
        said.lines().find_map(|l| l.strip_prefix("what was gathered is kept: bowwave calibrate extrinsics "));
    let kept = kept.unwrap_or_else(|| panic!("{said}"));
    assert!(
        kept.contains("calibrate-extrinsics-") && fs::metadata(kept).is_ok_and(|m| m.len() > 0),
        "{kept}"
    );
}

#[test]
fn what_cannot_be_done_is_said_and_nothing_is_written() {
    let without_board = wizard(recording(), "1\n\nq\n", &[]);
    expect_code(&without_board, 1);
    assert!(
        told(&without_board).contains("!! no board: start again with --target"),
        "{}",
        told(&without_board)
    );
    // Keys that end are an end, also where something could be saved.
    let ended = wizard(recording(), "", &["extrinsics"]);
    expect_code(&ended, 1);
    assert!(told(&ended).contains("PASS"), "{}", told(&ended));
    let nowhere = wizard(recording(), "\nq\n", &["imu"]);
    expect_code(&nowhere, 1);
    assert!(told(&nowhere).contains("!! nothing is written"), "{}", told(&nowhere));
    let absent = wizard(Path::new("absent.mcap"), "", &[]);
    expect_code(&absent, 1);
}

#[test]
fn on_a_terminal_keys_are_single_and_the_terminal_is_left_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("new.toml");
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let slave = PathBuf::from(ptsname(&master, Vec::new()).unwrap().into_string().unwrap());
    let end = || File::options().read(true).write(true).open(&slave).unwrap();
    let kept = end();
    let before = rustix::termios::tcgetattr(&kept).unwrap();
    let mut child = command(recording(), &["--out", out.to_str().unwrap()])
        .stdin(end())
        .stdout(end())
        .env("TERM", "xterm")
        .spawn()
        .expect("it starts");
    let (mut master, mut seen) = (File::from(master), String::new());
    let mut keys = [
        ("> 2 inertial unit", "4"),
        ("> 4 trigger", "2"),
        ("> 2 inertial unit", "\r"),
        ("to save", "\r"),
        ("Saved;", "q"),
    ]
    .into_iter()
    .peekable();
    let mut bytes = [0; 4096];
    while keys.peek().is_some() {
        let minute = Timespec { tv_sec: 60, tv_nsec: 0 };
        let ready = poll(&mut [PollFd::new(&master, PollFlags::IN)], Some(&minute)).unwrap();
        assert!(ready > 0, "{:?} does not come:\n{seen}", keys.peek());
        let count = master.read(&mut bytes).unwrap();
        seen += &String::from_utf8_lossy(&bytes[..count]);
        if let Some((_, key)) = keys.next_if(|(shown, _)| seen.contains(shown)) {
            master.write_all(key.as_bytes()).unwrap();
            seen.clear();
        }
    }
    let status = child.wait().unwrap();
    assert_eq!(status.code(), Some(0));
    assert!(CalibrationFile::read(&out).is_ok());
    let after = rustix::termios::tcgetattr(&kept).unwrap();
    assert_eq!((after.local_modes, after.input_modes), (before.local_modes, before.input_modes));
}
