//! The calibration file as its users meet it.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a failed step in a test's helper fails the test"
)]

use std::{fs, path::Path};

use bowwave_calibration::{CalibrationError, CalibrationFile, Date, Provenance, history, parse, to_toml};
use bowwave_core::{
    calibration::{Calibration, TriggerLatency},
    geometry::{Distortion, Lens},
    own_ship::Phantom,
};
use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;

const EXAMPLE: &str = include_str!("../examples/mount.toml");

fn example() -> CalibrationFile {
    parse(EXAMPLE, "mount.toml").unwrap()
}

#[test]
fn every_example_is_read_and_comes_back_the_same() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let mut read = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "toml") {
            let file = CalibrationFile::read(&path).unwrap();
            assert_eq!(parse(&to_toml(&file), "again").unwrap(), file, "{}", path.display());
            read += 1;
        }
    }
    assert!(read >= 1);
}

#[test]
fn the_example_means_what_it_says() {
    let file = example();
    let c = &file.calibration;
    assert_eq!(file.made, Date::new(2026, 11, 20).unwrap());
    assert_eq!(file.lens.measured, Date::new(2026, 11, 18).unwrap());
    assert_eq!(c.lens.centre, DVec2::new(641.7, 358.2));
    assert_eq!(c.time_offset_ns, -3_200_000);
    assert_eq!(file.hidden[0][1], DVec2::new(420.0, 560.0));
    assert_eq!(file.phantoms[0].outline()[1], DVec2::new(670.0, 610.0));
    assert!(file.phantoms[0].recoils);
    assert!((0.05..0.08).contains(&file.own_ship().mask.unwrap().share()));
    assert!((c.gyro_bias.z - 0.021_f64.to_radians()).abs() < 1e-15);
    assert!((c.camera_from_imu_sigma.x - 0.7e-3).abs() < 1e-15);
    // What the unit feels ahead (its x) lies ahead in the camera (its z), what it feels below (its z) below (y).
    assert!((c.camera_from_imu * DVec3::X).distance(DVec3::Z) < 0.02);
    assert!((c.camera_from_imu * DVec3::Z).distance(DVec3::Y) < 0.02);
}

#[test]
fn mistakes_are_refused_with_their_place() {
    let cases = [
        ("focal_px = [1108.4, 1108.9]", "focal_px = [-1108.4, 1108.9]", "11:12", "lens.focal_px"),
        ("focal_px = [1108.4, 1108.9]", "focal_px = [nan, 1108.9]", "11:12", "lens.focal_px"),
        ("focal_sigma_px = 0.6", "focal_sigma_px = 0", "12:18", "above 0"),
        ("centre_px = [641.7, 358.2]", "centre_px = [641.7, 958.2]", "13:13", "outside the picture"),
        ("radial = [-0.112, 0.034]", "radial = [-3.0, 0.0]", "14:10", "folds back"),
        ("radial = [-0.112, 0.034]", "radial = [-0.112]", "14:10", "a list of 2"),
        ("size_px = [1280, 720]", "size_px = [0, 720]", "10:11", "1 to 8192"),
        ("rotation_wxyz = [0.4956172,", "rotation_wxyz = [0.6,", "21:17", "length"),
        ("sigma_mrad = [0.7, 0.7, 0.8]", "sigma_mrad = [0.7, inf, 0.8]", "22:14", "from_imu.sigma_mrad"),
        ("offset_ms = -3.2", "offset_ms = -32000", "27:13", "time_offset.offset_ms"),
        ("sigma_ms = 0.15", "sigma_ms = 1e-9", "28:12", "nanosecond"),
        ("right_deg = 0.21", "right_deg = 90.0", "33:13", "boresight.right_deg"),
        ("right_deg = 0.21", "right_dge = 0.21", "33:1", "right_dge"),
        ("imu_name = \"VN-100\"", "imu_nmae = \"VN-100\"", "6:1", "imu_nmae"),
        ("made = 2026-11-20", "made = \"2026-11-20\"", "2:8", "a day of the calendar, without quotes"),
        ("made = 2026-11-20", "made = 2026-11-20T10:00:00Z", "2:8", "without a time"),
        ("made = 2026-11-20", "made = 2026-02-30", "2:8", ""),
        ("[gyro_bias]", "[gyro_bias", "40:", ""),
        ("[gyro_bias]", "[gyro_bais]", "40:", "gyro_bais"),
        ("bias_deg_per_s = [0.012, -0.004, 0.021]\n", "", "40:", "bias_deg_per_s"),
        (", [430.0, 720.0], [0.0, 720.0]]", "]", "49:14", "polygon of 2 corners"),
        ("[420.0, 560.0]", "[1420.0, 560.0]", "49:14", "not in a picture of 1280x720"),
        ("[420.0, 560.0]", "[nan, 560.0]", "49:14", "not in a picture"),
        ("[420.0, 560.0], [430.0, 720.0]", "[0.0, 700.0]", "49:14", "hides nothing"),
        (
            "[[0.0, 640.0], [420.0, 560.0], [430.0, 720.0], [0.0, 720.0]]",
            "[[0.0, 0.0], [1280.0, 0.0], [1280.0, 700.0], [0.0, 700.0]]",
            "49:14",
            "hides 9",
        ),
    ];
    for (from, to, place, says) in cases {
        assert!(EXAMPLE.contains(from), "{from}");
        let message = parse(&EXAMPLE.replacen(from, to, 1), "mount.toml").unwrap_err().to_string();
        assert!(message.starts_with(&format!("mount.toml:{place}")), "{to}: {message}");
        assert!(message.contains(says), "{to}: {message}");
        assert!(!message.contains('\n'), "{message}");
    }
}

