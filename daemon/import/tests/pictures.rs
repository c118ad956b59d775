//! Recordings from folders of pictures.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a failed step in a test's helper fails the test"
)]

use std::{fs, ops::ControlFlow, path::Path};

use bowwave_calibration::Date;
use bowwave_import::{ImportError, ImportOptions, Progress, START, TelemetryReport, import_pictures};
use bowwave_record::{Entry, FrameEntry, RecordingReader};
use image::{ImageFormat, Rgb, RgbImage};

fn options() -> ImportOptions {
    ImportOptions::new(Date::new(2026, 11, 21).unwrap())
}

fn go_on(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// A picture of one colour.
fn paint(path: &Path, width: u32, height: u32, colour: [u8; 3], format: ImageFormat) {
    RgbImage::from_pixel(width, height, Rgb(colour)).save_with_format(path, format).unwrap();
}

fn frames(recording: &Path) -> Vec<FrameEntry> {
    let reader = RecordingReader::open(recording).unwrap();
    let entries = reader.entries().unwrap();
    entries
        .map(|e| match e.unwrap() {
            Entry::Frame(frame) => frame,
            other => panic!("{other:?}"),
        })
        .collect()
}

#[test]
fn pictures_come_in_the_order_of_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    paint(&at("shot10.png"), 64, 48, [200, 10, 10], ImageFormat::Png);
    paint(&at("shot9.JPG"), 64, 48, [10, 200, 10], ImageFormat::Jpeg);
    paint(&at("shot2.jpeg"), 64, 48, [10, 10, 200], ImageFormat::Jpeg);
    fs::write(at("notes.txt"), "no picture").unwrap();
    fs::write(at(".shot1.jpg"), "another program's").unwrap();
    fs::create_dir(at("shot0.png")).unwrap();
    let out = at("out.mcap");
    let mut seen = Vec::new();
    let report = import_pictures(folder.path(), 25.0, &out, &options(), &mut |p| {
        seen.push((p.frames, p.frames_total));
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!((report.frames, report.picture, report.imu_samples), (3, (64, 48), 0));
    assert_eq!(report.telemetry, TelemetryReport::None);
    assert_eq!(seen, [(1, Some(3)), (2, Some(3)), (3, Some(3))]);

    let frames = frames(&out);
    assert_eq!(&*frames[0].jpeg, fs::read(at("shot2.jpeg")).unwrap(), "taken over byte for byte");
    assert_eq!(&*frames[1].jpeg, fs::read(at("shot9.JPG")).unwrap());
    let red = image::load_from_memory_with_format(&frames[2].jpeg, ImageFormat::Jpeg).unwrap().to_rgb8();
    let [r, g, b] = red.get_pixel(30, 20).0;
    assert!(r.abs_diff(200) < 4 && g.abs_diff(10) < 4 && b.abs_diff(10) < 4, "{r} {g} {b}");
    let times: Vec<_> = frames.iter().map(|f| f.mid_exposure.ns_since(START)).collect();
    assert_eq!(times, [0, 40_000_000, 80_000_000]);
    assert_eq!(frames.iter().map(|f| f.sequence).collect::<Vec<_>>(), [0, 1, 2]);

    let properties = RecordingReader::open(&out).unwrap().properties().clone();
    let calibration = bowwave_calibration::parse(&properties.calibration_toml, "embedded").unwrap();
    assert_eq!((calibration.calibration.lens.width, calibration.calibration.lens.height), (64, 48));
    assert_eq!(properties.picture, (64, 48));
}

/// Error of an import that must fail; nothing may be left of the recording.
fn failure(folder: &Path, out: &Path, options: &ImportOptions) -> String {
    let error = import_pictures(folder, 25.0, out, options, &mut go_on).unwrap_err();
    let left: Vec<_> = fs::read_dir(out.parent().unwrap())
        .into_iter()
        .flatten()
        .map(|e| e.unwrap().file_name())
        .filter(|n| n.to_string_lossy().contains("mcap"))
        .collect();
    assert!(left.is_empty(), "{left:?}");
    let message = error.to_string();
    assert!(!message.contains('\n'), "{message}");
    message
}

#[test]
fn each_mistake_has_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let out_folder = tempfile::tempdir().unwrap();
    let out = out_folder.path().join("out.mcap");
    let message = failure(folder.path(), &out, &options());
    assert!(message.contains("holds no pictures"), "{message}");
    let message = failure(&folder.path().join("nowhere"), &out, &options());
    assert!(message.contains("nowhere"), "{message}");

    paint(&folder.path().join("a.jpg"), 64, 48, [1, 2, 3], ImageFormat::Jpeg);
    let message = failure(folder.path(), &out_folder.path().join("no/such/out.mcap"), &options());
    assert!(message.contains("no/such/out.mcap"), "{message}");
    for rate_hz in [0.0, -1.0, f64::NAN, 1e9] {
        let error = import_pictures(folder.path(), rate_hz, &out, &options(), &mut go_on).unwrap_err();
        assert!(matches!(error, ImportError::Rate { .. }), "{error}");
    }
    let text = fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../calibration/examples/mount.toml"),
    );
    let mut wrong = options();
    wrong.calibration = Some(bowwave_calibration::parse(&text.unwrap(), "mount.toml").unwrap());
    let message = failure(folder.path(), &out, &wrong);
    assert!(message.contains("1280x720") && message.contains("64x48"), "{message}");

    paint(&folder.path().join("b.png"), 64, 50, [1, 2, 3], ImageFormat::Png);
    let message = failure(folder.path(), &out, &options());
    assert!(message.contains("b.png is 64x50") && message.contains("64x48"), "{message}");
    fs::write(folder.path().join("b.png"), "not a picture at all").unwrap();
    let message = failure(folder.path(), &out, &options());
    assert!(message.contains("b.png") && message.contains("neither JPEG nor PNG"), "{message}");
    let whole = fs::read(folder.path().join("a.jpg")).unwrap();
    fs::write(folder.path().join("b.png"), &whole[..20]).unwrap();
    let message = failure(folder.path(), &out, &options());
    assert!(message.contains("b.png"), "{message}");
}

