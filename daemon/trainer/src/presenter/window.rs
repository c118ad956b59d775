//! The window on a desktop. Space is the trigger, Z says that the gun stands at its stow, escape ends.

use anyhow::{Context, Result};
use minifb::{Key, KeyRepeat, ScaleMode, Window, WindowOptions};

/// What the user did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pressed {
    /// The trigger was pressed (`true`) or released.
    Fire(bool),
    /// The gun stands at its stow.
    Rezero,
    /// The user wants to end.
    Quit,
}

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
        Ok(trigger.into_iter().chain(rezero).chain(ends.then_some(Pressed::Quit)))
    }
}
