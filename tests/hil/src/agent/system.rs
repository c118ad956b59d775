//! Programs, files, processes.

use std::{
    fs,
    io::{Read, Seek, SeekFrom, Write},
    path::Path,
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail, ensure};
use nix::{
    sys::{
        ptrace,
        wait::{WaitPidFlag, waitpid},
    },
    unistd::Pid,
};
use serde_json::{Value, json};

/// Most of a program's output that is sent.
const OUTPUT_MAX: u64 = 4 << 20;

/// Runs a program.
pub fn run(argv: &[String], timeout_ms: u64) -> Result<Value> {
    let (program, arguments) = argv.split_first().context("no program")?;
    let begun = Instant::now();
    let mut child = Command::new(program)
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .with_context(|| program.clone())?;
    let read = |pipe: Option<Box<dyn Read + Send>>| {
        thread::spawn(move || {
            let mut bytes = Vec::new();
            if let Some(pipe) = pipe {
                drop(pipe.take(OUTPUT_MAX).read_to_end(&mut bytes));
            }
            String::from_utf8_lossy(&bytes).into_owned()
        })
    };
    let out = read(child.stdout.take().map(|p| Box::new(p) as _));
    let err = read(child.stderr.take().map(|p| Box::new(p) as _));
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if begun.elapsed() > Duration::from_millis(timeout_ms) {
            child.kill()?;
            child.wait()?;
            bail!("{} still ran after {timeout_ms} ms", argv.join(" "));
        }
        thread::sleep(Duration::from_millis(5));
    };
    let text = |thread: thread::JoinHandle<String>| thread.join().unwrap_or_default();
    Ok(json!({
        "code": status.code().unwrap_or(-1),
        "out": text(out),
        "err": text(err),
        "ms": begun.elapsed().as_millis() as u64,
    }))
}

/// Makes a file whole or not at all.
pub fn write(path: &str, text: &str) -> Result<Value> {
    let path = Path::new(path);
    let folder = path.parent().context("a folder")?;
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    // Files of the kernel's own systems cannot be replaced.
    if path.starts_with("/sys") || path.starts_with("/proc") || path.starts_with("/dev") {
        fs::write(path, text).with_context(|| path.display().to_string())?;
        return Ok(Value::Null);
    }
    let part = path.with_extension("part");
    fs::write(&part, text).with_context(|| part.display().to_string())?;
    fs::rename(&part, path).with_context(|| path.display().to_string())?;
    Ok(Value::Null)
}

/// Damages a file.
pub fn patch(path: &str, offset: u64, count: u64) -> Result<Value> {
    ensure!(count <= 16 << 20, "too much damage");
    let mut file = fs::OpenOptions::new().write(true).open(path).with_context(|| path.to_owned())?;
    file.seek(SeekFrom::Start(offset))?;
    file.write_all(&vec![0xA5; count as usize])?;
    file.sync_all()?;
    Ok(Value::Null)
}

/// The trainer's main process.
fn trainer() -> Result<i32> {
    for entry in fs::read_dir("/proc")?.flatten() {
        let Some(pid) = entry.file_name().to_str().and_then(|n| n.parse::<i32>().ok()) else { continue };
        let line = fs::read(entry.path().join("cmdline")).unwrap_or_default();
        let mut words = line.split(|b| *b == 0);
        if words.next() == Some(b"/usr/bin/bowwave") && words.next() == Some(b"run") {
            return Ok(pid);
        }
    }
    bail!("the trainer does not run")
}

fn threads(pid: i32) -> Result<Vec<(i32, String)>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(format!("/proc/{pid}/task"))?.flatten() {
        let Some(tid) = entry.file_name().to_str().and_then(|n| n.parse::<i32>().ok()) else { continue };
        let name = fs::read_to_string(entry.path().join("comm")).unwrap_or_default();
        found.push((tid, name.trim().to_owned()));
    }
    Ok(found)
}

/// Stops one thread for a while, as a driver that does not return would.
pub fn hold(name: &str, ms: u64) -> Result<Value> {
    let pid = trainer()?;
    let all = threads(pid)?;
    let (tid, _) = all.iter().find(|(_, n)| n == name).with_context(|| {
        format!(
            "the trainer has no thread {name}, only {}",
            all.iter().map(|(_, n)| n.as_str()).collect::<Vec<_>>().join(" ")
        )
    })?;
    let thread = Pid::from_raw(*tid);
    ptrace::seize(thread, ptrace::Options::empty()).context("PTRACE_SEIZE")?;
    ptrace::interrupt(thread).context("PTRACE_INTERRUPT")?;
    waitpid(thread, Some(WaitPidFlag::__WALL)).context("the thread does not stop")?;
    let begun = bowwave_devices::clock::now().ns();
    thread::sleep(Duration::from_millis(ms));
    // Where the watchdog has ended it meanwhile, there is nothing to go on with.
    let detached = ptrace::detach(thread, None).is_ok();
    Ok(json!({ "begun_ns": begun, "ended_ns": bowwave_devices::clock::now().ns(), "went_on": detached }))
}

/// Resources that the trainer uses.
pub fn usage() -> Result<Value> {
    let pid = trainer()?;
    let status = fs::read_to_string(format!("/proc/{pid}/status"))?;
    let kib = |key: &str| {
        let line = status.lines().find_map(|l| l.strip_prefix(key));
        line.and_then(|l| l.trim().trim_end_matches(" kB").trim().parse::<u64>().ok()).unwrap_or(0)
    };
    let mut all = serde_json::Map::new();
    for (tid, name) in threads(pid)? {
        let stat = fs::read_to_string(format!("/proc/{pid}/task/{tid}/stat")).unwrap_or_default();
        // The name, in parentheses, may hold anything.
        let fields: Vec<&str> = stat.rsplit(") ").next().unwrap_or_default().split(' ').collect();
        let ticks = |i: usize| fields.get(i).and_then(|v| v.parse::<u64>().ok()).unwrap_or(0);
        let sum = ticks(11) + ticks(12) + all.get(&name).and_then(Value::as_u64).unwrap_or(0);
        all.insert(name, json!(sum));
    }
    Ok(json!({
        "pid": pid,
        "rss_kib": kib("VmRSS:"),
        "peak_kib": kib("VmHWM:"),
        "threads": all,
        "now_ns": bowwave_devices::clock::now().ns(),
    }))
}
