//! Recordings from videos without a gyro, and everything that can be wrong with a video or with the programs that read it.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a failed step in a test's helper fails the test"
)]

use std::{
    fs,
    ops::ControlFlow,
    path::{Path, PathBuf},
    process::Command,
};

use bowwave_calibration::Date;
use bowwave_import::{
    ImportError, ImportOptions, ImportReport, Progress, START, TelemetryReport, import_video,
};
use bowwave_record::{Entry, FrameEntry, RecordingReader};

fn options() -> ImportOptions {
    ImportOptions::new(Date::new(2026, 11, 21).unwrap())
}

fn go_on(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Whether ffmpeg is here; says so where it is not.
fn have_ffmpeg() -> bool {
    let here = Command::new("ffmpeg").arg("-version").output().is_ok();
    if !here {
        eprintln!("skipped: ffmpeg is not installed");
    }
    here
}

fn ffmpeg(arguments: &[&str], out: &Path) {
    let status =
        Command::new("ffmpeg").args(["-v", "error", "-y"]).args(arguments).arg(out).status().unwrap();
    assert!(status.success());
}

/// Error of an import that must fail; nothing may be left of the recording.
fn failure(video: &Path, options: &ImportOptions) -> ImportError {
    let folder = tempfile::tempdir().unwrap();
    let error = import_video(video, &folder.path().join("out.mcap"), options, &mut go_on).unwrap_err();
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "{error}");
    assert!(!error.to_string().contains('\n'), "{error}");
    error
}

/// Report and pictures of an import.
fn imported(video: &Path) -> (ImportReport, Vec<FrameEntry>) {
    let out = video.with_file_name("out.mcap");
    let report = import_video(video, &out, &options(), &mut go_on).unwrap();
    let entries = RecordingReader::open(&out).unwrap().entries().unwrap();
    let frames = entries.map(|entry| match entry.unwrap() {
        Entry::Frame(frame) => frame,
        other => panic!("{other:?}"),
    });
    (report, frames.collect())
}

#[test]
fn pictures_keep_the_times_of_the_container() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    // A name that looks like an option and like an address; a rate that changes within the video.
    let video = folder.path().join("-http:a b'c.mkv");
    let filter = "setpts='if(lt(N,5),N,5+(N-5)*3)'";
    ffmpeg(
        &["-f", "lavfi", "-i", "testsrc=s=320x180:r=25:d=0.4", "-vf", filter, "-fps_mode", "passthrough"],
        &video,
    );
    let (report, frames) = imported(&video);
    assert_eq!((report.frames, report.picture), (10, (320, 180)));
    assert_eq!(report.telemetry, TelemetryReport::Absent);
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    let times: Vec<_> = frames.iter().map(|f| f.mid_exposure.ns_since(START) / 1_000_000).collect();
    assert_eq!(times, [0, 40, 80, 120, 160, 200, 320, 440, 560, 680]);
}

#[test]
fn colours_come_through() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let video = folder.path().join("red.mp4");
    // High-definition videos are in BT.709, JPEG is in BT.601: without a conversion this red is 20 steps off.
    let tagged = "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p";
    let space = ["-colorspace", "bt709", "-color_range", "tv"];
    let source = ["-f", "lavfi", "-i", "color=c=0xC83214:s=320x180:r=25:d=0.2", "-vf", tagged];
    ffmpeg(&[&source[..], &space[..]].concat(), &video);
    let (_, frames) = imported(&video);
    let frame = frames.first().expect("a picture");
    let [r, g, b] = image::load_from_memory(&frame.jpeg).unwrap().to_rgb8().get_pixel(160, 90).0;
    assert!(r.abs_diff(0xC8) < 5 && g.abs_diff(0x32) < 5 && b.abs_diff(0x14) < 5, "{r} {g} {b}");
}

