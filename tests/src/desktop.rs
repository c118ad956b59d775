//! A virtual desktop, and somebody before one of its windows.

use std::{
    io::{BufRead as _, BufReader},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use x11rb::{
    connection::Connection,
    protocol::{
        xproto::{AtomEnum, ConnectionExt as _, ImageFormat, InputFocus, Window},
        xtest::ConnectionExt as _,
    },
    rust_connection::RustConnection,
};

/// XTEST: a key goes down.
pub const KEY_PRESS: u8 = 2;
/// XTEST: a key comes up.
pub const KEY_RELEASE: u8 = 3;
/// XTEST: a button of the mouse goes down.
pub const BUTTON_PRESS: u8 = 4;
/// XTEST: a button of the mouse comes up.
pub const BUTTON_RELEASE: u8 = 5;
/// XTEST: the mouse moves, to a place (detail 0) or by a step (1).
pub const MOTION: u8 = 6;

/// A process that ends with its owner.
pub struct Ended(pub Child);

impl Drop for Ended {
    fn drop(&mut self) {
        if self.0.kill().is_ok() {
            let _ = self.0.wait();
        }
    }
}

/// A virtual desktop and its name; `None` where Xvfb is not installed.
pub fn desktop() -> Option<(Ended, String)> {
    let mut child = Command::new("Xvfb")
        .args(["-displayfd", "1", "-screen", "0", "1400x900x24", "-nolisten", "tcp"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .ok()?;
    let mut number = String::new();
    BufReader::new(child.stdout.take().expect("piped")).read_line(&mut number).expect("its number");
    Some((Ended(child), format!(":{}", number.trim())))
}

/// Somebody before the program's window.
pub struct Sitter {
    connection: RustConnection,
    root: Window,
    window: Window,
}

impl Sitter {
    /// Waits for the window of a program: on a busy computer it is there before it can be seen.
    pub fn before(display: &str, program: &mut Child, patience: Duration) -> Self {
        let (connection, screen) = x11rb::connect(Some(display)).expect("the desktop answers");
        let root = connection.setup().roots[screen].root;
        let mut sitter = Self { connection, root, window: root };
        let begun = Instant::now();
        loop {
            assert!(begun.elapsed() < patience, "no window after {patience:?}");
            assert!(program.try_wait().expect("it can be asked").is_none(), "it ended without a window");
            if let Some(window) = sitter.named() {
                sitter.window = window;
                if sitter.size().and_then(|size| sitter.pixels(size)).is_some() {
                    return sitter;
                }
            }
            thread::sleep(Duration::from_millis(50));
        }
    }

    fn named(&self) -> Option<Window> {
        let children = self.connection.query_tree(self.root).expect("sent").reply().expect("a tree").children;
        children.into_iter().find(|window| {
            let asked = self.connection.get_property(false, *window, AtomEnum::WM_NAME, AtomEnum::ANY, 0, 64);
            asked.ok().and_then(|c| c.reply().ok()).is_some_and(|name| name.value.starts_with(b"Bowwave"))
        })
    }

    /// Gives the window the keys: there is no window manager that does.
    pub fn focus(&self) {
        self.connection.set_input_focus(InputFocus::PARENT, self.window, 0_u32).expect("sent");
        self.connection.flush().expect("sent");
    }

    /// Sends an event; places are the desktop's.
    pub fn send(&self, kind: u8, detail: u8, (x, y): (i16, i16)) {
        let sent = self.connection.xtest_fake_input(kind, detail, 0, self.root, x, y, 0);
        drop(sent.expect("sent"));
        self.connection.flush().expect("sent");
    }

    /// The desktop's place of a pixel of the window.
    pub fn on_desktop(&self, x: i16, y: i16) -> (i16, i16) {
        let at = self.connection.translate_coordinates(self.window, self.root, x, y);
        let at = at.expect("sent").reply().expect("a place");
        (at.dst_x, at.dst_y)
    }

    /// Code of the key of that name (X11, keysymdef.h).
    pub fn keycode(&self, name: u32) -> u8 {
        let setup = self.connection.setup();
        let (first, last) = (setup.min_keycode, setup.max_keycode);
        let asked = self.connection.get_keyboard_mapping(first, last - first + 1).expect("sent");
        let mapping = asked.reply().expect("a keyboard");
        let width = usize::from(mapping.keysyms_per_keycode);
        let found = mapping.keysyms.chunks(width).position(|names| names.contains(&name));
        first + u8::try_from(found.expect("the keyboard has it")).expect("few keys")
    }

    /// Width and height of the window, pixels.
    pub fn size(&self) -> Option<(u16, u16)> {
        let geometry = self.connection.get_geometry(self.window).ok()?.reply().ok()?;
        Some((geometry.width, geometry.height))
    }

    /// The window's pixels from its upper left corner, where it can be seen: blue, green, red and nothing, row by row.
    pub fn pixels(&self, (width, height): (u16, u16)) -> Option<Vec<u8>> {
        let asked = self.connection.get_image(ImageFormat::Z_PIXMAP, self.window, 0, 0, width, height, !0);
        Some(asked.ok()?.reply().ok()?.data)
    }
}
