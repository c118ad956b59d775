//! The trigger switch: which of its changes count as shots, as a function of the line's edges and of time.

use bowwave_core::{
    event::TriggerEdge,
    fault::{Fault, FaultChange},
    time::{NS_PER_S, Time},
};

use crate::gpio::Debouncer;

/// How long a level may differ from the newest edge before edges were lost: the kernel reads the level in a thread.
const RECHECK_NS: i64 = 5_000_000;
/// How far an edge's time may lie outside of what is possible: nothing is measured here, but clocks are read one by one.
const CLOCK_SLACK_NS: i64 = 1_000_000;
/// An edge that lies so far outside is of another clock...
const CLOCK_GROSS_NS: i64 = NS_PER_S;
/// ...as are so many in a row that lie outside at all. A single one may be of anything: the trainer fires no more after it is
/// refused, until it is started again.
const STRANGE_EDGES: u32 = 3;

/// Output of the switch.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum SwitchOutput {
    /// For the session.
    Edge(TriggerEdge),
    /// For the supervisor.
    Fault(FaultChange),
}

/// The life of the trigger.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TriggerLife {
    /// Its line is not open; it is looked for.
    #[default]
    Searching,
    /// Released.
    Released,
    /// Pressed, and firing.
    Pressed,
    /// Held, but not firing: it was held when the line was opened, when the interlock was open, or its press was lost. It
    /// fires again once it was released.
    Held,
    /// The kernel's times cannot be used: it fires no more.
    Refused,
}

/// Counts of what became of edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TriggerCounters {
    /// Presses handed on.
    pub presses: u64,
    /// Edges that were chatter.
    pub chatter: u64,
    /// Presses that did not count: the interlock was open, or the clock refused.
    pub withheld: u64,
    /// Times that edges were lost in the kernel.
    pub overruns: u64,
    /// Times that the line was opened.
    pub opened: u64,
    /// Edges dropped, oldest first, because nobody drained the queue.
    pub overflow: u64,
}

/// The line while it is open.
#[derive(Clone, Debug)]
struct OpenLine {
    /// When the line was asked for: the kernel keeps edges from somewhere after this.
    asked: Time,
    /// When its level had been read.
    since: Time,
    /// Edges in a row whose times cannot be.
    strange: u32,
    debouncer: Debouncer,
    /// Since when the level has differed from the newest edge.
    mismatch: Option<Time>,
    contact: SwitchContact,
}

/// Life of the switch's line.
#[derive(Debug)]
enum LineLife {
    /// It was not opened yet.
    Unopened,
    /// It cannot be opened, or is gone, and that was told.
    Lost,
    /// It is open.
    Open(OpenLine),
}

/// Contacts of the switch, without chatter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SwitchContact {
    /// Nobody presses it.
    Released,
    /// It is pressed, and its press was handed on: its release is, too.
    Firing(PressHold),
    /// It is held, and that counts for nothing before it was released: it was held when the line was opened, when the interlock was
    /// open, or its press was lost.
    Held(PressHold),
}

/// A press that lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PressHold {
    since: Time,
    /// It was told as stuck.
    stuck: bool,
}

impl PressHold {
    const fn since(since: Time) -> Self {
        Self { since, stuck: false }
    }
}

/// Whether presses count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Permit {
    /// They do: the interlock, if there is one, is closed.
    Armed,
    /// They do not: the interlock is open.
    Disarmed,
    /// They never do again: the kernel's times are those of another clock.
    Refused,
}

/// The trigger switch.
#[derive(Debug)]
pub(super) struct Switch {
    debounce_ns: i64,
    stuck_after_ns: i64,
    permit: Permit,
    line: LineLife,
    counters: TriggerCounters,
    /// Chatter of lines that were closed since.
    chatter: u64,
    out: Vec<SwitchOutput>,
}

impl Switch {
    /// `armed`: whether an interlock, if there is one, is known to be closed.
    pub(super) const fn new(debounce_ns: i64, stuck_after_ns: i64, armed: bool) -> Self {
        Self {
            debounce_ns,
            stuck_after_ns,
            permit: if armed { Permit::Armed } else { Permit::Disarmed },
            line: LineLife::Unopened,
            counters: TriggerCounters {
                presses: 0,
                chatter: 0,
                withheld: 0,
                overruns: 0,
                opened: 0,
                overflow: 0,
            },
            chatter: 0,
            out: Vec::new(),
        }
    }