#[test]
fn what_is_no_video_says_so() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let error = failure(&at("nowhere.mp4"), &options());
    assert!(
        matches!(error, ImportError::Read { .. }) && error.to_string().contains("nowhere.mp4"),
        "{error}"
    );
    fs::write(at("text.txt"), "hello there\n".repeat(100)).unwrap();
    fs::write(
        at("noise.mp4"),
        (0..40_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect::<Vec<_>>(),
    )
    .unwrap();
    fs::write(at("empty.mp4"), "").unwrap();
    ffmpeg(&["-f", "lavfi", "-i", "sine=d=0.2"], &at("sound.wav"));
    ffmpeg(&["-f", "lavfi", "-i", "testsrc=s=64x48:d=0.04", "-frames:v", "1"], &at("single.png"));
    ffmpeg(&["-f", "lavfi", "-i", "testsrc=s=64x48:r=25:d=1", "-c:v", "mpeg2video"], &at("whole.ts"));
    let playlist = "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nwhole.ts\n#EXT-X-ENDLIST\n";
    fs::write(at("playlist.mp4"), playlist).unwrap();
    fs::write(at("list.mp4"), "ffconcat version 1.0\nfile whole.ts\n").unwrap();
    for name in ["playlist.mp4", "list.mp4"] {
        let error = failure(&at(name), &options()).to_string();
        assert!(error.contains("no container with pictures"), "{error}");
    }
    ffmpeg(&["-f", "lavfi", "-i", "testsrc=s=9000x32:d=0.2", "-c:v", "mjpeg"], &at("wide.mkv"));
    let error = failure(&at("wide.mkv"), &options()).to_string();
    assert!(error.contains("a side of 9000 pixels"), "{error}");
    for name in ["text.txt", "noise.mp4", "empty.mp4", "sound.wav", "single.png"] {
        let error = failure(&at(name), &options());
        assert!(
            matches!(error, ImportError::NotVideo { .. }) && error.to_string().contains(name),
            "{name}: {error}"
        );
    }
}

#[test]
fn a_cut_video_gives_what_it_has_or_says_why_not() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.mkv");
    ffmpeg(&["-f", "lavfi", "-i", "testsrc=s=320x180:r=25:d=2", "-c:v", "mpeg4", "-g", "5"], &whole);
    let bytes = fs::read(&whole).unwrap();
    let cut = folder.path().join("cut.mkv");
    fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let out = folder.path().join("out.mcap");
    let report = import_video(&cut, &out, &options(), &mut go_on).unwrap();
    assert!((5..50).contains(&report.frames), "{}", report.frames);
    assert!(!report.warnings.is_empty());
    // The index in front, and nothing of what it points at.
    let whole = folder.path().join("whole.mp4");
    let fast =
        ["-f", "lavfi", "-i", "testsrc=s=320x180:r=25:d=1", "-c:v", "mpeg4", "-movflags", "+faststart"];
    ffmpeg(&fast, &whole);
    let bytes = fs::read(&whole).unwrap();
    let data = bytes.windows(4).position(|w| w == b"mdat").unwrap();
    let cut = folder.path().join("cut.mp4");
    fs::write(&cut, &bytes[..data + 4]).unwrap();
    let error = failure(&cut, &options());
    assert!(matches!(error, ImportError::NoFrames { .. }), "{error}");
}

/// A shell script that can be run. Another process writes it: a file that this one had open for writing when a
/// test beside it forked cannot be run until that child has started its program (`ETXTBSY`).
fn write_program(path: &Path, script: &str) {
    let text = format!("#!/bin/sh\n{script}\n");
    let writer = r#"printf %s "$2" >"$1" && chmod 755 "$1""#;
    let status = Command::new("sh").args(["-c", writer, "sh"]).arg(path).arg(text).status().unwrap();
    assert!(status.success(), "{status}");
}

/// A folder with an `ffmpeg` and an `ffprobe` that are shell scripts.
fn fake(ffmpeg: &str) -> (tempfile::TempDir, ImportOptions) {
    let folder = tempfile::tempdir().unwrap();
    let probe = "echo codec_name=h264; echo avg_frame_rate=25/1; echo nb_frames=9; echo format_name=mov";
    for (name, script) in [("ffmpeg", ffmpeg), ("ffprobe", probe)] {
        write_program(&folder.path().join(name), script);
    }
    let options = ImportOptions { ffmpeg: folder.path().join("ffmpeg"), ..options() };
    (folder, options)
}

/// Shell that writes a picture with its time, as ffmpeg does.
fn part(number: u32, jpeg: &Path) -> String {
    let bytes = fs::metadata(jpeg).unwrap().len();
    format!(
        "echo '[Parsed_showinfo_0 @ 0x1] [info] n: {number} pts: {number} pts_time:0' >&2\n\
         printf -- '--ffmpeg\\r\\nContent-type: image/jpeg\\r\\nContent-length: {bytes}\\r\\n\\r\\n'; cat '{}'; printf '\\r\\n'\n",
        jpeg.display()
    )
}

