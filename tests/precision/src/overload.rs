//! A computer that is busy with something else: how soon the trainer says so, what it leaves out, and how soon all is back. The program itself
//! runs in real time and keeps a recording, beside threads that do nothing but take processor time.

use std::{
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::Duration,
};

use anyhow::{Context, Result, bail};
use bowwave_core::{
    fault::{Change, Fault},
    time::Time,
};
use bowwave_record::{
    Entry, RecordingReader,
    journal::{RunSelection, ShotFilter, read_shots},
};
use rustix::time::{ClockId, clock_gettime};

use crate::table::TextTable;

/// Seconds before the load, with it, and after it.
const PHASES_S: [u64; 3] = [8, 10, 8];
/// What the load may change.
const LOAD: [Fault; 4] = [Fault::LoadRate, Fault::LoadWater, Fault::LoadFar, Fault::LoadUnseen];
/// Frames of a second, but for one.
const RATE_KEPT: usize = 29;

/// Runs the trainer beside busy loops.
#[derive(Debug, clap::Args)]
pub struct OverloadStudy {
    /// Numbers of busy loops
    #[arg(long, value_delimiter = ',', default_values_t = [0, 1, 2, 3, 4, 5, 6, 7, 8])]
    loops: Vec<usize>,
    /// The program
    #[arg(long, default_value = "target/release/bowwave")]
    program: PathBuf,
}

/// What a run's recording tells.
#[derive(Debug, Default)]
struct Told {
    ticks: Vec<Time>,
    /// When a fault of [`LOAD`] came (`true`) or went.
    changes: Vec<(Time, Fault, bool)>,
}

fn now() -> Time {
    let t = clock_gettime(ClockId::Monotonic);
    Time::from_ns(t.tv_sec * 1_000_000_000 + t.tv_nsec)
}

impl OverloadStudy {
    /// Prints a line for each number of loops.
    pub fn run(&self) -> Result<()> {
        if !self.program.is_file() {
            bail!("no program at {}; build it with cargo build --release", self.program.display());
        }
        let titles = [
            ("loops", 5),
            ("frames", 7),
            ("told s", 7),
            ("untold s", 8),
            ("back s", 7),
            ("rms px", 6),
            ("rounds", 7),
            ("left out", 40),
        ];
        let mut table = TextTable::new(0, titles);
        print!("{}", table.take());
        for loops in &self.loops {
            table.row(self.row(*loops)?);
            print!("{}", table.take());
        }
        println!(
            "frames: shown of 30 a second while the load lasted. told: after the load began. untold: seconds with fewer than {RATE_KEPT} frames \
             in the last one and no word of it. back: all drawn again after the load ended."
        );
        Ok(())
    }

    fn row(&self, loops: usize) -> Result<[String; 8]> {
        let folder = tempfile::tempdir()?;
        let duration_s: u64 = PHASES_S.iter().sum();
        let mut child = Command::new(&self.program)
            .args(["simulate", "--realtime", "--record", "--duration", &duration_s.to_string(), "--out"])
            .arg(folder.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .context("the program cannot be started")?;
        thread::sleep(Duration::from_secs(PHASES_S[0]));
        let over = AtomicBool::new(false);
        let [begun, ended] = thread::scope(|scope| {
            let begun = now();
            for _ in 0..loops {
                scope.spawn(|| {
                    while !over.load(Ordering::Relaxed) {
                        std::hint::spin_loop();
                    }
                });
            }
            thread::sleep(Duration::from_secs(PHASES_S[1]));
            over.store(true, Ordering::Relaxed);
            [begun, now()]
        });
        let status = child.wait()?;
        if !status.success() {
            bail!("the program ended with {status}");
        }
        let told = read(&folder.path().join("recording.mcap"))?;
        let summary: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.path().join("summary.json"))?)?;
        let filter = ShotFilter { runs: RunSelection::Latest, hits_only: false };
        let kept = read_shots(&folder.path().join("hits.sqlite"), &filter)?.len();
        let shown = told.ticks.iter().filter(|t| **t > begun && **t <= ended).count();
        let seconds = |s: Option<f64>| s.map_or_else(|| "-".to_owned(), |s| format!("{s:.2}"));
        let came = told.changes.iter().find(|(time, _, came)| *came && *time > begun);
        let mut codes: Vec<&str> =
            told.changes.iter().filter(|(_, _, came)| *came).map(|(_, fault, _)| fault.code()).collect();
        codes.sort_unstable();
        codes.dedup();
        Ok([
            loops.to_string(),
            format!("{:.1} %", 100.0 * shown as f64 / (30.0 * ended.secs_since(begun))),
            seconds(came.map(|(time, ..)| time.secs_since(begun))),
            format!("{:.2}", told.untold_s()),
            seconds(told.changes.iter().rfind(|(_, _, came)| !came).map(|(time, ..)| time.secs_since(ended))),
            summary["registration_px"]["rms"].as_f64().map_or("-".to_owned(), |px| format!("{px:.2}")),
            format!("{kept}/{}", summary["shots"]),
            codes.join(" "),
        ])
    }
}

impl Told {
    /// Seconds in which fewer frames than are promised had been begun in the last one, and nothing said so.
    fn untold_s(&self) -> f64 {
        let mut untold_s = 0.0;
        for (n, pair) in self.ticks.windows(2).enumerate().skip(30) {
            let [before, at] = pair else { continue };
            let frames = self.ticks[..=n].iter().rev().take_while(|t| before.secs_since(**t) < 1.0).count();
            let is_told = LOAD.iter().any(|fault| {
                let mut of = self.changes.iter().filter(|(time, other, _)| other == fault && time <= at);
                of.next_back().is_some_and(|(_, _, came)| *came)
            });
            if frames < RATE_KEPT && !is_told {
                untold_s += at.secs_since(*before);
            }
        }
        untold_s
    }
}

fn read(path: &Path) -> Result<Told> {
    let mut told = Told::default();
    for entry in RecordingReader::open(path)?.entries_as_written()? {
        match entry? {
            Entry::Tick(tick) => told.ticks.push(tick.tick.time),
            Entry::Fault(entry) if LOAD.contains(&entry.change.fault) => {
                let came = matches!(entry.change.change, Change::Raised { .. });
                told.changes.push((entry.change.time, entry.change.fault, came));
            }
            _ => {}
        }
    }
    Ok(told)
}
