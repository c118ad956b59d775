//! From a session's notes to the log.

use bowwave_core::session::Note;

/// Writes one line.
pub fn tell(note: &Note) {
    if note.warning {
        log::warn!("{}", note.text);
    } else {
        log::info!("{}", note.text);
    }
}
