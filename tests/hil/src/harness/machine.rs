//! The virtual machine: QEMU with the image's disks, an LCD, a USB serial adapter, a hardware watchdog and the bench's ports.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail, ensure};
use bowwave_hil::{PORT_CONTROL, PORT_IMU, TAPE_SERIAL};
use serde_json::json;

use super::{
    cpio::{Archive, stripped},
    guest::Guest,
    lcd::LcdWatch,
    qmp::{Qmp, wait_for_socket},
    unit::SerialUnit,
};

/// Parts of a machine.
pub struct MachineParts {
    /// Output folder of systemd/image/build.
    pub image: PathBuf,
    /// Output folder of tests/hil/modules/build.
    pub modules: PathBuf,
    /// The agent's program.
    pub agent: PathBuf,
    /// The tape.
    pub tape: PathBuf,
    /// Files for the machine, under /run/hil: name, content.
    pub files: Vec<(String, String)>,
    /// Files of the host for the machine, under /run/hil: name, where it is.
    pub blobs: Vec<(String, PathBuf)>,
    /// The service manager's files, under /run/systemd/system: name, content.
    pub units: Vec<(String, String)>,
}

/// How it is started.
pub struct MachineStart<'a> {
    /// Folder for sockets and logs.
    pub folder: &'a Path,
    /// The data partition, written to.
    pub data: &'a Path,
    /// Pixels of the LCD.
    pub lcd: (u32, u32),
    /// The hardware clock at start, as QEMU's -rtc takes it.
    pub clock: &'a str,
}

/// A running machine.
pub struct VirtualMachine {
    /// The program.
    process: Child,
    /// Its controls.
    pub qmp: Qmp,
    /// Its LCD.
    pub lcd: LcdWatch,
    /// Its agent.
    pub guest: Guest,
    /// Its inertial unit.
    pub unit: SerialUnit,
    /// When it was switched on.
    pub power_on: Instant,
    folder: PathBuf,
}

const INIT: &str = "#!/bin/busybox sh
/bin/busybox mount -t tmpfs -o nosuid,nodev,mode=0755,size=40% run /run
/bin/busybox cp -a /hil /run/hil
/bin/busybox mkdir -p /run/systemd
/bin/busybox cp -a /units /run/systemd/system
/bin/busybox mkdir -p /run/udev
/bin/busybox cp -a /hil/udev /run/udev/rules.d
/bin/busybox mkfifo /run/hil/output
exec /boot.sh
";

const AGENT_UNIT: &str = "[Unit]
Description=Agent of the test bench
DefaultDependencies=no
After=systemd-modules-load.service
[Service]
ExecStart=/run/hil/agent
OOMScoreAdjust=-900
Nice=-15
[Install]
WantedBy=sysinit.target
";

impl MachineParts {
    /// The kernel that the modules must fit.
    pub fn release(image: &Path) -> Result<String> {
        let path = image.join("release");
        Ok(fs::read_to_string(&path).with_context(|| path.display().to_string())?.trim().to_owned())
    }

    /// The image's initial file system with the bench's appended.
    pub fn initrd(&self, out: &Path) -> Result<()> {
        let mut archive = Archive::new();
        archive.file("init", 0o755, INIT.as_bytes());
        archive.folder("hil");
        let folder = tempfile::tempdir().context("a folder")?;
        archive.file("hil/agent", 0o755, &stripped(&self.agent, folder.path())?);
        archive.folder("hil/modules");
        for entry in fs::read_dir(&self.modules).context("the bench's modules")? {
            let path = entry?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let bytes = fs::read(&path).with_context(|| path.display().to_string())?;
            archive.file(&format!("hil/modules/{name}"), 0o644, &bytes);
        }
        for (name, content) in &self.files {
            put(&mut archive, "hil", name, content.as_bytes());
        }
        for (name, path) in &self.blobs {
            let bytes = fs::read(path).with_context(|| path.display().to_string())?;
            put(&mut archive, "hil", name, &bytes);
        }
        archive.folder("units");
        archive.file("units/hil-agent.service", 0o644, AGENT_UNIT.as_bytes());
        archive.folder("units/sysinit.target.wants");
        archive.link("units/sysinit.target.wants/hil-agent.service", "../hil-agent.service");
        for (name, content) in &self.units {
            put(&mut archive, "units", name, content.as_bytes());
        }
        archive.append_to(&self.image.join("initrd.img"), out)
    }
}

/// A file and the folder that it is in.
fn put(archive: &mut Archive, root: &str, name: &str, content: &[u8]) {
    if let Some((folder, _)) = name.rsplit_once('/') {
        archive.folder(&format!("{root}/{folder}"));
    }
    archive.file(&format!("{root}/{name}"), 0o644, content);
}

