//! The threads of the software driver, each on a core of its own.
//!
//! Mesa's software driver splits a drawing among one thread a core. On a machine of few cores Linux often wakes two of them on the
//! same core and leaves the other idle, which takes the drawing twice as long. With a core of its own each begins at once.

use std::fs;

use rustix::thread::{CpuSet, Pid, sched_getaffinity, sched_setaffinity};

/// How the driver names its threads, before their number.
const NAME: &str = "llvmpipe-";

/// Most cores on which threads are kept to one: with more of them Linux finds an idle one, and others may want a certain one.
const CORES_MAX: usize = 4;

/// Keeps each thread of the software driver in this process to a core of its own, where there are as many of them as cores that the
/// process may use, two to four. What cannot be done is told in the log: it costs time only.
pub(crate) fn keep_to_cores() {
    let allowed = match sched_getaffinity(None) {
        Ok(set) => set,
        Err(e) => return log::debug!("the software driver's threads stay where Linux puts them: {e}"),
    };
    let cores: Vec<usize> = (0..CpuSet::MAX_CPU).filter(|core| allowed.is_set(*core)).collect();
    let threads = rasterisers();
    let highest = threads.iter().map(|(number, _)| *number).max();
    if !(2..=CORES_MAX).contains(&cores.len()) || highest != cores.len().checked_sub(1) {
        return;
    }
    for (number, thread) in threads {
        let Some(core) = cores.get(number) else { continue };
        let mut own = CpuSet::new();
        own.set(*core);
        if let Err(e) = sched_setaffinity(Some(thread), &own) {
            log::debug!("the software driver's thread {number} stays where Linux puts it: {e}");
        }
    }
}

/// Number and thread of each of the driver's threads in this process.
fn rasterisers() -> Vec<(usize, Pid)> {
    let Ok(tasks) = fs::read_dir("/proc/self/task") else { return Vec::new() };
    let named = |task: fs::DirEntry| {
        let name = fs::read_to_string(task.path().join("comm")).ok()?;
        let number = name.trim_end().strip_prefix(NAME)?.parse().ok()?;
        Some((number, Pid::from_raw(task.file_name().to_str()?.parse().ok()?)?))
    };
    tasks.filter_map(Result::ok).filter_map(named).collect()
}

#[cfg(test)]
mod tests {
    use std::{sync::mpsc, thread};

    use super::*;

    #[test]
    fn each_thread_gets_a_core_of_its_own() {
        let allowed = sched_getaffinity(None).unwrap();
        let cores: Vec<usize> = (0..CpuSet::MAX_CPU).filter(|core| allowed.is_set(*core)).collect();
        if !(2..=CORES_MAX).contains(&cores.len()) {
            eprintln!("not tried: this machine has {} cores", cores.len());
            return;
        }
        if let Err(e) = sched_setaffinity(None, &allowed) {
            eprintln!("not tried: this machine keeps threads where they are: {e}");
            return;
        }
        let workers: Vec<_> = (0..cores.len())
            .map(|i| {
                let (go_on, goes_on) = mpsc::channel::<()>();
                let (tell, told) = mpsc::channel();
                let worker = thread::Builder::new().name(format!("{NAME}{i}")).spawn(move || {
                    tell.send(()).unwrap();
                    goes_on.recv().unwrap();
                    let mine = sched_getaffinity(None).unwrap();
                    (0..CpuSet::MAX_CPU).filter(|core| mine.is_set(*core)).collect::<Vec<_>>()
                });
                told.recv().unwrap();
                (go_on, worker.unwrap())
            })
            .collect();
        keep_to_cores();
        for ((go_on, worker), core) in workers.into_iter().zip(&cores) {
            go_on.send(()).unwrap();
            assert_eq!(worker.join().unwrap(), [*core]);
        }
    }
}
