//! A failing disk, meddling with the files, and each kind of end, at every operation of a run that shoots: no round that was reported is
//! lost; what was not reported is in the journal, in the side file or in the log, unless the program was killed; the end takes a second
//! at most.
//!
//! The trainer's own storage shoots, SQLite as it is shipped below it. The layer is below both; `filesystem.rs` has a real file system there.
//!
//! `BOWWAVE_DISK_CASES` says how many cases (200 unless told, none for 0). `BOWWAVE_DISK_CASE` has that one of them alone, and what it printed.

mod cases;
mod filesystem;
pub mod gun;
mod look;
mod plan;

use std::{
    collections::BTreeMap,
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use cases::{Case, DiskFailure, Lasting, Trouble, cases};
use look::{CaseReport, RoundCounts, Shooting};

const CASES: usize = 200;
/// For so many cases each trouble goes once with each end on a real file system.
const CASES_FOR_EACH: usize = 2000;
/// Cases that compute and write side by side, and those that mostly wait.
const AT_ONCE: usize = 3;
const AT_ONCE_LONG: usize = 16;
/// The longest that an end may take.
const END_MOST: Duration = Duration::from_secs(1);

/// Runs the cases and prints a table.
pub fn run() {
    let asked = crate::asked("BOWWAVE_DISK_CASES").unwrap_or(CASES);
    if asked == 0 {
        return;
    }
    let begun = Instant::now();
    let calls = Shooting::run(None, false).calls;
    assert!(calls > 60, "{calls} calls: what is not seen?");
    let all: Vec<(usize, Case)> = cases(asked, calls).into_iter().enumerate().collect();
    if let Some(only) = crate::asked("BOWWAVE_DISK_CASE") {
        let (_, case) = all[only];
        let shooting = Shooting::run(Some(case), true);
        println!("{}{case:?}\n{:#?}", shooting.log, shooting.look(&case));
        return;
    }
    let (long, short): (Vec<_>, Vec<_>) = all.iter().copied().partition(|(_, case)| case.is_long());
    let mut reports = run_all(&short, AT_ONCE);
    reports.extend(run_all(&long, AT_ONCE_LONG));
    print(&reports);
    let cases: usize = reports.iter().map(|(_, case, _)| case.count()).sum();
    let faults = reports.iter().filter(|(_, _, report)| !report.faults.is_empty()).count();
    println!("{cases} cases at {calls} calls in {} s", begun.elapsed().as_secs());
    filesystem::run(asked.div_ceil(CASES_FOR_EACH));
    assert_eq!(faults, 0, "runs of the program that lost something, invented something or ended late");
}

type Done = (usize, Case, CaseReport);

fn run_all(cases: &[(usize, Case)], at_once: usize) -> Vec<Done> {
    let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    thread::scope(|scope| {
        for _ in 0..at_once {
            scope.spawn(|| {
                while let Some((index, case)) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let report = Shooting::run(Some(*case), false).look(case);
                    for fault in &report.faults {
                        println!("case {index}, {case:?}: {fault}");
                    }
                    done.lock().unwrap().push((*index, *case, report));
                }
            });
        }
    });
    done.into_inner().unwrap()
}

/// A line for each trouble.
fn print(reports: &[Done]) {
    let mut by_trouble: BTreeMap<String, Vec<&Done>> = BTreeMap::new();
    for done in reports {
        let lasting = match done.1.trouble {
            Trouble::Disk(DiskFailure::Slow, _) => " by 5 s",
            Trouble::Disk(_, Lasting::ForEver) | Trouble::Meddling(_, Lasting::ForEver) => ", stays so",
            Trouble::Disk(..) | Trouble::Meddling(..) => ", for a while",
        };
        let name = match done.1.trouble {
            Trouble::Disk(failure, _) => format!("{failure:?}{lasting}"),
            Trouble::Meddling(meddling, _) => format!("{meddling:?}{lasting}"),
        };
        by_trouble.entry(name).or_default().push(done);
    }
    println!("| Trouble | Cases | Rounds reported | Lost | In the side file | In the log | Longest end, s |");
    println!("|---|---|---|---|---|---|---|");
    for (name, done) in by_trouble {
        let sum =
            |value: fn(&RoundCounts) -> usize| done.iter().map(|(_, _, r)| value(&r.rounds)).sum::<usize>();
        let end = done.iter().filter_map(|(_, _, r)| r.end).max().unwrap_or_default();
        println!(
            "| {name} | {} | {} | {} | {} | {} | {:.2} |",
            done.iter().map(|(_, case, _)| case.count()).sum::<usize>(),
            sum(|r| r.reported),
            sum(|r| r.lost),
            sum(|r| r.aside),
            sum(|r| r.logged),
            end.as_secs_f64()
        );
    }
}