impl VirtualMachine {
    /// Switches it on. It is not waited for.
    pub fn start(parts: &MachineParts, start: &MachineStart<'_>) -> Result<Self> {
        let folder = start.folder;
        fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        for name in ["qmp", "watch", "ctl", "imu"] {
            drop(fs::remove_file(folder.join(name)));
        }
        let initrd = folder.join("initrd.img");
        parts.initrd(&initrd)?;
        let (unit, terminal) = SerialUnit::new()?;
        let log = |name: &str| fs::File::create(folder.join(name)).with_context(|| format!("{name} of QEMU"));
        // Whatever becomes of the harness, the machine does not outlive it.
        let mut qemu = Command::new("setpriv");
        qemu.args(["--pdeathsig", "KILL", "qemu-system-x86_64"]);
        qemu.args(arguments(parts, start, &initrd, unit.path()));
        let power_on = Instant::now();
        let process = qemu
            .stdin(Stdio::null())
            .stdout(Stdio::from(log("qemu.out")?))
            .stderr(Stdio::from(log("qemu.err")?))
            .spawn()
            .context("qemu-system-x86_64 cannot be run; ./check setup installs it")?;
        let connected = || -> Result<_> {
            let qmp = Qmp::connect(&folder.join("qmp"))?;
            let lcd = LcdWatch::start(Qmp::connect(&folder.join("watch"))?, folder, start.lcd)?;
            let guest = Guest::new(wait_for_socket(&folder.join("ctl"))?, log("journal.txt")?)?;
            unit.relay(wait_for_socket(&folder.join("imu"))?, terminal)?;
            Ok((qmp, lcd, guest))
        };
        match connected() {
            Ok((qmp, lcd, guest)) => {
                Ok(Self { process, qmp, lcd, guest, unit, power_on, folder: folder.to_owned() })
            }
            Err(e) => {
                let mut process = process;
                drop(process.kill());
                drop(process.wait());
                let said = fs::read_to_string(folder.join("qemu.err")).unwrap_or_default();
                Err(e.context(format!("QEMU did not start: {}", said.trim())))
            }
        }
    }

    /// Plugs the unit's adapter again.
    pub fn plug_adapter(&mut self, id: &str) -> Result<()> {
        let device = json!({
            "driver": "usb-serial", "id": id, "chardev": "line", "bus": "usb.0", "serial": "unit1",
        });
        self.qmp.execute("device_add", device).map(|_| ())
    }

    /// Takes the power away, now: the process is killed. A time of the machine that it did not reach.
    pub fn cut(mut self) -> Result<i64> {
        self.process.kill().context("QEMU cannot be killed")?;
        self.process.wait().context("QEMU")?;
        Ok(self.guest.now_ns())
    }

    /// Waits until it has switched itself off.
    pub fn off(mut self, patience: Duration) -> Result<()> {
        let until = Instant::now() + patience;
        while Instant::now() < until {
            if let Some(status) = self.process.try_wait().context("QEMU")? {
                ensure!(status.success(), "QEMU ended with {status}");
                return Ok(());
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        self.process.kill().context("QEMU")?;
        self.process.wait().context("QEMU")?;
        bail!("the machine did not switch itself off within {} s", patience.as_secs());
    }

    /// Text of its serial console.
    pub fn console(&self) -> String {
        String::from_utf8_lossy(&fs::read(self.folder.join("console")).unwrap_or_default()).into_owned()
    }
}

impl Drop for VirtualMachine {
    fn drop(&mut self) {
        drop(self.process.kill());
        drop(self.process.wait());
    }
}

/// Writes go to the host's page cache, which outlives the process: a killed process then loses what the machine had not
/// handed to its disk, and nothing that it had. That is what a disk with a cache that honours flushes does, at its kindest;
/// tests of every write boundary (`./check cuts`) cover the unkind ones.
const WRITTEN: &str = "format=raw,if=none,cache=writeback,aio=threads";

fn arguments(parts: &MachineParts, start: &MachineStart<'_>, initrd: &Path, line: &Path) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    let mut add = |words: &str| all.extend(words.split(' ').map(str::to_owned));
    let socket = |name: &str| start.folder.join(name).display().to_string();
    let shown = |path: &Path| path.display().to_string();
    add("-machine q35 -accel tcg,thread=multi,tb-size=512 -smp 2 -cpu max -m 1536");
    add("-nodefaults -no-user-config -display none -no-reboot -vga none");
    add(&format!("-rtc base={}", start.clock));
    add(&format!("-kernel {} -initrd {}", shown(&parts.image.join("vmlinuz")), shown(initrd)));
    add(&format!("-chardev file,id=con,path={} -serial chardev:con", socket("console")));
    for (name, file, options) in [
        ("root", parts.image.join("root.img"), "format=raw,if=none,readonly=on"),
        ("data", start.data.to_owned(), WRITTEN),
        (TAPE_SERIAL, parts.tape.clone(), "format=raw,if=none,readonly=on"),
    ] {
        add(&format!("-drive id={name},file={},{options}", shown(&file)));
        add(&format!("-device virtio-blk-pci,drive={name},serial={name}"));
    }
    add(&format!("-device qemu-xhci,id=usb -chardev serial,id=line,path={}", shown(line)));
    add("-device usb-serial,id=adapter0,chardev=line,bus=usb.0,serial=unit1");
    add("-device virtio-serial-pci,id=ports");
    for (id, name) in [("ctl", PORT_CONTROL), ("imu", PORT_IMU)] {
        add(&format!("-chardev socket,id={id},path={},server=on,wait=off", socket(id)));
        add(&format!("-device virtserialport,bus=ports.0,chardev={id},name={name}"));
    }
    add("-device virtio-rng-pci -device i6300esb -action watchdog=reset");
    let (width, height) = start.lcd;
    add(&format!("-device virtio-gpu-pci,id=lcd,xres={width},yres={height},edid=off"));
    for name in ["qmp", "watch"] {
        add(&format!("-qmp unix:{},server=on,wait=off", socket(name)));
    }
    all.push("-append".to_owned());
    // For who looks for what keeps a machine from starting: systemd.journald.forward_to_console=1, for one.
    let further = std::env::var("BOWWAVE_HIL_APPEND").unwrap_or_default();
    all.push(format!(
        "console=ttyS0,115200 root=/dev/vda ro quiet loglevel=3 vt.global_cursor_default=0 systemd.show_status=0 \
         fsck.repair=yes panic=-1 oops=panic {further}"
    ));
    all
}
