//! The bench: a machine, what the harness knows of it, and the questions that every test asks.

use std::{
    fs,
    path::{Path, PathBuf},
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail, ensure};
use bowwave_hil::{
    INTERLOCK, INTERLOCK_INVERTED,
    protocol::{AgentCommand, PlayerFeed},
    tape::{Tape, TapeHeader},
};
use serde_json::Value;

use super::{
    lcd::Plate,
    machine::{MachineParts, MachineStart, VirtualMachine},
};

/// Pictures of the tape. Small, because the machine's processor is emulated.
pub const PICTURE: (u32, u32) = (192, 128);
/// Pixels of the LCD: as many as software Vulkan in emulation draws at a steady rate.
pub const LCD: (u32, u32) = (160, 96);
/// Length of the disk that the data partition is on: small enough to be filled in seconds.
const DATA_BYTES: u64 = 640 << 20;
/// How long READY must last to be believed: the LCD shows what was so some frames ago.
const STEADY: Duration = Duration::from_millis(600);
/// Most that a first start may take.
const FIRST_START: Duration = Duration::from_secs(600);
/// Where the trainer keeps hits.
pub const STATE: &str = "/var/lib/bowwave";
/// The file that the trainer writes frames' hashes into.
pub const HASHES: &str = "/run/bowwave/frames";
/// The file that the layer which breaks the GPU looks for.
pub const GPU_FAULT: &str = "/run/bowwave/gpu-fault";

/// Everything that is built once for all machines.
pub struct Shop {
    /// For what is left.
    pub out: PathBuf,
    /// Parts of the machines.
    pub parts: MachineParts,
    /// The tape, without its pictures.
    pub tape: TapeHeader,
}

impl Shop {
    /// Makes tape and parts.
    pub fn open(image: &Path, modules: &Path, out: &Path) -> Result<Self> {
        fs::create_dir_all(out).with_context(|| out.display().to_string())?;
        let tape_path = out.join("tape");
        let tape = match Tape::read(&tape_path) {
            Ok(tape) => tape,
            Err(_) => make_tape(&out.join("tape.mcap"), &tape_path)?,
        };
        let beside = std::env::current_exe().context("this program's path")?;
        let mut parts = MachineParts {
            image: image.to_owned(),
            modules: modules.to_owned(),
            agent: beside.with_file_name("hil-agent"),
            tape: tape_path,
            files: vec![
                ("etc/bowwave.toml".into(), configuration(&Configured::default())),
                ("etc/calibration.toml".into(), tape.header.calibration_toml.clone()),
                ("etc/scenario.toml".into(), SCENARIO.to_owned()),
                ("thermal".into(), "41000\n".to_owned()),
                ("udev/66-hilcam.rules".into(), CAMERA_RULE.to_owned()),
            ],
            blobs: Vec::new(),
            units: vec![("bowwave.service.d/90-hil.conf".into(), SERVICE.to_owned())],
        };
        let layer = beside.with_file_name("libgpu_fault_layer.so");
        if layer.exists() {
            let manifest = Path::new("tests/hil/gpu-fault-layer/VkLayer_bowwave_gpu_fault.json");
            parts.blobs.push(("layer/libgpu_fault_layer.so".into(), layer));
            parts.blobs.push(("layer/VkLayer_bowwave_gpu_fault.json".into(), manifest.to_owned()));
        }
        Ok(Self { out: out.to_owned(), parts, tape: tape.header })
    }

    /// A data partition as after the first start: the Vulkan driver has compiled the shaders, which takes minutes in emulation,
    /// and no round was fired.
    pub fn used_data(&self, name: &str) -> Result<PathBuf> {
        let (kept, stamp_path) = (self.out.join("data-used.img"), self.out.join("data-used.stamp"));
        let root = fs::metadata(self.parts.image.join("root.img")).context("root.img")?;
        let stamp = format!("{} {:?}", root.len(), root.modified().context("root.img")?);
        if !kept.exists() || fs::read_to_string(&stamp_path).unwrap_or_default() != stamp {
            eprintln!("first start, which compiles the shaders");
            let (w, h) = PICTURE;
            let data = self.fresh_data("first-data.img")?;
            let mut bench = HilBench::switch_on(self, &data, "utc")?;
            bench.pull(1, true)?;
            bench.play()?;
            bench.started(FIRST_START)?;
            // Rounds and a hit have shaders of their own.
            bench.shoot(3000)?;
            thread::sleep(Duration::from_secs(20));
            bench.ready(FIRST_START)?;
            // So have the other codings and sizes of the camera.
            for mode in [format!("MJPG:{w}x{h}@30"), format!("YUYV:{}x{}@30", w / 2, h / 2)] {
                bench.camera("unplug")?;
                bench.camera(&format!("modes {mode}"))?;
                bench.camera("plug 0")?;
                thread::sleep(Duration::from_secs(5));
                bench.lcd(Instant::now(), FIRST_START, "a picture", |p, _| p != Plate::Black)?;
            }
            bench.machine.guest.run(&["/bin/systemctl", "stop", "bowwave.service"])?;
            bench.machine.guest.shell(&format!("rm -f {STATE}/hits.sqlite* {STATE}/summary.json"))?;
            bench.machine.guest.run(&["/bin/systemctl", "--no-block", "poweroff"])?;
            bench.machine.off(Duration::from_secs(120))?;
            fs::rename(&data, &kept).context("data-used.img")?;
            fs::write(&stamp_path, stamp).context("data-used.stamp")?;
        }
        let to = self.out.join(name);
        fs::copy(&kept, &to).with_context(|| to.display().to_string())?;
        Ok(to)
    }

