//! The program that shoots into a failing disk: the trainer's own storage, a signal handler, and a log.

use std::{
    io::Write as _,
    path::Path,
    sync::{Arc, atomic},
    thread,
    time::{Duration, Instant},
};

use bowwave_core::{time::Time, world::track::TrackBlock};
use bowwave_record::Run;
use bowwave_trainer::{
    storage::{Storage, StorageOptions},
    supervisor::FaultLog,
};
use signal_hook::{consts::SIGTERM, flag};

use crate::{
    layer::{ENDED, ENDING},
    shoot::{OPTIONS, say, shot, wait_for_go},
};

pub const FLAG: &str = "--shoot-while-it-fails";
/// Rounds fired one by one, and then in a burst.
const ROUNDS: u64 = 12;
/// How long the program goes on after the last round.
const HOLD: Duration = Duration::from_millis(80);

/// Shoots, and says what was fired and what was reported.
pub fn run(folder: &Path) {
    wait_for_go();
    log::set_logger(&StderrLog).unwrap();
    log::set_max_level(log::LevelFilter::Warn);
    let ends = Arc::new(atomic::AtomicBool::new(false));
    flag::register(SIGTERM, Arc::clone(&ends)).unwrap();
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
        if ends.load(atomic::Ordering::Relaxed) {
            break;
        }
        say(&format!("fired {number}"));
        storage.take(&[shot(number)], &[], &TrackBlock::default());
        if number <= ROUNDS {
            poll(&mut storage);
            thread::sleep(Duration::from_micros(700));
        }
    }
    let shot = Instant::now();
    while !ends.load(atomic::Ordering::Relaxed) && shot.elapsed() < HOLD {
        poll(&mut storage);
        thread::sleep(Duration::from_millis(2));
    }
    // Asked to end, or past its last round: from there on nobody wants to wait.
    say(ENDING);
    for wrong in storage.finish().1 {
        log::error!("{wrong:#}");
    }
    say(ENDED);
}

/// The log, as on another disk.
struct StderrLog;

impl log::Log for StderrLog {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            // A line is written at once, as the program's own log does: one that is killed leaves none in halves.
            let line = format!("{}: {}\n", record.level(), record.args());
            let _ = std::io::stderr().write_all(line.as_bytes());
        }
    }

    fn flush(&self) {}
}
