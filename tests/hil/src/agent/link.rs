//! The serial ports to the host.

use std::{
    fs::{File, OpenOptions},
    io::Write,
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError},
    thread,
    time::Duration,
};

use anyhow::{Context, Result};
use bowwave_hil::{PORT_CONTROL, PORT_IMU, protocol::AgentMessage};

/// How long the ports may take to appear after the driver is there.
const APPEAR: Duration = Duration::from_secs(120);

/// The agent's way to the host.
pub struct Link {
    control: Mutex<File>,
    imu: Mutex<File>,
}

impl Link {
    /// Waits for the ports. The file is for reading requests.
    pub fn open() -> Result<(Arc<Self>, File)> {
        let control = open_port(PORT_CONTROL)?;
        let requests = control.try_clone().context("the control port")?;
        let imu = open_port(PORT_IMU)?;
        Ok((Arc::new(Self { control: Mutex::new(control), imu: Mutex::new(imu) }), requests))
    }

    /// Tells the host. One that does not listen any more has seen enough.
    pub fn say(&self, message: &AgentMessage) {
        let Ok(mut line) = serde_json::to_vec(message) else { return };
        line.push(b'\n');
        let mut control = self.control.lock().unwrap_or_else(PoisonError::into_inner);
        drop(control.write_all(&line));
    }

    /// Sends bytes of the unit.
    pub fn send_imu(&self, bytes: &[u8]) {
        let mut imu = self.imu.lock().unwrap_or_else(PoisonError::into_inner);
        drop(imu.write_all(bytes));
    }
}

/// udev may be late with the names, the kernel is not.
fn open_port(name: &str) -> Result<File> {
    let begun = std::time::Instant::now();
    loop {
        for port in std::fs::read_dir("/sys/class/virtio-ports").into_iter().flatten().flatten() {
            let named = std::fs::read_to_string(port.path().join("name")).unwrap_or_default();
            if named.trim() == name {
                let node = PathBuf::from("/dev").join(port.file_name());
                if let Ok(file) = OpenOptions::new().read(true).write(true).open(&node) {
                    return Ok(file);
                }
            }
        }
        anyhow::ensure!(begun.elapsed() < APPEAR, "no virtio serial port {name}");
        thread::sleep(Duration::from_millis(50));
    }
}
