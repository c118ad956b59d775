//! GoPro's public sample clip: its gyro on its pictures' time base, the drift that an overlay then has, and what becomes of
//! the clip when it is damaged. The clip is not part of the project; without it these tests are skipped.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a failed step in a test's helper fails the test"
)]

#[path = "../measure/mod.rs"]
mod measure;

use std::{
    fs,
    ops::ControlFlow,
    path::{Path, PathBuf},
    process::Command,
};

use bowwave_calibration::{CalibrationFile, Date};
use bowwave_import::{
    BiasSource, ImportError, ImportOptions, START, TelemetryReport, import_video, read_telemetry,
};
use bowwave_record::RecordingReader;

/// The clip, where it is there.
fn clip() -> Option<PathBuf> {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/camera_imu/gopro_karma/karma.mp4");
    if !path.exists() {
        eprintln!("skipped: {} is not there", path.display());
        return None;
    }
    Some(path)
}

fn have_ffmpeg() -> bool {
    let here = Command::new("ffmpeg").arg("-version").output().is_ok();
    if !here {
        eprintln!("skipped: ffmpeg is not installed");
    }
    here
}

fn options() -> ImportOptions {
    let calibration =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../calibration/examples/gopro_karma.toml");
    ImportOptions {
        calibration: Some(CalibrationFile::read(&calibration).unwrap()),
        bias_from_s: Some(5.0),
        ..ImportOptions::new(Date::new(2026, 11, 21).unwrap())
    }
}

