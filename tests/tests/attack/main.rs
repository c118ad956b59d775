//! The whole program on hostile files of each kind that it reads: each run ends by itself within ten seconds of processor time and 512 MB,
//! with an exit code of its own and no panic, and prints no control character and no line that the file made up.
//!
//! Files are made of good ones by damage of many kinds. `BOWWAVE_MUTATIONS` says how many of each kind (12 by default), `BOWWAVE_MUTATIONS_FROM`
//! the number of the first, `BOWWAVE_MUTATIONS_OF` the only kind; what breaks the program is kept in target/attack.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on has failed")]

mod mutation;
mod targets;

use std::{
    fs,
    ops::Range,
    path::Path,
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

use bowwave_tests::root;
use mutation::{Mutator, mutated};
use targets::Target;

const MUTATIONS: usize = 12;
/// Of so many files some are still good, and some are not.
const MANY: usize = 1000;
/// Runs side by side.
const AT_ONCE: usize = 2;

#[test]
fn hostile_files_neither_crash_nor_hang_the_program_nor_forge_its_lines() {
    let asked = std::env::var("BOWWAVE_MUTATIONS").ok();
    let count = asked.map_or(MUTATIONS, |text| text.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let first = std::env::var("BOWWAVE_MUTATIONS_FROM").map_or(0, |text| text.parse().unwrap());
    let (mut broken, mut one_sided) = (0, Vec::new());
    let only = std::env::var("BOWWAVE_MUTATIONS_OF").ok();
    for target in targets::all(folder.path()) {
        if only.as_ref().is_some_and(|only| only != target.name) {
            continue;
        }
        let (seen, faults) = attack(&target, folder.path(), first..first + count);
        println!(
            "{}: {count} files, of which {} were taken and {} refused; {faults} broke it",
            target.name, seen.taken, seen.refused
        );
        if count >= MANY && (seen.taken == 0 || seen.refused == 0) {
            one_sided.push(target.name);
        }
        broken += faults;
    }
    assert!(one_sided.is_empty(), "of {one_sided:?} all damaged files are taken, or none is");
    assert_eq!(broken, 0, "files that broke the program are in target/attack");
}

#[derive(Default)]
struct Seen {
    taken: usize,
    refused: usize,
}

/// Runs the program on the files of these numbers; how many it took and refused, and how many broke it.
fn attack(target: &Target, folder: &Path, numbers: Range<usize>) -> (Seen, usize) {
    let (next, seen, broken) =
        (AtomicUsize::new(numbers.start), Mutex::new(Seen::default()), AtomicUsize::new(0));
    let seeds = target.seeds();
    thread::scope(|scope| {
        for worker in 0..AT_ONCE {
            let (next, seen, broken, seeds, numbers) = (&next, &seen, &broken, &seeds, &numbers);
            scope.spawn(move || {
                let place = folder.join(format!("{}-{worker}", target.name));
                fs::create_dir_all(&place).unwrap();
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= numbers.end {
                        break;
                    }
                    let bytes = mutated(seeds, &mut Mutator::new(target.name, number as u64));
                    match target.run(&place, number, &bytes) {
                        // What was left of it, where it was cut short.
                        Ok(0 | 3) => seen.lock().unwrap().taken += 1,
                        Ok(_) => seen.lock().unwrap().refused += 1,
                        Err(fault) => {
                            broken.fetch_add(1, Ordering::Relaxed);
                            keep(target, number, &bytes, &fault);
                        }
                    }
                }
            });
        }
    });
    (seen.into_inner().unwrap(), broken.into_inner())
}

fn keep(target: &Target, number: usize, bytes: &[u8], fault: &str) {
    let folder = root().join("target/attack");
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join(format!("{}-{number}", target.name));
    fs::write(&path, bytes).unwrap();
    println!("{}: {fault}", path.display());
}
