//! `bowwave doctor imu`: what the inertial unit says, for somebody who sets one up.

use std::time::Duration;

use anyhow::Result;
use bowwave_core::estimate::clock::{ClockReport, DRIFT_MUCH_PPM};
use bowwave_devices::{
    imu::ImuFormat,
    serial::{self, ImuSettings, ImuStatus, LineReport, LineStatus, LowLatency},
};

use super::{Check, Verdict, check, configured, failed};
use crate::{cli::DoctorImu, config};

/// Samples that the time must bring at least: fewer are no unit that the trainer can follow.
const SAMPLES_MIN: u64 = 10;

/// Listens to the unit.
pub(super) fn checks(arguments: &DoctorImu) -> Result<Vec<Check>> {
    let mut settings = match &arguments.config {
        Some(path) => config::read(path)?.imu,
        None => ImuSettings::default(),
    };
    if let Some(device) = &arguments.device {
        settings.line.device = Some(device.clone());
    }
    let time = Duration::from_secs(u64::from(arguments.seconds));
    let found = match serial::check(settings, time) {
        Ok(found) => found,
        Err(e) => return Ok(vec![failed("imu", e)]),
    };
    let status = &found.status;
    let enough = status.said.counters.samples >= SAMPLES_MIN;
    let mut checks = vec![configured::verdict("imu", &found.faults, unit(status), enough)];
    let fields = status.said.fields;
    if status.said.format.is_some() {
        let verdict =
            if fields.clock && fields.rate && fields.accel { Verdict::Ok } else { Verdict::Warning };
        checks.push(check("output", verdict, fields.to_string()));
        checks.push(check("timing", Verdict::Ok, timing(status)));
        checks.push(clock(status, found.clock.as_ref()));
    }
    checks.push(check("line", Verdict::Ok, line(status)));
    Ok(checks)
}

/// Which unit answers, where and how fast.
pub(super) fn unit(status: &ImuStatus) -> String {
    let (line, said) = (&status.line, &status.said);
    let Some(place) = &line.open else { return "no unit answers".to_owned() };
    match said.format {
        Some(format) if said.timing.period_ms > 0.0 => {
            format!("{place}: {format}, {:.1} samples a second", 1e3 / said.timing.period_ms)
        }
        Some(format) => format!("{place}: {format}"),
        None if line.status == LineStatus::Garbled || said.counters.skipped_bytes > 0 => {
            let known = ImuFormat::ALL.map(|f| f.to_string()).join(", ");
            format!("{place}: bytes come that are none of {known}")
        }
        None => format!("{place}: nothing comes"),
    }
}

fn timing(status: &ImuStatus) -> String {
    let t = status.said.timing;
    if t.period_ms <= 0.0 {
        return "too few samples to tell".to_owned();
    }
    format!(
        "a sample every {:.2} ms by the unit's time; arrivals up to {:.1} ms apart (99 %), {:.2} ms off in the median; {} \
         samples missing",
        t.period_ms, t.gap_p99_ms, t.jitter_p50_ms, status.said.lost_samples
    )
}

/// How the unit's clock does, and what to do where it does badly.
fn clock(status: &ImuStatus, report: Option<&ClockReport>) -> Check {
    if !status.said.fields.clock {
        let found = "the unit tells no time: its samples are timed by their own beat";
        return check("clock", Verdict::Ok, found);
    }
    let Some(clock) = report else {
        return check("clock", Verdict::Ok, "too short to tell its drift (--seconds 20)");
    };
    let verdict = if clock.is_bad() { Verdict::Warning } else { Verdict::Ok };
    let advice = if clock.drift_ppm.abs() > DRIFT_MUCH_PPM {
        "; no crystal drifts as much: is its clock set to follow another one?"
    } else if clock.is_bad() {
        "; set the adapter's latency timer to 1 ms, and look for what holds the line up"
    } else {
        ""
    };
    check("clock", verdict, format!("{}{advice}", in_words(clock)))
}

/// A clock's report for people.
fn in_words(clock: &ClockReport) -> String {
    format!(
        "{:+.1} ppm against this computer (sigma {:.1}); mapped times jitter by {:.3} ms (1 sigma), {:.3} ms at most, arrivals by \
         {:.2} ms; {} restarts",
        clock.drift_ppm,
        clock.drift_sigma_ppm,
        clock.jitter_s * 1e3,
        clock.jitter_max_s * 1e3,
        clock.arrival_jitter_s * 1e3,
        clock.restarts
    )
}

