//! What the thread that reads the inertial unit does next, as a function of what came over the line and of time.

use bowwave_core::{
    fault::{Fault, FaultChange},
    time::Time,
};

use super::Baud;

/// A line that carries nothing for this long is silent.
pub(super) const SILENT_NS: i64 = 100_000_000;
/// Bytes without a packet for this long come at another rate...
const GARBLED_NS: i64 = 500_000_000;
/// ...or for this long, where the port sees broken bytes.
const GARBLED_FRAMING_NS: i64 = 150_000_000;
/// A single byte of noise is no rate.
const GARBLED_BYTES_MIN: u64 = 32;
/// Broken bytes that are a sign of another rate, at least an eighth of all.
const FRAMING_SHARE: u64 = 8;
/// How long a rate is tried: several packets of a unit that sends 40 a second.
const DWELL_NS: i64 = 300_000_000;
/// A line silent for this long during the scan is not garbled but dead.
const DEAD_NS: i64 = 1_000_000_000;
/// Packets that prove a rate.
const PROOF: u64 = 2;
/// A port that says it can be read and gives nothing for this long is opened anew.
const SPURIOUS_NS: i64 = 150_000_000;
/// How long a port is listened to, where any port may be the right one, before the next one is tried.
const ROAM_NS: i64 = 1_500_000_000;

/// What the reader is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Action {
    /// Go on.
    Keep,
    /// Set this rate.
    SetBaud(u32),
    /// Close the port and open it again.
    Reopen,
    /// Close the port and try the next one.
    NextPort,
}

/// How the line does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LineStatus {
    /// No port is open: none fits, or it may not be opened. It is looked for.
    #[default]
    Searching,
    /// The port is open; no packet came yet.
    Listening,
    /// Packets come.
    Streaming,
    /// The port is open and carries nothing.
    Silent,
    /// Bytes come that are no packets: other rates are tried, where there are any.
    Garbled,
    /// [`ImuPort::stop`](super::ImuPort::stop) ended it, or the thread broke down.
    Stopped,
}

#[derive(Clone, Copy, Debug)]
struct Open {
    /// When this rate was set.
    since: Time,
    opened: Time,
    last_bytes: Option<Time>,
    /// When bytes began that were followed by no packet.
    garbage: Option<Time>,
    garbage_bytes: u64,
    framing: u64,
    packets: u64,
    proven: bool,
    scanning: bool,
    spurious: Option<Time>,
}

/// The line's health. Changes of faults are collected for the caller to fetch.
#[derive(Debug)]
pub(super) struct Health {
    rates: Vec<u32>,
    rate: usize,
    /// The rate that last proved right.
    good: Option<usize>,
    /// The rate that the scan looks at in turn with the good one.
    turn: usize,
    open: Option<Open>,
    /// Why no samples come: the unit lost, or its rate wrong. One at a time.
    trouble: Option<Fault>,
    blocked: bool,
    changes: Vec<FaultChange>,
}

impl Health {
    pub(super) fn new(baud: &Baud) -> Self {
        let rates = baud.rates().to_vec();
        Self {
            rates,
            rate: 0,
            good: None,
            turn: 0,
            open: None,
            trouble: None,
            blocked: false,
            changes: Vec::new(),
        }
    }

    /// The rate in use, or to be used next.
    pub(super) fn baud(&self) -> u32 {
        self.rates.get(self.rate).copied().unwrap_or_default()
    }

