//! A computer that is short of processor time, memory or disk: how soon the trainer says so, what it leaves out, and how soon all is back. The
//! program itself runs in real time and keeps a recording.

mod shortage;
mod witness;

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    process::{Command, Stdio},
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

use self::{
    shortage::{Place, Shortage},
    witness::{Stops, Witness},
};
use crate::table::TextTable;

/// Seconds before the shortage, with it, and after it.
const PHASES_S: [u64; 3] = [8, 10, 8];
/// What it may change.
const LOAD: [Fault; 4] = [Fault::LoadRate, Fault::LoadWater, Fault::LoadFar, Fault::LoadUnseen];
/// Frames of a second, but for one.
const RATE_KEPT: usize = 29;

/// Runs the trainer on a computer that falls short: busy loops beside it; as root also heat, memory used up and a slow disk.
#[derive(Debug, clap::Args)]
pub struct OverloadStudy {
    /// Numbers of busy loops
    #[arg(long, value_delimiter = ',', default_values_t = [0, 1, 2, 3, 4, 5, 6, 7, 8])]
    loops: Vec<usize>,
    /// Speeds of a hot processor, of 1
    #[arg(long, value_delimiter = ',', default_values_t = [0.75, 0.5, 0.25])]
    heat: Vec<f64>,
    /// MB of memory that are left
    #[arg(long, value_delimiter = ',', default_values_t = [64])]
    memory: Vec<u64>,
    /// MB that the disk writes a second
    #[arg(long, value_delimiter = ',', default_values_t = [1])]
    disk: Vec<u64>,
    /// Without what only root may bring about
    #[arg(long)]
    loops_only: bool,
    /// The program
    #[arg(long, default_value = "target/release/bowwave")]
    program: PathBuf,
}

/// What a run's recording tells.
#[derive(Debug, Default)]
struct Told {
    ticks: Vec<Time>,
    /// When a fault came (`true`) or went.
    changes: Vec<(Time, Fault, bool)>,
}

fn now() -> Time {
    let t = clock_gettime(ClockId::Monotonic);
    Time::from_ns(t.tv_sec * 1_000_000_000 + t.tv_nsec)
}

impl OverloadStudy {
    /// Prints a line for each shortage.
    pub fn run(&self) -> Result<()> {
        if !self.program.is_file() {
            bail!("no program at {}; build it with cargo build --release", self.program.display());
        }
        let titles = [
            ("short of", 16),
            ("frames", 7),
            ("told s", 7),
            ("untold s", 8),
            ("back s", 7),
            ("stopped", 7),
            ("rms px", 6),
            ("rounds", 7),
            ("recorded", 9),
            ("said", 40),
        ];
        let mut table = TextTable::new(1, titles);
        print!("{}", table.take());
        let mut all: Vec<_> = self.loops.iter().map(|count| Shortage::Loops(*count)).collect();
        if !self.loops_only {
            all.extend(self.heat.iter().map(|share| Shortage::Heat(*share)));
            all.extend(self.memory.iter().map(|mb| Shortage::Memory(*mb)));
            all.extend(self.disk.iter().map(|mb| Shortage::Disk(*mb)));
        }
        for short in all {
            table.row(self.row(short)?);
            print!("{}", table.take());
        }
        println!(
            "frames: shown of 30 a second while it lasted. told: after it began. untold: seconds with fewer than {RATE_KEPT} frames in the last \
             one and no word of it. back: all drawn again after it ended, and for good but for what the host did. stopped: how often after that something was left out \
             within a second of a stop of the computer itself, of its stops in all (as root, which alone can tell). rounds: in the journal of \
             those fired. recorded: frames of those shown."
        );
        Ok(())
    }