#[test]
fn a_stopped_import_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.jpg", "b.jpg", "c.jpg"] {
        paint(&folder.path().join(name), 64, 48, [1, 2, 3], ImageFormat::Jpeg);
    }
    let out = folder.path().join("out.mcap");
    let stop =
        &mut |p: Progress| if p.frames == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    let error = import_pictures(folder.path(), 25.0, &out, &options(), stop).unwrap_err();
    assert!(matches!(error, ImportError::Stopped), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
}

#[test]
fn a_recording_is_replaced_only_on_demand() {
    let folder = tempfile::tempdir().unwrap();
    paint(&folder.path().join("a.jpg"), 64, 48, [1, 2, 3], ImageFormat::Jpeg);
    let out = folder.path().join("out.mcap");
    fs::write(&out, "precious").unwrap();
    let error = import_pictures(folder.path(), 25.0, &out, &options(), &mut go_on).unwrap_err();
    assert!(matches!(error, ImportError::Exists { .. }), "{error}");
    assert_eq!(fs::read(&out).unwrap(), b"precious");
    let replace = ImportOptions { replace: true, ..options() };
    // A failing import does not take the old one along.
    paint(&folder.path().join("b.jpg"), 32, 48, [1, 2, 3], ImageFormat::Jpeg);
    import_pictures(folder.path(), 25.0, &out, &replace, &mut go_on).unwrap_err();
    assert_eq!(fs::read(&out).unwrap(), b"precious");
    fs::remove_file(folder.path().join("b.jpg")).unwrap();
    import_pictures(folder.path(), 25.0, &out, &replace, &mut go_on).unwrap();
    assert_eq!(frames(&out).len(), 1);
}
