//! Next step of the thread that reads a line, as a function of what came over the line and of time.

use bowwave_core::{
    fault::{Fault, FaultChange},
    time::Time,
};

use super::{Baud, feed::LineKind};

/// Bytes without a packet for this long come at another rate...
const GARBLED_NS: i64 = 500_000_000;
/// ...or for this long, where the port sees broken bytes.
const GARBLED_FRAMING_NS: i64 = 150_000_000;

/// Next step of the reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LineAction {
    /// Go on.
    Keep,
    /// Set this rate.
    SetBaud(u32),
    /// Close the port and open it again.
    Reopen,
    /// Try the next port, where there is another: [`LineHealth::leave`].
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
struct OpenRate {
    /// When this rate was set.
    since: Time,
    opened: Time,
    /// When another port was last asked for, at first when this one was opened.
    roamed: Time,
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
pub(super) struct LineHealth {
    kind: &'static LineKind,
    rates: Vec<u32>,
    rate: usize,
    /// The rate that last proved right.
    good: Option<usize>,
    /// The rate that the scan looks at in turn with the good one.
    turn: usize,
    open: Option<OpenRate>,
    /// Why no samples come: the unit lost, or its rate wrong. One at a time.
    trouble: Option<Fault>,
    blocked: bool,
    /// Ports were left without a unit: bytes that are no packets then are another device's, and no wrong rate.
    astray: bool,
    changes: Vec<FaultChange>,
}

impl LineHealth {
    pub(super) fn new(baud: &Baud, kind: &'static LineKind) -> Self {
        let rates = baud.rates().to_vec();
        Self {
            kind,
            rates,
            rate: 0,
            good: None,
            turn: 0,
            open: None,
            trouble: None,
            blocked: false,
            astray: false,
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
            (Some(_), Some(fault)) if fault == self.kind.baud => LineStatus::Garbled,
            (Some(open), _) if open.last_bytes.is_none() || !open.proven => LineStatus::Listening,
            (Some(_), Some(_)) => LineStatus::Silent,
            (Some(_), None) => LineStatus::Streaming,
        }
    }

    /// No port could be opened.
    pub(super) fn absent(&mut self, now: Time, cause: &str) {
        self.open = None;
        self.unblock(now);
        self.trouble(now, self.kind.lost, cause);
    }

    /// A port was opened at [`Self::baud`].
    pub(super) fn opened(&mut self, now: Time) {
        self.open = Some(OpenRate::at(now));
    }

    /// The port does not take [`Self::baud`]: the next rate takes its place.
    pub(super) fn refused(&mut self, now: Time, cause: &str) {
        self.wrong_rate(now, cause);
        self.rotate();
    }

    /// The open port hung up or failed.
    pub(super) fn lost(&mut self, now: Time, cause: &str) {
        self.open = None;
        self.unblock(now);
        self.trouble(now, self.kind.lost, cause);
        self.rate = self.good.unwrap_or(0);
    }