    pub(super) fn changes(&mut self) -> impl Iterator<Item = FaultChange> + '_ {
        self.changes.drain(..)
    }

    pub(super) fn status(&self) -> LineStatus {
        match (&self.open, self.trouble) {
            (None, _) => LineStatus::Searching,
            (Some(_), Some(Fault::ImuBaud)) => LineStatus::Garbled,
            (Some(open), _) if open.last_bytes.is_none() || !open.proven => LineStatus::Listening,
            (Some(_), Some(_)) => LineStatus::Silent,
            (Some(_), None) => LineStatus::Streaming,
        }
    }

    /// No port could be opened.
    pub(super) fn absent(&mut self, now: Time, cause: &str) {
        self.open = None;
        self.unblock(now);
        self.trouble(now, Fault::ImuLost, cause);
    }

    /// A port was opened at [`Self::baud`].
    pub(super) fn opened(&mut self, now: Time) {
        self.open = Some(Open::at(now));
    }

    /// The port does not take [`Self::baud`]: the next rate takes its place.
    pub(super) fn refused(&mut self, now: Time, cause: &str) {
        self.trouble(now, Fault::ImuBaud, cause);
        self.rotate();
    }

    /// The open port hung up or failed.
    pub(super) fn lost(&mut self, now: Time, cause: &str) {
        self.open = None;
        self.unblock(now);
        self.trouble(now, Fault::ImuLost, cause);
        self.rate = self.good.unwrap_or(0);
    }

    /// `bytes` came; `packets` were completed by them.
    pub(super) fn received(&mut self, now: Time, bytes: usize, packets: u64) {
        let Some(open) = &mut self.open else { return };
        open.last_bytes = Some(now);
        open.spurious = None;
        if packets == 0 {
            open.garbage.get_or_insert(now);
            open.garbage_bytes = open.garbage_bytes.saturating_add(bytes as u64);
        } else {
            (open.garbage, open.garbage_bytes, open.framing) = (None, 0, 0);
            open.packets = open.packets.saturating_add(packets);
        }
        if open.packets >= PROOF {
            (open.proven, open.scanning) = (true, false);
            self.good = Some(self.rate);
            if packets > 0
                && let Some(fault) = self.trouble.take()
            {
                self.changes.push(FaultChange::cleared(now, fault));
            }
        }
        self.unblock(now);
    }

    /// The port counted `errors` more broken bytes.
    pub(super) fn framing(&mut self, errors: u32) {
        if let Some(open) = &mut self.open {
            open.framing = open.framing.saturating_add(u64::from(errors));
        }
    }

    /// The port says that it can be read, and gives nothing.
    pub(super) fn spurious(&mut self, now: Time) {
        if let Some(open) = &mut self.open {
            open.spurious.get_or_insert(now);
        }
    }

    /// To be called often. `roam`: any port may be the right one, and there are others.
    pub(super) fn tick(&mut self, now: Time, roam: bool) -> Action {
        let Some(open) = self.open else { return Action::Keep };
        if open.spurious.is_some_and(|since| now.ns_since(since) >= SPURIOUS_NS) {
            if !std::mem::replace(&mut self.blocked, true) {
                let cause = "the port says that bytes wait and gives none; it is opened anew";
                self.changes.push(FaultChange::raised(now, Fault::ImuBlocked, cause));
            }
            self.open = None;
            return Action::Reopen;
        }
        if roam && self.good.is_none() && now.ns_since(open.opened) >= self.roam_ns(&open) {
            self.trouble(
                now,
                Fault::ImuLost,
                "no packet of an inertial unit on this port; the next one is tried",
            );
            (self.open, self.rate, self.turn) = (None, 0, 0);
            return Action::NextPort;
        }
        let silent_ns = now.ns_since(open.last_bytes.unwrap_or(open.opened));
        if open.scanning { self.scan(now, &open, silent_ns) } else { self.watch(now, &open, silent_ns) }
    }

    /// Long enough for every rate, where something comes at all.
    fn roam_ns(&self, open: &Open) -> i64 {
        let rates = i64::try_from(self.rates.len()).unwrap_or(1);
        if open.last_bytes.is_none() { ROAM_NS } else { ROAM_NS.max(GARBLED_NS + rates * DWELL_NS) }
    }

    fn watch(&mut self, now: Time, open: &Open, silent_ns: i64) -> Action {
        if silent_ns >= SILENT_NS {
            if let Some(open) = &mut self.open {
                (open.garbage, open.garbage_bytes) = (None, 0);
            }
            self.trouble(now, Fault::ImuLost, "the line is silent: is the unit powered, is its output on?");
            return Action::Keep;
        }
        let Some(since) = open.garbage else { return Action::Keep };
        let framing = open.framing.saturating_mul(FRAMING_SHARE) >= open.garbage_bytes;
        let wait_ns = if framing { GARBLED_FRAMING_NS } else { GARBLED_NS };
        if now.ns_since(since) < wait_ns || open.garbage_bytes < GARBLED_BYTES_MIN {
            return Action::Keep;
        }
        let baud = self.baud();
        let cause = if self.rates.len() > 1 {
            format!("bytes come that are no packets at {baud} baud; other rates are tried")
        } else {
            format!("bytes come that are no packets at {baud} baud; set the unit's rate in the configuration")
        };
        self.trouble(now, Fault::ImuBaud, &cause);
        if let Some(open) = &mut self.open {
            open.scanning = true;
        }
        self.next_rate(now)
    }

    fn scan(&mut self, now: Time, open: &Open, silent_ns: i64) -> Action {
        if silent_ns >= DEAD_NS {
            self.trouble(now, Fault::ImuLost, "the line fell silent; is the unit powered?");
            if let Some(open) = &mut self.open {
                open.scanning = false;
            }
            let home = self.good.unwrap_or(0);
            return if home == self.rate { Action::Keep } else { self.set(now, home) };
        }
        if now.ns_since(open.since) >= DWELL_NS { self.next_rate(now) } else { Action::Keep }
    }

    fn next_rate(&mut self, now: Time) -> Action {
        if self.rates.len() < 2 {
            return Action::Keep;
        }
        let next = self.rotate();
        self.set(now, next)
    }

    /// The next rate: the others in turn, and after each of them the one that was right before, because a fault on the line
    /// is likelier than a unit that changed its rate.
    fn rotate(&mut self) -> usize {
        let count = self.rates.len().max(1);
        self.rate = match self.good {
            Some(good) if self.rate != good => good,
            good => {
                self.turn = (self.turn + 1) % count;
                if Some(self.turn) == good {
                    self.turn = (self.turn + 1) % count;
                }
                self.turn
            }
        };
        self.rate
    }

    fn set(&mut self, now: Time, rate: usize) -> Action {
        self.rate = rate;
        if let Some(open) = &mut self.open {
            *open = Open {
                opened: open.opened,
                last_bytes: open.last_bytes,
                scanning: open.scanning,
                ..Open::at(now)
            };
        }
        Action::SetBaud(self.baud())
    }

    fn trouble(&mut self, now: Time, fault: Fault, cause: &str) {
        if self.trouble == Some(fault) {
            return;
        }
        if let Some(other) = self.trouble.replace(fault) {
            self.changes.push(FaultChange::cleared(now, other));
        }
        self.changes.push(FaultChange::raised(now, fault, cause));
    }

    fn unblock(&mut self, now: Time) {
        if std::mem::take(&mut self.blocked) {
            self.changes.push(FaultChange::cleared(now, Fault::ImuBlocked));
        }
    }
}

