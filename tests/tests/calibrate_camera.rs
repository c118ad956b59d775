//! The lens from pictures of the board, as a maintainer measures it, and everything that can be wrong with them.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on has failed")]

use std::{fs, path::Path};

use bowwave_calibration::CalibrationFile;
use bowwave_tests::{bowwave, expect_code, said};
use glam::DQuat;
use image::GrayImage;
use precision::target::{
    draw::{BoardShot, TrueLens, draw},
    shots::{board, held},
};

/// A small camera, so that the pictures are drawn soon.
const LENS: TrueLens = TrueLens {
    size: (640, 360),
    numbers: [450.0, 452.0, 327.0, 176.0, -0.19, 0.05, 6e-4, -9e-4],
    fisheye: false,
};

/// Draws the board as `shots` have it into a folder.
fn pictures(folder: &Path, lens: &TrueLens, shots: &[BoardShot]) {
    fs::create_dir_all(folder).expect("a folder");
    let directions = lens.directions();
    for (i, shot) in shots.iter().enumerate() {
        let drawn = draw(&board(), lens, &directions, shot);
        let picture = GrayImage::from_raw(drawn.size.0 as u32, drawn.size.1 as u32, drawn.grey)
            .expect("as many codes as pixels");
        picture.save(folder.join(format!("picture{i}.png"))).expect("a picture");
    }
}

fn calibrate(pictures: &Path, out: &Path, further: &[&str]) -> std::process::Output {
    let mut arguments = vec![
        "calibrate".as_ref(),
        "intrinsics".as_ref(),
        pictures.as_os_str(),
        "--out".as_ref(),
        out.as_os_str(),
    ];
    arguments.extend(further.iter().map(std::ffi::OsStr::new));
    bowwave(arguments)
}

/// Requires failure, one line of complaint with all of `words`, and nothing written.
fn refused(output: &std::process::Output, out: &Path, words: &[&str]) {
    expect_code(output, 1);
    let said = said(output);
    let line =
        said.lines().find(|l| l.starts_with("bowwave: ")).unwrap_or_else(|| panic!("no message: {said}"));
    for word in words {
        assert!(line.contains(word), "'{word}' is missing: {line}");
    }
    assert!(!out.exists(), "{} was written", out.display());
}

#[test]
fn the_lens_that_drew_the_pictures_is_found_and_only_it_is_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    let (shown, out) = (folder.path().join("shown"), folder.path().join("calibration.toml"));
    pictures(&shown, &LENS, &held(&LENS, &board(), 18, 0.7, 3));
    // One that shows no board does no harm.
    GrayImage::new(640, 360).save(shown.join("empty.png")).expect("a picture");
    let target = board().to_string();
    let output = calibrate(&shown, &out, &["--target", &target]);
    expect_code(&output, 0);
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    for word in ["PASS", "18 of 19", "pinhole", "mrad", "at 500 m", "empty.png"] {
        assert!(told.contains(word), "'{word}' is missing: {told}");
    }
    let begun = CalibrationFile::read(&out).expect("a calibration");
    let (lens, [fx, fy, cx, cy, k1, k2, p1, p2]) = (begun.calibration.lens, LENS.numbers);
    assert_eq!((lens.width, lens.height), (640, 360));
    let sigma = begun.calibration.focal_sigma_px;
    assert!(sigma < 0.5, "{sigma}");
    assert!(
        (lens.focal.x - fx).abs() < 3.0 * sigma && (lens.focal.y - fy).abs() < 3.0 * sigma,
        "{lens:?} +- {sigma}"
    );
    // The picture's geometry is that of the truth, over all of it.
    assert!((lens.centre.x - cx).abs() < 0.3 && (lens.centre.y - cy).abs() < 0.3, "{lens:?}");
    for i in 0..63 {
        let pixel = glam::DVec2::new(f64::from(i % 9) * 80.0, f64::from(i / 9) * 60.0);
        let off = lens.project(LENS.direction(pixel)).expect("a pixel").distance(pixel);
        assert!(off < 0.5, "{off} px at {pixel}: {lens:?}, truth {:?}", [k1, k2, p1, p2]);
    }
    // Anew, over a file in which something else was measured.
    let mut measured = begun.clone();
    measured.calibration.camera_from_imu = DQuat::from_rotation_y(0.2);
    measured.calibration.lens.focal *= 1.1;
    measured.camera_name = "the one on the bow".to_owned();
    measured.write(&out).expect("it is written");
    expect_code(&calibrate(&shown, &out, &["--target", &target, "--json"]), 0);
    let again = CalibrationFile::read(&out).expect("a calibration");
    assert_eq!(again.calibration.lens, begun.calibration.lens);
    assert_eq!(again.camera_name, measured.camera_name);
    let off = again.calibration.camera_from_imu.angle_between(measured.calibration.camera_from_imu);
    assert!(off < 1e-9, "{off}");
}