    /// A fresh data partition.
    pub fn fresh_data(&self, name: &str) -> Result<PathBuf> {
        let to = self.out.join(name);
        let from = self.parts.image.join("data.img");
        fs::copy(&from, &to).with_context(|| format!("{} to {}", from.display(), to.display()))?;
        // The file system takes what is free behind it, as on a gun computer's disk.
        fs::OpenOptions::new().write(true).open(&to)?.set_len(DATA_BYTES)?;
        Ok(to)
    }
}

fn make_tape(recording: &Path, out: &Path) -> Result<Tape> {
    drop(fs::remove_file(recording));
    hw_sim::make::make(&recipe(), recording, &mut |_, _| {})?;
    let tape = Tape::from_recording(recording)?;
    tape.write(out)?;
    Ok(tape)
}

/// Recipe of the tape.
pub fn recipe() -> hw_sim::make::Recipe {
    let mut recipe =
        hw_sim::make::Recipe { width: PICTURE.0, height: PICTURE.1, ..hw_sim::make::Recipe::default() };
    // Each packet costs the emulated processor as much as twenty cost a real one.
    recipe.imu.rate_hz = 100.0;
    recipe
}

/// A camera on USB has a serial number; this one gets its own, so that it is found again by it.
const CAMERA_RULE: &str = r#"SUBSYSTEM=="video4linux", ATTR{name}=="HIL camera", ENV{ID_SERIAL}="HIL_camera_0001", ENV{ID_SERIAL_SHORT}="0001", SYMLINK+="v4l/by-id/usb-HIL_camera_0001-video-index0"
"#;

/// The machine is slower than any gun computer: patience is scaled, nothing else is changed.
const SERVICE: &str = "[Service]
ExecStart=
ExecStart=/usr/bin/bowwave run --config /run/hil/etc/bowwave.toml --frame-hashes /run/bowwave/frames --print-commits
# The harness hears of each commit as soon as the program says so.
StandardOutput=file:/run/hil/output
StandardError=journal
WatchdogSec=30
TimeoutStartSec=600
TimeoutStopSec=20
# Software Vulkan compiles in a third of the time where LLVM does not optimise; what it draws stays the same.
Environment=GALLIVM_PERF=nopt
Environment=VK_ADD_LAYER_PATH=/run/hil/layer
Environment=VK_INSTANCE_LAYERS=VK_LAYER_BOWWAVE_gpu_fault
Environment=BOWWAVE_GPU_FAULT=/run/bowwave/gpu-fault
";

/// One boat that the tape's gun sweeps over, near enough to be struck, and ammunition for the whole test.
const SCENARIO: &str = include_str!("../../data/bench.toml");

/// Settings that differ between configurations.
#[derive(Clone, Debug)]
pub struct Configured {
    /// Modes of the camera, preferred first.
    pub modes: String,
    /// The calibration's name.
    pub calibration: String,
    /// Folder for data, where not the service's own.
    pub data: Option<String>,
    /// Whether what goes in is kept.
    pub record: bool,
    /// How the interlock is wired.
    pub interlock: String,
    /// A line of its own.
    pub extra: String,
}

impl Default for Configured {
    fn default() -> Self {
        let (w, h) = PICTURE;
        Self {
            modes: format!("\"YUYV {w}x{h}@30\", \"MJPEG {w}x{h}@30\", \"YUYV {}x{}@30\"", w / 2, h / 2),
            calibration: "calibration.toml".into(),
            data: None,
            record: false,
            // The contacts are set one after the other, and the machine is slow.
            interlock: "bias = \"external-pull-down\"\ndiscrepancy_ms = 5000\nsecond = { chip = \"bench\", line = \"interlock-inverted\", active_low = true, bias = \"external-pull-up\" }".into(),
            extra: String::new(),
        }
    }
}