impl Open {
    const fn at(now: Time) -> Self {
        Self {
            since: now,
            opened: now,
            last_bytes: None,
            garbage: None,
            garbage_bytes: 0,
            framing: 0,
            packets: 0,
            proven: false,
            scanning: false,
            spurious: None,
        }
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

    /// A line with a unit that sends 200 packets of 50 bytes a second at `unit_baud`, stepped every 5 ms.
    struct Rig {
        health: Health,
        now_ms: i64,
        unit_baud: Option<u32>,
        garbage: bool,
        framing: bool,
        log: Vec<(i64, String)>,
        set: Vec<u32>,
    }

    impl Rig {
        fn new(baud: Baud, unit_baud: Option<u32>) -> Self {
            let mut health = Health::new(&baud);
            health.opened(at(0));
            Self {
                health,
                now_ms: 0,
                unit_baud,
                garbage: false,
                framing: false,
                log: Vec::new(),
                set: Vec::new(),
            }
        }

        fn run(&mut self, ms: i64) {
            for _ in 0..ms / 5 {
                self.now_ms += 5;
                let now = at(self.now_ms);
                if self.garbage {
                    self.health.received(now, 50, 0);
                } else if let Some(baud) = self.unit_baud {
                    let right = baud == self.health.baud();
                    self.health.received(now, 50, u64::from(right));
                    if !right && self.framing {
                        self.health.framing(20);
                    }
                }
                if let Action::SetBaud(baud) = self.health.tick(now, false) {
                    self.set.push(baud);
                }
                self.fetch();
            }
        }

        fn fetch(&mut self) {
            for c in self.health.changes() {
                let sign = if c.change == Change::Cleared { '-' } else { '+' };
                self.log.push((self.now_ms, format!("{sign}{}", c.fault.code())));
            }
        }

        fn codes(&self) -> Vec<&str> {
            self.log.iter().map(|(_, code)| code.as_str()).collect()
        }
    }

    #[test]
    fn the_right_rate_raises_nothing() {
        let mut rig = Rig::new(Baud::Fixed(115_200), Some(115_200));
        rig.run(3000);
        assert_eq!(rig.codes(), [""; 0]);
        assert_eq!(rig.health.status(), LineStatus::Streaming);
    }

    #[test]
    fn a_wrong_rate_is_told_after_500_ms_and_the_right_one_is_found_and_kept() {
        for (unit, framing) in [(9_600, false), (460_800, false), (460_800, true)] {
            let mut rig = Rig::new(Baud::default(), Some(unit));
            rig.framing = framing;
            rig.run(4000);
            assert_eq!(rig.codes(), ["+IMU_BAUD", "-IMU_BAUD"], "{unit}");
            let told = rig.log.first().map(|l| l.0).unwrap();
            assert!(if framing { told <= 160 } else { (500..=510).contains(&told) }, "{told}");
            assert_eq!((rig.health.baud(), rig.health.status()), (unit, LineStatus::Streaming));
            let sets = rig.set.len();
            rig.run(5000);
            assert_eq!(rig.set.len(), sets, "no more changes");
        }
    }

    #[test]
    fn a_fixed_rate_is_not_changed() {
        let mut rig = Rig::new(Baud::Fixed(115_200), Some(9_600));
        rig.run(3000);
        assert_eq!(rig.codes(), ["+IMU_BAUD"]);
        assert!(rig.set.is_empty());
        rig.unit_baud = Some(115_200);
        rig.run(20);
        assert_eq!(rig.codes(), ["+IMU_BAUD", "-IMU_BAUD"]);
    }

    /// After a burst of garbage the rate that was right is looked at every other time.
    #[test]
    fn a_long_burst_of_garbage_does_not_lose_the_rate() {
        let mut rig = Rig::new(Baud::default(), Some(230_400));
        rig.run(4000);
        for burst_ms in [200, 700, 1100, 2500, 60_000] {
            rig.garbage = true;
            rig.run(burst_ms);
            rig.garbage = false;
            rig.run(620);
            assert_eq!(
                (rig.health.baud(), rig.health.status()),
                (230_400, LineStatus::Streaming),
                "{burst_ms} ms"
            );
        }
    }

    #[test]
    fn silence_is_told_after_100_ms_and_ends_with_the_first_packet() {
        let mut rig = Rig::new(Baud::default(), Some(115_200));
        rig.run(1000);
        rig.unit_baud = None;
        rig.run(300);
        assert_eq!(rig.log, [(1100, "+IMU_LOST".to_owned())]);
        assert_eq!(rig.health.status(), LineStatus::Silent);
        rig.unit_baud = Some(115_200);
        rig.run(5);
        assert_eq!(rig.codes(), ["+IMU_LOST", "-IMU_LOST"]);
        assert!(rig.set.is_empty(), "silence is no reason to change the rate");
    }

    /// A unit without power and one that is switched off during the scan: lost, not at another rate.
    #[test]
    fn silence_is_no_wrong_rate() {
        let mut rig = Rig::new(Baud::default(), None);
        rig.run(3000);
        assert_eq!(rig.codes(), ["+IMU_LOST"]);
        let mut rig = Rig::new(Baud::default(), Some(19_200));
        rig.run(1000);
        rig.unit_baud = None;
        rig.run(2000);
        assert_eq!(rig.codes(), ["+IMU_BAUD", "-IMU_BAUD", "+IMU_LOST"]);
        assert_eq!(rig.health.baud(), 115_200);
    }

    #[test]
    fn a_port_that_lies_about_bytes_is_opened_anew() {
        let mut health = Health::new(&Baud::Fixed(9_600));
        health.opened(at(0));
        health.spurious(at(10));
        assert_eq!(health.tick(at(20), false), Action::Keep);
        health.received(at(30), 50, 2);
        health.spurious(at(40));
        assert_eq!(health.tick(at(180), false), Action::Keep);
        assert_eq!(health.tick(at(190), false), Action::Reopen);
        let raised: Vec<_> = health.changes().map(|c| c.fault).collect();
        assert_eq!(raised, [Fault::ImuLost, Fault::ImuBlocked], "nothing came, and why");
        health.opened(at(300));
        health.received(at(310), 50, 2);
        let cleared: Vec<_> = health.changes().map(|c| (c.fault, c.change)).collect();
        assert_eq!(cleared, [(Fault::ImuLost, Change::Cleared), (Fault::ImuBlocked, Change::Cleared)]);
    }

    #[test]
    fn where_any_port_may_be_it_the_next_one_is_tried() {
        let mut health = Health::new(&Baud::default());
        health.opened(at(0));
        assert_eq!(health.tick(at(1400), true), Action::Keep);
        assert_eq!(health.tick(at(1500), true), Action::NextPort);
        health.opened(at(1600));
        health.received(at(1700), 100, 2);
        assert_eq!(health.tick(at(9000), true), Action::Keep, "the unit was here");
    }

    proptest! {
        /// Whatever happens, at most one of "lost" and "rate" is there, each is raised and cleared in turn, and a unit that
        /// sends at a rate of the list streams within a full scan.
        #[test]
        fn faults_alternate_and_the_unit_is_found(
            happenings in prop::collection::vec((0u8..5, 1i64..200, 0u64..3), 0..200),
        ) {
            let mut health = Health::new(&Baud::Scan(vec![1, 2, 3]));
            let mut active = std::collections::HashSet::new();
            let mut now_ms = 0;
            let mut follow = |health: &mut Health| {
                for c in health.changes() {
                    let fresh = if c.change == Change::Cleared { active.remove(&c.fault) } else { active.insert(c.fault) };
                    assert!(fresh, "{c:?}");
                }
                assert!(!(active.contains(&Fault::ImuLost) && active.contains(&Fault::ImuBaud)));
            };
            for (what, ms, packets) in happenings {
                now_ms += ms;
                let now = at(now_ms);
                match what {
                    0 => health.opened(now),
                    1 => health.lost(now, "lost"),
                    2 => health.absent(now, "absent"),
                    3 => health.spurious(now),
                    _ => health.received(now, 40, packets),
                }
                health.tick(now, false);
                follow(&mut health);
            }
            health.opened(at(now_ms));
            for _ in 0..600 {
                now_ms += 5;
                let packets = u64::from(health.baud() == 3);
                health.received(at(now_ms), 50, packets);
                health.tick(at(now_ms), false);
                follow(&mut health);
            }
            prop_assert_eq!(health.status(), LineStatus::Streaming);
            prop_assert!(active.is_empty());
        }
    }
}