    pub(super) fn out(&mut self) -> impl Iterator<Item = SwitchOutput> + '_ {
        self.out.drain(..)
    }

    const fn open(&self) -> Option<&OpenLine> {
        match &self.line {
            LineLife::Open(open) => Some(open),
            LineLife::Unopened | LineLife::Lost => None,
        }
    }

    const fn open_mut(&mut self) -> Option<&mut OpenLine> {
        match &mut self.line {
            LineLife::Open(open) => Some(open),
            LineLife::Unopened | LineLife::Lost => None,
        }
    }

    pub(super) fn life(&self) -> TriggerLife {
        match (self.permit, self.open().map(|open| open.contact)) {
            (Permit::Refused, _) => TriggerLife::Refused,
            (_, None) => TriggerLife::Searching,
            (_, Some(SwitchContact::Released)) => TriggerLife::Released,
            (_, Some(SwitchContact::Firing(_))) => TriggerLife::Pressed,
            (_, Some(SwitchContact::Held(_))) => TriggerLife::Held,
        }
    }

    pub(super) fn counters(&self) -> TriggerCounters {
        let open = self.open().map_or(0, |o| o.debouncer.chatter());
        TriggerCounters { chatter: self.chatter + open, ..self.counters }
    }

    /// The kernel's edges carry no monotonic time: nothing fires any more.
    pub(super) fn refuse(&mut self, now: Time, cause: &str) {
        if self.permit != Permit::Refused {
            self.permit = Permit::Refused;
            self.stop_firing(now);
            self.fault(FaultChange::raised(now, Fault::TriggerClock, cause));
        }
    }

    /// The line was asked for at `asked`; it is open and at `level`.
    pub(super) fn opened(&mut self, asked: Time, now: Time, level: bool) {
        self.released(now);
        let debouncer = Debouncer::new(self.debounce_ns, level, now);
        let contact =
            if level { SwitchContact::Held(PressHold::since(now)) } else { SwitchContact::Released };
        let open = OpenLine { asked, since: now, strange: 0, debouncer, mismatch: None, contact };
        self.counters.opened += 1;
        if let LineLife::Lost = std::mem::replace(&mut self.line, LineLife::Open(open)) {
            self.fault(FaultChange::cleared(now, Fault::TriggerLost));
        }
    }

    /// The line is gone, or cannot be opened. Whatever fires stops.
    pub(super) fn lost(&mut self, now: Time, cause: &str) {
        self.released(now);
        self.chatter += self.open().map_or(0, |o| o.debouncer.chatter());
        match std::mem::replace(&mut self.line, LineLife::Lost) {
            LineLife::Lost => {}
            LineLife::Unopened | LineLife::Open(_) => {
                self.fault(FaultChange::raised(now, Fault::TriggerLost, cause));
            }
        }
    }

    /// The interlock closed or opened.
    pub(super) fn arm(&mut self, now: Time, armed: bool) {
        if self.permit != Permit::Refused {
            self.permit = if armed { Permit::Armed } else { Permit::Disarmed };
        }
        if !armed {
            self.stop_firing(now);
        }
    }

    /// An edge, read at `now`.
    pub(super) fn edge(&mut self, now: Time, time: Time, level: bool) {
        let Some(open) = self.open_mut() else { return };
        let outside_ns = open.asked.ns_since(time).max(time.ns_since(now));
        if outside_ns > CLOCK_SLACK_NS {
            self.strange(now, time, outside_ns);
            return;
        }
        open.strange = 0;
        // It is in the level that was read. Where it is not, that is told as an edge lost: no shot comes of a doubt.
        if time < open.since {
            return;
        }
        open.mismatch = None;
        let mut changes = Vec::new();
        open.debouncer.edge(time, level, |t, pressed| changes.push((t, pressed)));
        self.changed(&changes);
    }

    /// An edge whose time lies outside of what is possible: it does not count, and another clock is refused.
    fn strange(&mut self, now: Time, time: Time, outside_ns: i64) {
        let Some(open) = self.open_mut() else { return };
        open.strange += 1;
        if outside_ns < CLOCK_GROSS_NS && open.strange < STRANGE_EDGES {
            return;
        }
        let (time, asked, now_ns) = (time.ns(), open.asked.ns(), now.ns());
        let cause = format!(
            "an edge read at {now_ns} ns carries the time {time} ns, its line was asked for at {asked} ns: not CLOCK_MONOTONIC; \
             Linux 5.7 or newer is needed"
        );
        self.refuse(now, &cause);
    }

    /// The line's level, read at `now` when all edges were taken in.
    pub(super) fn level(&mut self, now: Time, level: bool) {
        let Some(open) = self.open_mut() else { return };
        if open.debouncer.level() == level {
            open.mismatch = None;
            return;
        }
        let since = *open.mismatch.get_or_insert(now);
        if now.ns_since(since) < RECHECK_NS {
            return;
        }
        open.mismatch = None;
        open.debouncer.correct(now, level);
        let was = open.contact;
        if level && was == SwitchContact::Released {
            open.contact = SwitchContact::Held(PressHold::since(now));
        }
        self.counters.overruns += 1;
        let cause = if level {
            "the trigger is pressed and no edge told so: not counted as a shot"
        } else {
            "the trigger is released and no edge told so"
        };
        self.fault(FaultChange::noted(now, Fault::TriggerOverrun, cause));
        if !level {
            self.released(now);
        }
    }

    /// Time has come to `now`.
    pub(super) fn tick(&mut self, now: Time) {
        let stuck_after_ns = self.stuck_after_ns;
        let Some(open) = self.open_mut() else { return };
        let mut changes = Vec::new();
        open.debouncer.settle(now, |t, pressed| changes.push((t, pressed)));
        self.changed(&changes);
        let Some(open) = self.open_mut() else { return };
        if let SwitchContact::Firing(hold) | SwitchContact::Held(hold) = &mut open.contact
            && !hold.stuck
            && now.ns_since(hold.since) > stuck_after_ns
        {
            hold.stuck = true;
            let held_s = now.secs_since(hold.since);
            let cause = format!("the trigger has been held for {held_s:.1} s: release it");
            self.fault(FaultChange::raised(now, Fault::TriggerStuck, cause));
        }
    }

    /// When the level is to be read and [`Self::tick`] called at the latest, where that is soon.
    pub(super) fn deadline(&self) -> Option<Time> {
        let open = self.open()?;
        let recheck = open.mismatch.map(|since| since.plus_ns(RECHECK_NS));
        recheck.into_iter().chain(open.debouncer.deadline()).min()
    }

    fn changed(&mut self, changes: &[(Time, bool)]) {
        for &(time, pressed) in changes {
            if !pressed {
                self.released(time);
                continue;
            }
            let may_fire = self.permit == Permit::Armed;
            let Some(open) = self.open_mut() else { return };
            let hold = PressHold::since(time);
            if may_fire {
                open.contact = SwitchContact::Firing(hold);
                self.counters.presses += 1;
                self.out.push(SwitchOutput::Edge(TriggerEdge { time, pressed: true }));
            } else {
                open.contact = SwitchContact::Held(hold);
                self.counters.withheld += 1;
            }
        }
    }

    /// What fires stops, and counts no more before it was released.
    fn stop_firing(&mut self, time: Time) {
        if let Some(open) = self.open_mut()
            && let SwitchContact::Firing(hold) = open.contact
        {
            open.contact = SwitchContact::Held(hold);
            self.out.push(SwitchOutput::Edge(TriggerEdge { time, pressed: false }));
        }
    }

    fn released(&mut self, time: Time) {
        self.stop_firing(time);
        let Some(open) = self.open_mut() else { return };
        if let SwitchContact::Held(PressHold { stuck: true, .. }) =
            std::mem::replace(&mut open.contact, SwitchContact::Released)
        {
            self.fault(FaultChange::cleared(time, Fault::TriggerStuck));
        }
    }

    fn fault(&mut self, change: FaultChange) {
        self.out.push(SwitchOutput::Fault(change));
    }
}

