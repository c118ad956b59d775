//! `bowwave doctor`: checks of this computer, each with what to do about it.

mod configured;
mod imu;
mod interlock;
mod ship;

use std::{fmt, path::Path, process::Command};

use anyhow::Result;
use bowwave_devices::{camera, gpio, lcd, serial};
use serde::Serialize;

use crate::{
    cache,
    cli::{Doctor, DoctorDevice},
    stdout,
};

/// Free space below which a session of an hour may not fit, bytes.
const FREE_BYTES_MIN: u64 = 2_000_000_000;

/// How a check went.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Verdict {
    /// All is well.
    Ok,
    /// The trainer runs, but not as it should.
    Warning,
    /// The trainer cannot run like this.
    Failed,
    /// Not asked for, and not there.
    Absent,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Ok => "ok",
            Self::Warning => "WARNING",
            Self::Failed => "FAILED",
            Self::Absent => "none",
        })
    }
}

/// One check.
#[derive(Clone, Debug, Serialize)]
struct Check {
    name: &'static str,
    verdict: Verdict,
    /// The finding; for a failure, also what to do.
    found: String,
}

fn check(name: &'static str, verdict: Verdict, found: impl Into<String>) -> Check {
    Check { name, verdict, found: found.into() }
}

fn failed(name: &'static str, error: impl fmt::Display) -> Check {
    check(name, Verdict::Failed, error.to_string())
}

/// Runs all checks; `true` where none failed.
pub fn run(arguments: &Doctor) -> Result<bool> {
    if let Some(DoctorDevice::Imu(arguments)) = &arguments.device {
        return print(&imu::checks(arguments)?, arguments.json);
    }
    if let Some(DoctorDevice::Interlock(arguments)) = &arguments.device {
        return print(&interlock::checks(arguments)?, arguments.json);
    }
    let mut checks = Vec::new();
    if let Some(path) = &arguments.config {
        checks.extend(configured::checks(path));
    } else {
        checks.extend(gpus(arguments.gpu.as_deref()));
        checks.extend(cameras(arguments.camera.as_deref()));
        checks.extend(serial_lines(arguments.imu.as_deref()));
        checks.extend(triggers(arguments.trigger.as_deref()));
        checks.extend(displays());
    }
    checks.push(disk());
    checks.push(default_recording());
    checks.push(ffmpeg());
    print(&checks, arguments.json)
}

/// Prints the checks; `true` where none failed.
fn print(checks: &[Check], json: bool) -> Result<bool> {
    if json {
        stdout::print_json(checks)?;
    } else {
        let line = |c: &Check| format!("{:<8} {:<16} {}\n", c.verdict, c.name, c.found);
        stdout::print(checks.iter().map(line).collect::<String>())?;
    }
    Ok(checks.iter().all(|c| c.verdict != Verdict::Failed))
}

fn gpus(wanted: Option<&str>) -> Vec<Check> {
    let devices = match bowwave_render::devices() {
        Ok(devices) => devices,
        Err(e) => return vec![failed("vulkan", e)],
    };
    let mut checks: Vec<Check> = devices
        .iter()
        .map(|d| {
            let kind = if d.software { "software" } else { "hardware" };
            let found = format!(
                "{}: {} ({kind}, {}, Vulkan {}.{})",
                d.index, d.name, d.driver, d.vulkan.0, d.vulkan.1
            );
            check("vulkan", if d.vulkan >= (1, 3) { Verdict::Ok } else { Verdict::Warning }, found)
        })
        .collect();
    if let Some(wanted) = wanted
        && let Err(e) = bowwave_render::find_device(wanted)
    {
        checks.push(failed("vulkan", e));
    }
    checks
}

fn cameras(wanted: Option<&Path>) -> Vec<Check> {
    if let Some(node) = wanted {
        return vec![match camera::check(node) {
            Ok(info) => check("camera", Verdict::Ok, describe_camera(&info)),
            Err(e) => failed("camera", e),
        }];
    }
    let found = camera::list();
    if found.is_empty() {
        return vec![check("camera", Verdict::Absent, "no camera; plug one in (UVC cameras need no driver)")];
    }
    let one = |camera: Result<camera::CameraInfo, camera::CameraError>| match camera {
        Ok(info) if info.modes.iter().any(|m| m.coding.usable()) => {
            check("camera", Verdict::Ok, describe_camera(&info))
        }
        Ok(info) => check(
            "camera",
            Verdict::Warning,
            format!("{}; none of these can be shown", describe_camera(&info)),
        ),
        Err(e) => check("camera", Verdict::Warning, e.to_string()),
    };
    found.into_iter().map(one).collect()
}

fn describe_camera(info: &camera::CameraInfo) -> String {
    let modes: Vec<String> = info
        .modes
        .iter()
        .map(|m| {
            let sizes: Vec<String> = m.sizes.iter().map(ToString::to_string).collect();
            format!("{} {}", m.coding, sizes.join(" "))
        })
        .collect();
    let link = info.by_id.as_ref().map_or_else(String::new, |p| format!(", {}", p.display()));
    format!(
        "{}: {} ({}, {}{link}): {}",
        info.node.display(),
        info.card,
        info.driver,
        info.bus,
        modes.join("; ")
    )
}

