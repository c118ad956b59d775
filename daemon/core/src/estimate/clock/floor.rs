//! Tells when all arrivals have left a line under them: the device's clock has slowed down.
//!
//! A line that arrivals fall below is mended by the first of them. Above it they may lie for any reason, and only that not even the
//! quickest of some seconds comes down to it any more tells that it is wrong. How near the quickest come differs from host to host (a timer
//! that beats with the device lets none through for a while), so it is learnt: by how much they came down again before.

use std::collections::VecDeque;

use crate::time::NS_PER_S;

/// The least delay is kept of so long, device time.
const BLOCK_NS: i64 = NS_PER_S / 2;

/// So many of them are kept: a minute.
const BLOCKS: usize = 128;

/// Spans that are looked at, in blocks: the short one tells sooner, the long one where quick arrivals are rare.
const SPANS: [usize; 2] = [2, 4];

/// Nothing is told before so many blocks are known.
const BLOCKS_LEAST: usize = 20;

/// A span that lies above the line by this much...
const ABOVE_NS: i64 = 50_000;

/// ...and by this many quarters of what spans came down by before has left it.
const FALL_QUARTERS: i64 = 7;

/// What rises faster than this is no clock that runs slower: all arrivals are late for a while...
const RISE_MAX: f64 = 1000e-6;

/// ...unless they stay so.
const LATE_NS: i64 = 10 * NS_PER_S;

/// How far above the line the quickest arrivals lay, half second by half second.
#[derive(Clone, Debug, Default)]
pub(super) struct Floor {
    /// Where the current block began, device time, and its least.
    block: Option<(i64, i64)>,
    /// The least of each whole block, oldest first, nanoseconds.
    least: VecDeque<i64>,
    /// Since when, device time, arrivals are late by more than a clock's rate can do.
    late_since: Option<i64>,
}

impl Floor {
    /// Takes in an arrival `above_ns` over the line. Once all have left it, returns the device time that a new line should begin at.
    pub(super) fn observe(&mut self, device_ns: i64, above_ns: i64) -> Option<i64> {
        let (begun, least) = self.block.unwrap_or((device_ns, above_ns));
        let long_ns = device_ns.saturating_sub(begun);
        if long_ns < BLOCK_NS {
            self.block = Some((begun, least.min(above_ns)));
            return None;
        }
        self.block = Some((device_ns, above_ns));
        self.least.push_back(least);
        if self.least.len() > BLOCKS {
            self.least.pop_front();
        }
        let left = SPANS.into_iter().find_map(|span| Some((span, self.rise_of_one_that_left(span)?)));
        let Some((span, rise_ns)) = left else {
            self.late_since = None;
            return None;
        };
        let is_late = rise_ns as f64 > RISE_MAX * long_ns as f64;
        if is_late && self.late_since.is_none() {
            self.late_since = Some(device_ns);
        }
        if self.late_since.is_some_and(|since| device_ns.saturating_sub(since) < LATE_NS) {
            return None;
        }
        self.late_since = None;
        // The line is taken under the middle of what it is begun with: one and a half spans ago, where enough is known of both sides.
        Some(device_ns.saturating_sub(3 * span as i64 * BLOCK_NS))
    }

    /// The line now lies higher by `raised_ns`: what was kept is told against it.
    pub(super) fn raise(&mut self, raised_ns: i64) {
        self.block = None;
        for least in &mut self.least {
            *least = least.saturating_sub(raised_ns);
        }
    }

    /// By how much more than one block ago the newest span lies above the line; `None` where it has not left it.
    fn rise_of_one_that_left(&self, span: usize) -> Option<i64> {
        let newest = self.least.len().checked_sub(span).filter(|known| *known >= BLOCKS_LEAST)?;
        let least = |from: usize| self.least.range(from..from + span).copied().min().unwrap_or(0);
        let (mut most, mut fall) = (i64::MIN, 0);
        for now in (0..=newest - span).map(least) {
            most = now.max(most);
            fall = fall.max(most.saturating_sub(now));
        }
        let above = least(newest);
        let has_left = above > (fall / 4).saturating_mul(FALL_QUARTERS).saturating_add(ABOVE_NS);
        has_left.then(|| above.saturating_sub(least(newest - 1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// When a line is left, seconds, whose arrivals lie `above_us(s)` over it at 200 Hz, and where the next begins.
    fn left(above_us: impl Fn(f64) -> f64) -> Option<(f64, f64)> {
        let mut floor = Floor::default();
        (0..120 * 200).find_map(|i| {
            let s = f64::from(i) / 200.0;
            let begin = floor.observe(i64::from(i) * 5_000_000, (above_us(s) * 1e3) as i64)?;
            Some((s, begin as f64 * 1e-9))
        })
    }

    #[test]
    fn arrivals_that_rise_as_a_slower_clock_does_leave_the_line() {
        let (s, begin) = left(|s| (s - 60.0).max(0.0) * 200.0).expect("left");
        assert!((60.5..62.5).contains(&s) && begin < s - 2.0, "{s} {begin}");
    }

    #[test]
    fn what_came_down_before_is_waited_for() {
        // As a timer does that lets a quick one through every two seconds and a half only.
        let beat = |s: f64| s.rem_euclid(2.5) * 100.0;
        assert_eq!(left(beat), None);
        let (s, _) = left(|s| beat(s) + (s - 60.0).max(0.0) * 200.0).expect("left");
        assert!((61.0..64.0).contains(&s), "{s}");
    }

    #[test]
    fn late_ones_are_not_followed_unless_they_stay_late() {
        assert_eq!(left(|s| if (60.0..66.0).contains(&s) { 1500.0 } else { 0.0 }), None);
        let (s, _) = left(|s| if s > 60.0 { 1500.0 } else { 0.0 }).expect("left");
        assert!((70.0..73.0).contains(&s), "{s}");
    }

    #[test]
    fn a_line_that_was_raised_is_left_no_more() {
        let mut floor = Floor::default();
        let mut raised = 0;
        for i in 0..120 * 200 {
            let above = (i - 60 * 200).clamp(0, 500) * 1000;
            if floor.observe(i * 5_000_000, above - raised).is_some() {
                floor.raise(above - raised);
                raised = above;
            }
        }
        assert!(raised > 0);
        let fallen = floor.rise_of_one_that_left(SPANS[0]);
        assert_eq!(fallen, None, "{floor:?}");
    }
}
