//! What becomes of rounds when the power is cut, and when the disk, its files or the process fail: see `cuts.rs` and `failures/`.
//!
//! The test starts itself again as the program that shoots, under strace, which sees what it does to files and has it fail. With
//! `BOWWAVE_CUTS` or `BOWWAVE_DISK_CASES` set, a missing strace is an error.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod cuts;
mod failures;
mod image;
mod shoot;
mod trace;
mod verify;

use std::{env, path::Path, process::Command};

fn main() {
    let arguments: Vec<_> = env::args().collect();
    match &arguments[..] {
        [_, flag, path, phase] if flag == shoot::FLAG => {
            return shoot::run(Path::new(path), phase.parse().unwrap());
        }
        [_, flag, folder, end] if flag == failures::gun::FLAG => {
            return failures::gun::run(Path::new(folder), end);
        }
        _ => {}
    }
    // What else a test runner may pass (filters, --nocapture) changes nothing here; --list has nothing to say.
    if arguments.iter().any(|argument| argument == "--list") {
        return;
    }
    if !Command::new("strace").arg("-V").output().is_ok_and(|output| output.status.success()) {
        let asked = asked("BOWWAVE_CUTS").or_else(|| asked("BOWWAVE_DISK_CASES"));
        assert!(asked.is_none(), "no strace here: install it (./check setup)");
        println!("skipped: no strace here to see what is written");
        return;
    }
    cuts::run();
    failures::run();
}

/// The number in an environment variable.
fn asked(name: &str) -> Option<usize> {
    let text = env::var(name).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{name} is no number")))
}

/// A folder in memory where there is some: thousands of databases are made.
fn scratch() -> tempfile::TempDir {
    tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap()
}
