//! The two inputs that keep watch: the inert interlock and the power supply's warning.

use bowwave_core::{
    fault::{Fault, FaultChange},
    time::Time,
};

/// The interlock must be closed for this long before the trainer arms.
const ARM_NS: i64 = 50_000_000;
/// The supply must be well for this long before the warning ends.
const POWER_NS: i64 = 1_000_000_000;

/// The interlock: active means that the gun is inert. It arms late and disarms at once.
#[derive(Debug)]
pub(super) struct Interlock {
    /// Since when the line has been active without an interruption.
    active: Option<Time>,
    armed: bool,
    raised: bool,
    out: Vec<FaultChange>,
}

impl Interlock {
    /// Not armed, and says so, until the line has shown otherwise.
    pub(super) fn new(now: Time) -> Self {
        let mut interlock = Self { active: None, armed: false, raised: false, out: Vec::new() };
        interlock.disarm(now, "the interlock has not been read yet");
        interlock
    }

    pub(super) fn out(&mut self) -> impl Iterator<Item = FaultChange> + '_ {
        self.out.drain(..)
    }

    pub(super) const fn armed(&self) -> bool {
        self.armed
    }

    /// An edge to `level`. An edge to where the line already is comes of an interruption too short to be read.
    pub(super) fn edge(&mut self, now: Time, level: bool) {
        self.disarm(now, "the inert plug is out: the interlock's line is not active");
        self.active = level.then_some(now);
    }

    /// The line's level, read at `now`.
    pub(super) fn level(&mut self, now: Time, level: bool) {
        if !level {
            self.edge(now, false);
        } else if self.active.is_none() {
            self.active = Some(now);
        }
    }

    /// The line is gone.
    pub(super) fn lost(&mut self, now: Time, cause: &str) {
        self.disarm(now, cause);
        self.active = None;
    }

    /// Time has come to `now`.
    pub(super) fn tick(&mut self, now: Time) {
        if !self.armed && self.active.is_some_and(|since| now.ns_since(since) >= ARM_NS) {
            (self.armed, self.raised) = (true, false);
            self.out.push(FaultChange::cleared(now, Fault::NotInert));
        }
    }

    fn disarm(&mut self, now: Time, cause: &str) {
        self.armed = false;
        if !std::mem::replace(&mut self.raised, true) {
            self.out.push(FaultChange::raised(now, Fault::NotInert, cause));
        }
    }
}

/// The supply's warning: active means that power is about to fail.
#[derive(Debug, Default)]
pub(super) struct PowerSupply {
    raised: bool,
    good: Option<Time>,
    out: Vec<FaultChange>,
}

impl PowerSupply {
    pub(super) fn out(&mut self) -> impl Iterator<Item = FaultChange> + '_ {
        self.out.drain(..)
    }

    /// An edge to `level`, or that level read.
    pub(super) fn level(&mut self, now: Time, level: bool) {
        if !level {
            self.good.get_or_insert(now);
            return;
        }
        self.good = None;
        if !std::mem::replace(&mut self.raised, true) {
            self.out.push(FaultChange::raised(
                now,
                Fault::Brownout,
                "the power supply's warning line is active",
            ));
        }
    }

    /// The line is gone: a warning that was there stays.
    pub(super) fn lost(&mut self) {
        self.good = None;
    }

    /// Time has come to `now`.
    pub(super) fn tick(&mut self, now: Time) {
        if self.raised && self.good.is_some_and(|since| now.ns_since(since) >= POWER_NS) {
            self.raised = false;
            self.out.push(FaultChange::cleared(now, Fault::Brownout));
        }
    }
}

#[cfg(test)]
mod tests {
    use bowwave_core::fault::Change;

    use super::*;

    fn at(ms: i64) -> Time {
        Time::from_ns(ms * 1_000_000)
    }

    fn raised(changes: impl Iterator<Item = FaultChange>) -> Vec<bool> {
        changes.map(|c| matches!(c.change, Change::Raised { .. })).collect()
    }

    #[test]
    fn it_arms_after_50_ms_and_disarms_at_once() {
        let mut interlock = Interlock::new(at(0));
        assert_eq!(raised(interlock.out()), [true], "not armed from the beginning");
        interlock.level(at(10), true);
        interlock.tick(at(59));
        assert!(!interlock.armed());
        interlock.tick(at(60));
        assert!(interlock.armed());
        assert_eq!(raised(interlock.out()), [false]);
        interlock.edge(at(100), false);
        assert!(!interlock.armed());
        interlock.edge(at(101), true);
        interlock.level(at(102), true);
        interlock.tick(at(150));
        assert!(!interlock.armed());
        interlock.tick(at(151));
        assert!(interlock.armed());
        assert_eq!(raised(interlock.out()), [true, false]);
    }

    #[test]
    fn an_interruption_too_short_to_be_read_and_a_lost_line_disarm() {
        let mut interlock = Interlock::new(at(0));
        interlock.level(at(0), true);
        interlock.tick(at(50));
        interlock.edge(at(60), true);
        assert!(!interlock.armed());
        interlock.tick(at(110));
        assert!(interlock.armed());
        interlock.lost(at(120), "gone");
        assert!(!interlock.armed());
        interlock.tick(at(1000));
        assert!(!interlock.armed());
    }

    #[test]
    fn the_supply_warns_at_once_and_is_trusted_after_a_second() {
        let mut power = PowerSupply::default();
        power.level(at(0), false);
        power.tick(at(5000));
        power.level(at(6000), true);
        assert_eq!(raised(power.out()), [true]);
        power.level(at(6100), false);
        power.level(at(6500), true);
        power.level(at(6600), false);
        power.tick(at(7599));
        assert_eq!(raised(power.out()), [false; 0]);
        power.tick(at(7600));
        assert_eq!(raised(power.out()), [false]);
    }
}