fn line(status: &ImuStatus) -> String {
    let (line, c) = (&status.line, status.said.counters);
    format!(
        "{} packets, of them {} samples, {} parts and other ones, {} that lack something, {} with numbers that are none; {} \
         damaged, {} bytes of no packet; {} framing errors, {} overruns; low latency {}",
        c.packets,
        c.samples,
        c.other,
        c.unusable,
        c.not_finite,
        c.bad_crc,
        c.skipped_bytes,
        line.framing_errors,
        line.overruns,
        low_latency(line)
    )
}

/// Low-latency mode of the serial adapter, in words.
pub(super) fn low_latency(line: &LineReport) -> &'static str {
    match line.open.as_ref().map(|open| open.low_latency) {
        None => "unknown, no port is open",
        Some(LowLatency::NotAsked) => "not asked for",
        Some(LowLatency::Set) => "on",
        Some(LowLatency::NotOffered) => "not offered by the adapter's driver",
        Some(LowLatency::Refused) => "refused to this user",
    }
}

#[cfg(test)]
mod tests {
    use bowwave_devices::{
        imu::Fields,
        serial::{ArrivalTiming, ImuReport, OpenLine},
    };

    use super::*;

    fn status() -> ImuStatus {
        ImuStatus {
            line: LineReport {
                open: Some(OpenLine {
                    node: "/dev/ttyUSB0".into(),
                    baud: 115_200,
                    low_latency: LowLatency::Set,
                }),
                ..LineReport::default()
            },
            said: ImuReport {
                format: Some(ImuFormat::Bno08x),
                fields: Fields { counter: true, accel: true, attitude: true, ..Fields::default() },
                timing: ArrivalTiming {
                    period_ms: 10.0,
                    gap_p99_ms: 16.2,
                    jitter_p50_ms: 1.5,
                    jitter_p99_ms: 6.0,
                },
                ..ImuReport::default()
            },
        }
    }

    #[test]
    fn what_answers_is_told_in_words() {
        let mut told = status();
        assert_eq!(unit(&told), "/dev/ttyUSB0 at 115200 baud: BNO08x UART-RVC, 100.0 samples a second");
        assert!(
            timing(&told)
                .starts_with("a sample every 10.00 ms by the unit's time; arrivals up to 16.2 ms apart")
        );
        assert_eq!(unit(&ImuStatus::default()), "no unit answers");
        told.said.format = None;
        assert_eq!(unit(&told), "/dev/ttyUSB0 at 115200 baud: nothing comes");
        told.said.counters.skipped_bytes = 900;
        let strange = unit(&told);
        assert!(strange.contains("none of VectorNav binary") && strange.contains("Witmotion"), "{strange}");
        assert!(line(&told).contains("900 bytes of no packet"));
    }

    #[test]
    fn a_clock_is_told_and_warned_of() {
        let good = ClockReport {
            drift_ppm: 35.04,
            drift_sigma_ppm: 0.2,
            jitter_s: 7e-6,
            jitter_max_s: 3e-5,
            arrival_jitter_s: 1.6e-3,
            restarts: 0,
        };
        let of = |report: Option<ClockReport>| {
            let mut status = status();
            status.said.fields.clock = true;
            clock(&status, report.as_ref())
        };
        let told = of(Some(good));
        assert_eq!(told.verdict, Verdict::Ok);
        assert!(
            told.found
                .starts_with("+35.0 ppm against this computer (sigma 0.2); mapped times jitter by 0.007 ms")
        );
        let fast = of(Some(ClockReport { drift_ppm: -300.0, ..good }));
        assert!(fast.verdict == Verdict::Warning && fast.found.contains("no crystal"), "{}", fast.found);
        let shaken = of(Some(ClockReport { jitter_s: 1e-3, ..good }));
        assert!(
            shaken.verdict == Verdict::Warning && shaken.found.contains("latency timer"),
            "{}",
            shaken.found
        );
        assert!(of(None).found.contains("too short"));
        assert!(clock(&status(), None).found.contains("tells no time"));
    }

    #[test]
    fn a_line_that_is_not_there_fails_with_what_to_do() {
        let arguments =
            DoctorImu { device: Some("/dev/absent-imu".into()), config: None, seconds: 1, json: false };
        let checks = checks(&arguments).unwrap();
        assert_eq!(checks[0].verdict, Verdict::Failed);
        assert!(checks[0].found.contains("absent-imu"), "{}", checks[0].found);
    }
}
