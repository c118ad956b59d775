//! What systemd is told: that the trainer is ready, how it fares, and that it lives.

use std::time::Duration;

use bowwave_core::{
    fault::Fault,
    frame::scene::{Hud, StatusWords},
    time::{NS_PER_S, Time},
};
use sd_notify::NotifyState;

/// The status line is told at least this often, nanoseconds.
const STATUS_EVERY_NS: i64 = NS_PER_S;

/// The link to systemd. Silent where the program was not started by it.
#[derive(Debug)]
pub struct Notifier {
    /// How often a sign of life is sent, where one is expected.
    every: Option<Duration>,
    fed: Option<Time>,
    told: (Option<Time>, String),
    ready: bool,
}

impl Notifier {
    /// Takes what systemd expects from the environment.
    pub fn from_environment() -> Self {
        // Three times within the time that systemd allows.
        let every = sd_notify::watchdog_enabled().map(|d| d / 3);
        Self { every, fed: None, told: (None, String::new()), ready: false }
    }

    /// The trainer shows pictures: told once.
    pub fn ready(&mut self) {
        if !std::mem::replace(&mut self.ready, true) {
            send(&[NotifyState::Ready]);
        }
    }

    /// A sign of life, where one is due.
    pub fn feed(&mut self, now: Time) {
        let Some(every) = self.every else { return };
        let due = self.fed.is_none_or(|t| now.ns_since(t) as u128 >= every.as_nanos());
        if due {
            self.fed = Some(now);
            send(&[NotifyState::Watchdog]);
        }
    }

    /// How it fares, where that has changed or was told long ago.
    pub fn status(&mut self, hud: &Hud, warnings: impl Iterator<Item = Fault>, now: Time) {
        let text = status_text(hud, warnings);
        let (at, last) = &self.told;
        if *last == text && at.is_some_and(|t| now.ns_since(t) < STATUS_EVERY_NS) {
            return;
        }
        send(&[NotifyState::Status(&text)]);
        self.told = (Some(now), text);
    }

    /// The configuration is read anew.
    pub fn reloading(&mut self) {
        send(&[
            NotifyState::Reloading,
            NotifyState::monotonic_usec_now().unwrap_or(NotifyState::MonotonicUsec(0)),
        ]);
        self.ready = false;
    }

    /// The end has begun.
    pub fn stopping(&mut self) {
        send(&[NotifyState::Stopping]);
    }
}

/// Time by which a start that goes on is given longer, microseconds.
const LONGER_US: u32 = 15_000_000;

/// Something at the start, or a new start of the renderer, takes long but goes on.
pub fn still_starting() {
    send(&[NotifyState::ExtendTimeoutUsec(LONGER_US), NotifyState::Watchdog]);
}

fn send(state: &[NotifyState<'_>]) {
    if let Err(e) = sd_notify::notify(state) {
        log::debug!("systemd was not told: {e}");
    }
}

/// What the LCD says, as one line, but with all `warnings` and not only the first:
/// "NOT SCORED: CAMERA LOST; warning REC: DISK FULL; rounds 120, shots 14, hits 3".
pub fn status_text(hud: &Hud, warnings: impl Iterator<Item = Fault>) -> String {
    let StatusWords { word, cause, .. } = hud.status.words();
    let mut text = if cause.is_empty() { word.to_owned() } else { format!("{word}: {cause}") };
    for (i, warning) in warnings.enumerate() {
        text.push_str(if i == 0 { "; warning " } else { ", " });
        text.push_str(warning.cause());
    }
    text.push_str(&format!("; rounds {}, shots {}, hits {}", hud.rounds_left, hud.shots, hud.hits));
    if hud.neutral_hits > 0 {
        text.push_str(&format!(", neutral {}", hud.neutral_hits));
    }
    text
}

#[cfg(test)]
mod tests {
    use bowwave_core::frame::scene::Status;

    use super::*;

    #[test]
    fn the_status_line_says_what_the_lcd_says() {
        let hud = Hud {
            status: Status::NotScored { cause: "CAMERA LOST", action: "CHECK THE CAMERA CABLE" },
            warning: Some(Fault::DiskFull),
            rounds_left: 120,
            shots: 14,
            hits: 3,
            neutral_hits: 0,
            clock_s: 1.0,
            sea: None,
            heading_tenths_deg: None,
            ..Hud::READY
        };
        let said = "NOT SCORED: CAMERA LOST; warning REC: DISK FULL; rounds 120, shots 14, hits 3";
        assert_eq!(status_text(&hud, [Fault::DiskFull].into_iter()), said);
        let several = status_text(&hud, [Fault::DiskFull, Fault::ClockUnset].into_iter());
        assert!(several.contains("; warning REC: DISK FULL, CLOCK NOT SET; "), "{several}");
    }
}
