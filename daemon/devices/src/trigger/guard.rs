//! The two inputs that keep watch: the inert interlock and the power supply's warning.

use bowwave_core::{
    fault::{Fault, FaultChange},
    time::Time,
};

/// The interlock must be closed for this long before the trainer arms.
const ARM_NS: i64 = 50_000_000;
/// The supply must be well for this long before the warning ends.
const POWER_NS: i64 = 1_000_000_000;

/// A contact of the interlock: whether it is active, and since when.
#[derive(Clone, Copy, Debug)]
struct Contact {
    active: bool,
    since: Time,
}

/// The interlock: active means that the gun is inert. It arms late and disarms at once. Two contacts that differ for too long are
/// believed no more before both have shown the plug out. A single one is believed once it has.
#[derive(Debug)]
pub(super) struct Interlock {
    /// Its contacts; `None` where one has not been read.
    contacts: Vec<Option<Contact>>,
    /// How long two may differ, nanoseconds.
    discrepancy_ns: i64,
    armed: bool,
    raised: bool,
    /// The contacts differed for too long.
    discrepant: bool,
    /// A shorted wire does not pass for the plug: there are two contacts, or the one has shown the plug out since the start.
    proven: bool,
    /// The test of the plug was asked for.
    asked: bool,
    out: Vec<FaultChange>,
}

impl Interlock {
    /// Of so many contacts. Not armed, and says so, until they have shown otherwise.
    pub(super) fn new(now: Time, contacts: usize, discrepancy_ns: i64) -> Self {
        let mut interlock = Self {
            contacts: vec![None; contacts],
            discrepancy_ns,
            armed: false,
            raised: false,
            discrepant: false,
            proven: contacts > 1,
            asked: false,
            out: Vec::new(),
        };
        interlock.disarm(now, "the interlock has not been read yet");
        interlock
    }

