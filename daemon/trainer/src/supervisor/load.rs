//! Whether the computer keeps up with 30 frames a second, and what is left out where it does not: first what nobody sees, then the water
//! of far boats, then all of it. Registration, rounds and the journal are never left out.
//!
//! What is left out is told to the session as faults, so that a recording holds it and a replay leaves out the same.

use std::collections::VecDeque;

use bowwave_core::fault::Fault;

/// What is left out, step by step.
const STEPS: [(Fault, &str); 3] = [
    (
        Fault::LoadUnseen,
        "the computer is too busy: the sea is not measured, and pictures are recorded coarsely",
    ),
    (Fault::LoadFar, "the computer is too busy: only the nearest boat has a reflection and a wake"),
    (Fault::LoadWater, "the computer is too busy: no boat has a reflection or a wake"),
];
/// Frames that are looked back at: a second.
const WINDOW: usize = 30;
/// So many late frames...
const LATE: usize = 2;
/// ...among so many since the last step ask for the next one.
const STEP_WITHIN: usize = 10;
/// So does half of these taking longer than this, milliseconds of the 33 that there are: the next odd one would be late.
const NEARLY_LATE_MS: f64 = 29.0;
/// For so long no frame may have been late before all is drawn again: less than a second, so that the sailor has it back within one.
const CALM: usize = 24;
/// Nine frames of ten must be expected to take less than this with all drawn again, milliseconds, of the 33 that there are.
const BACK_MS: f64 = 26.0;
/// An expectation that keeps things left out is tried after so many frames, half a minute: scene and load have become others by then.
const EXPECTED_FOR: usize = 900;

/// A frame that was due.
#[derive(Clone, Copy, Debug)]
struct DueFrame {
    is_late: bool,
    /// From its beginning to its end, milliseconds; `None` of one that was not drawn.
    took_ms: Option<f64>,
}

/// Watches a run that is paced.
#[derive(Debug, Default)]
pub struct LoadWatch {
    frames: VecDeque<DueFrame>,
    /// Steps that are left out.
    left_out: usize,
    /// Frames since the last step, or since all is drawn again.
    since: usize,
    /// How much of a whole frame's time one takes after each step, as the last return from it showed.
    shares: [Option<f64>; STEPS.len()],
    /// The last return, until it has shown that.
    returned: Option<Return>,
    missed: u64,
}

/// All was drawn again.
#[derive(Clone, Copy, Debug)]
struct Return {
    /// Steps that were left out before.
    left_out: usize,
    /// What a frame took then, milliseconds.
    took_ms: f64,
}

impl LoadWatch {
    /// A frame is complete: how long it took, and whether it was complete in time.
    pub fn drawn(&mut self, took_ms: f64, is_late: bool) {
        self.due(DueFrame { is_late, took_ms: Some(took_ms) });
    }

    /// So many frames were left out since the run began, because the loop came too late.
    pub fn missed(&mut self, count: u64) {
        let more = count.saturating_sub(self.missed).min(WINDOW as u64);
        self.missed = count;
        for _ in 0..more {
            self.due(DueFrame { is_late: true, took_ms: None });
        }
    }

    fn due(&mut self, frame: DueFrame) {
        if self.frames.len() == WINDOW {
            self.frames.pop_front();
        }
        self.frames.push_back(frame);
        self.since += 1;
    }

    /// Decides from the frames so far; each fault, and why it is there: `None` where it is not.
    pub fn decide(&mut self) -> [(Fault, Option<String>); STEPS.len() + 1] {
        let asks = self.left_out < STEPS.len()
            && (self.late(STEP_WITHIN.min(self.since)) >= LATE || self.is_nearly_late());
        self.learn(asks);
        if asks {
            // What did not hold is left out again at once, not step by step.
            self.left_out = self.returned.take().map_or(self.left_out + 1, |back| back.left_out);
            self.since = 0;
        } else if self.left_out > 0 && self.may_return() {
            self.returned = Some(Return { left_out: self.left_out, took_ms: self.quantile(CALM, 0.5) });
            (self.left_out, self.since) = (0, 0);
        }
        let late = self.late(WINDOW);
        let slow = (late >= LATE).then(|| {
            format!("{late} of the last {WINDOW} frames came late or not at all; stop other programs")
        });
        let [unseen, far, water] = STEPS;
        let told = |step: usize, (fault, why): (Fault, &str)| {
            (fault, (step < self.left_out).then(|| why.to_owned()))
        };
        [(Fault::LoadRate, slow), told(0, unseen), told(1, far), told(2, water)]
    }

    /// Whether what nobody sees is left out.
    pub const fn leaves_unseen_out(&self) -> bool {
        self.left_out > 0
    }

    /// True of frames that leave no room for one that takes a little longer.
    fn is_nearly_late(&self) -> bool {
        self.since >= STEP_WITHIN && self.quantile(STEP_WITHIN, 0.5) > NEARLY_LATE_MS
    }

    /// Late ones of the newest frames.
    fn late(&self, newest: usize) -> usize {
        self.frames.iter().rev().take(newest).filter(|f| f.is_late).count()
    }

    /// Whether all can be drawn again. Only a return shows how much leaving out saves: frames before and after a step differ by the load as
    /// well, which may be gone a moment later.
    fn may_return(&self) -> bool {
        if self.since < CALM || self.late(CALM) > 0 {
            return false;
        }
        let share = self.shares[self.left_out - 1].unwrap_or(1.0);
        self.quantile(CALM, 0.9) / share < BACK_MS || self.since >= EXPECTED_FOR
    }