#[test]
fn what_tells_no_lens_is_refused_with_what_is_missing() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("calibration.toml");
    let target = board().to_string();
    let at = |name: &str| folder.path().join(name);
    let shots = held(&LENS, &board(), 6, 0.6, 8);
    pictures(&at("few"), &LENS, &shots[..3]);
    refused(&calibrate(&at("few"), &out, &["--target", &target]), &out, &["3 pictures", "at least 4"]);
    let frontal: Vec<BoardShot> =
        (0..6).map(|i| BoardShot { seed: i, ..BoardShot::frontal(0.62 + 0.02 * i as f64) }).collect();
    pictures(&at("frontal"), &LENS, &frontal);
    refused(&calibrate(&at("frontal"), &out, &["--target", &target]), &out, &["tilt"]);
    // Five pictures with the board in the left half: a lens, and what it lacks.
    let left = held(&LENS, &board(), 60, 0.5, 9).into_iter().filter(|s| s.middle.x < -0.05);
    let left: Vec<BoardShot> = left.map(|s| BoardShot { noise: 12.0, ..s }).take(5).collect();
    pictures(&at("left"), &LENS, &left);
    let output = calibrate(&at("left"), &out, &["--target", &target, "--dry-run"]);
    expect_code(&output, 0);
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(told.starts_with("PASS: the lens is usable") && told.contains("upper right corner"), "{told}");
    assert!(!out.exists() && said(&output).contains("nothing was written"));
    // Of a larger board two tags alone: eight corners a picture make a poor lens, which is written only where that is asked for.
    pictures(&at("other"), &LENS, &shots);
    let output = calibrate(&at("other"), &out, &["--target", "2x1:34"]);
    expect_code(&output, 1);
    assert!(!out.exists() && said(&output).contains("--accept-poor"));
    let poor = at("poor.toml");
    expect_code(&calibrate(&at("other"), &poor, &["--target", "2x1:34", "--accept-poor"]), 1);
    assert!(CalibrationFile::read(&poor).expect("a calibration").lens.how.contains("poor"));
    GrayImage::new(320, 240).save(at("few").join("picture9.png")).expect("a picture");
    refused(&calibrate(&at("few"), &out, &["--target", &target]), &out, &["picture9.png", "320x240"]);
    fs::create_dir(at("nothing")).expect("a folder");
    refused(&calibrate(&at("nothing"), &out, &[]), &out, &["no JPEG or PNG"]);
    refused(&calibrate(&at("not-there"), &out, &[]), &out, &["not-there"]);
    fs::write(at("nothing").join("text.png"), b"no picture").expect("a file");
    refused(&calibrate(&at("nothing"), &out, &[]), &out, &["text.png"]);
    expect_code(&bowwave(["calibrate", "intrinsics", "x", "--target", "7"]), 2);
    expect_code(&bowwave(["calibrate", "nothing"]), 2);
}

#[test]
fn the_board_is_drawn_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("board.svg");
    let out = path.to_str().expect("a plain path");
    expect_code(&bowwave(["calibrate", "board", "--out", out, "--target", "7x5:25"]), 0);
    let drawing = fs::read_to_string(&path).expect("a drawing");
    assert!(
        drawing.starts_with("<svg") && drawing.contains("7x5:25") && drawing.trim_end().ends_with("</svg>")
    );
    let again = bowwave(["calibrate", "board", "--out", out]);
    expect_code(&again, 1);
    assert!(said(&again).contains("--force"));
    assert_eq!(fs::read_to_string(&path).expect("a drawing"), drawing);
    expect_code(&bowwave(["calibrate", "board", "--out", out, "--force"]), 0);
}

#[test]
fn a_board_is_named_by_kalibrs_file_as_well() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a name").to_owned();
    let (drawn, yaml, again) = (path("drawn.svg"), path("board.yaml"), path("again.svg"));
    let board = ["calibrate", "board", "--target"];
    let made = [&board[..], &["7x5:25:0.25", "--out", &drawn, "--kalibr", &yaml]].concat();
    expect_code(&bowwave(&made), 0);
    expect_code(&bowwave(&made), 1);
    expect_code(&bowwave([&board[..], &[&yaml, "--out", &again]].concat()), 0);
    assert_eq!(fs::read(&drawn).expect("a drawing"), fs::read(&again).expect("a drawing"));
    fs::write(&yaml, "target_type: 'aprilgrid'\ntagCols: many\n").expect("a file");
    for (name, words) in [
        (yaml, ["board.yaml: line 2, column 10", "tagCols is not a whole number", "tagSize (metres)"]),
        (path("absent.yml"), ["cannot read", "absent.yml", "bowwave calibrate board --kalibr"]),
        ("6x6".to_owned(), ["'6x6' is no target", "6x6:22:0.3", "Kalibr's file"]),
    ] {
        let output = bowwave([&board[..], &[&name, "--out", &path("not.svg")]].concat());
        expect_code(&output, 2);
        let said = said(&output);
        for word in words {
            assert!(said.contains(word), "'{word}' is missing: {said}");
        }
    }
    assert!(!folder.path().join("not.svg").exists());
}