#[cfg(test)]
mod tests {
    use bowwave_core::fault::Change;
    use proptest::prelude::*;

    use super::*;

    const MS: i64 = 1_000_000;

    fn at(ms: i64) -> Time {
        Time::from_ns(ms * MS)
    }

    fn switch() -> Switch {
        let mut switch = Switch::new(15 * MS, 5000 * MS, true);
        switch.opened(at(0), at(0), false);
        switch
    }

    /// What came out: `P`ress or `R`elease with its time in milliseconds, or a fault.
    fn out(switch: &mut Switch) -> Vec<String> {
        let text = |output| match output {
            SwitchOutput::Edge(e) => format!("{}{}", if e.pressed { 'P' } else { 'R' }, e.time.ns() / MS),
            SwitchOutput::Fault(c) => match c.change {
                Change::Raised { .. } => format!("+{}", c.fault.code()),
                Change::Cleared => format!("-{}", c.fault.code()),
                Change::Noted { .. } => format!("!{}", c.fault.code()),
            },
        };
        switch.out().map(text).collect()
    }

    fn edge(switch: &mut Switch, ms: i64, level: bool) {
        switch.edge(at(ms), at(ms), level);
    }

    #[test]
    fn a_press_and_a_release_keep_the_kernels_times() {
        let mut s = switch();
        s.edge(at(107), at(100), true);
        assert_eq!(s.life(), TriggerLife::Pressed);
        edge(&mut s, 102, false);
        edge(&mut s, 103, true);
        s.tick(at(130));
        s.edge(at(400), at(390), false);
        s.tick(at(500));
        assert_eq!(out(&mut s), ["P100", "R390"]);
        assert_eq!((s.counters().presses, s.counters().chatter, s.life()), (1, 2, TriggerLife::Released));
    }

