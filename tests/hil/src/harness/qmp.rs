//! QEMU's control socket.

use std::{
    io::{BufRead, BufReader, Write},
    os::unix::net::UnixStream,
    path::Path,
    sync::mpsc::{Receiver, RecvTimeoutError, channel},
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use serde_json::{Value, json};

/// How long a command may take: the machine may be busy.
const PATIENCE: Duration = Duration::from_secs(20);

/// A connection.
pub struct Qmp {
    socket: UnixStream,
    messages: Receiver<Value>,
    events: Vec<Value>,
}

impl Qmp {
    /// Connects as soon as the socket is there.
    pub fn connect(path: &Path) -> Result<Self> {
        let socket = wait_for_socket(path)?;
        let lines = BufReader::new(socket.try_clone()?);
        let (sender, messages) = channel();
        thread::spawn(move || {
            for line in lines.lines().map_while(Result::ok) {
                if serde_json::from_str(&line).is_ok_and(|v| sender.send(v).is_err()) {
                    return;
                }
            }
        });
        let mut qmp = Self { socket, messages, events: Vec::new() };
        qmp.execute("qmp_capabilities", json!({}))?;
        Ok(qmp)
    }

    /// Executes a command.
    pub fn execute(&mut self, command: &str, arguments: Value) -> Result<Value> {
        let line = json!({ "execute": command, "arguments": arguments });
        writeln!(self.socket, "{line}").with_context(|| format!("QEMU's control socket, {command}"))?;
        let until = Instant::now() + PATIENCE;
        loop {
            let message = self.next(until).with_context(|| format!("QEMU, {command}"))?;
            if let Some(result) = message.get("return") {
                return Ok(result.clone());
            }
            if let Some(error) = message.get("error") {
                bail!("QEMU, {command}: {error}");
            }
        }
    }

    fn next(&mut self, until: Instant) -> Result<Value> {
        match self.messages.recv_timeout(until.saturating_duration_since(Instant::now())) {
            Ok(message) => {
                if message.get("event").is_some() {
                    self.events.push(message.clone());
                }
                Ok(message)
            }
            Err(RecvTimeoutError::Timeout) => bail!("no answer in {} s", PATIENCE.as_secs()),
            Err(RecvTimeoutError::Disconnected) => bail!("QEMU has ended"),
        }
    }

    /// Removes a device, and waits until it is gone.
    pub fn remove(&mut self, id: &str) -> Result<()> {
        self.events.clear();
        self.execute("device_del", json!({ "id": id }))?;
        let until = Instant::now() + PATIENCE;
        let gone = |e: &Value| e["event"] == "DEVICE_DELETED" && e["data"]["device"] == id;
        while !self.events.iter().any(gone) {
            self.next(until).with_context(|| format!("{id} does not go"))?;
        }
        Ok(())
    }
}

/// A socket that QEMU is about to make.
pub fn wait_for_socket(path: &Path) -> Result<UnixStream> {
    let until = Instant::now() + Duration::from_secs(10);
    loop {
        match UnixStream::connect(path) {
            Ok(socket) => return Ok(socket),
            Err(_) if Instant::now() < until => thread::sleep(Duration::from_millis(20)),
            Err(e) => return Err(e).with_context(|| path.display().to_string()),
        }
    }
}