const BASE: &str =
    "echo '[Parsed_showinfo_0 @ 0x1] [info] config in time_base: 1/25, frame_rate: 25/1' >&2\n";

/// A file that passes for a video, and a picture.
fn props() -> (tempfile::TempDir, PathBuf, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let (video, jpeg) = (folder.path().join("video.mp4"), folder.path().join("picture.jpg"));
    fs::write(&video, "for a program that does not look").unwrap();
    image::RgbImage::new(64, 48).save(&jpeg).unwrap();
    (folder, video, jpeg)
}

#[test]
fn a_reader_that_dies_says_where() {
    let (_folder, video, jpeg) = props();
    let two = format!("{BASE}{}{}", part(0, &jpeg), part(1, &jpeg));
    let torn = "printf -- '--ffmpeg\\r\\nContent-length: 5000\\r\\n\\r\\nabc'\n";
    let cases = [
        (format!("{two}echo '[error] out of luck' >&2; exit 3"), "after 2 pictures: out of luck"),
        (format!("{two}kill -9 $$"), "after 2 pictures"),
        (format!("{two}{torn}kill -9 $$"), "after 2 pictures"),
        (
            format!("{two}printf -- '--ffmpeg\\r\\nContent-length: x\\r\\n\\r\\n'"),
            "after 2 pictures: a part's length",
        ),
        (two.replace("pts: 1 ", "pts: NOPTS "), "after 1 pictures: the next picture has no time"),
        (format!("{}exec >&-; exec 2>&-; exit 1", part(0, &jpeg)), "has no time"),
    ];
    for (script, says) in cases {
        let (_programs, options) = fake(&script);
        let error = failure(&video, &options);
        assert!(matches!(error, ImportError::Interrupted { .. }), "{error}");
        assert!(error.to_string().contains(says), "{error}");
    }
    let (_programs, options) = fake("echo '[fatal] nothing here' >&2; exit 1");
    let error = failure(&video, &options);
    assert!(
        matches!(error, ImportError::NoFrames { .. }) && error.to_string().contains("nothing here"),
        "{error}"
    );
}

#[test]
fn the_same_scripts_work_when_nothing_goes_wrong() {
    let (folder, video, jpeg) = props();
    let (_programs, options) = fake(&format!("{BASE}{}{}", part(0, &jpeg), part(1, &jpeg)));
    let report = import_video(&video, &folder.path().join("out.mcap"), &options, &mut go_on).unwrap();
    assert_eq!((report.frames, report.picture), (2, (64, 48)));
}

#[test]
fn missing_programs_say_what_to_install() {
    let (_folder, video, _) = props();
    let missing = ImportOptions { ffmpeg: PathBuf::from("/no/such/place/ffmpeg"), ..options() };
    let error = failure(&video, &missing);
    assert!(matches!(error, ImportError::ProgramMissing { .. }), "{error}");
    assert!(error.to_string().contains("apt-get install ffmpeg"), "{error}");
    let (programs, options) = fake("exit 0");
    fs::remove_file(programs.path().join("ffmpeg")).unwrap();
    assert!(matches!(failure(&video, &options), ImportError::ProgramMissing { .. }));
    fs::write(programs.path().join("ffmpeg"), "no program").unwrap();
    assert!(matches!(failure(&video, &options), ImportError::ProgramStart { .. }));
}

#[test]
fn unwritable_places_and_stops_leave_nothing() {
    let (folder, video, jpeg) = props();
    let (_programs, options) = fake(&format!("{BASE}{}{}", part(0, &jpeg), part(1, &jpeg)));
    let nowhere = folder.path().join("no/such/out.mcap");
    let error = import_video(&video, &nowhere, &options, &mut go_on).unwrap_err();
    assert!(error.to_string().contains("no/such/out.mcap"), "{error}");
    let out = folder.path().join("out.mcap");
    let error = import_video(&video, &out, &options, &mut |_| ControlFlow::Break(())).unwrap_err();
    assert!(matches!(error, ImportError::Stopped), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}