    #[test]
    fn what_is_held_at_the_start_fires_after_a_release() {
        let mut s = Switch::new(15 * MS, 5000 * MS, true);
        s.opened(at(0), at(0), true);
        assert_eq!(s.life(), TriggerLife::Held);
        edge(&mut s, 100, false);
        s.tick(at(120));
        edge(&mut s, 200, true);
        assert_eq!(out(&mut s), ["P200"]);
    }

    #[test]
    fn a_trigger_held_too_long_is_stuck_until_released() {
        let mut s = switch();
        edge(&mut s, 1000, true);
        s.tick(at(6000));
        assert_eq!(out(&mut s), ["P1000"]);
        s.tick(at(6001));
        s.tick(at(9000));
        edge(&mut s, 9500, false);
        assert_eq!(out(&mut s), ["+TRG_STUCK", "R9500", "-TRG_STUCK"]);
    }

    #[test]
    fn a_lost_press_is_no_shot_and_a_lost_release_is_one() {
        let mut s = switch();
        s.level(at(100), true);
        assert_eq!(out(&mut s), [""; 0], "the kernel's thread may be on its way");
        assert_eq!(s.deadline(), Some(at(105)));
        s.level(at(105), true);
        assert_eq!(out(&mut s), ["!TRG_OVERRUN"]);
        assert_eq!(s.life(), TriggerLife::Held);
        s.tick(at(200));
        edge(&mut s, 300, false);
        s.tick(at(400));
        edge(&mut s, 500, true);
        s.tick(at(600));
        s.level(at(700), false);
        s.level(at(706), false);
        assert_eq!(out(&mut s), ["P500", "!TRG_OVERRUN", "R706"]);
        assert_eq!((s.counters().overruns, s.counters().presses), (2, 1));
    }

    /// The kernel's queue holds 16 edges; what is lost within the window changes nothing where the end is the same.
    #[test]
    fn edges_lost_in_chatter_are_no_second_shot() {
        let mut s = switch();
        for n in 0..16 {
            edge(&mut s, 100 + n / 4, n % 2 == 0);
        }
        s.level(at(104), true);
        s.level(at(110), true);
        s.tick(at(200));
        assert_eq!(out(&mut s), ["P100", "!TRG_OVERRUN"]);
        assert_eq!(s.life(), TriggerLife::Pressed);
    }

    #[test]
    fn a_level_that_the_edge_confirms_is_no_loss() {
        let mut s = switch();
        s.level(at(100), true);
        s.edge(at(103), at(99), true);
        s.level(at(103), true);
        s.level(at(110), true);
        assert_eq!(out(&mut s), ["P99"]);
    }

    #[test]
    fn a_line_that_is_lost_stops_firing() {
        let mut s = switch();
        edge(&mut s, 100, true);
        s.lost(at(200), "gone");
        s.lost(at(300), "still gone");
        assert_eq!(out(&mut s), ["P100", "R200", "+TRG_LOST"]);
        s.opened(at(400), at(400), true);
        s.tick(at(500));
        assert_eq!(out(&mut s), ["-TRG_LOST"]);
        assert_eq!(s.life(), TriggerLife::Held);
    }

