//! The display's video in step with the page's time line.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use bowwave_record::{RunSelection, read_tracks};
use bowwave_tests::{bowwave, expect_code, said};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::{browser::Browser, reviewed};

/// Frames of the video that tells its own frames' numbers.
const FRAMES: u64 = 270;

/// The run with a video in which each frame is as bright as its number says; the summary has these times for its frames.
fn with_numbered_video(times: &Value, change: impl Fn(&mut Value)) -> (TempDir, PathBuf) {
    let run = reviewed();
    let folder = tempfile::tempdir().unwrap();
    let journal = folder.path().join("hits.sqlite");
    fs::copy(run.page.with_file_name("hits.sqlite"), &journal).unwrap();
    let summary = fs::read(run.page.with_file_name("summary.json")).unwrap();
    let mut summary: Value = serde_json::from_slice(&summary).unwrap();
    summary["video_frames"] = times.clone();
    change(&mut summary);
    fs::write(folder.path().join("summary.json"), summary.to_string()).unwrap();
    let source = format!(
        "color=black:s=64x36:r=30:d={},format=yuv420p,geq=lum='16+2*mod(N,100)':cb=128:cr=128",
        FRAMES / 30
    );
    let made = Command::new("ffmpeg")
        .args([
            "-nostdin", "-v", "error", "-f", "lavfi", "-i", &source, "-c:v", "libx264", "-crf", "1",
            "-pix_fmt", "yuv420p",
        ])
        .arg(folder.path().join("video.mp4"))
        .status()
        .unwrap();
    assert!(made.success());
    (folder, journal)
}

/// The number that the frame shown tells, modulo 100.
const SHOWN: &str = "const canvas = document.createElement('canvas'); canvas.width = 64; canvas.height = 36; \
    const c = canvas.getContext('2d'); c.drawImage(bowwave.film.video, 0, 0); \
    return Math.round(c.getImageData(32, 18, 1, 1).data[1] * 219 / 255 / 2)";

/// First time of the run, nanoseconds of its clock.
fn begin_ns(journal: &Path) -> i64 {
    read_tracks(journal, RunSelection::Latest).unwrap().tracks.samples[0].time_ns
}

#[test]
fn a_run_keeps_the_times_of_its_videos_frames() {
    let run = reviewed();
    let summary = fs::read(run.page.with_file_name("summary.json")).unwrap();
    let summary: Value = serde_json::from_slice(&summary).unwrap();
    // Thirty a second throughout, from the run's first picture on.
    let times = summary["video_frames"].as_array().unwrap();
    let after_s =
        (times[0][1].as_i64().unwrap() - begin_ns(&run.page.with_file_name("hits.sqlite"))) as f64 * 1e-9;
    assert!(times.len() == 1 && times[0][0] == 0 && after_s.abs() < 0.1, "{times:?} {after_s}");
    assert!(fs::read_to_string(&run.page).unwrap().contains("id=\"video-data\">AAAA"), "it is in the page");
}

#[test]
fn a_browser_shows_the_videos_frame_of_each_time() {
    let begin_ns = begin_ns(&reviewed().page.with_file_name("hits.sqlite"));
    // It begins a tenth before the run, and a second is missing after 90 frames.
    let times = json!([[0, begin_ns - 100_000_000], [90, begin_ns + 3_900_000_000i64]]);
    let (folder, journal) = with_numbered_video(&times, |_| {});
    let made = bowwave(["review", journal.to_str().unwrap()]);
    expect_code(&made, 0);
    assert!(said(&made).contains("MB) is in the page"), "{}", said(&made));
    let Some(browser) = Browser::open(&folder.path().join("review-1.html")) else { return };
    browser.wait("return bowwave.film.video.readyState >= 2");
    for (time_s, frame) in [(0.0, 3), (1.0, 33), (2.5, 78), (3.3, 89), (3.9, 90), (5.0, 123), (0.5, 18)] {
        browser.run(&format!("bowwave.clock.set({time_s})"));
        browser.wait("return !bowwave.film.video.seeking && bowwave.film.video.readyState >= 2");
        assert_eq!(browser.number(SHOWN), f64::from(frame % 100), "at {time_s} s");
    }
    // Played, it keeps up.
    browser.click("#play");
    browser.wait("return bowwave.clock.now_s > 1.5");
    let off_s = browser
        .number("return bowwave.film.video.currentTime - bowwave.film.placeOf(bowwave.clock.now_s, 9)");
    assert!(off_s.abs() < 0.3, "{off_s} s");
    browser.click("#play");
    browser.wait("return bowwave.film.video.paused");
    // A round's row has the picture of its moment, and leads there.
    browser.run("document.getElementById('rounds').scrollIntoView()");
    browser.wait("return document.querySelector('#rounds canvas').dataset.drawn !== undefined");
    let fired_s = browser.number("return bowwave.run.rounds[0].fired_s");
    let drawn = browser.run("return document.querySelector('#rounds canvas').dataset.drawn");
    let frame = if fired_s < 2.9 { (fired_s + 0.1) * 30.0 } else { 90.0 + (fired_s - 3.9) * 30.0 };
    assert_eq!(drawn.as_str().unwrap(), frame.max(0.0).round().to_string(), "{fired_s}");
    browser.click("#rounds canvas");
    assert_eq!(browser.number("return bowwave.clock.now_s"), fired_s);
    let errors = browser.errors();
    assert!(errors.is_empty(), "{errors:?}");
}

