//! The whole program on hostile files of each kind that it reads: each run ends by itself within ten seconds and 512 MB, with an exit code
//! of its own and no panic, and prints no control character and no line that the file made up.
//!
//! Files are made of good ones by damage of many kinds. `BOWWAVE_MUTATIONS` says how many of each kind (12 unless told), `BOWWAVE_MUTATIONS_FROM`
//! the number of the first; what breaks the program is kept in target/attack.

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
/// Runs side by side.
const AT_ONCE: usize = 2;

#[test]
fn hostile_files_neither_crash_nor_hang_the_program_nor_forge_its_lines() {
    let asked = std::env::var("BOWWAVE_MUTATIONS").ok();
    let count = asked.map_or(MUTATIONS, |text| text.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let first = std::env::var("BOWWAVE_MUTATIONS_FROM").map_or(0, |text| text.parse().unwrap());
    let mut broken = 0;
    for target in targets::all(folder.path()) {
        let (seen, faults) = attack(&target, folder.path(), first..first + count);
        println!(
            "{}: {count} files, of which {} were taken and {} refused; {faults} broke it",
            target.name, seen.taken, seen.refused
        );
        assert!(
            count < 100 || (seen.taken > 0 && seen.refused > 0),
            "{}: damage of one kind only",
            target.name
        );
        broken += faults;
    }
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
                        Ok(0) => seen.lock().unwrap().taken += 1,
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