fn serial_lines(wanted: Option<&Path>) -> Vec<Check> {
    let ports = match serial::list() {
        Ok(ports) => ports,
        Err(e) => return vec![failed("serial line", e)],
    };
    if let Some(node) = wanted {
        // Opening at any rate shows whether it is there and may be used.
        return vec![match serial::ImuPort::open(node, 115_200).and_then(serial::ImuPort::stop) {
            Ok(_) => check("serial line", Verdict::Ok, format!("{} opens", node.display())),
            Err(e) => failed("serial line", e),
        }];
    }
    if ports.is_empty() {
        return vec![check(
            "serial line",
            Verdict::Absent,
            "no serial port; plug the inertial unit's adapter in",
        )];
    }
    ports
        .iter()
        .map(|p| {
            let link = p.by_id.as_ref().map_or_else(String::new, |l| format!(", {}", l.display()));
            check("serial line", Verdict::Ok, format!("{}: {}{link}", p.node.display(), p.kind))
        })
        .collect()
}

fn triggers(wanted: Option<&str>) -> Vec<Check> {
    if let Some(text) = wanted {
        let Some((chip, line)) = text.rsplit_once(':') else {
            return vec![failed(
                "trigger",
                format!("'{text}' names no line: write CHIP:LINE, as /dev/gpiochip0:17"),
            )];
        };
        return vec![match gpio::check(Path::new(chip), line) {
            Ok(info) => {
                check("trigger", Verdict::Ok, format!("{chip} line {} is there and free", info.offset))
            }
            Err(e) => failed("trigger", e),
        }];
    }
    let chips = gpio::list();
    if chips.is_empty() {
        return vec![check("trigger", Verdict::Absent, "no GPIO chip; the trigger needs a line of one")];
    }
    let one = |chip: Result<gpio::ChipInfo, gpio::GpioError>| match chip {
        Ok(c) => {
            let free = c.lines.iter().filter(|l| !l.used).count();
            check(
                "trigger",
                Verdict::Ok,
                format!(
                    "{}: {} ({}), {free} of {} lines free",
                    c.node.display(),
                    c.label,
                    c.name,
                    c.lines.len()
                ),
            )
        }
        Err(e) => check("trigger", Verdict::Warning, e.to_string()),
    };
    chips.into_iter().map(one).collect()
}

fn displays() -> Vec<Check> {
    let found = lcd::list();
    if found.is_empty() {
        return vec![check(
            "lcd",
            Verdict::Absent,
            "no display card; simulate runs without, run draws to nobody",
        )];
    }
    let one = |card: Result<lcd::CardInfo, lcd::LcdError>| match card {
        Ok(card) => {
            let connectors: Vec<String> = card
                .connectors
                .iter()
                .map(|c| format!("{} {:?}, {} modes", c.name, c.connection, c.modes.len()).to_lowercase())
                .collect();
            let found = format!("{} ({}): {}", card.node.display(), card.driver, connectors.join("; "));
            check("lcd", Verdict::Ok, found)
        }
        Err(e) => check("lcd", Verdict::Warning, e.to_string()),
    };
    found.into_iter().map(one).collect()
}

fn disk() -> Check {
    let here = std::env::current_dir().unwrap_or_else(|_| ".".into());
    match rustix::fs::statvfs(&here) {
        Ok(s) => {
            let free = s.f_bavail.saturating_mul(s.f_frsize);
            let found = format!("{:.1} GB free in {}", free as f64 * 1e-9, here.display());
            if free < FREE_BYTES_MIN {
                check("disk", Verdict::Warning, format!("{found}; a recorded hour needs more: free some"))
            } else {
                check("disk", Verdict::Ok, found)
            }
        }
        Err(e) => {
            check("disk", Verdict::Warning, format!("cannot ask for free space in {}: {e}", here.display()))
        }
    }
}

fn default_recording() -> Check {
    match cache::default_recording_path() {
        Ok(path) if path.exists() => {
            check("recording", Verdict::Ok, format!("built-in recording kept at {}", path.display()))
        }
        Ok(path) => check(
            "recording",
            Verdict::Ok,
            format!("the built-in recording will be made on first use, at {}", path.display()),
        ),
        Err(e) => check("recording", Verdict::Warning, format!("{e:#}")),
    }
}

fn ffmpeg() -> Check {
    match Command::new("ffmpeg").arg("-version").output() {
        Ok(out) if out.status.success() => {
            let text = String::from_utf8_lossy(&out.stdout);
            check("ffmpeg", Verdict::Ok, text.lines().next().unwrap_or("there").to_owned())
        }
        _ => check("ffmpeg", Verdict::Absent, "import of videos and --video need it: apt-get install ffmpeg"),
    }
}
