//! The place where pictures wait for the display: bounded, the newest wins, and nobody waits for anybody.
//!
//! Three buffers go round. One is on the screen (`front`); one may be handed to the kernel for the next vblank
//! (`pending`); the third is free, lent to the caller that draws in it, or `ready` to be handed over. A caller that comes
//! while a picture is ready takes that one back and overwrites it.

use bowwave_core::time::Time;

/// A buffer with a picture in it.
#[derive(Debug)]
pub(super) struct FilledScanout<B> {
    /// The buffer.
    pub(super) buffer: B,
    /// The caller's number of the picture; `None` for the black one with which a mode is set.
    pub(super) frame: Option<u64>,
    /// When the caller gave it.
    pub(super) given: Time,
}

/// A buffer lent to a caller, to be given back with [`ScanoutSlot::give_back`].
#[derive(Debug)]
pub(super) struct LentScanout<B> {
    /// The buffer.
    pub(super) buffer: B,
    /// Which screen it is of.
    screen: u64,
    /// A picture that waited in it is overwritten.
    takes_ready: bool,
}

/// The buffers of the screen that is there now, if any.
#[derive(Debug)]
pub(super) struct ScanoutSlot<B> {
    /// Counts screens: a buffer of an earlier one is not taken back.
    screen: u64,
    is_open: bool,
    free: Vec<B>,
    ready: Option<FilledScanout<B>>,
    pending: Option<FilledScanout<B>>,
    front: Option<FilledScanout<B>>,
}

impl<B> Default for ScanoutSlot<B> {
    fn default() -> Self {
        Self { screen: 0, is_open: false, free: Vec::new(), ready: None, pending: None, front: None }
    }
}

impl<B> ScanoutSlot<B> {
    /// A new screen with its buffers.
    pub(super) fn open(&mut self, buffers: Vec<B>) {
        let screen = self.screen.wrapping_add(1);
        *self = Self { screen, is_open: true, free: buffers, ..Self::default() };
    }

    /// The screen is gone, and its buffers with it. Gives how many of the caller's pictures were still on their way.
    pub(super) fn close(&mut self) -> u64 {
        let waiting =
            [&self.ready, &self.pending].into_iter().flatten().filter(|f| f.frame.is_some()).count();
        *self = Self { screen: self.screen, ..Self::default() };
        waiting as u64
    }

    /// A buffer to draw in. `None` without a screen, or while another caller draws in the last one.
    pub(super) fn lend(&mut self) -> Option<LentScanout<B>> {
        let screen = self.screen;
        if let Some(buffer) = self.free.pop() {
            return Some(LentScanout { buffer, screen, takes_ready: false });
        }
        let old = self.ready.take()?;
        Some(LentScanout { buffer: old.buffer, screen, takes_ready: true })
    }

    /// The drawn buffer comes back and is ready. Gives how many waiting pictures gave way to it; where the screen has gone
    /// meanwhile, as an error, how many pictures went with the buffer.
    pub(super) fn give_back(&mut self, lent: LentScanout<B>, frame: u64, given: Time) -> Result<u64, u64> {
        let overwritten = u64::from(lent.takes_ready);
        if !self.is_open || lent.screen != self.screen {
            return Err(1 + overwritten);
        }
        let old = self.ready.replace(FilledScanout { buffer: lent.buffer, frame: Some(frame), given });
        let gave_way = overwritten + u64::from(old.is_some());
        self.free.extend(old.map(|f| f.buffer));
        Ok(gave_way)
    }

    /// The picture to be handed to the kernel now: the ready one, unless another is still pending. It is pending from here
    /// on.
    pub(super) fn hand_over(&mut self) -> Option<&FilledScanout<B>> {
        if self.pending.is_some() {
            return None;
        }
        self.pending = self.ready.take();
        self.pending.as_ref()
    }

    /// A free buffer, as it is, becomes pending: the black picture with which a mode is set.
    pub(super) fn hand_over_blank(&mut self, now: Time) -> Option<&FilledScanout<B>> {
        let buffer = self.free.pop()?;
        self.pending = Some(FilledScanout { buffer, frame: None, given: now });
        self.pending.as_ref()
    }

    /// The kernel did not take the pending picture: it waits again, unless a newer one does. `true` where it gave way.
    pub(super) fn take_back(&mut self) -> bool {
        let Some(refused) = self.pending.take() else { return false };
        let gives_way = self.ready.is_some();
        if gives_way {
            self.free.push(refused.buffer);
        } else {
            self.ready = Some(refused);
        }
        gives_way
    }

