//! The ship's own heading, on a serial line of its own: a second USB adapter, whose other end says it.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};
use hw_sim::pty::Terminal;
use serde_json::json;

use super::{CaseResult, FaultRow, SpecialCase};
use crate::{
    bench::{Configured, HilBench, JournalChange},
    lcd::Plate,
};

/// Between two lines.
const PERIOD: Duration = Duration::from_millis(100);
/// The heading of the tape's ship, roughly.
const HEADING: &str = "HEHDT,318.0,T";
/// Line of a compass that does not know the heading.
const INVALID: &str = "HEHDT,,T";

pub fn rows() -> Vec<FaultRow> {
    vec![FaultRow::Own(SpecialCase {
        number: "S",
        fault: "Ship's heading lost",
        injected: "its USB adapter is removed and plugged again; its compass says no heading for a while",
        code: "SHIP_LOST",
        target: "a warning, training goes on; back 2 s",
        run: lost,
    })]
}

/// The ship's end of the line.
struct Compass {
    knows: Arc<AtomicBool>,
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    slave: String,
}

impl Compass {
    fn start() -> Result<Self> {
        let terminal = Terminal::open().context("no pseudo-terminal for the ship's line")?;
        let slave = terminal.slave().display().to_string();
        let (knows, ends) = (Arc::new(AtomicBool::new(true)), Arc::new(AtomicBool::new(false)));
        let shared = (Arc::clone(&knows), Arc::clone(&ends));
        let thread = thread::Builder::new().name("ship".into()).spawn(move || {
            while !shared.1.load(Ordering::Relaxed) {
                let text = if shared.0.load(Ordering::Relaxed) { HEADING } else { INVALID };
                let sum = text.bytes().fold(0, |sum, byte| sum ^ byte);
                // What nobody reads is lost.
                drop(terminal.send(format!("${text}*{sum:02X}\r\n").as_bytes()));
                thread::sleep(PERIOD);
            }
        });
        Ok(Self { knows, ends, thread: Some(thread.context("a thread")?), slave })
    }
}

impl Drop for Compass {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

fn plug(bench: &mut HilBench) -> Result<i64> {
    let device = json!({ "driver": "usb-serial", "id": "ship0", "chardev": "ship", "bus": "usb.0", "serial": "ship1" });
    bench.machine.qmp.execute("device_add", device)?;
    Ok(bench.machine.guest.now_ns())
}

fn lost(bench: &mut HilBench) -> Result<CaseResult> {
    bench.ready(bench.scaled(2.0))?;
    let compass = Compass::start()?;
    let backend = json!({ "type": "serial", "data": { "device": compass.slave } });
    bench.machine.qmp.execute("chardev-add", json!({ "id": "ship", "backend": backend }))?;
    plug(bench)?;
    let extra = "[ship]\ndevice = \"/dev/serial/by-id/*ship1*\"\nbaud = 4800\n".to_owned();
    bench.configure(&Configured { extra, ..Configured::default() })?;
    bench.service("reload")?;
    let seen = tried(bench, &compass);
    bench.configure(&Configured::default())?;
    bench.service("reload")?;
    drop(bench.machine.qmp.remove("ship0"));
    bench.machine.qmp.execute("chardev-remove", json!({ "id": "ship" }))?;
    bench.settle()?;
    seen
}

fn tried(bench: &mut HilBench, compass: &Compass) -> Result<CaseResult> {
    thread::sleep(Duration::from_secs(2));
    bench.ready(bench.scaled(5.0))?;
    bench.without_warning()?;
    let from = bench.machine.guest.now_ns();
    let at = Instant::now();
    bench.machine.qmp.remove("ship0")?;
    bench.told("SHIP_LOST", JournalChange::Came, from, bench.scaled(2.0))?;
    let warned = bench.lcd(at, bench.scaled(2.0), "a warning", |p, warning| p == Plate::Ready && warning)?;
    let lcd = bench.says("SHIP HEADING LOST")?;
    bench.keep_picture("row-S");
    let plugged = plug(bench)?;
    let back = bench.told("SHIP_LOST", JournalChange::Went, plugged, bench.scaled(2.0))?;
    bench.without_warning()?;
    let asked = bench.machine.guest.now_ns();
    compass.knows.store(false, Ordering::Relaxed);
    bench.told("SHIP_INVALID", JournalChange::Came, asked, bench.scaled(2.0))?;
    compass.knows.store(true, Ordering::Relaxed);
    bench.told("SHIP_INVALID", JournalChange::Went, asked, bench.scaled(2.0))?;
    Ok(CaseResult {
        lcd,
        seen_s: Some(warned.saturating_duration_since(at).as_secs_f64()),
        back_s: Some((back - plugged) as f64 * 1e-9),
        within_s: Some(2.0),
        met: true,
        note: "SHIP_INVALID came and went with the compass that does not know".into(),
        ..CaseResult::default()
    })
}

impl HilBench {
    /// Waits until the status line warns of nothing about the ship.
    fn without_warning(&mut self) -> Result<()> {
        let until = Instant::now() + self.scaled(2.0);
        loop {
            let status = self.status()?;
            if status.starts_with("READY") && !status.contains("SHIP") {
                return Ok(());
            }
            ensure!(Instant::now() < until, "the LCD says \"{status}\"");
            thread::sleep(Duration::from_millis(200));
        }
    }
}
