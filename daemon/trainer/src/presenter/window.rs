//! The window on a desktop. Space is the trigger, letters are the trainee's acts (see [`KEYS`]), Z says that the gun stands at its stow,
//! escape ends.

use anyhow::{Context, Result};
use bowwave_core::{act::Act, side::Side};
use minifb::{Key, KeyRepeat, ScaleMode, Window, WindowOptions};

/// What the user did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pressed {
    /// The trigger was pressed (`true`) or released.
    Fire(bool),
    /// The gun stands at its stow.
    Rezero,
    /// An act of the trainee, or a call that an instructor marks.
    Act(Act),
    /// The user wants to end.
    Quit,
}

/// Keys of the trainee's acts.
pub const KEYS: [(Key, Act); 8] = [
    (Key::R, Act::Report),
    (Key::H, Act::Identify(Side::Hostile)),
    (Key::N, Act::Identify(Side::Neutral)),
    (Key::W, Act::Warn),
    (Key::L, Act::Reload),
    (Key::C, Act::Clear),
    (Key::S, Act::Safe),
    (Key::F, Act::Ready),
];

/// A window of the screen's size.
pub struct Screen {
    window: Window,
    size: (usize, usize),
    /// 0RGB words, as the window takes them.
    words: Vec<u32>,
    firing: bool,
}

impl Screen {
    /// Opens the window.
    pub fn open((width, height): (u32, u32)) -> Result<Self> {
        let size = (width as usize, height as usize);
        let options = WindowOptions {
            resize: true,
            scale_mode: ScaleMode::AspectRatioStretch,
            ..WindowOptions::default()
        };
        let window = Window::new("Bowwave - TRAINING", size.0, size.1, options)
            .context("cannot open a window; is there a desktop (DISPLAY)? --headless runs without")?;
        Ok(Self { window, size, words: vec![0; size.0 * size.1], firing: false })
    }

    /// Shows a frame (sRGB RGBA bytes) and says what the user did meanwhile.
    pub fn show(&mut self, rgba: &[u8]) -> Result<impl Iterator<Item = Pressed> + use<>> {
        for (word, pixel) in self.words.iter_mut().zip(rgba.chunks_exact(4)) {
            *word = u32::from_be_bytes([0, pixel[0], pixel[1], pixel[2]]);
        }
        self.window
            .update_with_buffer(&self.words, self.size.0, self.size.1)
            .context("cannot draw into the window")?;
        let firing = self.window.is_key_down(Key::Space);
        let trigger = (firing != self.firing).then_some(Pressed::Fire(firing));
        self.firing = firing;
        let ends = !self.window.is_open() || self.window.is_key_pressed(Key::Escape, KeyRepeat::No);
        let rezero = self.window.is_key_pressed(Key::Z, KeyRepeat::No).then_some(Pressed::Rezero);
        let acts: Vec<Pressed> = KEYS
            .into_iter()
            .filter(|(key, _)| self.window.is_key_pressed(*key, KeyRepeat::No))
            .map(|(_, act)| Pressed::Act(act))
            .collect();
        Ok(trigger.into_iter().chain(rezero).chain(acts).chain(ends.then_some(Pressed::Quit)))
    }
}
