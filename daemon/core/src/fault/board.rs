//! Which faults are active, and what the log is to be told of them.

use super::{Change, Fault, FaultChange, Severity};
use crate::time::{NS_PER_S, Time};

/// Within this time the log gets at most [`LINES_PER_WINDOW`] lines of one fault; the rest are counted.
const WINDOW_NS: i64 = 60 * NS_PER_S;
/// Lines of one fault within the window: ten comings and goings.
const LINES_PER_WINDOW: u32 = 20;

/// A line for the log.
#[derive(Clone, Debug, PartialEq)]
pub struct LogEntry {
    /// Which fault.
    pub fault: Fault,
    /// The change.
    pub what: LogEvent,
    /// Lines of this fault that were left out since the last one, because there were too many.
    pub left_out: u32,
}

/// The change that a line of the log tells.
#[derive(Clone, Debug, PartialEq)]
pub enum LogEvent {
    /// It came.
    Raised {
        /// The cause.
        cause: String,
    },
    /// It went.
    Cleared {
        /// How long it was there, seconds.
        after_s: f64,
    },
    /// It happened.
    Noted {
        /// The cause.
        cause: String,
    },
}

#[derive(Clone, Copy, Debug, Default)]
struct FaultRow {
    since: Option<Time>,
    times: u64,
    window: Option<Time>,
    lines: u32,
    left_out: u32,
}

/// The faults of a running trainer.
#[derive(Clone, Debug)]
pub struct FaultBoard {
    rows: [FaultRow; Fault::COUNT],
}

impl Default for FaultBoard {
    fn default() -> Self {
        Self::new()
    }
}

impl FaultBoard {
    /// Nothing has happened.
    pub const fn new() -> Self {
        Self { rows: [FaultRow { since: None, times: 0, window: None, lines: 0, left_out: 0 }; Fault::COUNT] }
    }

    /// Takes in a change. Gives the line for the log, unless nothing changed or the log has had enough of this fault.
    pub fn take(&mut self, change: &FaultChange) -> Option<LogEntry> {
        let row = &mut self.rows[change.fault as usize];
        let what = match (&change.change, row.since) {
            (Change::Raised { .. }, Some(_)) | (Change::Cleared, None) => return None,
            (Change::Raised { cause }, None) => {
                row.since = Some(change.time);
                row.times += 1;
                LogEvent::Raised { cause: cause.clone() }
            }
            (Change::Cleared, Some(since)) => {
                row.since = None;
                LogEvent::Cleared { after_s: change.time.secs_since(since) }
            }
            (Change::Noted { cause }, _) => {
                row.times += 1;
                LogEvent::Noted { cause: cause.clone() }
            }
        };
        if row.window.is_none_or(|begun| change.time.ns_since(begun) >= WINDOW_NS) {
            row.window = Some(change.time);
            row.lines = 0;
        }
        if row.lines >= LINES_PER_WINDOW {
            row.left_out = row.left_out.saturating_add(1);
            return None;
        }
        row.lines += 1;
        Some(LogEntry { fault: change.fault, what, left_out: std::mem::take(&mut row.left_out) })
    }

    /// Whether `fault` is there.
    pub fn is_active(&self, fault: Fault) -> bool {
        self.rows[fault as usize].since.is_some()
    }

    /// Since when `fault` has been there.
    pub fn since(&self, fault: Fault) -> Option<Time> {
        self.rows[fault as usize].since
    }

    /// How often `fault` came or happened.
    pub fn times(&self, fault: Fault) -> u64 {
        self.rows[fault as usize].times
    }

    /// The faults that are there, most severe first.
    pub fn active(&self) -> impl Iterator<Item = Fault> + '_ {
        let of = move |severity| {
            Fault::ALL.into_iter().filter(move |f| f.severity() == severity && self.is_active(*f))
        };
        of(Severity::Fault)
            .chain(of(Severity::NotScored))
            .chain(of(Severity::Warning))
            .chain(of(Severity::Note))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(s: i64) -> Time {
        Time::from_ns(s * NS_PER_S)
    }

    #[test]
    fn one_line_when_it_comes_and_one_when_it_goes() {
        let mut board = FaultBoard::new();
        let came = board.take(&FaultChange::raised(at(1), Fault::ImuLost, "a")).unwrap();
        assert_eq!(came.what, LogEvent::Raised { cause: "a".into() });
        assert_eq!(board.take(&FaultChange::raised(at(2), Fault::ImuLost, "b")), None);
        assert_eq!((board.since(Fault::ImuLost), board.times(Fault::ImuLost)), (Some(at(1)), 1));
        let went = board.take(&FaultChange::cleared(at(4), Fault::ImuLost)).unwrap();
        assert_eq!(went.what, LogEvent::Cleared { after_s: 3.0 });
        assert_eq!(board.take(&FaultChange::cleared(at(5), Fault::ImuLost)), None);
        assert!(!board.is_active(Fault::ImuLost));
    }

    #[test]
    fn the_most_severe_comes_first() {
        let mut board = FaultBoard::new();
        for fault in [Fault::DisplayLost, Fault::Thermal, Fault::ImuLost, Fault::CamLost, Fault::NotInert] {
            board.take(&FaultChange::raised(at(0), fault, ""));
        }
        let order = [Fault::NotInert, Fault::CamLost, Fault::ImuLost, Fault::Thermal, Fault::DisplayLost];
        assert_eq!(board.active().collect::<Vec<_>>(), order);
    }

    #[test]
    fn a_chattering_fault_does_not_fill_the_log() {
        let mut board = FaultBoard::new();
        let told =
            |board: &mut FaultBoard, s| board.take(&FaultChange::noted(at(s), Fault::CamTimestamp, ""));
        let lines = (0..59).filter(|s| told(&mut board, *s).is_some()).count();
        assert_eq!(lines, LINES_PER_WINDOW as usize);
        let next = told(&mut board, 60).unwrap();
        assert_eq!(next.left_out, 59 - LINES_PER_WINDOW);
        assert_eq!(board.times(Fault::CamTimestamp), 60);
    }
}