#[test]
fn a_large_video_stays_beside_the_page() {
    let begin_ns = begin_ns(&reviewed().page.with_file_name("hits.sqlite"));
    let (folder, journal) = with_numbered_video(&json!([[0, begin_ns]]), |_| {});
    let made = bowwave(["review", journal.to_str().unwrap(), "--embed-mb", "0"]);
    expect_code(&made, 0);
    assert!(said(&made).contains("stays beside the page, which plays it from video.mp4"), "{}", said(&made));
    let path = folder.path().join("review-1.html");
    let page = fs::read_to_string(&path).unwrap();
    assert!(page.contains("is played from video.mp4") && !page.contains("id=\"video-data\""));
    let Some(browser) = Browser::open(&path) else { return };
    browser.wait("return bowwave.film.video.readyState >= 2");
    let errors = browser.errors();
    assert!(errors.is_empty(), "{errors:?}");
    fs::remove_file(folder.path().join("video.mp4")).unwrap();
    let Some(browser) = Browser::open(&path) else { return };
    browser
        .wait("return document.getElementById('video-note').textContent.includes('video.mp4 is not there')");
}

#[test]
fn a_video_of_unknown_times_is_said_to_be_assumed() {
    let assumed = "it is assumed to begin with the run";
    // Of a version that kept no times, and of another run.
    let other = |summary: &mut Value| summary["seed"] = json!(77);
    let begin_ns = begin_ns(&reviewed().page.with_file_name("hits.sqlite"));
    for (times, is_other) in [(Value::Null, false), (json!([[0, begin_ns]]), true)] {
        let (folder, journal) = with_numbered_video(&times, |summary| {
            if is_other {
                other(summary)
            }
        });
        let made = bowwave(["review", journal.to_str().unwrap()]);
        assert!(said(&made).contains(assumed), "{}", said(&made));
        let page = folder.path().join("review-1.html");
        assert!(fs::read_to_string(&page).unwrap().contains(assumed));
        let given = bowwave(["review", journal.to_str().unwrap(), "--video-at", "-2.5"]);
        assert!(!said(&given).contains(assumed), "{}", said(&given));
        assert!(fs::read_to_string(&page).unwrap().contains("\"marks\":[[0,-2.5]]"));
    }
}

#[test]
fn what_is_no_video_is_refused_and_a_recording_leads_to_one() {
    let run = reviewed();
    let journal = run.page.parent().unwrap().to_str().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let text = folder.path().join("video.mp4");
    fs::write(&text, "no video at all").unwrap();
    for (named, words) in
        [(text.to_str().unwrap(), "is no MP4 file"), ("no/such.mp4", "cannot read the video no/such.mp4")]
    {
        let refused = bowwave(["review", journal, "--video", named]);
        expect_code(&refused, 1);
        assert!(said(&refused).contains(words), "{}", said(&refused));
    }
    // A pipe without a writer is not waited for, and no page replaces its video.
    let pipe = folder.path().join("pipe.mp4");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    expect_code(&bowwave(["review", journal, "--video", pipe.to_str().unwrap()]), 1);
    let video = run.page.with_file_name("video.mp4");
    let over = bowwave(["review", journal, "--out", video.to_str().unwrap(), "--force"]);
    expect_code(&over, 1);
    assert!(said(&over).contains("would replace its video"), "{}", said(&over));
    let copy = folder.path().join("hits.sqlite");
    fs::copy(run.page.with_file_name("hits.sqlite"), &copy).unwrap();
    // One that is beside the journal by chance only leaves the page without a video.
    let made = bowwave(["review", copy.to_str().unwrap()]);
    expect_code(&made, 0);
    assert!(said(&made).contains("the page goes without it"), "{}", said(&made));
    fs::remove_file(&text).unwrap();
    fs::write(folder.path().join("recording.mcap"), "").unwrap();
    let led = said(&bowwave(["review", copy.to_str().unwrap()]));
    assert!(led.contains("bowwave simulate ") && led.contains("--headless --video --out "), "{led}");
}
