//! The checks of what a configuration names: the same doors that `bowwave run` goes through, each for a moment.

use std::{path::Path, thread, time::Duration};

use bowwave_core::fault::{Change, Fault};
use bowwave_devices::{
    camera::CameraPort,
    clock::{now, sleep_until},
    gpio::{self, InputLine},
    lcd,
    report::reporting,
    serial,
    trigger::{InterlockWiring, TriggerSettings},
};

use super::{Check, Verdict, check, failed};
use crate::{
    config::Config,
    run::settings::{Reader, Settings, camera_settings},
};

/// How long camera and inertial unit are listened to.
const LISTEN: Duration = Duration::from_millis(2500);
/// How long the ship's instruments are: one line a second, at a rate that may have to be found.
const LISTEN_SHIP: Duration = Duration::from_secs(6);
/// Pictures and samples that such a time must bring at least.
const PICTURES_MIN: u64 = 10;

/// Checks everything that `path` names.
pub(super) fn checks(path: &Path) -> Vec<Check> {
    // No last good copies: the files themselves are asked after.
    let reader = Reader::new(path.into(), None);
    let settings = match reader.read() {
        Ok(settings) => settings,
        Err(e) => return vec![failed("configuration", format!("{e:#}"))],
    };
    let mut checks = files(path, &settings);
    let config = &settings.config;
    let wanted = bowwave_render::find_device(config.gpu.device.as_deref().unwrap_or("0"));
    checks.push(match wanted {
        Ok(device) => check("vulkan", Verdict::Ok, format!("{} draws", device.name)),
        Err(e) => failed("vulkan", e),
    });
    // Both take their time, so they take it together.
    let camera = thread::scope(|scope| {
        let camera = scope.spawn(|| camera(&settings));
        let ship =
            config.heading.ship.clone().map(|ship| scope.spawn(|| super::ship::check(ship, LISTEN_SHIP)));
        checks.push(imu(config));
        let broke_down = |name| move |_| failed(name, "the check broke down; report it");
        checks.extend(ship.map(|ship| ship.join().unwrap_or_else(broke_down("ship"))));
        camera.join().unwrap_or_else(broke_down("camera"))
    });
    checks.push(camera);
    checks.extend(lines(config));
    checks.push(match lcd::check(&config.lcd) {
        Ok(choice) => {
            let remark = choice.remark.map_or_else(String::new, |r| format!("; {r}"));
            check(
                "lcd",
                Verdict::Ok,
                format!("{} {}: {}{remark}", choice.card.display(), choice.connector, choice.mode),
            )
        }
        Err(e) => failed("lcd", e),
    });
    checks
}

fn files(path: &Path, settings: &Settings) -> Vec<Check> {
    let mut checks: Vec<Check> = settings
        .faults
        .iter()
        .map(|fault| {
            let name = if fault.fault == Fault::NoCalibration { "calibration" } else { "configuration" };
            match &fault.change {
                Change::Raised { cause } | Change::Noted { cause } => failed(name, cause),
                Change::Cleared => check(name, Verdict::Ok, "good"),
            }
        })
        .collect();
    if checks.is_empty() {
        let scenario = &settings.setup.scenario;
        let lens = &settings.setup.calibration.lens;
        checks.push(check(
            "configuration",
            Verdict::Ok,
            format!(
                "{} is good; scenario {:?} with {} boats, calibrated for {}x{} pictures",
                path.display(),
                scenario.name,
                scenario.boats.len(),
                lens.width,
                lens.height
            ),
        ));
    }
    checks
}

/// A check that fails with the faults that are left, or is `found`.
pub(super) fn verdict(name: &'static str, faults: &[(Fault, String)], found: String, enough: bool) -> Check {
    match faults {
        [] if enough => check(name, Verdict::Ok, found),
        [] => failed(name, format!("{found}: too little; look at its cable")),
        faults => {
            let text: Vec<String> =
                faults.iter().map(|(fault, cause)| format!("{} {cause}", fault.code())).collect();
            let warns = faults.iter().all(|(f, _)| f.severity() <= bowwave_core::fault::Severity::Warning);
            let verdict = if warns && enough { Verdict::Warning } else { Verdict::Failed };
            check(name, verdict, format!("{found}; {}", text.join("; ")))
        }
    }
}