    /// The pending picture is on the screen: number and time when it was given. The one before is free.
    pub(super) fn flipped(&mut self) -> Option<(Option<u64>, Time)> {
        let shown = self.pending.take()?;
        let told = (shown.frame, shown.given);
        self.free.extend(self.front.replace(shown).map(|f| f.buffer));
        Some(told)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn opened() -> ScanoutSlot<u8> {
        let mut slot = ScanoutSlot::default();
        slot.open(vec![0, 1, 2]);
        slot
    }

    /// Shows a picture; gives whether another one gave way.
    fn show(slot: &mut ScanoutSlot<u8>, frame: u64) -> bool {
        let lent = slot.lend().expect("a buffer");
        slot.give_back(lent, frame, Time::from_ns(frame as i64)).expect("the screen is there") == 1
    }

    #[test]
    fn without_a_screen_nothing_is_taken() {
        let mut slot = ScanoutSlot::<u8>::default();
        assert!(slot.lend().is_none() && slot.hand_over().is_none());
        assert_eq!(slot.flipped(), None);
    }

    #[test]
    fn the_newest_picture_wins() {
        let mut slot = opened();
        assert!(!show(&mut slot, 1));
        assert_eq!(slot.hand_over().and_then(|f| f.frame), Some(1));
        assert!(!show(&mut slot, 2));
        assert_eq!(slot.hand_over().map(|f| f.frame), None, "one is pending");
        assert!(show(&mut slot, 3), "2 gave way, from the third buffer");
        assert!(show(&mut slot, 4), "3 gave way, from the buffer of 2");
        assert_eq!(slot.flipped(), Some((Some(1), Time::from_ns(1))));
        assert_eq!(slot.hand_over().and_then(|f| f.frame), Some(4));
        assert!(!show(&mut slot, 5));
        assert!(show(&mut slot, 6), "no buffer is free: 5 is overwritten");
    }

    #[test]
    fn a_buffer_of_an_earlier_screen_is_not_taken_back() {
        let mut slot = opened();
        let lent = slot.lend().expect("a buffer");
        slot.close();
        assert_eq!(slot.give_back(lent, 1, Time::MIN), Err(1));
        slot.open(vec![3]);
        let lent = slot.lend().expect("a buffer");
        slot.open(vec![4, 5]);
        assert_eq!(slot.give_back(lent, 2, Time::MIN), Err(1));
        assert_eq!(slot.close(), 0);
    }

    #[test]
    fn a_picture_that_the_kernel_refused_waits_again() {
        let mut slot = opened();
        show(&mut slot, 1);
        slot.hand_over();
        assert!(!slot.take_back());
        assert_eq!(slot.flipped(), None);
        assert_eq!(slot.hand_over().and_then(|f| f.frame), Some(1));
        show(&mut slot, 2);
        assert!(slot.take_back());
        assert_eq!(slot.hand_over().and_then(|f| f.frame), Some(2), "a newer one came meanwhile");
    }

    #[test]
    fn the_pictures_that_a_lost_screen_swallowed_are_told() {
        let mut slot = opened();
        show(&mut slot, 7);
        slot.hand_over();
        assert!(!show(&mut slot, 8));
        assert_eq!(slot.close(), 2);
        slot.open(vec![0]);
        slot.hand_over_blank(Time::MIN);
        assert_eq!(slot.close(), 0, "the black picture is nobody's");
    }

    proptest! {
        /// Whatever the order of calls: buffers are neither lost nor doubled, and numbers reach the screen in their order.
        #[test]
        fn buffers_go_round(steps in prop::collection::vec(0u8..5, 0..200)) {
            let mut slot = opened();
            let (mut lent, mut number, mut last) = (None, 0, 0);
            let (mut shown, mut gave_way) = (0, 0);
            for step in steps {
                match step {
                    4 => gave_way += u64::from(slot.take_back()),
                    0 if lent.is_none() => lent = slot.lend(),
                    1 => if let Some(l) = lent.take() {
                        number += 1;
                        gave_way += slot.give_back(l, number, Time::MIN).expect("the screen is there");
                    },
                    2 => { slot.hand_over(); }
                    _ => if let Some((Some(frame), _)) = slot.flipped() {
                        prop_assert!(frame > last);
                        last = frame;
                        shown += 1;
                    },
                }
                let mut all: Vec<u8> = slot.free.clone();
                all.extend([&slot.ready, &slot.pending, &slot.front].into_iter().flatten().map(|f| f.buffer));
                all.extend(lent.as_ref().map(|l| l.buffer));
                all.sort_unstable();
                prop_assert_eq!(all, [0, 1, 2]);
                let waiting = [&slot.ready, &slot.pending].into_iter().flatten().count() as u64;
                // A picture that is being overwritten gives way when the new one is there.
                let overwritten = u64::from(lent.as_ref().is_some_and(|l| l.takes_ready));
                prop_assert_eq!(number, shown + gave_way + waiting + overwritten, "every picture is accounted for");
            }
        }
    }
}
