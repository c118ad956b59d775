//! Whether each injected fault was seen and ridden out.

use bowwave_core::{
    frame::scene::Status,
    time::{NS_PER_S, Time},
};
use hw_sim::fault::{Fault, FaultKind};

/// So long after a fault has gone all must be well again: the longest of the recovery times that are promised.
const RECOVERED_NS: i64 = NS_PER_S;

/// Follows a run with its planned faults.
#[derive(Debug)]
pub struct Recovery {
    origin: Time,
    /// By the time at which they must be over.
    faults: Vec<Fault>,
    next: usize,
    last_trouble: Option<Time>,
    /// Faults that were over in time to be judged.
    pub judged: u64,
    /// Of these, all was well in time after them.
    pub recovered: u64,
    /// Of these, that must not go unseen.
    pub to_be_seen: u64,
    /// Of these, those that the display told of.
    pub seen: u64,
}

impl Recovery {
    /// Nothing has happened since `origin`.
    pub fn new(origin: Time, mut faults: Vec<Fault>) -> Self {
        faults.sort_by_key(|f| f.from_ns.saturating_add(f.for_ns));
        Self { origin, faults, next: 0, last_trouble: None, judged: 0, recovered: 0, to_be_seen: 0, seen: 0 }
    }

    /// Takes in what the display says at `time`; times must not go back.
    pub fn frame(&mut self, time: Time, status: &Status) {
        let trouble = matches!(status, Status::NotScored { .. } | Status::Fault { .. });
        if trouble {
            self.last_trouble = Some(time);
        }
        while let Some(fault) = self.faults.get(self.next).copied() {
            let begun = self.origin.plus_ns(fault.from_ns);
            let due = begun.plus_ns(fault.for_ns).plus_ns(RECOVERED_NS);
            if time < due {
                break;
            }
            self.next += 1;
            self.judged += 1;
            self.recovered += u64::from(!trouble);
            if must_be_seen(fault) {
                self.to_be_seen += 1;
                self.seen += u64::from(self.last_trouble.is_some_and(|t| t >= begun));
            }
        }
    }
}

/// Faults that take the pose or the picture away for longer than the display may go on without saying so.
fn must_be_seen(fault: Fault) -> bool {
    let least_ns = match fault.kind {
        FaultKind::LineGarbage => return false,
        // Stuck numbers are noticed after 300 ms, and tell of themselves 100 ms later.
        FaultKind::ImuFreeze => 450_000_000,
        _ => 200_000_000,
    };
    fault.for_ns >= least_ns
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOST: Status = Status::NotScored { cause: "", action: "" };

    fn run(trouble_ms: std::ops::Range<i64>) -> (u64, u64, u64, u64) {
        let fault = Fault { kind: FaultKind::ImuDropOut, from_ns: NS_PER_S, for_ns: NS_PER_S };
        let mut recovery = Recovery::new(Time::from_ns(5), vec![fault]);
        for ms in (0..5000).step_by(33) {
            let status = if trouble_ms.contains(&ms) { &LOST } else { &Status::Ready };
            recovery.frame(Time::from_ns(5 + ms * 1_000_000), status);
        }
        (recovery.judged, recovery.recovered, recovery.to_be_seen, recovery.seen)
    }

    #[test]
    fn a_fault_is_to_be_seen_and_over_in_time() {
        assert_eq!(run(1100..2100), (1, 1, 1, 1));
        assert_eq!(run(1100..4000), (1, 0, 1, 1), "too late");
        assert_eq!(run(0..0), (1, 1, 1, 0), "nobody was told");
        assert_eq!(run(0..900), (1, 1, 1, 0), "trouble before it is not it");
    }
}