#[test]
fn a_fisheye_stands_in_place_of_the_other_model() {
    let both = "radial = [-0.112, 0.034]\n";
    let text = EXAMPLE.replace(both, "fisheye = [-0.02, 0.01, -0.004, 0.001]\n");
    let message = parse(&text, "x").unwrap_err().to_string();
    assert!(message.contains("lens.fisheye") && message.contains("one or the other"), "{message}");
    let alone: String =
        text.lines().filter(|l| !l.starts_with("tangential")).fold(String::new(), |t, l| t + l + "\n");
    let file = parse(&alone, "x").unwrap();
    assert_eq!(file.calibration.lens.distortion, Distortion::fisheye([-0.02, 0.01, -0.004, 0.001]));
    assert_eq!(parse(&to_toml(&file), "again").unwrap(), file);
    let folding = parse(&alone.replace("-0.02, 0.01", "-2.0, 0.01"), "x").unwrap_err().to_string();
    assert!(folding.contains("lens.fisheye") && folding.contains("folds back"), "{folding}");
    let none = alone.lines().filter(|l| !l.starts_with("fisheye")).fold(String::new(), |t, l| t + l + "\n");
    assert!(parse(&none, "x").unwrap_err().to_string().contains("give radial and tangential, or fisheye"));
}

#[test]
fn a_rolling_shutter_is_optional_and_checked() {
    let global = example();
    assert_eq!((global.calibration.readout_ns, &global.shutter), (0, &None));
    let section = "\n[shutter]\nreadout_ms = -21.5\nsigma_ms = 0.2\nmeasured = 2026-11-19\n";
    let rolling = parse(&format!("{EXAMPLE}{section}"), "rolling").unwrap();
    assert_eq!(
        (rolling.calibration.readout_ns, rolling.calibration.readout_sigma_ns),
        (-21_500_000, 200_000)
    );
    assert_eq!(parse(&to_toml(&rolling), "again").unwrap(), rolling);
    for (from, to, says) in [("-21.5", "-2150", "shutter.readout_ms"), ("= 0.2", "= 0", "shutter.sigma_ms")] {
        let message = parse(&format!("{EXAMPLE}{}", section.replace(from, to)), "x").unwrap_err().to_string();
        assert!(message.contains(says), "{message}");
    }
}

/// The example in a file of its own, and the folder that holds it.
fn written() -> (tempfile::TempDir, std::path::PathBuf, CalibrationFile) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("calibration.toml");
    let file = example();
    file.write(&path).unwrap();
    (folder, path, file)
}

#[test]
fn writing_keeps_the_former_file() {
    let (folder, path, first) = written();
    let mut second = first.clone();
    second.calibration.time_offset_ns = 7_000_001;
    second.write(&path).unwrap();
    assert_eq!(CalibrationFile::read(&path).unwrap(), second);
    let kept = history::copies(&path).unwrap();
    assert_eq!(CalibrationFile::read(&kept[0].path).unwrap(), first);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "temporary files stay behind");
}

#[test]
fn nothing_that_cannot_be_read_back_is_written() {
    let (_folder, path, good) = written();
    let mut bad = good.clone();
    bad.calibration.gyro_bias.x = f64::NAN;
    assert!(matches!(bad.write(&path), Err(CalibrationError::Unreadable(_))));
    assert_eq!(CalibrationFile::read(&path).unwrap(), good);
}

