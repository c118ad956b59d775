//! When the port's thread looks, waits and gives up: a state machine over time, without a display.

use bowwave_core::time::{NS_PER_S, Time};

use super::{LcdMode, LcdState};

/// Between two looks at the connector: a display that was unplugged is noticed, and one that came back is found, within
/// this time.
const LOOK_NS: i64 = NS_PER_S / 2;
/// A flip comes with the next vblank; a mode may take a while to set. What takes longer than this does not come any more.
const FLIP_NS: i64 = 3 * NS_PER_S;
/// Longest sleep, so that the heartbeat goes on.
const SLEEP_NS: i64 = 50_000_000;

/// Action that is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LcdDue {
    /// Nothing but to wait for the kernel or a picture.
    Nothing,
    /// A look at the connector, or for one.
    Look,
    /// The kernel has swallowed a flip: this screen is given up.
    FlipOverdue,
}

/// Change to tell the supervisor of.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum DisplayChange {
    /// No display, and why.
    Raised(String),
    /// It is there again.
    Cleared,
}

/// The life of the display's connection.
#[derive(Debug)]
pub(super) struct LcdLife {
    state: LcdState,
    next_look: Time,
    flip_begun: Option<Time>,
    is_raised: bool,
    losses: u64,
}

impl LcdLife {
    /// Looks at once.
    pub(super) const fn new(now: Time) -> Self {
        Self { state: LcdState::Searching, next_look: now, flip_begun: None, is_raised: false, losses: 0 }
    }

    pub(super) const fn state(&self) -> LcdState {
        self.state
    }

    /// How often a display that showed pictures was lost.
    pub(super) const fn losses(&self) -> u64 {
        self.losses
    }

    /// The action that is due at `now`. A look counts as taken.
    pub(super) fn due(&mut self, now: Time) -> LcdDue {
        if self.flip_begun.is_some_and(|begun| now.ns_since(begun) > FLIP_NS) {
            return LcdDue::FlipOverdue;
        }
        if now < self.next_look {
            return LcdDue::Nothing;
        }
        self.next_look = now.plus_ns(LOOK_NS);
        LcdDue::Look
    }

    /// How long there is nothing to do unless something happens, nanoseconds.
    pub(super) fn sleep_ns(&self, now: Time) -> i64 {
        self.next_look.ns_since(now).clamp(0, SLEEP_NS)
    }

    /// A picture was handed to the kernel.
    pub(super) const fn flip_begun(&mut self, now: Time) {
        self.flip_begun = Some(now);
    }

    /// A picture is on the screen, in `mode`.
    pub(super) fn flipped(&mut self, mode: LcdMode) -> Option<DisplayChange> {
        self.flip_begun = None;
        self.state = LcdState::Showing(mode);
        std::mem::take(&mut self.is_raised).then_some(DisplayChange::Cleared)
    }

    /// There is no display: none was found, or the one that was there is gone. Looks again after the usual time.
    pub(super) fn missing(&mut self, now: Time, why: impl Into<String>) -> Option<DisplayChange> {
        self.flip_begun = None;
        if let LcdState::Showing(_) = self.state {
            self.state = LcdState::Lost { since: now };
            self.losses += 1;
        }
        self.next_look = now.plus_ns(LOOK_NS);
        (!std::mem::replace(&mut self.is_raised, true)).then(|| DisplayChange::Raised(why.into()))
    }

    /// The end.
    pub(super) const fn stop(&mut self) {
        self.state = LcdState::Stopped;
        self.flip_begun = None;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MODE: LcdMode = LcdMode::PANEL;

    fn at_ms(ms: i64) -> Time {
        Time::from_ns(ms * 1_000_000)
    }

    #[test]
    fn a_missing_display_is_raised_once_and_looked_for_twice_a_second() {
        let mut life = LcdLife::new(at_ms(0));
        let (mut told, mut looks) = (0, 0);
        for ms in 0..10_000 {
            if life.due(at_ms(ms)) == LcdDue::Look {
                looks += 1;
                told += usize::from(life.missing(at_ms(ms), "no cable").is_some());
            }
        }
        assert_eq!((told, looks, life.losses()), (1, 20, 0));
        assert_eq!(life.state(), LcdState::Searching, "never shown, never lost");
    }

    #[test]
    fn a_display_that_comes_back_clears_its_fault_within_two_seconds() {
        let mut life = LcdLife::new(at_ms(0));
        assert_eq!(life.due(at_ms(0)), LcdDue::Look);
        life.flip_begun(at_ms(1));
        assert_eq!(life.flipped(MODE), None, "there was no fault");
        assert_eq!(life.missing(at_ms(1000), "unplugged"), Some(DisplayChange::Raised("unplugged".into())));
        assert_eq!(life.state(), LcdState::Lost { since: at_ms(1000) });
        let back = (1001..).find(|ms| life.due(at_ms(*ms)) == LcdDue::Look).expect("looked for");
        assert!(back <= 1500, "{back}");
        life.flip_begun(at_ms(back));
        assert_eq!(life.flipped(MODE), Some(DisplayChange::Cleared));
        assert_eq!((life.state(), life.losses()), (LcdState::Showing(MODE), 1));
    }

    #[test]
    fn a_flip_that_never_comes_is_given_up() {
        let mut life = LcdLife::new(at_ms(0));
        life.flip_begun(at_ms(0));
        let given_up = (0..).find(|ms| life.due(at_ms(*ms)) == LcdDue::FlipOverdue).expect("given up");
        assert_eq!(given_up, FLIP_NS / 1_000_000 + 1);
        life.missing(at_ms(given_up), "no flip");
        assert_eq!(life.due(at_ms(given_up)), LcdDue::Nothing, "not twice");
    }

    #[test]
    fn the_end_is_final_in_the_status() {
        let mut life = LcdLife::new(at_ms(0));
        life.flipped(MODE);
        life.stop();
        assert_eq!(life.state(), LcdState::Stopped);
    }

    proptest! {
        /// Raised and cleared alternate, whatever happens, and the thread never sleeps longer than its heartbeat allows.
        #[test]
        fn faults_come_and_go_in_turn(steps in prop::collection::vec((0u8..3, 0i64..2_000), 0..100)) {
            let (mut life, mut now, mut raised) = (LcdLife::new(at_ms(0)), 0, false);
            for (step, ms) in steps {
                now += ms;
                let told = match step {
                    0 => life.missing(at_ms(now), "gone"),
                    1 => life.flipped(MODE),
                    _ => { life.flip_begun(at_ms(now)); life.due(at_ms(now)); None }
                };
                match told {
                    Some(DisplayChange::Raised(_)) => { prop_assert!(!raised); raised = true; }
                    Some(DisplayChange::Cleared) => { prop_assert!(raised); raised = false; }
                    None => {}
                }
                prop_assert!((0..=SLEEP_NS).contains(&life.sleep_ns(at_ms(now))));
            }
        }
    }
}