    #[test]
    fn without_the_interlock_nothing_fires() {
        let mut s = Switch::new(15 * MS, 5000 * MS, false);
        s.opened(at(0), at(0), false);
        edge(&mut s, 100, true);
        s.tick(at(120));
        s.arm(at(200), true);
        s.tick(at(300));
        assert_eq!(out(&mut s), [""; 0], "held while it was armed");
        edge(&mut s, 400, false);
        s.tick(at(420));
        edge(&mut s, 500, true);
        s.arm(at(600), false);
        edge(&mut s, 700, false);
        assert_eq!(out(&mut s), ["P500", "R600"]);
        assert_eq!(s.counters().withheld, 1);
    }

    #[test]
    fn times_of_another_clock_end_it_for_good() {
        for wrong_ms in [1_700_000_000_000, -5000] {
            let mut s = switch();
            edge(&mut s, 100, true);
            s.edge(at(200), at(wrong_ms), false);
            assert_eq!(out(&mut s), ["P100", "R200", "+TRG_CLOCK"]);
            edge(&mut s, 300, false);
            s.tick(at(400));
            edge(&mut s, 500, true);
            s.tick(at(600));
            assert_eq!(out(&mut s), [""; 0]);
            assert_eq!(s.life(), TriggerLife::Refused);
        }
    }

    /// The kernel keeps edges as soon as it has the line; reading the level after that may take a while.
    #[test]
    fn edges_from_before_the_level_was_read_are_in_it() {
        let mut s = Switch::new(15 * MS, 5000 * MS, true);
        s.opened(at(100), at(140), false);
        // A release that chatters: the press in it is none.
        for (ms, level) in [(110, false), (112, true), (113, false)] {
            s.edge(at(141), at(ms), level);
        }
        s.level(at(141), false);
        s.tick(at(200));
        assert_eq!((out(&mut s), s.life()), (vec![], TriggerLife::Released));
        edge(&mut s, 300, true);
        assert_eq!(out(&mut s), ["P300"]);
        // One that came after the level: it is there, and was not seen to come.
        s.opened(at(400), at(440), false);
        out(&mut s);
        s.edge(at(441), at(439), true);
        s.level(at(441), true);
        s.level(at(446), true);
        assert_eq!(out(&mut s), ["!TRG_OVERRUN"]);
        assert_eq!(s.life(), TriggerLife::Held);
    }

    #[test]
    fn a_clock_that_is_little_off_is_refused_after_several_edges() {
        let mut s = switch();
        edge(&mut s, 100, true);
        s.edge(at(200), at(-50), false);
        s.level(at(200), false);
        s.level(at(205), false);
        assert_eq!(out(&mut s), ["P100", "!TRG_OVERRUN", "R205"], "it stops all the same");
        edge(&mut s, 300, true);
        edge(&mut s, 400, false);
        s.tick(at(450));
        assert_eq!(out(&mut s), ["P300", "R400"]);
        for ms in [500, 510, 520] {
            s.edge(at(ms), at(ms + 50), ms != 510);
        }
        assert_eq!(out(&mut s), ["+TRG_CLOCK"]);
        assert_eq!(s.life(), TriggerLife::Refused);
    }

    proptest! {
        /// Whatever happens: presses and releases alternate, no press is invented, none comes while disarmed, lost or refused,
        /// and what fires stops with the line.
        #[test]
        fn no_phantom_shots(happenings in prop::collection::vec((0u8..7, 0i64..40, any::<bool>()), 0..300)) {
            let mut s = switch();
            let (mut ms, mut firing, mut armed, mut open) = (0, false, true, true);
            let mut press_edges = std::collections::HashSet::new();
            for (what, step, level) in happenings {
                ms += step;
                let mut may_fire = armed && open;
                match what {
                    0 | 1 => {
                        if level && open {
                            press_edges.insert(ms);
                        }
                        edge(&mut s, ms, level);
                    }
                    2 | 3 => s.level(at(ms), level),
                    4 => {
                        armed = level;
                        s.arm(at(ms), level);
                    }
                    5 => {
                        if level { s.opened(at(ms), at(ms), false) } else { s.lost(at(ms), "lost") }
                        open = level;
                        if !level { press_edges.clear(); }
                    }
                    _ => s.tick(at(ms)),
                }
                may_fire &= armed && open;
                for output in s.out() {
                    let SwitchOutput::Edge(e) = output else { continue };
                    prop_assert!(e.pressed != firing, "alternate");
                    firing = e.pressed;
                    if e.pressed {
                        prop_assert!(may_fire && press_edges.contains(&(e.time.ns() / MS)));
                    }
                }
                prop_assert!(!firing || (armed && open));
            }
        }
    }
}