    pub(super) fn out(&mut self) -> impl Iterator<Item = FaultChange> + '_ {
        self.out.drain(..)
    }

    pub(super) const fn armed(&self) -> bool {
        self.armed
    }

    /// An edge of a contact to `level`. An edge to where it already is comes of an interruption too short to be read.
    pub(super) fn edge(&mut self, contact: usize, now: Time, level: bool) {
        self.disarm(now, "the inert plug is out: the interlock's line is not active");
        if let Some(contact) = self.contacts.get_mut(contact) {
            *contact = Some(Contact { active: level, since: now });
        }
    }

    /// A contact's level, read at `now`.
    pub(super) fn level(&mut self, contact: usize, now: Time, level: bool) {
        let known = self.contacts.get(contact).copied().flatten();
        if known.is_none_or(|known| known.active != level) {
            self.edge(contact, now, level);
        }
    }

    /// A contact's line is gone.
    pub(super) fn lost(&mut self, contact: usize, now: Time, cause: &str) {
        self.disarm(now, cause);
        if let Some(contact) = self.contacts.get_mut(contact) {
            *contact = None;
        }
    }

    /// Time has come to `now`.
    pub(super) fn tick(&mut self, now: Time) {
        let for_long = |c: &Contact| now.ns_since(c.since) >= ARM_NS;
        let all = |active: bool| {
            self.contacts.iter().all(|c| c.is_some_and(|c| c.active == active && for_long(&c)))
        };
        let (inert, out) = (all(true), all(false));
        if let [Some(first), Some(second)] = self.contacts[..]
            && first.active != second.active
            && now.ns_since(first.since.max(second.since)) >= self.discrepancy_ns
            && !std::mem::replace(&mut self.discrepant, true)
        {
            let which = if first.active { "second" } else { "first" };
            let cause = format!(
                "the interlock's contacts differ: the {which} one is not active, the other is; a wire is broken or shorted, look at the plug \
                 and its cable, then run `bowwave doctor interlock`"
            );
            self.out.push(FaultChange::raised(now, Fault::Interlock, cause));
        }
        if self.discrepant && out {
            self.discrepant = false;
            self.out.push(FaultChange::cleared(now, Fault::Interlock));
        }
        if out {
            self.proven = true;
            if std::mem::take(&mut self.asked) {
                self.out.push(FaultChange::cleared(now, Fault::InterlockUntested));
            }
        }
        if inert && !self.proven && !std::mem::replace(&mut self.asked, true) {
            let cause = "the interlock has one contact, which has not shown the plug out since the start: a shorted wire would look the same; \
                         pull the inert plug and fit it, or wire a second contact (interlock.second)";
            self.out.push(FaultChange::raised(now, Fault::InterlockUntested, cause));
        }
        if !self.armed && inert && self.proven && !self.discrepant {
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

    fn faults(interlock: &mut Interlock) -> Vec<Fault> {
        interlock.out().map(|c| c.fault).collect()
    }

    /// The plug goes in or out: each contact follows at its time, and 50 ms after the last one they are looked at.
    fn plug(interlock: &mut Interlock, fitted: bool, at_ms: &[i64]) {
        for (contact, ms) in (0..).zip(at_ms) {
            interlock.edge(contact, at(*ms), fitted);
        }
        interlock.tick(at(at_ms.iter().fold(0, |last, ms| last.max(*ms)) + 50));
    }

    /// One contact that has shown the plug out.
    fn tested(from: Time) -> Interlock {
        let mut interlock = Interlock::new(from, 1, 0);
        interlock.level(0, from, false);
        interlock.tick(from.plus_ns(ARM_NS));
        interlock
    }

    #[test]
    fn one_contact_arms_only_after_it_has_shown_the_plug_out() {
        let mut interlock = Interlock::new(at(0), 1, 0);
        interlock.level(0, at(0), true);
        interlock.tick(at(60_000));
        assert!(!interlock.armed(), "its wire may be shorted");
        assert_eq!(faults(&mut interlock), [Fault::NotInert, Fault::InterlockUntested]);
        interlock.edge(0, at(61_000), false);
        interlock.tick(at(61_049));
        assert_eq!(faults(&mut interlock), []);
        interlock.tick(at(61_050));
        assert_eq!(faults(&mut interlock), [Fault::InterlockUntested]);
        plug(&mut interlock, true, &[62_000]);
        assert!(interlock.armed());
        assert_eq!(faults(&mut interlock), [Fault::NotInert]);
    }

    #[test]
    fn it_arms_after_50_ms_and_disarms_at_once() {
        let mut interlock = tested(at(-100));
        assert_eq!(raised(interlock.out()), [true], "not armed from the beginning");
        interlock.level(0, at(10), true);
        interlock.tick(at(59));
        assert!(!interlock.armed());
        interlock.tick(at(60));
        assert!(interlock.armed());
        assert_eq!(raised(interlock.out()), [false]);
        interlock.edge(0, at(100), false);
        assert!(!interlock.armed());
        interlock.edge(0, at(101), true);
        interlock.level(0, at(102), true);
        interlock.tick(at(150));
        assert!(!interlock.armed());
        interlock.tick(at(151));
        assert!(interlock.armed());
        assert_eq!(raised(interlock.out()), [true, false]);
    }

    #[test]
    fn an_interruption_too_short_to_be_read_and_a_lost_line_disarm() {
        let mut interlock = tested(at(-100));
        interlock.level(0, at(0), true);
        interlock.tick(at(50));
        interlock.edge(0, at(60), true);
        assert!(!interlock.armed());
        interlock.tick(at(110));
        assert!(interlock.armed());
        interlock.lost(0, at(120), "gone");
        assert!(!interlock.armed());
        interlock.tick(at(1000));
        assert!(!interlock.armed());
    }

    #[test]
    fn two_contacts_arm_together_and_one_that_stays_behind_is_told_until_the_plug_was_out() {
        let mut interlock = Interlock::new(at(0), 2, 500_000_000);
        assert_eq!(raised(interlock.out()), [true]);
        interlock.level(0, at(0), true);
        interlock.tick(at(400));
        assert!(!interlock.armed(), "the other has not been read");
        interlock.level(1, at(400), true);
        interlock.tick(at(450));
        assert!(interlock.armed());
        assert_eq!(raised(interlock.out()), [false]);
        // Pulled: the first one is shorted and stays.
        interlock.edge(1, at(1000), false);
        assert!(!interlock.armed());
        interlock.tick(at(1499));
        assert_eq!(faults(&mut interlock), [Fault::NotInert]);
        interlock.tick(at(1500));
        assert_eq!(faults(&mut interlock), [Fault::Interlock]);
        // Fitted again: both say inert, and are not believed.
        interlock.edge(1, at(2000), true);
        interlock.tick(at(9000));
        assert!(!interlock.armed());
        assert_eq!(faults(&mut interlock), []);
        // Mended: both show the plug out, then in.
        plug(&mut interlock, false, &[10_000, 10_100]);
        assert_eq!(faults(&mut interlock), [Fault::Interlock]);
        plug(&mut interlock, true, &[11_000, 11_300]);
        assert!(interlock.armed());
        assert_eq!(faults(&mut interlock), [Fault::NotInert]);
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
