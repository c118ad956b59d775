//! Outlines traced by hand, with mouse and keys, in a window.

mod editor;
mod sheet;
mod window;

use anyhow::Result;
use bowwave_core::own_ship::Phantom;

use editor::{Editor, End};

/// Shows a picture with the parts of the calibration and those that pictures tell, and each picture that is `newer`; `None` where it was ended
/// without saving.
pub fn trace(
    codes: &[u8],
    size: (u32, u32),
    [calibrated, found]: [&[Phantom]; 2],
    newer: impl FnMut() -> Option<Vec<u8>>,
) -> Result<Option<Vec<Phantom>>> {
    Ok(match window::trace(Editor::new(size, calibrated, found), codes, size, newer)? {
        End::Saved(parts) => Some(parts),
        End::Cancelled => None,
    })
}
