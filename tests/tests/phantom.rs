//! The gun's outlines as a maintainer takes them: from a model, from a traced plane, and what is refused.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a failed step fails the test")]

use std::{
    f64::consts::TAU,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use bowwave_calibration::{CalibrationFile, gun::GunFrame, to_toml};
use bowwave_core::{
    geometry::{Distortion, Lens},
    own_ship::Phantom,
};
use bowwave_models::{PartMesh, parts_glb};
use bowwave_tests::{bowwave, expect_code, program, said};
use glam::{DVec2, DVec3};
use hw_sim::make::{self, Recipe};
use serde_json::Value;

/// The camera's place in the model, as an argument and as a place.
const CAMERA_AT: &str = "0.02,0.25,-0.6";

fn camera_at() -> DVec3 {
    DVec3::new(0.02, 0.25, -0.6)
}

struct Bench {
    folder: tempfile::TempDir,
    file: CalibrationFile,
}

impl Bench {
    /// A calibration of a lens that bends lines, and a folder.
    fn new() -> Self {
        let mut file = make::calibration(&Recipe { width: 1280, height: 720, ..Recipe::default() });
        let distortion = Distortion::radial_tangential(DVec2::new(-0.15, 0.03), DVec2::new(3e-4, -2e-4));
        file.calibration.lens = Lens { distortion, ..Lens::pinhole(1280, 720, 1.0) };
        file.calibration.boresight = DVec2::new(0.01, 0.02);
        let bench = Self { folder: tempfile::tempdir().unwrap(), file };
        fs::write(bench.path("cal.toml"), to_toml(&bench.file)).unwrap();
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn frame(&self) -> GunFrame {
        GunFrame::new(&self.file.calibration, Some(camera_at()), 0.0)
    }

    fn phantom(&self, arguments: &[&str]) -> Output {
        let calibration = self.path("cal.toml");
        let common = ["calibrate", "phantom", "--calibration", calibration.to_str().unwrap()];
        bowwave(common.into_iter().chain(arguments.iter().copied()))
    }

    fn model(&self, parts: &[PartMesh]) -> String {
        let path = self.path("gun.glb");
        fs::write(&path, parts_glb(parts)).unwrap();
        path.to_str().unwrap().to_owned()
    }

    /// Outlines that a calibration file has.
    fn outlines(&self, name: &str) -> Vec<Phantom> {
        CalibrationFile::read(&self.path(name)).unwrap().phantoms
    }
}

/// A ring about the bore's height, and a tube along the bore that reaches behind the camera.
fn ring_and_barrel() -> [PartMesh; 2] {
    let on = |i: u32, radius: f64, up: f64, z: f64| {
        let angle = TAU * f64::from(i % 96) / 96.0;
        DVec3::new(radius * angle.cos(), up + radius * angle.sin(), z)
    };
    let quads = |a: &dyn Fn(u32) -> DVec3, b: &dyn Fn(u32) -> DVec3| -> Vec<[DVec3; 3]> {
        (0..96).flat_map(|i| [[a(i), a(i + 1), b(i + 1)], [a(i), b(i + 1), b(i)]]).collect()
    };
    let ring = quads(&|i| on(i, 0.06, 0.25, 0.3), &|i| on(i, 0.05, 0.25, 0.3));
    let barrel = quads(&|i| on(i, 0.03, 0.0, -0.9), &|i| on(i, 0.03, 0.0, 0.8));
    [("ring sight", ring), ("barrel", barrel)]
        .map(|(name, triangles)| PartMesh { name: name.to_owned(), triangles })
}

#[test]
fn a_model_gives_the_outlines_of_its_parts() {
    let bench = Bench::new();
    let model = bench.model(&ring_and_barrel());
    let out = bench.path("new.toml");
    let arguments = ["--model", &model, "--camera-at", CAMERA_AT, "--json", "--out", out.to_str().unwrap()];
    let output = bench.phantom(&arguments);
    expect_code(&output, 0);
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(told["openings"].as_array().unwrap().len(), 1, "{told}");
    assert!(told["notes"].to_string().contains("openings of"), "{told}");
    let outlines = bench.outlines("new.toml");
    let names: Vec<_> = outlines.iter().map(|p| &*p.name).collect();
    assert_eq!(names, ["ring sight", "barrel"]);
    // The ring's outer edge, seen through the lens.
    let lens = &bench.file.calibration.lens;
    let frame = bench.frame();
    for i in 0..96 {
        let angle = TAU * (f64::from(i) + 0.5) / 96.0;
        let radius = 0.06 * (TAU / 192.0).cos();
        let edge = DVec3::new(radius * angle.cos(), 0.25 + radius * angle.sin(), 0.3);
        let seen = lens.project(frame.to_camera(edge)).unwrap();
        assert!(outlines[0].distance(seen).abs() < 0.1, "{} px at {seen}", outlines[0].distance(seen));
    }
    let [low, high] = outlines[1].bounds();
    assert!(high.y == 720.0 && low.y > 360.0, "{low} {high}");
}

#[test]
fn without_a_place_of_the_camera_the_muzzle_is_the_models_origin() {
    let mut bench = Bench::new();
    let model = bench.model(&ring_and_barrel());
    bench.file.calibration.muzzle_in_camera = DVec3::ZERO;
    fs::write(bench.path("cal.toml"), to_toml(&bench.file)).unwrap();
    let output = bench.phantom(&["--model", &model]);
    expect_code(&output, 1);
    assert!(said(&output).contains("--camera-at"), "{}", said(&output));
    bench.file.calibration.muzzle_in_camera = DVec3::new(-0.1, 0.25, 0.6);
    fs::write(bench.path("cal.toml"), to_toml(&bench.file)).unwrap();
    let output = bench.phantom(&["--model", &model]);
    expect_code(&output, 0);
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(told.contains("the camera stands at") && told.contains("barrel"), "{told}");
}

/// Points of a plate beside the bore, metres: left and up on it.
const PLATE: [[f64; 2]; 5] = [[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2], [0.0, 0.05]];

/// A place of the plate in the gun's frame.
fn on_plate([x, y]: [f64; 2]) -> DVec3 {
    DVec3::new(-x, 0.1 + 0.8 * y, 0.3 + 0.6 * y + 0.1)
}

fn plane_argument(bench: &Bench, place: impl Fn([f64; 2]) -> DVec3) -> String {
    let (lens, frame) = (&bench.file.calibration.lens, bench.frame());
    let point = |p: [f64; 2]| {
        let seen = lens.project(frame.to_camera(place(p))).unwrap();
        format!("{:.3},{:.3}={},{}", seen.x, seen.y, p[0], p[1])
    };
    PLATE.map(point).join(" ")
}

/// Largest distance of one outline's edges from the other's, pixels.
fn apart(a: &Phantom, b: &Phantom) -> f64 {
    a.edges()
        .flat_map(|(from, to)| {
            let steps = from.distance(to).ceil().max(1.0) as u32;
            (0..steps).map(move |i| from.lerp(to, f64::from(i) / f64::from(steps)))
        })
        .map(|place| b.distance(place).abs())
        .fold(0.0, f64::max)
}

#[test]
fn what_is_traced_on_a_plane_comes_back_as_a_model() {
    let bench = Bench::new();
    let plane = plane_argument(&bench, on_plate);
    // Concave, with long edges that the lens bends.
    let corners = [
        [420.0, 480.0],
        [860.0, 470.0],
        [880.0, 640.0],
        [700.0, 655.0],
        [690.0, 540.0],
        [560.0, 545.0],
        [555.0, 660.0],
        [400.0, 650.0],
    ];
    let text: Vec<_> = corners.iter().map(|[x, y]| format!("{x},{y}")).collect();
    let outline = format!("shield={}", text.join(" "));
    let glb = bench.path("shield.glb");
    let glb = glb.to_str().unwrap();
    let trace = |axes: &[&str]| {
        let common =
            ["--camera-at", CAMERA_AT, "--plane", &plane, "--outline", &outline, "--glb", glb, "--json"];
        let output = bench.phantom(&[&common, axes].concat());
        expect_code(&output, 0);
        let told: Value = serde_json::from_slice(&output.stdout).unwrap();
        println!("{told}");
        assert!(told["parts"][0]["off_px"].as_f64().unwrap() < 0.05, "{told}");
    };
    trace(&[]);
    // The calibration stays as it is.
    assert_eq!(bench.outlines("cal.toml"), []);
    let out = bench.path("new.toml");
    let output = bench.phantom(&["--model", glb, "--camera-at", CAMERA_AT, "--out", out.to_str().unwrap()]);
    expect_code(&output, 0);
    let found = bench.outlines("new.toml");
    assert_eq!((found.len(), &*found[0].name), (1, "shield"));
    let traced = Phantom::new("shield", corners.map(DVec2::from_array).to_vec(), (1280, 720));
    let off = [apart(&traced, &found[0]), apart(&found[0], &traced)];
    println!("round trip: {off:?} px at most");
    assert!(off.iter().all(|off| *off < 0.1), "{off:?}");
    // The same by the plane's axes as they were measured.
    let axes = "0,0.1,0.4 -1,0,0 0,0.8,0.6";
    trace(&["--plane-axes", axes]);
}

#[test]
fn what_does_not_tell_the_gun_is_refused_with_what_to_do() {
    let bench = Bench::new();
    let plane = plane_argument(&bench, on_plate);
    let glb = bench.path("out.glb");
    let glb = glb.to_str().unwrap();
    let refused = |arguments: &[&str], code: i32, words: &[&str]| {
        let output = bench.phantom(arguments);
        expect_code(&output, code);
        let said = said(&output);
        assert!(words.iter().all(|word| said.contains(word)), "{arguments:?}: {said}");
    };
    let bow = "bow=500,500 800,650 800,500 500,650";
    let with = |plane: &str, outline: &str, words: &[&str]| {
        refused(&["--camera-at", CAMERA_AT, "--plane", plane, "--outline", outline, "--glb", glb], 1, words);
    };
    with(&plane, bow, &["bow", "from corner 1 to 2 meets that from 3 to 4"]);
    let frame = "shield=420,480 860,470 700,655";
    let three: Vec<&str> = plane.split(' ').take(3).collect();
    with(&three.join(" "), frame, &["3 points", "give 4 to 64"]);
    // A plate that the camera looks along: it stands 0.25 up.
    let edge_on = plane_argument(&bench, |[x, y]| DVec3::new(-x, 0.2499, 0.4 + y));
    with(&edge_on, frame, &["edge-on", "condition number", "--model"]);
    refused(&["--plane", &plane, "--outline", frame], 2, &["--glb"]);
    refused(&["--model", "/nowhere/gun.glb", "--camera-at", CAMERA_AT], 1, &["gun.glb"]);
    refused(&[], 2, &["RECORDING"]);
    let behind = bench.model(&ring_and_barrel().map(|part| {
        let triangles = part.triangles.iter().map(|t| t.map(|p| p - DVec3::Z * 9.0)).collect();
        PartMesh { triangles, ..part }
    }));
    let output = bench.phantom(&["--model", &behind, "--camera-at", CAMERA_AT]);
    expect_code(&output, 1);
    assert!(String::from_utf8_lossy(&output.stdout).contains("nothing of the model is in the picture"));
    let output = bowwave(["calibrate", "phantom", "--model", &behind]);
    expect_code(&output, 1);
    assert!(said(&output).contains("--calibration"), "{}", said(&output));
}

fn picture(path: &Path, size: (u32, u32)) {
    image::GrayImage::from_pixel(size.0, size.1, image::Luma([120])).save(path).unwrap();
}

#[test]
fn a_picture_is_traced_on_and_a_missing_desktop_says_so() {
    let bench = Bench::new();
    let (still, small) = (bench.path("still.png"), bench.path("small.png"));
    picture(&still, (1280, 720));
    picture(&small, (640, 360));
    let still = still.to_str().unwrap();
    let output = bench.phantom(&[still]);
    expect_code(&output, 1);
    assert!(said(&output).contains("--trace or --outline"), "{}", said(&output));
    let output = bench.phantom(&[small.to_str().unwrap(), "--trace"]);
    expect_code(&output, 1);
    assert!(said(&output).contains("640x360") && said(&output).contains("1280x720"), "{}", said(&output));
    let shown = bench.path("shown.png");
    let outline = "barrel=600,560 680,560 760,720 520,720";
    let output = bench.phantom(&[still, "--outline", outline, "--picture", shown.to_str().unwrap()]);
    expect_code(&output, 0);
    let shown = image::open(&shown).unwrap().into_rgb8();
    assert_eq!((shown.get_pixel(640, 560).0, shown.get_pixel(640, 500).0), ([255, 40, 40], [120; 3]));
    assert_eq!(bench.outlines("cal.toml").len(), 1);
    let output = Command::new(program())
        .args(["calibrate", "phantom", still, "--trace", "--calibration"])
        .arg(bench.path("cal.toml"))
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .output()
        .unwrap();
    expect_code(&output, 1);
    let said = said(&output);
    assert!(said.contains("--outline") && said.contains("--picture") && said.contains("DISPLAY"), "{said}");
}

#[test]
fn without_a_camera_the_live_view_says_what_to_do() {
    let bench = Bench::new();
    let config = bench.path("bowwave.toml");
    let camera = "[camera]\ndevice = \"/dev/v4l/by-id/usb-No_Such_Camera\"\n";
    fs::write(&config, camera).unwrap();
    let live = ["--live", "--seconds", "1", "--config", config.to_str().unwrap()];
    for more in [&[][..], &["--trace"]] {
        let output = bench.phantom(&[&live[..], more].concat());
        expect_code(&output, 1);
        let said = said(&output);
        for part in ["no pictures from the camera", "No_Such_Camera", "bowwave doctor --config"] {
            assert!(said.contains(part), "{part}: {said}");
        }
        assert!(!said.contains("without stop"), "the camera is not closed: {said}");
    }
    // The calibration may be the configuration's; without any nothing is opened.
    let bare = |text: &str| {
        fs::write(&config, text).unwrap();
        bowwave([&["calibrate", "phantom"], &live[..]].concat())
    };
    let output = bare(camera);
    expect_code(&output, 1);
    assert!(said(&output).contains("names no calibration"), "{}", said(&output));
    let output = bare(&format!("[files]\ncalibration = \"absent.toml\"\n{camera}"));
    expect_code(&output, 1);
    assert!(said(&output).contains("bowwave calibrate wizard"), "{}", said(&output));
    let output = bare(&format!("[files]\ncalibration = \"cal.toml\"\n{camera}"));
    expect_code(&output, 1);
    assert!(said(&output).contains("No_Such_Camera"), "{}", said(&output));
}

#[test]
fn the_live_view_is_instead_of_a_recording() {
    let bench = Bench::new();
    for wrong in [&["--live", "a.mcap"][..], &["--trace"], &["a.mcap", "--config", "b.toml"]] {
        expect_code(&bench.phantom(wrong), 2);
    }
    let help = bowwave(["calibrate", "phantom", "--help"]);
    expect_code(&help, 0);
    assert!(String::from_utf8_lossy(&help.stdout).contains("--live"));
    let completions = bowwave(["completions", "bash"]);
    assert!(String::from_utf8_lossy(&completions.stdout).contains("--live --config --seconds"));
}
