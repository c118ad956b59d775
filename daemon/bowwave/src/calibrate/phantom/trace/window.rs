//! The window in which outlines are traced: turns mouse and keys into gestures, and shows what comes of them.

use anyhow::{Context, Result};
use glam::DVec2;
use minifb::{Key, KeyRepeat, MouseButton, MouseMode, ScaleMode, Window, WindowOptions};

use super::{
    editor::{Editor, End, Gesture},
    sheet::Sheet,
};

/// Longest side of the window at first, pixels; larger pictures are shrunk.
const SIDE_MOST: f64 = 1600.0;
/// Pictures a second.
const RATE: usize = 60;
/// Arrow keys, and their step with a shift key, pixels.
const ARROWS: [(Key, DVec2); 4] =
    [(Key::Left, DVec2::NEG_X), (Key::Right, DVec2::X), (Key::Up, DVec2::NEG_Y), (Key::Down, DVec2::Y)];
const SHIFT_STEP: f64 = 10.0;
/// Keys that are a gesture each.
const KEYS: [(Key, Gesture); 9] = [
    (Key::Space, Gesture::Corner),
    (Key::Backspace, Gesture::Back),
    (Key::Enter, Gesture::Close),
    (Key::NumPadEnter, Gesture::Close),
    (Key::R, Gesture::Recoils),
    (Key::Tab, Gesture::Next),
    (Key::Delete, Gesture::LeaveOut),
    (Key::S, Gesture::Save),
    (Key::Escape, Gesture::Cancel),
];
const BUTTONS: [(MouseButton, Gesture); 2] =
    [(MouseButton::Left, Gesture::Corner), (MouseButton::Right, Gesture::Back)];

/// Shows the picture, and those that come after it, until somebody ends it.
pub fn trace(
    mut editor: Editor,
    codes: &[u8],
    size: (u32, u32),
    mut newer: impl FnMut() -> Option<Vec<u8>>,
) -> Result<End> {
    let mut sheet = Sheet::new(codes, size)?;
    let (width, height) = (size.0 as usize, Sheet::height(size));
    let shrunk = (SIDE_MOST / width.max(height) as f64).min(1.0);
    let shown = |side: usize| ((side as f64 * shrunk) as usize).max(1);
    let options = WindowOptions { resize: true, scale_mode: ScaleMode::Stretch, ..WindowOptions::default() };
    let mut window = Window::new("Bowwave - trace the gun", shown(width), shown(height), options).context(
        "cannot open a window; is there a desktop (DISPLAY)? --picture FILE writes the picture, --outline takes the corners without a window",
    )?;
    window.set_target_fps(RATE);
    let mut hands = Hands::default();
    loop {
        for gesture in hands.gestures(&window, (width, height), f64::from(size.1)) {
            editor.take(gesture);
        }
        if !window.is_open() {
            editor.take(Gesture::Cancel);
        }
        if let Some(end) = editor.end() {
            return Ok(end.clone());
        }
        if let Some(codes) = newer() {
            sheet.show(&codes);
        }
        window
            .update_with_buffer(sheet.draw(&editor), width, height)
            .context("cannot draw into the window")?;
    }
}

/// Where mouse and buttons were.
#[derive(Default)]
struct Hands {
    pointer: Option<DVec2>,
    down: [bool; 2],
}

impl Hands {
    /// What was done since the last call, in a window that shows so many pixels, of which the picture has `picture_height` rows.
    fn gestures(
        &mut self,
        window: &Window,
        (width, height): (usize, usize),
        picture_height: f64,
    ) -> Vec<Gesture> {
        let mut done = Vec::new();
        let (shown_width, shown_height) = window.get_size();
        let scale =
            DVec2::new(width as f64 / shown_width.max(1) as f64, height as f64 / shown_height.max(1) as f64);
        // The middle of the pixel that the pointer is on. Below the picture there are only words.
        let pointer = window
            .get_unscaled_mouse_pos(MouseMode::Discard)
            .map(|(x, y)| (DVec2::new(f64::from(x), f64::from(y)) + 0.5) * scale)
            .filter(|place| place.y <= picture_height);
        // A pointer that rests does not undo what the arrow keys did.
        done.extend(pointer.filter(|_| pointer != self.pointer).map(Gesture::Point));
        self.pointer = pointer;
        let shift = [Key::LeftShift, Key::RightShift].into_iter().any(|key| window.is_key_down(key));
        for (_, step) in ARROWS.into_iter().filter(|(key, _)| window.is_key_pressed(*key, KeyRepeat::Yes)) {
            done.push(Gesture::Move(if shift { step * SHIFT_STEP } else { step }));
        }
        for ((button, gesture), was_down) in BUTTONS.into_iter().zip(&mut self.down) {
            let is_down = window.get_mouse_down(button);
            if is_down && !*was_down && pointer.is_some() {
                done.push(gesture);
            }
            *was_down = is_down;
        }
        let pressed = KEYS.into_iter().filter(|(key, _)| window.is_key_pressed(*key, KeyRepeat::No));
        done.extend(pressed.map(|(_, gesture)| gesture));
        done
    }
}
