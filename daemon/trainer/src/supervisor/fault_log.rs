//! Where all reports of faults come together: what is active, and the log.

use bowwave_core::{
    event::Event,
    fault::{Fault, FaultBoard, FaultChange, LogEntry, LogEvent, Severity},
};

/// Keeps the board and writes the log.
#[derive(Debug, Default)]
pub struct FaultLog {
    board: FaultBoard,
    boot_id: String,
}

impl FaultLog {
    /// Nothing has happened in this boot.
    pub fn new(boot_id: Option<String>) -> Self {
        Self { board: FaultBoard::new(), boot_id: boot_id.unwrap_or_default() }
    }

    /// Takes in a change: a line to the log where it is one, and the event for the session.
    pub fn take(&mut self, change: FaultChange, events: &mut Vec<Event>) {
        self.tell(&change);
        events.push(Event::Fault(change));
    }

    /// Takes in a change that the session itself has found: a line to the log where it is one.
    pub fn tell(&mut self, change: &FaultChange) {
        if let Some(entry) = self.board.take(change) {
            self.log(&entry);
        }
    }

    /// Raises or clears `fault`, by whether there is a `cause`.
    pub fn set(&mut self, fault: Fault, cause: Option<String>, events: &mut Vec<Event>) {
        let now = bowwave_devices::clock::now();
        match cause {
            Some(cause) if !self.board.is_active(fault) => {
                self.take(FaultChange::raised(now, fault, cause), events)
            }
            None if self.board.is_active(fault) => self.take(FaultChange::cleared(now, fault), events),
            _ => {}
        }
    }

    /// Everything is looked at anew: the log is told that what there was is over.
    pub fn end_all(&mut self) {
        let mut nobody = Vec::new();
        for fault in self.board.active().collect::<Vec<_>>() {
            self.set(fault, None, &mut nobody);
        }
    }

    /// The warnings that are there.
    pub fn warnings(&self) -> impl Iterator<Item = Fault> + '_ {
        self.board.active().filter(|f| f.severity() == Severity::Warning)
    }

    /// How often each fault came or happened, those that never did left out.
    pub fn counts(&self) -> impl Iterator<Item = (&'static str, u64)> + '_ {
        Fault::ALL.into_iter().map(|f| (f.code(), self.board.times(f))).filter(|(_, n)| *n > 0)
    }

    fn log(&self, entry: &LogEntry) {
        let code = entry.fault.code();
        let boot = self.boot_id.as_str();
        let more = if entry.left_out > 0 {
            format!(" ({} lines of this left out)", entry.left_out)
        } else {
            String::new()
        };
        match &entry.what {
            LogEvent::Raised { cause } if entry.fault.severity() > Severity::Note => {
                log::error!(fault_code = code, fault_state = "raised", trainer_boot = boot; "{code} {cause}{more}");
            }
            LogEvent::Raised { cause } => {
                log::warn!(fault_code = code, fault_state = "raised", trainer_boot = boot; "{code} {cause}{more}");
            }
            LogEvent::Cleared { after_s } => {
                log::warn!(
                    fault_code = code, fault_state = "cleared", fault_seconds = after_s, trainer_boot = boot;
                    "{code} over after {after_s:.3} s{more}"
                );
            }
            LogEvent::Noted { cause } => {
                log::warn!(fault_code = code, fault_state = "noted", trainer_boot = boot; "{code} {cause}{more}");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_left_when_all_is_looked_at_anew() {
        let mut faults = FaultLog::new(None);
        let mut events = Vec::new();
        for fault in [Fault::Config, Fault::ImuLost] {
            faults.set(fault, Some("a".into()), &mut events);
        }
        faults.end_all();
        assert_eq!((faults.board.active().count(), events.len()), (0, 2));
    }

    #[test]
    fn the_session_hears_of_each_change_once() {
        let mut faults = FaultLog::new(None);
        let mut events = Vec::new();
        faults.set(Fault::DiskFull, Some("a".into()), &mut events);
        faults.set(Fault::DiskFull, Some("a".into()), &mut events);
        faults.set(Fault::DiskFull, None, &mut events);
        faults.set(Fault::DiskFull, None, &mut events);
        let time = bowwave_devices::clock::now();
        faults.take(FaultChange::noted(time, Fault::CamTimestamp, ""), &mut events);
        assert_eq!(events.len(), 3);
        assert_eq!(faults.counts().collect::<Vec<_>>(), [("DISK_FULL", 1), ("CAM_TS", 1)]);
    }
}