#[test]
fn missing_files_and_folders_say_so() {
    let folder = tempfile::tempdir().unwrap();
    let nowhere = folder.path().join("no/such/calibration.toml");
    let read = CalibrationFile::read(&nowhere).unwrap_err();
    assert!(matches!(read, CalibrationError::Read { .. }) && read.to_string().contains("no/such"), "{read}");
    let write = example().write(&nowhere).unwrap_err();
    assert!(
        matches!(write, CalibrationError::Write { .. }) && write.to_string().contains("no/such"),
        "{write}"
    );
}

fn vec3(low: f64, high: f64) -> impl Strategy<Value = DVec3> {
    [low..high, low..high, low..high].prop_map(DVec3::from_array)
}

fn sigma3() -> impl Strategy<Value = DVec3> {
    vec3(-12.0, 0.0).prop_map(|v| DVec3::new(v.x.exp(), v.y.exp(), v.z.exp()))
}

fn rotation() -> impl Strategy<Value = DQuat> {
    [-1.0..1.0, -1.0..1.0, -1.0..1.0, -1.0..1.0f64]
        .prop_filter("too short to have a direction", |v| v.iter().map(|c| c * c).sum::<f64>() > 0.01)
        .prop_map(|v| DQuat::from_array(v).normalize())
}

fn lens() -> impl Strategy<Value = Lens> {
    let radial =
        (64u32..4096, 64u32..4096, 0.4..1.3f64, [-0.05..0.05, -0.01..0.01f64], [-1e-3..1e-3, -1e-3..1e-3f64])
            .prop_map(|(width, height, hfov, radial, tangential)| Lens {
                distortion: Distortion::radial_tangential(
                    DVec2::from_array(radial),
                    DVec2::from_array(tangential),
                ),
                ..Lens::pinhole(width, height.min(width), hfov)
            });
    let k = [-0.03..0.03, -0.01..0.01, -0.002..0.002, -2e-4..2e-4f64];
    let fisheye = (64u32..4096, 64u32..4096, 0.4..1.6f64, k)
        .prop_map(|(width, height, hfov, k)| Lens::fisheye(width, height.min(width), hfov, k));
    prop_oneof![radial, fisheye]
}

fn date() -> impl Strategy<Value = Date> {
    (1u16..=9999, 1u8..=12, 1u8..=28).prop_map(|(y, m, d)| Date::new(y, m, d).unwrap())
}

/// Text of any characters, or of those that TOML has a use for.
fn text(longest: usize) -> impl Strategy<Value = String> {
    let delicate = prop::sample::select(vec!['"', '\'', '\\', '\n', '\t', '\r', '\0', '\u{7f}']);
    prop::collection::vec(prop_oneof![3 => any::<char>(), 1 => delicate], 0..=longest)
        .prop_map(String::from_iter)
}

fn provenance() -> impl Strategy<Value = Provenance> {
    (date(), text(20)).prop_map(|(measured, how)| Provenance { measured, how })
}

prop_compose! {
    fn calibration()(
        lens in lens(),
        focal_sigma_px in 1e-3..10.0f64,
        camera_from_imu in rotation(),
        camera_from_imu_sigma in sigma3(),
        time_offset_ns in -10_000_000_000i64..=10_000_000_000,
        time_offset_sigma_ns in 1i64..1_000_000_000,
        readout_ns in -100_000_000i64..=100_000_000,
        readout_sigma_ns in 1i64..1_000_000,
        rolling in any::<bool>(),
        boresight in [-0.5..0.5, -0.5..0.5f64],
        boresight_sigma in 1e-6..0.1f64,
        muzzle_in_camera in vec3(-3.0, 3.0),
        trigger in proptest::option::of((-1_000_000_000i64..=1_000_000_000, 1i64..1_000_000_000)),
        gyro_bias in vec3(-0.5, 0.5),
        gyro_bias_sigma in sigma3(),
    ) -> Calibration {
        Calibration {
            lens,
            focal_sigma_px,
            camera_from_imu,
            camera_from_imu_sigma,
            time_offset_ns,
            time_offset_sigma_ns,
            readout_ns: if rolling { readout_ns } else { 0 },
            readout_sigma_ns: if rolling { readout_sigma_ns } else { 0 },
            boresight: DVec2::from_array(boresight),
            boresight_sigma,
            muzzle_in_camera,
            trigger: trigger.map(|(latency_ns, sigma_ns)| TriggerLatency { latency_ns, sigma_ns }),
            gyro_bias,
            gyro_bias_sigma,
        }
    }
}

