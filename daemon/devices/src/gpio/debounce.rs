//! Changes of a switch, out of the edges that its contacts make.

use bowwave_core::time::Time;

/// Removes the chatter of contacts. The first edge of a press or a release counts, with its own time; what follows within the
/// window is chatter. A level that chatter ends on and that differs from the one reported counts at the window's end, with
/// the time of the edge that brought it. Nothing is reported that no edge told.
#[derive(Clone, Debug)]
pub struct Debouncer {
    window_ns: i64,
    reported: bool,
    /// The level by the newest edge, and when that edge was.
    level: bool,
    since: Time,
    /// End of the window.
    quiet: Option<Time>,
    chatter: u64,
}

impl Debouncer {
    /// A switch whose level is known, and which has been quiet.
    pub const fn new(window_ns: i64, level: bool, now: Time) -> Self {
        Self { window_ns, reported: level, level, since: now, quiet: None, chatter: 0 }
    }

    /// The contacts changed to `level` at `time`. Calls `report` with each change of the switch that is known now.
    pub fn edge(&mut self, time: Time, level: bool, mut report: impl FnMut(Time, bool)) {
        let time = time.max(self.since);
        self.settle(time, &mut report);
        if self.quiet.is_none() && level != self.reported {
            (self.level, self.since, self.reported) = (level, time, level);
            self.quiet = Some(time.plus_ns(self.window_ns));
            report(time, level);
            return;
        }
        // Also a spike whose level was read back after it was over.
        self.chatter += 1;
        if level != self.level {
            (self.level, self.since) = (level, time);
        }
    }

    /// Time has come to `now`: to be called at [`Self::deadline`] at the latest.
    pub fn settle(&mut self, now: Time, mut report: impl FnMut(Time, bool)) {
        while let Some(end) = self.quiet
            && now >= end
        {
            self.quiet = None;
            if self.level != self.reported {
                self.reported = self.level;
                self.quiet = Some(end.plus_ns(self.window_ns));
                report(self.since, self.level);
            }
        }
    }

    /// The line was found at a level that no edge told: edges were lost. Where that is another than the one reported, it
    /// is taken as the switch's, unreported.
    pub fn correct(&mut self, now: Time, level: bool) {
        (self.level, self.since) = (level, now.max(self.since));
        if self.reported != level {
            self.reported = level;
            self.quiet = Some(now.plus_ns(self.window_ns));
        }
    }

    /// When [`Self::settle`] has something to do.
    pub const fn deadline(&self) -> Option<Time> {
        self.quiet
    }

    /// The switch, without chatter.
    pub const fn reported(&self) -> bool {
        self.reported
    }

    /// The contacts, by the newest edge.
    pub const fn level(&self) -> bool {
        self.level
    }

    /// Edges that were chatter.
    pub const fn chatter(&self) -> u64 {
        self.chatter
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MS: i64 = 1_000_000;
    const WINDOW_MS: i64 = 15;

    fn at(us: i64) -> Time {
        Time::from_ns(us * 1000)
    }

    /// Reports of a switch whose edges (microseconds, level) are settled a second later.
    fn reported(edges: &[(i64, bool)]) -> (Vec<(i64, bool)>, u64) {
        let mut switch = Debouncer::new(WINDOW_MS * MS, false, at(0));
        let mut out = Vec::new();
        let mut report = |t: Time, level| out.push((t.ns() / 1000, level));
        for (us, level) in edges {
            switch.edge(at(*us), *level, &mut report);
        }
        let last = edges.last().map_or(0, |e| e.0);
        switch.settle(at(last + 1_000_000), &mut report);
        assert_eq!(switch.deadline(), None);
        (out, switch.chatter())
    }

    #[test]
    fn a_press_that_chatters_is_one_with_the_time_of_its_first_edge() {
        let edges = [(1000, true), (1300, false), (1900, true), (3000, false), (3100, true), (90_000, false)];
        assert_eq!(reported(&edges), (vec![(1000, true), (90_000, false)], 4));
    }

    #[test]
    fn a_release_that_chatters_fires_no_second_shot() {
        let edges =
            [(1000, true), (90_000, false), (91_000, true), (91_500, false), (99_000, true), (99_900, false)];
        assert_eq!(reported(&edges).0, [(1000, true), (90_000, false)]);
    }

    #[test]
    fn a_tap_shorter_than_the_window_ends_when_its_last_edge_was() {
        assert_eq!(reported(&[(1000, true), (5000, false)]).0, [(1000, true), (5000, false)]);
    }

    /// The kernel reads the level when it gets to it: a short spike may show as an edge to where the line already is.
    #[test]
    fn an_edge_to_the_same_level_is_chatter() {
        assert_eq!(reported(&[(1000, false), (5000, false)]), (vec![], 2));
        let twice = [(1000, true), (1100, true), (50_000, true), (90_000, false)];
        assert_eq!(reported(&twice), (vec![(1000, true), (90_000, false)], 2));
    }

    #[test]
    fn a_correction_reports_nothing() {
        let mut switch = Debouncer::new(WINDOW_MS * MS, false, at(0));
        switch.correct(at(1000), true);
        assert!(switch.reported() && switch.level());
        let mut out = Vec::new();
        switch.edge(at(90_000), false, |t, level| out.push((t.ns() / 1000, level)));
        assert_eq!(out, [(90_000, false)]);
    }

    proptest! {
        /// Whatever the contacts do: changes alternate, in the order of time, each with the time of an edge to that level;
        /// the last one agrees with the contacts; and no more presses than one a window.
        #[test]
        fn reports_alternate_and_end_where_the_contacts_do(
            steps in prop::collection::vec((0i64..40_000, any::<bool>()), 0..200),
        ) {
            let mut us = 0;
            let edges: Vec<_> = steps.iter().map(|(step, level)| { us += step; (us, *level) }).collect();
            let (out, chatter) = reported(&edges);
            prop_assert!(out.iter().enumerate().all(|(i, (_, level))| *level == (i % 2 == 0)));
            prop_assert!(out.is_sorted_by_key(|(us, _)| *us));
            prop_assert!(out.iter().all(|change| edges.contains(change)));
            prop_assert_eq!(out.last().is_some_and(|o| o.1), edges.last().is_some_and(|e| e.1));
            prop_assert!(out.len() as i64 <= 2 + us / (WINDOW_MS * 1000));
            prop_assert!(chatter <= edges.len() as u64);
        }

        /// However a press and a release chatter within the window, it is one shot with its first edge's time.
        #[test]
        fn one_press_is_one_shot(
            press in prop::collection::vec(1i64..1500, 0..8),
            hold_us in 20_000i64..500_000,
            release in prop::collection::vec(1i64..1500, 0..8),
        ) {
            let mut edges = vec![(1000, true)];
            let burst = |edges: &mut Vec<(i64, bool)>, steps: &[i64]| {
                // Pairs, so that the level is where it was.
                for pair in steps.chunks_exact(2) {
                    for step in pair {
                        let (us, level) = edges[edges.len() - 1];
                        edges.push((us + step, !level));
                    }
                }
            };
            burst(&mut edges, &press);
            let released = edges[edges.len() - 1].0 + hold_us;
            edges.push((released, false));
            burst(&mut edges, &release);
            prop_assert_eq!(reported(&edges).0, [(1000, true), (released, false)]);
        }
    }
}
