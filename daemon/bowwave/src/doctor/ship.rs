//! What the ship's own instruments say.

use std::time::Duration;

use bowwave_devices::serial::{self, LineSettings, ShipReport, ShipStatus};

use super::{Check, configured, failed};

/// Headings that the time must bring at least: an instrument sends one a second.
const HEADINGS_MIN: u64 = 2;

/// Listens to the feed for `time`.
pub(super) fn check(settings: LineSettings, time: Duration) -> Check {
    match serial::check_ship(settings, time) {
        Ok(found) => {
            let enough = found.status.said.headings >= HEADINGS_MIN;
            configured::verdict("ship", &found.faults, told(&found.status), enough)
        }
        Err(e) => failed("ship", e),
    }
}

fn told(status: &ShipStatus) -> String {
    let Some(place) = &status.line.open else { return "no ship feed answers".to_owned() };
    let lines = status.said.lines;
    let counts = format!(
        "{} headings in {} lines, {} damaged, {} bytes of no line",
        status.said.headings, lines.packets, lines.bad_crc, lines.skipped_bytes
    );
    let fix = fix_told(&status.said);
    let Some((sentence, sample)) = status.said.newest else {
        return format!("{place}: no heading{fix}; {counts}");
    };
    let deg = |what: &str, angle: Option<f64>| angle.map(|a| format!(", {what} {:.2} deg", a.to_degrees()));
    let rate = status.said.period_s.filter(|s| *s > 0.0).map(|s| format!(", {:.1} a second", s.recip()));
    let parts = [
        deg("heading", sample.heading),
        deg("roll", sample.roll),
        deg("pitch", sample.pitch),
        deg("its own sigma", sample.heading_sigma),
        sample.reduced.then(|| ", quality reduced".to_owned()),
        rate,
    ];
    format!("{place}: {}{}{fix}; {counts}", sentence.name(), parts.into_iter().flatten().collect::<String>())
}

/// Place and time, as far as they are told.
fn fix_told(said: &ShipReport) -> String {
    match (said.place, said.utc) {
        (Some(place), Some((_, utc))) => format!("; at {place}, {utc}"),
        (Some(place), None) => format!("; at {place}, no date (RMC or ZDA)"),
        (None, Some((_, utc))) => format!("; {utc}, no place (RMC or GGA)"),
        (None, None) => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use bowwave_core::{
        ephemeris::{Place, Utc},
        event::ShipSample,
        time::Time,
    };
    use bowwave_devices::{
        nmea::{LineCounters, NmeaSentence},
        serial::{LineReport, LowLatency, OpenLine},
    };

    use super::*;

    #[test]
    fn a_feed_is_told_in_words() {
        let sample = ShipSample {
            arrival: Time::MIN,
            heading: Some(235.18f64.to_radians()),
            roll: None,
            pitch: None,
            heading_sigma: None,
            reduced: true,
        };
        let said = ShipReport {
            newest: Some((NmeaSentence::Hdt, sample)),
            period_s: Some(0.1),
            headings: 25,
            lines: LineCounters { packets: 50, bad_crc: 1, skipped_bytes: 7 },
            ..ShipReport::default()
        };
        let open = OpenLine { node: "/dev/ttyUSB1".into(), baud: 4800, low_latency: LowLatency::Set };
        let line = LineReport { open: Some(open), ..LineReport::default() };
        let told_now = told(&ShipStatus { line: line.clone(), said });
        assert_eq!(
            told_now,
            "/dev/ttyUSB1 at 4800 baud: HDT, heading 235.18 deg, quality reduced, 10.0 a second; 25 headings in 50 lines, 1 \
             damaged, 7 bytes of no line"
        );
        let (place, utc) = (Place::new(54.1, -7.9), Utc::from_ms(1_780_315_200_000));
        let fixed = ShipReport { place, utc: utc.map(|utc| (Time::MIN, utc)), ..said };
        let told_fix = told(&ShipStatus { line: line.clone(), said: fixed });
        assert!(
            told_fix.contains("10.0 a second; at 54.100 N 7.900 W, 2026-06-01 12:00 UTC; 25 headings"),
            "{told_fix}"
        );
        let silent = told(&ShipStatus { line, said: ShipReport::default() });
        assert!(silent.starts_with("/dev/ttyUSB1 at 4800 baud: no heading; 0 headings"), "{silent}");
        assert_eq!(told(&ShipStatus::default()), "no ship feed answers");
    }

    #[test]
    fn a_feed_that_is_not_there_fails_with_what_to_do() {
        let found = check(LineSettings::ship("/dev/absent-ship".into()), Duration::from_millis(300));
        assert_eq!(found.verdict, super::super::Verdict::Failed);
        assert!(found.found.contains("absent-ship"), "{}", found.found);
    }
}
