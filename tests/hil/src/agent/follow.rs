//! What is sent to the host as it comes.

use std::{
    fs::File,
    io::{BufRead, BufReader, Read, Seek, SeekFrom},
    path::Path,
    process::{Command, Stdio},
    sync::Arc,
    thread,
    time::Duration,
};

use anyhow::{Context, Result};
use bowwave_devices::clock;
use bowwave_hil::protocol::AgentMessage;
use serde_json::{Map, Value};

use crate::link::Link;

/// How often a followed file is looked at.
const LOOK: Duration = Duration::from_millis(60);
/// Most of a line that is kept.
const LINE_MAX: usize = 4096;

/// There from when the journal lies where it stays: who follows it earlier sees only what came before.
const FLUSHED: &str = "/run/systemd/journal/flushed";

/// Follows the journal of this boot from its beginning.
pub fn journal(link: &Arc<Link>) -> Result<Value> {
    let link = Arc::clone(link);
    thread::spawn(move || {
        while !Path::new(FLUSHED).exists() {
            thread::sleep(LOOK);
        }
        let ended = follow_journal(&link).err().map_or_else(String::new, |e| format!(": {e:#}"));
        link.say(&AgentMessage::Failure { what: format!("journalctl has ended{ended}") });
    });
    Ok(Value::Null)
}

fn follow_journal(link: &Link) -> Result<()> {
    let mut child = Command::new("/bin/journalctl")
        .args(["--boot", "--follow", "--no-tail", "--output=json", "--quiet"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .context("journalctl")?;
    let out = child.stdout.take().context("journalctl's output")?;
    for line in BufReader::new(out).lines().map_while(Result::ok) {
        if let Some(message) = journal_message(&line) {
            link.say(&message);
        }
    }
    child.wait().context("journalctl")?;
    Ok(())
}

/// The fields that matter, of the kernel, of the service manager on the trainer, and of the trainer.
fn journal_message(line: &str) -> Option<AgentMessage> {
    let Value::Object(all) = serde_json::from_str(line).ok()? else { return None };
    let text = |name: &str| all.get(name).and_then(Value::as_str).unwrap_or_default().to_owned();
    let at_us: i64 = text("__MONOTONIC_TIMESTAMP").parse().ok()?;
    let unit = [text("_SYSTEMD_UNIT"), text("UNIT")].iter().any(|u| u == "bowwave.service");
    let kernel = text("_TRANSPORT") == "kernel" && text("PRIORITY").parse().is_ok_and(|p: u8| p <= 4);
    if !unit && !kernel {
        return None;
    }
    let keep = |name: &str| {
        matches!(name, "MESSAGE" | "PRIORITY" | "_PID" | "SYSLOG_IDENTIFIER")
            || (!name.starts_with('_')
                && !name.starts_with("SYSLOG_")
                && name != "MESSAGE_ID"
                && name != "INVOCATION_ID")
    };
    let fields: Map<String, Value> = all.into_iter().filter(|(name, _)| keep(name)).collect();
    Some(AgentMessage::Journal { at_ns: at_us.saturating_mul(1000), fields: Value::Object(fields) })
}

/// Follows a file from its beginning, over truncation and replacement.
pub fn file(link: &Arc<Link>, path: String) -> Result<Value> {
    let link = Arc::clone(link);
    thread::spawn(move || {
        let (mut at, mut rest) = (0u64, Vec::new());
        loop {
            drop(read_on(&path, &mut at, &mut rest));
            while let Some(end) = rest.iter().position(|b| *b == b'\n') {
                let line: Vec<u8> = rest.drain(..=end).collect();
                let text = String::from_utf8_lossy(&line[..end]).into_owned();
                link.say(&AgentMessage::Line { at_ns: clock::now().ns(), path: path.clone(), text });
            }
            if rest.len() > LINE_MAX {
                rest.clear();
            }
            thread::sleep(LOOK);
        }
    });
    Ok(Value::Null)
}

fn read_on(path: &str, at: &mut u64, rest: &mut Vec<u8>) -> std::io::Result<()> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    if length < *at {
        *at = 0;
        rest.clear();
    }
    file.seek(SeekFrom::Start(*at))?;
    *at += file.take(1 << 20).read_to_end(rest)? as u64;
    Ok(())
}

/// Follows a named pipe, over all who write to it.
pub fn pipe(link: &Arc<Link>, path: String) -> Result<Value> {
    // Open for writing as well, so that it does not end with a writer.
    let pipe = File::options().read(true).write(true).open(&path).with_context(|| path.clone())?;
    let link = Arc::clone(link);
    thread::spawn(move || {
        for text in BufReader::new(pipe).lines().map_while(Result::ok) {
            link.say(&AgentMessage::Line { at_ns: clock::now().ns(), path: path.clone(), text });
        }
    });
    Ok(Value::Null)
}