    /// Learns from a return, once it has failed or lasts.
    fn learn(&mut self, has_failed: bool) {
        let Some(back) = self.returned.filter(|_| has_failed || self.since >= STEP_WITHIN) else { return };
        let whole_ms = self.quantile(self.since.min(STEP_WITHIN), 0.5);
        self.shares[back.left_out - 1] = Some((back.took_ms / whole_ms).min(1.0));
        if !has_failed {
            self.returned = None;
        }
    }

    fn quantile(&self, newest: usize, share: f64) -> f64 {
        let took = self.frames.iter().rev().take(newest).filter_map(|f| f.took_ms);
        bowwave_core::statistics::quantile(took, share).max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames that take `load` times `costs` by what is left out, of which what lasts longer than a frame's time is late; steps after each.
    fn run(watch: &mut LoadWatch, frames: usize, load: impl Fn(usize) -> f64) -> Vec<usize> {
        let costs = [9.0, 8.5, 7.5, 5.0];
        let mut steps = Vec::new();
        for frame in 0..frames {
            let took_ms = load(frame) * costs[watch.left_out];
            watch.drawn(took_ms, took_ms > 33.3);
            let told = watch.decide();
            let count = told[1..].iter().filter(|(_, why)| why.is_some()).count();
            assert_eq!(count, watch.left_out, "each step is told");
            steps.push(count);
        }
        steps
    }

    #[test]
    fn an_odd_slow_frame_leaves_nothing_out() {
        let mut watch = LoadWatch::default();
        let steps = run(&mut watch, 300, |frame| if frame % 15 == 0 { 6.0 } else { 1.0 });
        assert!(steps.iter().all(|s| *s == 0), "{steps:?}");
    }

    #[test]
    fn overload_takes_step_by_step_and_all_is_back_within_a_second_of_its_end() {
        let mut watch = LoadWatch::default();
        let steps = run(&mut watch, 90, |frame| if frame < 45 { 8.0 } else { 1.0 });
        assert_eq!(&steps[..6], [0, 1, 1, 2, 2, 3], "within a fifth of a second");
        assert!(steps[6..45].iter().all(|s| *s == 3));
        assert_eq!(steps[45 + 29], 0, "{steps:?}");
    }

    #[test]
    fn frames_that_are_nearly_late_leave_something_out_before_one_is() {
        let mut watch = LoadWatch::default();
        // All drawn takes 31.5 ms, without far boats' water 26.
        let steps = run(&mut watch, 300, |frame| if frame < 100 { 2.0 } else { 3.5 });
        assert!(steps[..100].iter().all(|s| *s == 0) && steps[110] == 1 && steps[140] == 2, "{steps:?}");
        assert!(steps[140..].iter().all(|s| *s == 2), "{steps:?}");
        assert_eq!(watch.late(WINDOW), 0);
    }

    /// Two frames at the start, or later, take long for no load of the scene's: neither keeps the water away.
    #[test]
    fn what_a_moment_held_up_is_back_within_a_second() {
        for (stops, load) in [(0..3, 2.0), (100..102, 2.0), (100..106, 2.5), (100..103, 1.0)] {
            let mut watch = LoadWatch::default();
            let end = stops.end;
            let steps = run(&mut watch, 900, |frame| if stops.contains(&frame) { 20.0 } else { load });
            assert!(steps[..end + 1].iter().any(|s| *s > 0), "{stops:?}");
            assert!(steps[end + 29..].iter().all(|s| *s == 0), "{stops:?} at {load}: {steps:?}");
        }
    }

    /// A return that a moment spoilt keeps the water away for half a minute at most.
    #[test]
    fn what_a_return_showed_is_not_believed_for_ever() {
        let mut watch = LoadWatch::default();
        let long = |frame: usize| (100..102).contains(&frame) || (127..130).contains(&frame);
        let steps = run(&mut watch, 1200, |frame| if long(frame) { 20.0 } else { 2.0 });
        assert!(steps[131] > 0 && steps[800] > 0, "{steps:?}");
        assert!(steps[130 + EXPECTED_FOR + 2..].iter().all(|s| *s == 0), "{steps:?}");
    }

    #[test]
    fn a_load_under_which_less_can_be_drawn_does_not_make_the_water_flicker() {
        // All drawn takes 36 to 50 ms, without water 20 to 28; the load is there from the start, or begins later.
        for (begin, load) in [(0, 4.0), (100, 4.0), (100, 4.5), (107, 5.0), (100, 5.5)] {
            let mut watch = LoadWatch::default();
            let steps = run(&mut watch, 900, |frame| if frame < begin { 1.0 } else { load });
            let changes = steps.windows(2).filter(|w| w[0] != w[1]).count();
            assert!(changes <= 5, "{changes} changes at load {load} from frame {begin}");
            assert!(steps.last().is_some_and(|s| *s > 0));
        }
    }

    #[test]
    fn frames_that_were_not_drawn_count_as_late_and_the_rate_is_told() {
        let mut watch = LoadWatch::default();
        run(&mut watch, 30, |_| 1.0);
        watch.missed(4);
        let told = watch.decide();
        assert!(told[0].1.as_deref().is_some_and(|why| why.starts_with("4 of the last 30")), "{told:?}");
        assert_eq!(watch.left_out, 1);
        assert!(run(&mut watch, 30, |_| 1.0).last() == Some(&0) && watch.decide()[0].1.is_none());
    }
}