    fn row(&self, short: Shortage) -> Result<[String; 10]> {
        let place = Place::new(short)?;
        let folder = place.folder();
        let duration_s: u64 = PHASES_S.iter().sum();
        let witness = Witness::new();
        let mut child = Command::new(&self.program)
            .args(["simulate", "--realtime", "--record", "--duration", &duration_s.to_string(), "--out"])
            .arg(folder)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .context("the program cannot be started")?;
        place.enter(child.id())?;
        thread::sleep(Duration::from_secs(PHASES_S[0]));
        let [begun, ended] = place.fall_short(Duration::from_secs(PHASES_S[1]), now)?;
        let status = child.wait()?;
        let stops = witness.stops();
        if !status.success() {
            bail!("the program ended with {status}");
        }
        let told = read(&folder.join("recording.mcap"))?;
        let summary: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.join("summary.json"))?)?;
        let filter = ShotFilter { runs: RunSelection::Latest, hits_only: false };
        let kept = read_shots(&folder.join("hits.sqlite"), &filter)?.len();
        let shown = told.ticks.iter().filter(|t| **t > begun && **t <= ended).count();
        let seconds = |s: Option<f64>| s.map_or_else(|| "-".to_owned(), |s| format!("{s:.2}"));
        let (back, stopped) = told.back(ended, &stops);
        let came = told.of_load().find(|(time, _, came)| *came && *time > begun);
        let mut codes: Vec<&str> = told
            .changes
            .iter()
            .filter(|(time, _, came)| *came && *time > begun)
            .map(|(_, fault, _)| fault.code())
            .collect();
        codes.sort_unstable();
        codes.dedup();
        Ok([
            short.name(),
            format!("{:.1} %", 100.0 * shown as f64 / (30.0 * ended.secs_since(begun))),
            seconds(came.map(|(time, ..)| time.secs_since(begun))),
            format!("{:.2}", told.untold_s()),
            seconds(back.map(|time| time.secs_since(ended))),
            format!("{stopped} of {}", stops.count()),
            summary["registration_px"]["rms"].as_f64().map_or("-".to_owned(), |px| format!("{px:.2}")),
            format!("{kept}/{}", summary["shots"]),
            format!("{}/{}", told.ticks.len(), summary["frames"]),
            codes.join(" "),
        ])
    }
}

impl Told {
    /// Changes of what a load may change.
    fn of_load(&self) -> impl Iterator<Item = &(Time, Fault, bool)> {
        self.changes.iter().filter(|(_, fault, _)| LOAD.contains(fault))
    }

    /// Since when all is drawn, after the shortage's end; and how often after that something was left out because the computer itself stopped.
    fn back(&self, ended: Time, stops: &Stops) -> (Option<Time>, usize) {
        /// Frames of the last second say whether one is late.
        const LOOKED_AT_S: f64 = 1.0;
        let (mut standing, mut back, mut stopped) = (BTreeSet::new(), None, 0);
        let mut is_of_host = false;
        for (time, fault, came) in self.of_load() {
            if *came && standing.is_empty() {
                let from = time.plus_secs(-LOOKED_AT_S);
                is_of_host = *time > ended && stops.any_between(from, *time);
                stopped += usize::from(is_of_host);
            }
            if *came {
                standing.insert(*fault)
            } else {
                standing.remove(fault)
            };
            if standing.is_empty() && !is_of_host {
                back = Some(*time);
            }
        }
        (back, stopped)
    }

    /// Seconds in which fewer frames than are promised had been begun in the last one, and nothing said so.
    fn untold_s(&self) -> f64 {
        /// A second with half a frame's time more, so that the frame of a second ago counts.
        const SECOND_S: f64 = 1.0 + 0.5 / 30.0;
        let mut untold_s = 0.0;
        for (n, pair) in self.ticks.windows(2).enumerate().skip(30) {
            let [before, at] = pair else { continue };
            let frames = self.ticks[..=n].iter().rev().take_while(|t| at.secs_since(**t) < SECOND_S).count();
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
            Entry::Fault(entry) => {
                let came = matches!(entry.change.change, Change::Raised { .. });
                told.changes.push((entry.change.time, entry.change.fault, came));
            }
            _ => {}
        }
    }
    Ok(told)
}