fn camera(settings: &Settings) -> Check {
    let (reporter, reports) = reporting();
    let port = match CameraPort::start(camera_settings(settings), reporter) {
        Ok(port) => port,
        Err(e) => return failed("camera", e),
    };
    // Pictures that nobody takes would keep their buffers from the driver.
    let end = now().plus_ns(LISTEN.as_nanos() as i64);
    while now() < end {
        port.events().try_iter().for_each(drop);
        sleep_until(now().plus_ns(5_000_000));
    }
    let status = port.status();
    if let Err(e) = port.stop() {
        return failed("camera", e);
    }
    let c = status.counters;
    let found = match &status.in_use {
        Some(camera) => {
            let refused = match &camera.refused_controls[..] {
                [] => String::new(),
                controls => format!("; it does not let {} be locked", controls.join(", ")),
            };
            format!(
                "{} ({}): {}, {} pictures in {:.1} s, {} damaged{refused}",
                camera.node.display(),
                camera.card,
                camera.mode,
                c.frames,
                LISTEN.as_secs_f64(),
                c.damaged_pictures + c.damaged_buffers
            )
        }
        None => format!("no pictures ({:?})", status.life),
    };
    verdict("camera", &reports.left(), found, c.frames >= PICTURES_MIN)
}

fn imu(config: &Config) -> Check {
    let found = match serial::check(config.imu.clone(), LISTEN) {
        Ok(found) => found,
        Err(e) => return failed("imu", e),
    };
    let (status, counters) = (&found.status, found.status.said.counters);
    let text = format!(
        "{}: {} samples in {:.1} s, {} damaged packets, low latency {}",
        super::imu::unit(status),
        counters.samples,
        LISTEN.as_secs_f64(),
        counters.bad_crc,
        super::imu::low_latency(&status.line)
    );
    verdict("imu", &found.faults, text, counters.samples >= PICTURES_MIN)
}

fn lines(config: &Config) -> Vec<Check> {
    let mut checks = Vec::new();
    if let Err(e) = gpio::clock_is_monotonic() {
        checks.push(failed("trigger", e));
    }
    let one = |name: &'static str, input: &InputLine, active: &str, inactive: &str| match gpio::check(
        Path::new(&input.chip),
        &input.line,
    ) {
        Ok(info) => {
            let state = match info.high {
                Some(high) if high != input.active_low => active,
                Some(_) => inactive,
                None => "not readable",
            };
            check(name, Verdict::Ok, format!("{} line {}: {state}", input.chip, info.offset))
        }
        Err(e) => failed(name, e),
    };
    checks.push(match &config.gpio.trigger {
        Some(t) => one("trigger", &t.line, "pressed", "not pressed"),
        None => failed("trigger", "none is configured: set [trigger] to its line"),
    });
    checks.push(super::interlock::wiring(config.gpio.interlock.as_ref()));
    let contacts = config.gpio.interlock.iter().flat_map(InterlockWiring::contacts);
    checks.extend(contacts.map(|line| {
        one("interlock", line, "inert: the trainer arms", "NOT inert: the trainer does not arm")
    }));
    if let Some(line) = &config.gpio.power_fail {
        checks.push(one("power-fail", line, "power is failing", "power is good"));
    }
    for press in &config.heading.presses {
        checks.push(one(press.name(), &press.line, "pressed", "not pressed"));
    }
    if let Some(lamps) = &config.gpio.lamps {
        let trigger = config.gpio.trigger.as_ref().map(|t| TriggerSettings {
            interlock: config.gpio.interlock.clone(),
            power_fail: config.gpio.power_fail.clone(),
            presses: config.heading.presses.clone(),
            ..TriggerSettings::new(t.line.clone())
        });
        let inputs = trigger.iter().flat_map(TriggerSettings::inputs);
        checks.push(match lamps.check(inputs) {
            Ok(()) => check("lamps", Verdict::Ok, format!("on {}", lamps.chip)),
            Err(e) => failed("lamps", e),
        });
    }
    checks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_computer_without_devices_fails_each_check_with_what_to_do() {
        let path = std::env::temp_dir().join(format!("bowwave-doctor-{}.toml", std::process::id()));
        std::fs::write(
            &path,
            "[camera]\ndevice = \"/dev/absent-camera\"\n[imu]\ndevice = \"/dev/absent-imu\"\n\
             [trigger]\nchip = \"/dev/absent-chip\"\nline = 1\n[screen]\ncard = \"/dev/dri/absent\"\n",
        )
        .unwrap();
        let begun = now();
        let checks = checks(&path);
        std::fs::remove_file(&path).unwrap();
        assert!(now().secs_since(begun) < 10.0);
        for name in ["calibration", "camera", "imu", "trigger", "interlock", "lcd"] {
            let found: Vec<_> = checks.iter().filter(|c| c.name == name).collect();
            assert!(
                !found.is_empty() && found.iter().all(|c| c.verdict == Verdict::Failed),
                "{name}: {found:?}"
            );
        }
        let camera = checks.iter().find(|c| c.name == "camera").unwrap();
        assert!(camera.found.contains("absent-camera"), "{}", camera.found);
    }
}
