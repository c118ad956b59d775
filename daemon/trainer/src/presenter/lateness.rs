//! What the log is told of late frames: the first at once, then one line for as many as there are.

use bowwave_core::time::{NS_PER_S, Time};

/// At most one line within this time.
const EVERY_NS: i64 = 10 * NS_PER_S;

/// Late frames since the last line.
#[derive(Debug, Default)]
pub struct Lateness {
    told: Option<Time>,
    frames: u64,
    worst_s: f64,
}

impl Lateness {
    /// Frame `frame` was complete at `complete`, and `late_s` too late. The line for the log, where one is due.
    pub fn take(&mut self, frame: u64, complete: Time, late_s: f64) -> Option<String> {
        self.frames += 1;
        self.worst_s = self.worst_s.max(late_s);
        if self.told.is_some_and(|told| complete.ns_since(told) < EVERY_NS) {
            return None;
        }
        let line = match self.frames {
            1 => format!("frame {frame} was complete {:.1} ms late", late_s * 1e3),
            n => format!(
                "{n} frames up to number {frame} were complete late, the worst by {:.1} ms",
                self.worst_s * 1e3
            ),
        };
        *self = Self { told: Some(complete), ..Self::default() };
        Some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_that_is_always_late_does_not_flood_the_log() {
        let mut lateness = Lateness::default();
        let lines: Vec<String> = (0..600)
            .filter_map(|n| lateness.take(n, Time::from_ns(n as i64 * 33_333_333), 0.001 * (n % 50) as f64))
            .collect();
        assert_eq!(lines.len(), 2, "{lines:?}");
        assert!(lines[0].starts_with("frame 0 was complete 0.0 ms late"), "{}", lines[0]);
        assert!(lines[1].starts_with("301 frames up to number 301"), "{}", lines[1]);
        assert!(lines[1].ends_with("the worst by 49.0 ms"), "{}", lines[1]);
    }
}