/// The trainer's configuration for the bench.
pub fn configuration(c: &Configured) -> String {
    let data = c.data.as_ref().map_or_else(String::new, |d| format!("data = \"{d}\"\n"));
    format!(
        "[screen]\noutput = \"lcd\"\nsize = \"{}x{}\"\n[camera]\nmodes = [{}]\n[imu]\nbaud = [921600, 460800, 230400, 115200]\npacket_jitter_ms_max = 30\n\
         [trigger]\nchip = \"bench\"\nline = \"trigger\"\n[interlock]\nchip = \"bench\"\nline = \"interlock\"\n{}\n\
         [power_fail]\nchip = \"bench\"\nline = \"power-fail\"\n\
         [lamps]\nchip = \"bench\"\nready = \"lamp-ready\"\nhit = \"lamp-hit\"\nfault = \"lamp-fault\"\n\
         [gpu]\ngpu_timeout_ms = 15000\n[files]\nscenario = \"scenario.toml\"\ncalibration = \"{}\"\nrecord = {}\nrecord_exact = true\n{data}\
         [health]\nthermal = \"/run/hil/thermal\"\ntemperature_c_max = 78.0\n{}",
        LCD.0, LCD.1, c.modes, c.interlock, c.calibration, c.record, c.extra
    )
}

/// Change of a fault by a line of the journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JournalChange {
    /// It is there, or has happened.
    Came,
    /// It is gone.
    Went,
}

/// A running test.
pub struct HilBench {
    /// The machine.
    pub machine: VirtualMachine,
    /// How many times slower a core of the machine is than one of the host.
    pub slow: f64,
    /// Feed of the tape.
    pub feed: PlayerFeed,
    /// The tape, without its pictures.
    pub tape: TapeHeader,
    /// Pulls of the trigger: machine times before and after each edge, pressed.
    pub pulls: Vec<(i64, i64, bool)>,
    /// Times of the machine between which no round may be scored.
    pub blind: Vec<(i64, i64)>,
    /// For what is left.
    pub out: PathBuf,
    /// Number of the unit's adapter that is plugged.
    pub adapter: u32,
}

impl HilBench {
    /// Switches a machine on and waits for its agent.
    pub fn switch_on(shop: &Shop, data: &Path, clock: &str) -> Result<Self> {
        let folder = shop.out.join("machine");
        let start = MachineStart { folder: &folder, data, lcd: LCD, clock };
        let mut machine = VirtualMachine::start(&shop.parts, &start)?;
        if let Err(e) = machine.guest.greet(Duration::from_secs(180)) {
            let console = machine.console();
            let tail: Vec<&str> = console.lines().rev().take(30).collect();
            bail!("{e:#}; its console: {}", tail.into_iter().rev().collect::<Vec<_>>().join("\n"));
        }
        machine.guest.call(AgentCommand::FollowPipe { path: "/run/hil/output".into() })?;
        machine.guest.call(AgentCommand::FollowJournal)?;
        let (feed, adapter) = (PlayerFeed::default(), 0);
        Ok(Self {
            machine,
            slow: 20.0,
            feed,
            tape: shop.tape.clone(),
            pulls: Vec::new(),
            blind: Vec::new(),
            out: shop.out.clone(),
            adapter,
        })
    }

    /// Plugs the camera, closes the interlock and plays the tape.
    pub fn play(&mut self) -> Result<()> {
        let (w, h) = PICTURE;
        self.camera(&format!("modes YUYV:{w}x{h}@30 MJPG:{w}x{h}@30 YUYV:{}x{}@30", w / 2, h / 2))?;
        self.camera("plug 0")?;
        self.machine.guest.call(AgentCommand::Play { on: true })?;
        Ok(())
    }

    /// A command for the camera's driver.
    pub fn camera(&mut self, line: &str) -> Result<i64> {
        let at = self.machine.guest.now_ns();
        self.machine.guest.call(AgentCommand::Camera { line: line.to_owned() })?;
        Ok(at)
    }

    /// Changes how the tape is played; the machine's time of the change.
    pub fn feed(&mut self, change: impl FnOnce(&mut PlayerFeed)) -> Result<i64> {
        change(&mut self.feed);
        let at = self.machine.guest.call(AgentCommand::Feed(self.feed.clone()))?;
        at.as_i64().context("a time")
    }

