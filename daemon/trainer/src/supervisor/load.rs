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
/// For so long no frame may have been late before all is drawn again: less than a second, so that the sailor has it back within one.
const CALM: usize = 24;

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
    /// Frames since the last step.
    since: usize,
    /// What a frame took with all drawn, before the first step, milliseconds.
    whole_ms: f64,
    /// How much of that a frame takes as it is drawn now.
    share: Option<f64>,
    missed: u64,
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

    /// Decides anew; each fault, and why it is there: `None` where it is not.
    pub fn decide(&mut self) -> [(Fault, Option<String>); STEPS.len() + 1] {
        /// Nine frames of ten must be expected to take less than this with all drawn again, milliseconds, of the 33 that there are.
        const BACK_MS: f64 = 28.0;
        if self.left_out < STEPS.len() && self.late(STEP_WITHIN.min(self.since)) >= LATE {
            if self.left_out == 0 {
                self.whole_ms = self.late_ms();
            }
            self.left_out += 1;
            (self.since, self.share) = (0, None);
        } else if self.left_out > 0 {
            if self.since >= STEP_WITHIN && self.share.is_none() {
                self.share = Some((self.quantile(STEP_WITHIN, 0.5) / self.whole_ms).clamp(0.3, 1.0));
            }
            let whole_ms = self.quantile(CALM, 0.9) / self.share.unwrap_or(1.0);
            if self.since >= CALM && self.late(CALM) == 0 && whole_ms < BACK_MS {
                (self.left_out, self.since) = (0, 0);
            }
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

    /// Late ones of the newest frames.
    fn late(&self, newest: usize) -> usize {
        self.frames.iter().rev().take(newest).filter(|f| f.is_late).count()
    }

    /// What the late ones of the newest frames took, milliseconds: those before them were drawn under a smaller load.
    fn late_ms(&self) -> f64 {
        let newest = self.frames.iter().rev().take(STEP_WITHIN);
        let mut late = newest.filter(|f| f.is_late).filter_map(|f| f.took_ms).peekable();
        if late.peek().is_none() {
            return self.quantile(STEP_WITHIN, 1.0);
        }
        bowwave_core::statistics::quantile(late, 0.5).max(1.0)
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
