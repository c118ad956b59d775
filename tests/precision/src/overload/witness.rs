//! Stops of the computer itself: a virtual machine's host may take its processors away, which no program in it can help. A thread on each core
//! that comes before all others wakes every millisecond; where it did not, nothing ran there.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use bowwave_core::time::Time;
use rustix::{
    process::setpriority_process,
    thread::{CpuSet, gettid, sched_setaffinity},
};

use super::now;

/// A core that does nothing for so long is a stop: far beyond what a thread of the highest priority waits for its turn (3 ms), and long
/// enough to make a frame late.
const STOP_S: f64 = 0.01;

/// Watches until it is asked.
#[derive(Debug)]
pub struct Witness {
    is_over: Arc<AtomicBool>,
    threads: Vec<JoinHandle<Vec<[Time; 2]>>>,
}

/// Stops from first to last, each from when to when.
#[derive(Debug, Default)]
pub struct Stops(Vec<[Time; 2]>);

impl Witness {
    /// Begins; without root it has no priority and sees nothing.
    pub fn new() -> Self {
        let is_over = Arc::new(AtomicBool::new(false));
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let threads = (0..cores).map(|core| {
            let is_over = is_over.clone();
            thread::spawn(move || watch(core, &is_over))
        });
        Self { threads: threads.collect(), is_over }
    }

    /// Ends.
    pub fn stops(self) -> Stops {
        self.is_over.store(true, Ordering::Relaxed);
        let mut all: Vec<_> =
            self.threads.into_iter().flat_map(|thread| thread.join().unwrap_or_default()).collect();
        all.sort_by_key(|[from, _]| *from);
        Stops(all)
    }
}

fn watch(core: usize, is_over: &AtomicBool) -> Vec<[Time; 2]> {
    let mut cores = CpuSet::new();
    cores.set(core);
    let is_first =
        sched_setaffinity(None, &cores).is_ok() && setpriority_process(Some(gettid()), -20).is_ok();
    let (mut stops, mut before) = (Vec::new(), now());
    while is_first && !is_over.load(Ordering::Relaxed) {
        thread::sleep(Duration::from_millis(1));
        let at = now();
        if at.secs_since(before) > STOP_S {
            stops.push([before, at]);
        }
        before = at;
    }
    stops
}

impl Stops {
    /// Whether one lies between two times, in part at least.
    pub fn any_between(&self, from: Time, to: Time) -> bool {
        self.0.iter().any(|[begun, ended]| *begun <= to && *ended >= from)
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.0.len()
    }
}
