//! When frames are begun: locked to camera and display, or as fast as they can be drawn.

use bowwave_core::{
    event::Tick,
    pacing::{FRAMES_PER_S, FrameClock},
    time::{NS_PER_S, Time},
};
use bowwave_devices::clock::{now, sleep_until};

/// A frame that is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DueFrame {
    /// For the session.
    pub tick: Tick,
    /// When it was begun, on the host's clock.
    pub begun: Time,
    /// When its pixels must be complete; `None` where nobody waits for them.
    pub deadline: Option<Time>,
}

/// Gives the ticks of a run.
#[derive(Debug)]
pub enum TickClock {
    /// On the host's clock, locked to the camera's and the display's.
    Paced(Box<FrameClock>),
    /// On the recording's clock, 30 ticks for each of its seconds, as fast as they can be drawn.
    Fast {
        /// When the recording begins.
        origin: Time,
        /// The last tick's number.
        index: i64,
    },
}

impl TickClock {
    /// Ticks on the host's clock.
    pub fn paced() -> Self {
        Self::Paced(Box::default())
    }

    /// Ticks of a recording that begins at `origin`.
    pub const fn fast(origin: Time) -> Self {
        Self::Fast { origin, index: 0 }
    }

    /// Waits for the next frame.
    pub fn await_next(&mut self) -> DueFrame {
        match self {
            Self::Paced(clock) => {
                let plan = clock.plan(now());
                sleep_until(plan.start);
                let begun = now();
                DueFrame { tick: Tick { time: begun, shown: plan.shown }, begun, deadline: Some(plan.shown) }
            }
            Self::Fast { origin, index } => {
                *index += 1;
                DueFrame { tick: Tick::at(time_of(*origin, *index)), begun: now(), deadline: None }
            }
        }
    }

    /// When the next tick is on the recording's clock; `None` on the host's.
    pub fn next_on_recording(&self) -> Option<Time> {
        match self {
            Self::Paced(_) => None,
            Self::Fast { origin, index } => Some(time_of(*origin, *index + 1)),
        }
    }

    /// Leaves a tick out; how long after the recording's begin it was, nanoseconds. `None` on the host's clock, where time passes by itself.
    pub fn skip(&mut self) -> Option<i64> {
        let time = self.next_on_recording()?;
        let Self::Fast { origin, index } = self else { return None };
        *index += 1;
        Some(time.ns_since(*origin))
    }

    /// The lock to camera and display, where there is one.
    pub fn lock(&mut self) -> Option<&mut FrameClock> {
        match self {
            Self::Paced(clock) => Some(clock),
            Self::Fast { .. } => None,
        }
    }

    /// Ticks that could not be kept because the computer was too slow, and times that the tick slipped by a blank.
    pub fn missed_and_slips(&self) -> (u64, u64) {
        match self {
            Self::Paced(clock) => (clock.missed(), clock.slips()),
            Self::Fast { .. } => (0, 0),
        }
    }

    /// Whether frames have deadlines.
    pub const fn is_paced(&self) -> bool {
        matches!(self, Self::Paced(_))
    }
}

/// Time of a tick of a recording: exact, without accumulating error.
fn time_of(origin: Time, index: i64) -> Time {
    origin.plus_ns(index * NS_PER_S / FRAMES_PER_S)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_ticks_do_not_drift_and_have_no_deadline() {
        let mut clock = TickClock::fast(Time::from_ns(7));
        let due: Vec<_> = (0..30).map(|_| clock.await_next()).collect();
        assert_eq!(due[29].tick, Tick::at(Time::from_ns(7 + NS_PER_S)));
        assert!(due.iter().all(|d| d.deadline.is_none()) && !clock.is_paced());
    }

    #[test]
    fn paced_ticks_are_seen_after_they_are_begun() {
        let mut clock = TickClock::paced();
        let (a, b) = (clock.await_next(), clock.await_next());
        assert!(a.tick.shown > a.tick.time && b.tick.time > a.tick.time);
        assert_eq!(a.deadline, Some(a.tick.shown));
    }
}