    /// Sets an input, and with the interlock its second contact; the machine's time after it.
    pub fn pull(&mut self, line: usize, high: bool) -> Result<i64> {
        if line == INTERLOCK {
            self.pulls(INTERLOCK_INVERTED, vec![(0, !high)])?;
        }
        let times = self.pulls(line, vec![(0, high)])?;
        Ok(times.last().map_or(0, |t| t[1]))
    }

    /// Sets an input step after step.
    pub fn pulls(&mut self, line: usize, steps: Vec<(u64, bool)>) -> Result<Vec<[i64; 2]>> {
        let value = self.machine.guest.call(AgentCommand::Pull { line, steps: steps.clone() })?;
        let times: Vec<[i64; 2]> = serde_json::from_value(value)?;
        if line == 0 {
            let edges = times.iter().zip(&steps);
            self.pulls.extend(edges.map(|([before, after], (_, high))| (*before, *after, *high)));
        }
        Ok(times)
    }

    /// Pulls the trigger for a while; the machine's time of the press.
    pub fn shoot(&mut self, for_ms: u64) -> Result<i64> {
        let times = self.pulls(0, vec![(0, true), (for_ms * 1000, false)])?;
        Ok(times[0][0])
    }

    /// Waits until the journal says that the fault came or went, at `since_ns` or later; the machine's time of that.
    pub fn told(&self, code: &str, told: JournalChange, since_ns: i64, patience: Duration) -> Result<i64> {
        let what = format!("{code} {told:?} in the journal");
        let entry =
            self.machine.guest.journal(since_ns, patience, &what, |e| says(&e.fields, code) == Some(told))?;
        Ok(entry.at_ns)
    }

    /// Text of the LCD, by the service's status line.
    pub fn status(&mut self) -> Result<String> {
        let argv = ["/bin/systemctl", "show", "-P", "StatusText", "bowwave.service"];
        Ok(self.machine.guest.run(&argv)?.trim().to_owned())
    }