prop_compose! {
    fn calibration_file()(
        made in date(),
        texts in [text(20), text(20), text(20), text(20), text(20)],
        sections in [provenance(), provenance(), provenance(), provenance(), provenance(), provenance(), provenance()],
        calibration in calibration(),
        hidden in prop::option::of(0.2f64..1.0),
        barrel in prop::option::of((0.2f64..0.8, text(20), any::<bool>())),
    ) -> CalibrationFile {
        let [source, camera_name, camera_serial, imu_name, imu_serial] = texts;
        let [lens, camera_from_imu, time_offset, shutter, boresight, trigger, gyro_bias] = sections;
        let shutter = (calibration.readout_sigma_ns > 0).then_some(shutter);
        let trigger = calibration.trigger.map(|_| trigger);
        let size = DVec2::new(f64::from(calibration.lens.width), f64::from(calibration.lens.height));
        let corner = |share: f64| vec![DVec2::ZERO, DVec2::new(size.x * share, 0.0), DVec2::new(0.0, size.y)];
        let hidden = hidden.map(corner).into_iter().collect();
        let picture = (calibration.lens.width, calibration.lens.height);
        let phantom = |(share, name, recoils): (f64, String, bool)| {
            Phantom::new(name, corner(share), picture).recoiling(recoils)
        };
        let phantoms = barrel.map(phantom).into_iter().collect();
        CalibrationFile {
            made, source, camera_name, camera_serial, imu_name, imu_serial,
            lens, camera_from_imu, time_offset, shutter, boresight, trigger, gyro_bias, hidden, phantoms,
            calibration,
        }
    }
}

fn close(a: DVec3, b: DVec3) -> bool {
    a.to_array().iter().zip(b.to_array()).all(|(a, b)| (a - b).abs() <= 2.3e-16 * a.abs())
}

proptest! {
    #[test]
    fn what_came_from_a_file_comes_back_to_the_last_bit(made in calibration_file()) {
        let text = to_toml(&made);
        let read = parse(&text, "first").map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert_eq!(&parse(&to_toml(&read), "second").unwrap(), &read);

        // Of what was computed, only the angles may move, and those by one unit in the last place.
        let (a, b) = (&made.calibration, &read.calibration);
        prop_assert!(close(a.camera_from_imu_sigma, b.camera_from_imu_sigma));
        prop_assert!(close(a.gyro_bias, b.gyro_bias));
        prop_assert!(close(a.gyro_bias_sigma, b.gyro_bias_sigma));
        prop_assert!(close(a.boresight.extend(a.boresight_sigma), b.boresight.extend(b.boresight_sigma)));
        let mut same_angles = read.clone();
        same_angles.calibration.camera_from_imu_sigma = a.camera_from_imu_sigma;
        same_angles.calibration.gyro_bias = a.gyro_bias;
        same_angles.calibration.gyro_bias_sigma = a.gyro_bias_sigma;
        same_angles.calibration.boresight = a.boresight;
        same_angles.calibration.boresight_sigma = a.boresight_sigma;
        prop_assert_eq!(&same_angles, &made);
    }

    #[test]
    fn no_text_makes_the_reader_panic(text in text(200), cut in 0usize..2000, at in 0usize..2000, with in text(4)) {
        let _ = parse(&text, "noise");
        let mut torn: String = EXAMPLE.chars().take(cut).collect();
        let place = torn.char_indices().nth(at.min(cut)).map_or(torn.len(), |(i, _)| i);
        torn.insert_str(place, &with);
        let _ = parse(&torn, "torn");
    }
}

#[test]
fn a_triggers_latency_is_optional_and_comes_back() {
    let mut file = example();
    assert_eq!((file.calibration.trigger, &file.trigger), (None, &None));
    file.calibration.trigger = Some(TriggerLatency { latency_ns: -3_400_001, sigma_ns: 210_000 });
    file.trigger = Some(Provenance::new(Date::new(2026, 11, 23).unwrap(), "8 dry shots"));
    let text = to_toml(&file);
    assert_eq!(parse(&text, "again").unwrap(), file);
    for (from, to, says) in [
        ("latency_ms = -3.400001", "latency_ms = 2000.0", "trigger.latency_ms"),
        ("sigma_ms = 0.21", "sigma_ms = 0.0", "trigger.sigma_ms"),
        ("latency_ms = -3.400001", "latency_s = -0.1", "latency_s"),
    ] {
        assert!(text.contains(from), "{text}");
        let message = parse(&text.replacen(from, to, 1), "gun.toml").unwrap_err().to_string();
        assert!(message.contains(says), "{message}");
    }
}
