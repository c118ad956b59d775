//! Outlines traced by hand, with mouse and keys, in a window.

mod editor;
mod sheet;
mod window;

use anyhow::Result;
use bowwave_core::own_ship::Phantom;

use editor::{Editor, End};

/// Shows a picture with the parts of the calibration and those that a recording tells; `None` where it was ended without saving.
pub fn trace(
    codes: &[u8],
    size: (u32, u32),
    calibrated: &[Phantom],
    found: &[Phantom],
) -> Result<Option<Vec<Phantom>>> {
    Ok(match window::trace(Editor::new(size, calibrated, found), codes, size)? {
        End::Saved(parts) => Some(parts),
        End::Cancelled => None,
    })
}
