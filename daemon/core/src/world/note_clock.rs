//! Times at which something is noted on the scenario's clock, whatever the pace of frames.

use crate::time::Time;

/// Times of notes, an even interval apart from the scenario's beginning on.
#[derive(Clone, Copy, Debug)]
pub(super) struct NoteClock {
    every_s: f64,
    /// Notes that are kept: of more that wait, the last count.
    kept: u32,
    /// Number of the next note.
    next: u32,
}

impl NoteClock {
    /// One whose first note is the beginning's.
    pub(super) const fn new(every_s: f64, kept: u32) -> Self {
        Self { every_s, kept, next: 0 }
    }

    /// The next note's time; `None` once notes have been made up to `now`. The scenario began at `start`.
    pub(super) fn next(&mut self, start: Time, now: Time) -> Option<Time> {
        let newest = (now.secs_since(start) / self.every_s).floor();
        if newest < f64::from(self.next) {
            return None;
        }
        // After a stop, what is older than all that is kept concerns nobody any more.
        self.next = self.next.max((newest as u32).saturating_sub(self.kept));
        let time = start.plus_secs(f64::from(self.next) * self.every_s);
        self.next += 1;
        Some(time)
    }
}
