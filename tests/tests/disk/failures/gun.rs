//! The program that shoots into a failing disk: the trainer's own storage, a signal handler, and a log.

use std::{
    io::{self, Write},
    path::Path,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use bowwave_core::time::Time;
use bowwave_record::Run;
use bowwave_trainer::{
    storage::{Storage, StorageOptions},
    supervisor::FaultLog,
};
use rustix::process::{Signal, getpid, kill_process};
use signal_hook::{consts::SIGTERM, flag};

use crate::shoot::{OPTIONS, shot};

pub const FLAG: &str = "--shoot-while-it-fails";
/// Rounds fired one by one, and then in a burst.
const ROUNDS: u64 = 12;
/// How long the program goes on after the last round.
const HOLD: Duration = Duration::from_millis(80);

/// When and how the program is ended: `-` for by itself, else `term` or `kill`, after which round, and how much later, us.
fn parse(end: &str) -> Option<(Signal, u64, Duration)> {
    let parts: Vec<_> = end.split(':').collect();
    let [signal, round, later_us] = &parts[..] else { return None };
    let signal = if *signal == "term" { Signal::TERM } else { Signal::KILL };
    Some((signal, round.parse().unwrap(), Duration::from_micros(later_us.parse().unwrap())))
}

/// Shoots, and says what was fired, what was reported, and how long the end took.
pub fn run(folder: &Path, end: &str) {
    log::set_logger(&StderrLog).unwrap();
    log::set_max_level(log::LevelFilter::Warn);
    let ends = Arc::new(AtomicBool::new(false));
    flag::register(SIGTERM, Arc::clone(&ends)).unwrap();
    let end = parse(end);
    let asked = Arc::new(OnceLock::new());
    let run = Run { started: Some(Time::from_ns(1_000_000_000)), ..Run::default() };
    let options = StorageOptions {
        folder: folder.to_path_buf(),
        run,
        journal: OPTIONS,
        recording: None,
        strict: false,
        print_commits: true,
    };
    let mut storage = Storage::open(options, &mut Vec::new()).unwrap();
    let mut faults = FaultLog::new(None);
    let mut events = Vec::new();
    let mut poll = |storage: &mut Storage| {
        storage.poll(&mut faults, &mut events).unwrap();
        events.clear();
    };
    for number in 1..=2 * ROUNDS {
        if ends.load(Ordering::Relaxed) {
            break;
        }
        say(&format!("fired {number}"));
        storage.rounds(&[shot(number)]);
        if let Some((signal, _, later)) = end.filter(|(_, round, _)| *round == number) {
            let asked = Arc::clone(&asked);
            thread::spawn(move || {
                thread::sleep(later);
                asked.set(Instant::now()).unwrap();
                kill_process(getpid(), signal).unwrap();
            });
        }
        if number <= ROUNDS {
            poll(&mut storage);
            thread::sleep(Duration::from_micros(700));
        }
    }
    let shot = Instant::now();
    while !ends.load(Ordering::Relaxed) && shot.elapsed() < HOLD {
        poll(&mut storage);
        thread::sleep(Duration::from_millis(2));
    }
    // Asked to end, or past its last round: from there on nobody wants to wait.
    let asked = asked.get_or_init(Instant::now);
    for wrong in storage.finish().1 {
        log::error!("{wrong:#}");
    }
    say(&format!("ended {}", asked.elapsed().as_micros()));
}

/// One line, one write: the trace shows it among the operations on files.
fn say(line: &str) {
    io::stdout().lock().write_all(format!("{line}\n").as_bytes()).unwrap();
}

/// The log, as on another disk.
struct StderrLog;

impl log::Log for StderrLog {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            eprintln!("{}: {}", record.level(), record.args());
        }
    }

    fn flush(&self) {}
}