#[test]
fn a_boat_carried_by_the_gyro_stays_put() {
    let Some(video) = clip().filter(|_| have_ffmpeg()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("karma.mcap");
    let report = import_video(&video, &out, &options(), &mut |_| ControlFlow::Continue(())).unwrap();
    assert_eq!((report.frames, report.imu_samples, report.picture), (362, 4795, (854, 480)));
    let TelemetryReport::Used { camera, rate_hz, bias: Some(bias) } = report.telemetry else {
        panic!("{:?}", report.telemetry)
    };
    assert_eq!(camera, "GoPro HERO5 Black");
    assert!((rate_hz - 397.55).abs() < 0.1, "{rate_hz}");
    assert!(matches!(bias.source, BiasSource::Pictures { patches } if patches > 40), "{bias:?}");

    let properties = RecordingReader::open(&out).unwrap().properties().clone();
    let embedded = bowwave_calibration::parse(&properties.calibration_toml, "embedded").unwrap();
    assert!(embedded.calibration.gyro_bias.distance(bias.rate) < 1e-12);
    assert!(embedded.gyro_bias.how.contains("first 5.0 s"), "{}", embedded.gyro_bias.how);

    let clip = measure::DriftClip::read(&out).unwrap();
    let tracks = measure::Tracks::follow(&clip, 200).unwrap();
    let steady = measure::drift(&clip, &tracks, 0.0, 11.0).unwrap();
    let ahead = measure::drift(&clip, &tracks, 5.0, 11.0).unwrap();
    let swing = measure::drift(&clip, &tracks, 11.0, 100.0).unwrap();
    eprintln!("first 11 s: {steady}\n5 to 11 s: {ahead}\nswing: {swing}");
    assert!(steady.patches >= 30 && steady.pictures == 330, "{steady}");
    assert!(steady.overlay_rms <= 3.0, "{steady}");
    assert!(ahead.overlay_rms <= 3.0, "{ahead}");
    // The swing of ten degrees is 150 pixels.
    assert!(swing.pictures == 32 && swing.overlay_max <= 12.0, "{swing}");
}

#[test]
fn gyro_and_pictures_share_a_time_base() {
    let Some(video) = clip() else { return };
    let telemetry = read_telemetry(Path::new("ffmpeg"), &video).unwrap().unwrap();
    let (first, last) = (telemetry.samples[0], telemetry.samples[4794]);
    assert_eq!(first.arrival, START);
    assert!((last.arrival.secs_since(START) - 12.059).abs() < 0.002, "{}", last.arrival);
    let device_ns = last.device_time_ns - first.device_time_ns;
    assert!((device_ns - last.arrival.ns_since(first.arrival)).abs() <= 1);
    // At rest on a gimbal the accelerometer's first channel points up, in m/s^2.
    let mean = telemetry.samples.iter().map(|s| s.accel).sum::<glam::DVec3>() / 4795.0;
    assert!((mean.length() - 9.7).abs() < 0.2 && mean.x > 9.5, "{mean}");
    assert!(telemetry.samples.iter().all(|s| s.is_finite()));
}

#[test]
fn without_its_gyro_it_is_a_video_like_any_other() {
    let Some(video) = clip().filter(|_| have_ffmpeg()) else { return };
    let folder = tempfile::tempdir().unwrap();
    let without = ImportOptions { without_gyro: true, ..options() };
    let out = folder.path().join("out.mcap");
    let report = import_video(&video, &out, &without, &mut |_| ControlFlow::Continue(())).unwrap();
    assert_eq!((report.imu_samples, report.telemetry), (0, TelemetryReport::LeftOut));
}

/// A copy of the clip with some of its bytes changed.
fn damaged(video: &Path, change: impl FnOnce(&mut Vec<u8>)) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.mp4");
    let mut bytes = fs::read(video).unwrap();
    change(&mut bytes);
    fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn find_all(bytes: &[u8], what: &[u8]) -> Vec<usize> {
    bytes.windows(what.len()).enumerate().filter(|(_, w)| *w == what).map(|(i, _)| i).collect()
}

/// Where the entries of a table of the GPMF track's index begin.
fn table(bytes: &[u8], name: &[u8; 4]) -> usize {
    let track = find_all(bytes, b"gpmd")[0];
    let inside = find_all(&bytes[track..], name)[0] + track;
    inside + if name == b"stsz" { 16 } else { 12 }
}

#[test]
fn garbled_telemetry_is_one_line() {
    let Some(video) = clip() else { return };
    type Change = fn(&mut Vec<u8>);
    let cases: [(&str, Change); 6] = [
        ("no payload is one", |b| find_all(b, b"DEVC").into_iter().for_each(|i| b[i] = b'X')),
        ("gyro renamed", |b| find_all(b, b"GYRO").into_iter().for_each(|i| b[i] = b'X')),
        ("scale of nought", |b| find_all(b, b"SCAL").into_iter().for_each(|i| b[i + 8..i + 10].fill(0))),
        ("other unit", |b| find_all(b, b"rad/s").into_iter().for_each(|i| b[i] = b'm')),
        ("payload behind the end", |b| {
            let i = table(b, b"stco");
            b[i..i + 4].copy_from_slice(&0xfff0_0000_u32.to_be_bytes());
        }),
        ("payload of gigabytes", |b| {
            let i = table(b, b"stsz");
            b[i..i + 4].copy_from_slice(&0x7000_0000_u32.to_be_bytes());
        }),
    ];
    for (name, change) in cases {
        let (_folder, path) = damaged(&video, change);
        match read_telemetry(Path::new("ffmpeg"), &path) {
            Err(e @ ImportError::Telemetry { .. }) => {
                let message = e.to_string();
                assert!(!message.contains('\n') && message.contains("damaged.mp4"), "{name}: {message}");
            }
            other => panic!("{name}: {:?}", other.map(|t| t.map(|t| t.samples.len()))),
        }
    }
}

#[test]
fn nesting_without_end_is_survived() {
    let Some(video) = clip() else { return };
    // Half a megabyte of containers within containers, in place of the first payload.
    let (_folder, path) = damaged(&video, |bytes| {
        let (place, size) = (table(bytes, b"stco"), table(bytes, b"stsz"));
        let mut nest = Vec::new();
        let total = 512 << 10;
        while nest.len() < total {
            let left = total - nest.len() - 8;
            nest.extend(b"DEVC\0\x08");
            nest.extend(((left / 8) as u16).to_be_bytes());
        }
        // A box of its own, so that the file stays one.
        bytes.extend((total as u32 + 8).to_be_bytes());
        bytes.extend(b"free");
        let offset = bytes.len() as u32;
        bytes[place..place + 4].copy_from_slice(&offset.to_be_bytes());
        bytes[size..size + 4].copy_from_slice(&(total as u32).to_be_bytes());
        bytes.extend(nest);
    });
    // The other payloads are there as before.
    let telemetry = read_telemetry(Path::new("ffmpeg"), &path).unwrap().unwrap();
    assert_eq!(telemetry.samples.len(), 4795 - 392);
}

#[test]
fn random_damage_never_panics() {
    let Some(video) = clip() else { return };
    let whole = fs::read(&video).unwrap();
    let payloads = find_all(&whole, b"DEVC");
    let index = find_all(&whole, b"moov")[0];
    let mut seed = 7_u64;
    let mut random = |below: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize % below
    };
    for round in 0..60 {
        let (_folder, path) = damaged(&video, |bytes| {
            for _ in 0..=random(12) {
                let start = if round % 2 == 0 { payloads[random(payloads.len())] } else { index };
                let at = (start + random(6000)).min(bytes.len() - 1);
                bytes[at] = random(256) as u8;
            }
            if round % 5 == 0 {
                bytes.truncate(random(bytes.len()));
            }
        });
        if let Err(e) = read_telemetry(Path::new("ffmpeg"), &path) {
            assert!(!e.to_string().contains('\n'), "{e}");
        }
    }
}
