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

    /// Stops firing: the press counts no more before it was released.
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
mod tests;
