//! The window on a desktop. Space or the left mouse button is the trigger, mouse and arrow keys turn a simulated gun, letters are the
//! trainee's acts (see [`KEYS`]), numbers drive a boat (see [`DRIVE_KEYS`]), Z says that the gun stands at its stow, escape ends.

use anyhow::{Context, Result};
use bowwave_core::{
    act::{Act, DriveOrder},
    side::Side,
};
use minifb::{Key, KeyRepeat, MouseButton, MouseMode, ScaleMode, Window, WindowOptions};

/// What the user did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pressed {
    /// The trigger was pressed (`true`) or released.
    Fire(bool),
    /// The gun is to turn: to the right and upwards, in widths of the picture.
    Turn([f64; 2]),
    /// The gun stands at its stow.
    Rezero,
    /// An act of the trainee, or a call that an instructor marks.
    Act(Act),
    /// The user wants to end.
    Quit,
}

/// Keys of the trainee's acts.
pub const KEYS: [(Key, Act); 9] = [
    (Key::R, Act::Report),
    (Key::H, Act::Identify(Side::Hostile)),
    (Key::N, Act::Identify(Side::Neutral)),
    (Key::W, Act::Warn),
    (Key::L, Act::Reload),
    (Key::C, Act::Clear),
    (Key::S, Act::Safe),
    (Key::F, Act::Ready),
    (Key::B, Act::Light),
];

/// Keys of the person who drives a boat, as they lie on a pad of numbers; the row above the letters does as well.
pub const DRIVE_KEYS: [(Key, Key, DriveOrder); 5] = [
    (Key::NumPad8, Key::Key8, DriveOrder::Ahead),
    (Key::NumPad2, Key::Key2, DriveOrder::Astern),
    (Key::NumPad4, Key::Key4, DriveOrder::Port),
    (Key::NumPad6, Key::Key6, DriveOrder::Starboard),
    (Key::NumPad5, Key::Key5, DriveOrder::Midships),
];

/// Keys that turn the gun: to the right and upwards.
const ARROWS: [(Key, [f64; 2]); 4] =
    [(Key::Left, [-1.0, 0.0]), (Key::Right, [1.0, 0.0]), (Key::Up, [0.0, 1.0]), (Key::Down, [0.0, -1.0])];
/// Turn of a frame while an arrow is held, and with a shift key, in widths of the picture: about 12 and 2 degrees a second.
const ARROW_TURN: [f64; 2] = [0.007, 0.0012];
/// Share of the window beside its edge in which the pointer goes on turning the gun, and the turn of a frame there.
const EDGE: f64 = 0.02;
const EDGE_TURN: f64 = 0.008;

/// A window of the screen's size.
pub struct Screen {
    window: Window,
    size: (usize, usize),
    /// 0RGB words, as the window takes them.
    words: Vec<u32>,
    firing: bool,
    /// Where the pointer was, in widths and heights of the window.
    pointer: Option<[f64; 2]>,
}

impl Screen {
    /// Opens the window; `aims` where mouse and keys turn a gun.
    pub fn open((width, height): (u32, u32), aims: bool) -> Result<Self> {
        let size = (width as usize, height as usize);
        let options = WindowOptions {
            resize: true,
            scale_mode: ScaleMode::AspectRatioStretch,
            ..WindowOptions::default()
        };
        let mut window = Window::new("Bowwave - TRAINING", size.0, size.1, options)
            .context("cannot open a window; is there a desktop (DISPLAY)? --headless runs without")?;
        if aims {
            // The pointer only turns the gun: where it is means nothing.
            window.set_cursor_visibility(false);
        }
        Ok(Self { window, size, words: vec![0; size.0 * size.1], firing: false, pointer: None })
    }

    /// Shows a frame (sRGB RGBA bytes) and says what the user did meanwhile.
    pub fn show(&mut self, rgba: &[u8]) -> Result<impl Iterator<Item = Pressed> + use<>> {
        for (word, pixel) in self.words.iter_mut().zip(rgba.chunks_exact(4)) {
            *word = u32::from_be_bytes([0, pixel[0], pixel[1], pixel[2]]);
        }
        self.window
            .update_with_buffer(&self.words, self.size.0, self.size.1)
            .context("cannot draw into the window")?;
        let firing = self.window.is_key_down(Key::Space) || self.window.get_mouse_down(MouseButton::Left);
        let trigger = (firing != self.firing).then_some(Pressed::Fire(firing));
        self.firing = firing;
        let ends = !self.window.is_open() || self.window.is_key_pressed(Key::Escape, KeyRepeat::No);
        let rezero = self.window.is_key_pressed(Key::Z, KeyRepeat::No).then_some(Pressed::Rezero);
        let pressed = |key: Key| self.window.is_key_pressed(key, KeyRepeat::No);
        let spoken = KEYS.into_iter().filter(|(key, _)| pressed(*key)).map(|(_, act)| act);
        let driven = DRIVE_KEYS.into_iter().filter(|(pad, row, _)| pressed(*pad) || pressed(*row));
        let acts: Vec<Pressed> =
            spoken.chain(driven.map(|(_, _, order)| Act::Drive(order))).map(Pressed::Act).collect();
        let turn = Some(self.turn()).filter(|turn| *turn != [0.0; 2]).map(Pressed::Turn);
        Ok(trigger.into_iter().chain(turn).chain(rezero).chain(acts).chain(ends.then_some(Pressed::Quit)))
    }

    /// Turn that mouse and arrow keys ask for since the last frame.
    fn turn(&mut self) -> [f64; 2] {
        let (width, height) = self.window.get_size();
        let pointer = self
            .window
            .get_unscaled_mouse_pos(MouseMode::Discard)
            .map(|(x, y)| [f64::from(x) / width.max(1) as f64, f64::from(y) / height.max(1) as f64]);
        let aspect = height as f64 / width.max(1) as f64;
        let mut turn = match (self.pointer, pointer) {
            (Some(from), Some(to)) => [to[0] - from[0], (from[1] - to[1]) * aspect],
            _ => [0.0; 2],
        };
        self.pointer = pointer;
        if let Some([x, y]) = pointer {
            let beyond = |at: f64| f64::from(i8::from(at > 1.0 - EDGE) - i8::from(at < EDGE));
            turn[0] += EDGE_TURN * beyond(x);
            turn[1] -= EDGE_TURN * beyond(y);
        }
        let shift = [Key::LeftShift, Key::RightShift].into_iter().any(|key| self.window.is_key_down(key));
        for (_, [right, up]) in ARROWS.into_iter().filter(|(key, _)| self.window.is_key_down(*key)) {
            turn[0] += right * ARROW_TURN[usize::from(shift)];
            turn[1] += up * ARROW_TURN[usize::from(shift)];
        }
        turn
    }
}
