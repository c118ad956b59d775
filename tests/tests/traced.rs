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
    process::{Child, Command},
    thread,
    time::{Duration, Instant},
};

use bowwave_calibration::{CalibrationFile, to_toml};
use bowwave_core::own_ship::Phantom;
use bowwave_tests::{Ended, desktop, program};
use glam::DVec2;
use hw_sim::make::{self, Recipe};
use image::{GrayImage, Luma, Rgb, RgbImage};
use x11rb::{
    connection::Connection,
    protocol::{
        xproto::{AtomEnum, ConnectionExt as _, ImageFormat, Window},
        xtest::ConnectionExt as _,
    },
    rust_connection::RustConnection,
};

/// Size of the picture.
const SIZE: (u32, u32) = (1280, 720);
/// How long the window may take to be there, and an input to be shown.
const PATIENCE: Duration = Duration::from_secs(60);
const SHOWN: Duration = Duration::from_millis(120);
/// Events of XTEST.
const KEY_PRESS: u8 = 2;
const KEY_RELEASE: u8 = 3;
const BUTTON_PRESS: u8 = 4;
const BUTTON_RELEASE: u8 = 5;
const MOTION: u8 = 6;
/// Names of keys (X11, keysymdef.h).
const ENTER: u32 = 0xff0d;
const DELETE: u32 = 0xffff;
const RIGHT: u32 = 0xff53;
const DOWN: u32 = 0xff54;
const SHIFT: u32 = 0xffe1;
const SPACE: u32 = 0x20;
const R: u32 = 0x72;
const S: u32 = 0x73;

/// Somebody before the window.
struct Maintainer {
    connection: RustConnection,
    root: Window,
    window: Window,
}

impl Maintainer {
    fn before(display: &str, program: &mut Child) -> Self {
        let (connection, screen) = x11rb::connect(Some(display)).expect("the desktop answers");
        let root = connection.setup().roots[screen].root;
        let begun = Instant::now();
        loop {
            assert!(begun.elapsed() < PATIENCE, "no window after {PATIENCE:?}");
            assert!(program.try_wait().expect("it can be asked").is_none(), "it ended without a window");
            let children = connection.query_tree(root).expect("sent").reply().expect("a tree").children;
            let named = children.into_iter().find(|window| {
                let asked = connection.get_property(false, *window, AtomEnum::WM_NAME, AtomEnum::ANY, 0, 64);
                asked.ok().and_then(|c| c.reply().ok()).is_some_and(|name| name.value.starts_with(b"Bowwave"))
            });
            if let Some(window) = named {
                let maintainer = Self { connection, root, window };
                // No window manager gives it the keys.
                thread::sleep(Duration::from_millis(500));
                let focus = x11rb::protocol::xproto::InputFocus::PARENT;
                maintainer.connection.set_input_focus(focus, window, 0_u32).expect("sent");
                maintainer.connection.flush().expect("sent");
                return maintainer;
            }
            thread::sleep(Duration::from_millis(50));
        }
    }

    fn send(&self, kind: u8, detail: u8, (x, y): (i16, i16)) {
        let sent = self.connection.xtest_fake_input(kind, detail, 0, self.root, x, y, 0);
        drop(sent.expect("sent"));
        self.connection.flush().expect("sent");
        thread::sleep(SHOWN);
    }

    /// Points at a pixel of the window.
    fn point(&self, x: i16, y: i16) {
        let at = self.connection.translate_coordinates(self.window, self.root, x, y);
        let at = at.expect("sent").reply().expect("a place");
        self.send(MOTION, 0, (at.dst_x, at.dst_y));
    }

    fn click(&self, button: u8) {
        self.send(BUTTON_PRESS, button, (0, 0));
        self.send(BUTTON_RELEASE, button, (0, 0));
    }

    fn keycode(&self, name: u32) -> u8 {
        let setup = self.connection.setup();
        let (first, last) = (setup.min_keycode, setup.max_keycode);
        let asked = self.connection.get_keyboard_mapping(first, last - first + 1).expect("sent");
        let mapping = asked.reply().expect("a keyboard");
        let width = usize::from(mapping.keysyms_per_keycode);
        let found = mapping.keysyms.chunks(width).position(|names| names.contains(&name));
        first + u8::try_from(found.expect("the keyboard has it")).expect("few keys")
    }

    fn press(&self, name: u32) {
        self.send(KEY_PRESS, self.keycode(name), (0, 0));
        self.send(KEY_RELEASE, self.keycode(name), (0, 0));
    }

    /// What the window shows.
    fn look(&self) -> RgbImage {
        let geometry = self.connection.get_geometry(self.window).expect("sent").reply().expect("a size");
        let (width, height) = (geometry.width, geometry.height);
        let asked = self.connection.get_image(ImageFormat::Z_PIXMAP, self.window, 0, 0, width, height, !0);
        let data = asked.expect("sent").reply().expect("a picture").data;
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
    let hand = Maintainer::before(&display, &mut program.0);
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
    hand.send(KEY_PRESS, hand.keycode(SHIFT), (0, 0));
    hand.press(DOWN);
    hand.send(KEY_RELEASE, hand.keycode(SHIFT), (0, 0));
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