    /// `bytes` came; `packets` were completed by them.
    pub(super) fn received(&mut self, now: Time, bytes: usize, packets: u64) {
        /// Packets that prove a rate.
        const PROOF: u64 = 2;
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
            self.astray = false;
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

    /// To be called often. `roam`: another port may be the right one, as long as no unit answered on this one.
    pub(super) fn tick(&mut self, now: Time, roam: bool) -> LineAction {
        /// A port that says it can be read and gives nothing for this long is opened anew.
        const SPURIOUS_NS: i64 = 150_000_000;
        let Some(open) = self.open else { return LineAction::Keep };
        if open.spurious.is_some_and(|since| now.ns_since(since) >= SPURIOUS_NS) {
            if !std::mem::replace(&mut self.blocked, true) {
                let cause = "the port says that bytes wait and gives none; it is opened anew";
                self.changes.push(FaultChange::raised(now, self.kind.blocked, cause));
            }
            self.open = None;
            return LineAction::Reopen;
        }
        if roam
            && !open.proven
            && now.ns_since(open.roamed) >= self.roam_ns(&open)
            && let Some(open) = &mut self.open
        {
            open.roamed = now;
            return LineAction::NextPort;
        }
        let silent_ns = now.ns_since(open.last_bytes.unwrap_or(open.opened));
        if open.scanning { self.scan(now, &open, silent_ns) } else { self.watch(now, &open, silent_ns) }
    }

    /// The open port is left for another one.
    pub(super) fn leave(&mut self, now: Time) {
        let cause = format!("no packet of the {} on this port; the next one is tried", self.kind.name);
        self.trouble(now, self.kind.lost, &cause);
        (self.open, self.rate, self.turn, self.astray) = (None, self.good.unwrap_or(0), 0, true);
    }

    /// Long enough for every rate, where something comes at all.
    fn roam_ns(&self, open: &OpenRate) -> i64 {
        let rates = i64::try_from(self.rates.len()).unwrap_or(1);
        if open.last_bytes.is_none() {
            self.kind.roam_ns
        } else {
            self.kind.roam_ns.max(GARBLED_NS + rates * self.kind.dwell_ns)
        }
    }

    fn watch(&mut self, now: Time, open: &OpenRate, silent_ns: i64) -> LineAction {
        /// A single byte of noise is no rate.
        const GARBLED_BYTES_MIN: u64 = 32;
        /// Broken bytes that are a sign of another rate, at least an eighth of all.
        const FRAMING_SHARE: u64 = 8;
        if silent_ns >= self.kind.silent_ns {
            if let Some(open) = &mut self.open {
                (open.garbage, open.garbage_bytes) = (None, 0);
            }
            self.trouble(
                now,
                self.kind.lost,
                &format!("the line is silent: is the {} powered, is its output on?", self.kind.name),
            );
            return LineAction::Keep;
        }
        let Some(since) = open.garbage else { return LineAction::Keep };
        let framing = open.framing.saturating_mul(FRAMING_SHARE) >= open.garbage_bytes;
        let wait_ns = if framing { GARBLED_FRAMING_NS } else { GARBLED_NS };
        if now.ns_since(since) < wait_ns || open.garbage_bytes < GARBLED_BYTES_MIN {
            return LineAction::Keep;
        }
        let baud = self.baud();
        let cause = if self.rates.len() > 1 {
            format!("bytes come that are no packets at {baud} baud; other rates are tried")
        } else {
            format!("bytes come that are no packets at {baud} baud; set its rate in the configuration")
        };
        self.wrong_rate(now, &cause);
        if let Some(open) = &mut self.open {
            open.scanning = true;
        }
        self.next_rate(now)
    }

    fn scan(&mut self, now: Time, open: &OpenRate, silent_ns: i64) -> LineAction {
        if silent_ns >= self.kind.dead_ns {
            self.trouble(
                now,
                self.kind.lost,
                &format!("the line fell silent; is the {} powered?", self.kind.name),
            );
            if let Some(open) = &mut self.open {
                open.scanning = false;
            }
            let home = self.good.unwrap_or(0);
            return if home == self.rate { LineAction::Keep } else { self.set(now, home) };
        }
        if now.ns_since(open.since) >= self.kind.dwell_ns { self.next_rate(now) } else { LineAction::Keep }
    }

    fn next_rate(&mut self, now: Time) -> LineAction {
        if self.rates.len() < 2 {
            return LineAction::Keep;
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

    fn set(&mut self, now: Time, rate: usize) -> LineAction {
        self.rate = rate;
        if let Some(open) = &mut self.open {
            *open = OpenRate {
                opened: open.opened,
                roamed: open.roamed,
                last_bytes: open.last_bytes,
                scanning: open.scanning,
                ..OpenRate::at(now)
            };
        }
        LineAction::SetBaud(self.baud())
    }

    fn wrong_rate(&mut self, now: Time, cause: &str) {
        if !self.astray {
            self.trouble(now, self.kind.baud, cause);
        }
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
            self.changes.push(FaultChange::cleared(now, self.kind.blocked));
        }
    }
}

impl OpenRate {
    const fn at(now: Time) -> Self {
        Self {
            since: now,
            opened: now,
            roamed: now,
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
mod tests;