    /// Waits for a state on the LCD itself, seen at `since` or later.
    pub fn lcd(
        &self,
        since: Instant,
        patience: Duration,
        what: &str,
        wanted: impl Fn(Plate, bool) -> bool,
    ) -> Result<Instant> {
        let until = Instant::now() + patience;
        loop {
            if let Some(sight) = self.machine.lcd.first(since, |s| wanted(s.plate, s.warning)) {
                return Ok(sight.at);
            }
            if Instant::now() > until {
                bail!(
                    "{what} was not seen on the LCD within {:.0} s, only {:?}",
                    patience.as_secs_f64(),
                    self.machine.lcd.last()
                );
            }
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits for the end of a start, and tells meanwhile how it goes.
    pub fn started(&mut self, patience: Duration) -> Result<()> {
        let until = Instant::now() + patience;
        while self.ready(Duration::from_secs(20)).is_err() {
            let seconds = self.machine.power_on.elapsed().as_secs();
            eprintln!("  {seconds} s after power-on: \"{}\"", self.status()?);
            if Instant::now() > until {
                let lines = self.machine.guest.journal_since(0);
                let last: Vec<&str> = lines.iter().rev().take(12).map(|e| e.text()).collect();
                self.keep_picture("start");
                bail!(
                    "not READY after {} s; the journal, newest first: {}",
                    patience.as_secs(),
                    last.join(" | ")
                );
            }
        }
        Ok(())
    }

    /// Waits until the trainer is READY and stays so: by the LCD and by the service's status line, which are told apart by how
    /// long a frame takes to the LCD. A warning may stand beside it. When the LCD said it first.
    pub fn ready(&mut self, patience: Duration) -> Result<Instant> {
        let until = Instant::now() + patience;
        let mut first = None;
        loop {
            let since = Instant::now();
            let seen =
                self.lcd(since, until.saturating_duration_since(since), "READY", |p, _| p == Plate::Ready)?;
            let begun = *first.get_or_insert(seen);
            if !self.status()?.starts_with("READY") {
                first = None;
            } else if begun.elapsed() > STEADY {
                return Ok(begun);
            }
            if let Some(last) = self.machine.lcd.last().filter(|s| s.plate != Plate::Ready) {
                first = None;
                ensure!(Instant::now() < until, "READY did not stay on the LCD: {last:?}");
            }
            thread::sleep(Duration::from_millis(100));
        }
    }

    /// Waits until rounds are scored, whether or not the picture confirms where the camera looks.
    pub fn scoring(&mut self, patience: Duration) -> Result<()> {
        let until = Instant::now() + patience;
        loop {
            let status = self.status()?;
            if ["READY", "NOT CHECKED"].iter().any(|word| status.starts_with(word)) {
                return Ok(());
            }
            ensure!(Instant::now() < until, "no rounds are scored: {status}");
            thread::sleep(Duration::from_millis(300));
        }
    }

    /// Compares the LCD with the frames' hashes that the trainer keeps; how many of so many pictures were found.
    pub fn identical(&mut self, pictures: usize) -> Result<(usize, usize)> {
        let mut seen = Vec::new();
        let until = Instant::now() + Duration::from_secs(10);
        while seen.len() < pictures && Instant::now() < until {
            let hash = self.machine.lcd.newest().context("no picture of the LCD")?.hash();
            if !seen.contains(&hash) {
                seen.push(hash);
            }
            thread::sleep(Duration::from_millis(30));
        }
        let ring = self.machine.guest.run(&["/bin/cat", HASHES])?;
        let known: Vec<&str> = ring.lines().filter_map(|l| l.split_whitespace().nth(1)).collect();
        ensure!(!known.is_empty(), "{HASHES} is empty");
        Ok((seen.iter().filter(|h| known.contains(&h.as_str())).count(), seen.len()))
    }

    /// The rounds of all runs in the journal of hits.
    pub fn rounds(&mut self) -> Result<Vec<Value>> {
        let (code, out, err) = self
            .machine
            .guest
            .run_any(&["/usr/bin/bowwave", "hits", "--json", "--all-runs", STATE], Duration::from_secs(90))?;
        ensure!(code == 0, "bowwave hits: exit code {code}: {err}");
        serde_json::from_str(&out).context("bowwave hits")
    }

    /// Restarts or stops or starts the trainer.
    pub fn service(&mut self, verb: &str) -> Result<()> {
        self.machine.guest.run(&["/bin/systemctl", "--no-block", verb, "bowwave.service"]).map(|_| ())
    }

    /// Writes the trainer's configuration.
    pub fn configure(&mut self, c: &Configured) -> Result<()> {
        let (path, text) = ("/run/hil/etc/bowwave.toml".to_owned(), configuration(c));
        self.machine.guest.call(AgentCommand::Write { path, text }).map(|_| ())
    }

    /// A native time in the machine's terms, at most.
    pub fn scaled(&self, seconds: f64) -> Duration {
        Duration::from_secs_f64(seconds * self.slow)
    }

    /// Keeps the LCD's picture under a name.
    pub fn keep_picture(&self, name: &str) {
        if let Some(dump) = self.machine.lcd.newest() {
            drop(fs::create_dir_all(self.out.join("lcd")));
            if let Err(e) = dump.save(&self.out.join("lcd").join(format!("{name}.png"))) {
                eprintln!("{e:#}");
            }
        }
    }
}

/// Change of a fault by fields of the journal.
pub fn says(fields: &Value, code: &str) -> Option<JournalChange> {
    let field = |name: &str| fields[name].as_str().unwrap_or_default();
    let message = field("MESSAGE");
    let named = match field("FAULT_CODE") {
        "" => message.split_whitespace().next().unwrap_or_default(),
        named => named,
    };
    if named != code {
        return None;
    }
    let over = message.get(code.len()..).is_some_and(|rest| rest.starts_with(" over "));
    Some(if field("FAULT_STATE") == "cleared" || over { JournalChange::Went } else { JournalChange::Came })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_journal_is_understood() {
        let raised = json!({ "FAULT_CODE": "CAM_LOST", "FAULT_STATE": "raised", "MESSAGE": "CAM_LOST gone" });
        assert_eq!(says(&raised, "CAM_LOST"), Some(JournalChange::Came));
        assert_eq!(says(&raised, "CAM"), None);
        let cleared = json!({ "MESSAGE": "CAM_LOST over after 1.203 s" });
        assert_eq!(says(&cleared, "CAM_LOST"), Some(JournalChange::Went));
        assert_eq!(says(&json!({ "MESSAGE": "it is CAM_LOST" }), "CAM_LOST"), None);
    }

    #[test]
    fn the_configuration_is_one_that_the_trainer_takes() {
        let text =
            configuration(&Configured { data: Some("/run/hil/spare".into()), ..Configured::default() });
        bowwave::config::parse(&text, "bench", Path::new("/")).unwrap();
        assert!(
            configuration(&Configured { extra: "[camera".into(), ..Configured::default() })
                .ends_with("[camera")
        );
    }
}
