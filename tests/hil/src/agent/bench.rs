//! The bench's kernel modules: the camera's other side and the simulated GPIO chip.

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
    process::Command,
    time::Duration,
};

use anyhow::{Context, Result, bail};
use bowwave_devices::clock;
use bowwave_hil::{BENCH, INTERLOCK_INVERTED, LINES};
use serde::{Deserialize, Serialize};

const CONFIG: &str = "/sys/kernel/config";
const CAMERA: &str = "/dev/hilcam";

/// Loads what the image's kernel has not loaded by itself.
pub fn load_modules() -> Result<()> {
    let folder = Path::new(BENCH).join("modules");
    let order = fs::read_to_string(folder.join("order")).context("the bench's modules")?;
    for name in order.lines() {
        let out = Command::new("/sbin/insmod").arg(folder.join(name)).output().context("insmod")?;
        let said = String::from_utf8_lossy(&out.stderr);
        if !out.status.success() && !said.contains("File exists") {
            bail!("insmod {name}: {}", said.trim());
        }
    }
    Ok(())
}

/// State of /dev/hilcam.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CameraState {
    /// 1: there.
    pub plugged: u8,
    /// 1: somebody streams.
    pub streaming: u8,
    /// Of the mode.
    pub fourcc: String,
    /// Of the mode.
    pub width: u32,
    /// Of the mode.
    pub height: u32,
    /// Of the mode.
    pub rate_hz: u32,
    /// Pictures since the module was loaded.
    pub delivered: u64,
    /// For want of a buffer, or of another mode.
    pub dropped: u64,
    /// How often streaming was started.
    pub starts: u64,
}

/// Reads the driver's state.
pub fn camera_state() -> Result<CameraState> {
    let text = fs::read_to_string(CAMERA).context(CAMERA)?;
    serde_json::from_str(&text).with_context(|| format!("{CAMERA}: {text}"))
}

/// Gives a command to the driver.
pub fn camera_command(line: &str) -> Result<()> {
    let mut file = open_camera()?;
    file.write_all(line.as_bytes()).with_context(|| format!("{CAMERA}: {line}"))
}

/// For pictures.
pub fn open_camera() -> Result<fs::File> {
    fs::OpenOptions::new().write(true).open(CAMERA).context(CAMERA)
}

/// Head of a picture that is written to the driver: `struct hilcam_picture`.
pub struct PictureHead {
    /// Whether the buffer gets its error flag.
    pub flagged: bool,
    /// On the monotonic clock; 0: now.
    pub timestamp_ns: i64,
    /// Of the bytes that follow.
    pub fourcc: [u8; 4],
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
}

impl PictureHead {
    const MAGIC: u32 = 0x0142_4c48;

    /// As the driver wants it.
    pub fn bytes(&self) -> [u8; 32] {
        let mut out = [0; 32];
        let words = [Self::MAGIC, u32::from(self.flagged)];
        out[0..4].copy_from_slice(&words[0].to_ne_bytes());
        out[4..8].copy_from_slice(&words[1].to_ne_bytes());
        out[8..16].copy_from_slice(&self.timestamp_ns.to_ne_bytes());
        out[16..20].copy_from_slice(&self.fourcc);
        out[20..24].copy_from_slice(&self.width.to_ne_bytes());
        out[24..28].copy_from_slice(&self.height.to_ne_bytes());
        out
    }
}

/// The simulated GPIO chip.
pub struct Gpio {
    chip: String,
    lines: PathBuf,
}

impl Gpio {
    /// Makes it; inputs are low at first, and the plug is out.
    pub fn make() -> Result<Self> {
        if !Path::new(CONFIG).join("gpio-sim").exists() {
            let out = Command::new("/bin/mount").args(["-t", "configfs", "none", CONFIG]).output()?;
            if !out.status.success() {
                bail!("mount configfs: {}", String::from_utf8_lossy(&out.stderr).trim());
            }
        }
        let device = Path::new(CONFIG).join("gpio-sim/bench");
        let bank = device.join("bank0");
        if !bank.exists() {
            fs::create_dir_all(&bank).context("gpio-sim")?;
            fs::write(bank.join("num_lines"), LINES.len().to_string())?;
            fs::write(bank.join("label"), "bench")?;
            for (i, name) in LINES.iter().enumerate() {
                let line = bank.join(format!("line{i}"));
                fs::create_dir(&line)?;
                fs::write(line.join("name"), name)?;
            }
            fs::write(device.join("live"), "1").context("gpio-sim live")?;
        }
        let read = |path: PathBuf| -> Result<String> {
            Ok(fs::read_to_string(&path).with_context(|| path.display().to_string())?.trim().to_owned())
        };
        let chip = read(bank.join("chip_name"))?;
        let name = read(device.join("dev_name"))?;
        let gpio = Self { lines: Path::new("/sys/devices/platform").join(name).join(&chip), chip };
        gpio.pull(INTERLOCK_INVERTED, &[(0, true)])?;
        Ok(gpio)
    }

    /// Its device's name.
    pub fn chip(&self) -> &str {
        &self.chip
    }

    /// Sets an input step after step: before and after each, on the monotonic clock.
    pub fn pull(&self, line: usize, steps: &[(u64, bool)]) -> Result<Vec<[i64; 2]>> {
        let path = self.lines.join(format!("sim_gpio{line}/pull"));
        let mut file =
            fs::OpenOptions::new().write(true).open(&path).with_context(|| path.display().to_string())?;
        let mut times = Vec::with_capacity(steps.len());
        for (pause_us, high) in steps {
            if *pause_us > 0 {
                std::thread::sleep(Duration::from_micros(*pause_us));
            }
            let before = clock::now().ns();
            file.write_all(if *high { b"pull-up" } else { b"pull-down" })
                .with_context(|| path.display().to_string())?;
            times.push([before, clock::now().ns()]);
        }
        Ok(times)
    }

    /// Level of a line.
    pub fn level(&self, line: usize) -> Result<bool> {
        let path = self.lines.join(format!("sim_gpio{line}/value"));
        Ok(fs::read_to_string(&path).with_context(|| path.display().to_string())?.trim() == "1")
    }
}
