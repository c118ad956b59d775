//! `bowwave calibrate phantom --trace` on a virtual desktop, by somebody with mouse and keys. Needs Xvfb, and BOWWAVE_DESKTOP set:
//! `./check desktop` runs it.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

use std::{
    env, fs,
    process::Command,
    thread,
    time::{Duration, Instant},
};

use bowwave_calibration::{CalibrationFile, to_toml};
use bowwave_core::own_ship::Phantom;
use bowwave_tests::{
    desktop::{BUTTON_PRESS, BUTTON_RELEASE, Ended, KEY_PRESS, KEY_RELEASE, MOTION, Sitter, desktop},
    program,
};
use glam::DVec2;
use hw_sim::make::{self, Recipe};
use image::{GrayImage, Luma, Rgb, RgbImage};

/// Size of the picture.
const SIZE: (u32, u32) = (1280, 720);
/// How long the window may take to be there, and an input to be shown.
const PATIENCE: Duration = Duration::from_secs(60);
const SHOWN: Duration = Duration::from_millis(120);
/// Names of keys (X11, keysymdef.h).
const ENTER: u32 = 0xff0d;
const DELETE: u32 = 0xffff;
const RIGHT: u32 = 0xff53;
const DOWN: u32 = 0xff54;
const SHIFT: u32 = 0xffe1;
const SPACE: u32 = 0x20;
const R: u32 = 0x72;
const S: u32 = 0x73;

/// Somebody before the window, who waits until an input is shown.
struct Maintainer(Sitter);

impl Maintainer {
    fn send(&self, kind: u8, detail: u8, at: (i16, i16)) {
        self.0.send(kind, detail, at);
        thread::sleep(SHOWN);
    }

    /// Points at a pixel of the window.
    fn point(&self, x: i16, y: i16) {
        self.send(MOTION, 0, self.0.on_desktop(x, y));
    }

    fn click(&self, button: u8) {
        self.send(BUTTON_PRESS, button, (0, 0));
        self.send(BUTTON_RELEASE, button, (0, 0));
    }

    fn hold(&self, name: u32) {
        self.send(KEY_PRESS, self.0.keycode(name), (0, 0));
    }

    fn release(&self, name: u32) {
        self.send(KEY_RELEASE, self.0.keycode(name), (0, 0));
    }

    fn press(&self, name: u32) {
        self.hold(name);
        self.release(name);
    }

    /// Picture of the window.
    fn look(&self) -> RgbImage {
        let (width, height) = self.0.size().expect("a size");
        let data = self.0.pixels((width, height)).expect("a picture");
        RgbImage::from_fn(width.into(), height.into(), |x, y| {
            let at = 4 * (y * u32::from(width) + x) as usize;
            Rgb([data[at + 2], data[at + 1], data[at]])
        })
    }
}

#[test]
fn the_gun_is_traced_with_mouse_and_keys() {
    if env::var_os("BOWWAVE_DESKTOP").is_none() {
        eprintln!("skipped: ./check desktop traces");
        return;
    }
    let Some((_desktop, display)) = desktop() else { panic!("Xvfb is missing: ./check setup installs it") };
    let folder = tempfile::tempdir().unwrap();
    let [picture, calibration] = ["still.png", "cal.toml"].map(|name| folder.path().join(name));
    GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        Luma([if y > 500 && x.abs_diff(640) < y / 8 { 60 } else { 150 }])
    })
    .save(&picture)
    .unwrap();
    let mut file = make::calibration(&Recipe { width: SIZE.0, height: SIZE.1, ..Recipe::default() });
    let old = [[100.0, 100.0], [200.0, 100.0], [200.0, 200.0]].map(DVec2::from_array);
    file.phantoms = vec![Phantom::new("old", old.to_vec(), SIZE)];
    fs::write(&calibration, to_toml(&file)).unwrap();
    let mut program = Ended(
        Command::new(program())
            .args(["calibrate", "phantom", "--trace"])
            .arg(&picture)
            .arg("--calibration")
            .arg(&calibration)
            .env("DISPLAY", &display)
            .spawn()
            .expect("it starts"),
    );
    let hand = Maintainer(Sitter::before(&display, &mut program.0, PATIENCE));
    thread::sleep(Duration::from_millis(500));
    hand.0.focus();
    // The calibration's part is in hand: left out.
    hand.point(700, 300);
    hand.press(DELETE);
    // Two corners by mouse, a third that is taken back, two by keys.
    hand.point(577, 501);
    hand.click(1);
    hand.point(702, 501);
    hand.click(1);
    hand.point(900, 400);
    hand.click(1);
    hand.click(3);
    hand.point(720, 707);
    hand.press(RIGHT);
    hand.hold(SHIFT);
    hand.press(DOWN);
    hand.release(SHIFT);
    hand.press(SPACE);
    hand.point(550, 719);
    hand.press(SPACE);
    hand.press(R);
    hand.press(ENTER);
    let seen = hand.look();
    seen.save(std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("traced.png")).unwrap();
    assert_eq!(seen.get_pixel(640, 501).0, [0x50, 0xe0, 0x70], "the traced edge is not shown");
    hand.press(S);
    let begun = Instant::now();
    let ended = loop {
        if let Some(ended) = program.0.try_wait().expect("it can be asked") {
            break ended;
        }
        assert!(begun.elapsed() < PATIENCE, "it does not end");
        thread::sleep(Duration::from_millis(50));
    };
    assert!(ended.success(), "it fails");
    let parts = CalibrationFile::read(&calibration).unwrap().phantoms;
    let expected = [[577.5, 501.5], [702.5, 501.5], [721.5, 720.0], [550.5, 720.0]].map(DVec2::from_array);
    assert_eq!(parts, [Phantom::new("traced 1", expected.to_vec(), SIZE).recoiling(true)]);
}
