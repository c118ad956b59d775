//! What becomes of rounds when the power is cut, and when the disk, its files or the process fail: see `cuts.rs` and `failures/`.
//!
//! The test starts itself again as the program that shoots, over a layer that sees what it does to files and has that fail (`layer.rs`).

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]
#![cfg_attr(
    not(target_arch = "x86_64"),
    allow(dead_code, unused_imports, reason = "the layer knows one processor's calls")
)]

#[cfg(target_arch = "x86_64")]
mod cuts;
#[cfg(target_arch = "x86_64")]
mod failures;
#[cfg(target_arch = "x86_64")]
mod image;
#[cfg(target_arch = "x86_64")]
mod layer;
#[cfg(target_arch = "x86_64")]
mod shoot;
#[cfg(target_arch = "x86_64")]
mod step;
#[cfg(target_arch = "x86_64")]
mod verify;

use std::{env, path::Path};

#[cfg(not(target_arch = "x86_64"))]
fn main() {
    println!("skipped: the layer below the program knows the calls of x86-64 only");
}

#[cfg(target_arch = "x86_64")]
fn main() {
    let arguments: Vec<_> = env::args().collect();
    match &arguments[..] {
        [_, flag, path, phase] if flag == shoot::FLAG => {
            return shoot::run(Path::new(path), phase.parse().unwrap());
        }
        [_, flag, folder] if flag == failures::gun::FLAG => return failures::gun::run(Path::new(folder)),
        _ => {}
    }
    // What else a test runner may pass (filters, --nocapture) changes nothing here; --list has nothing to say.
    if arguments.iter().any(|argument| argument == "--list") {
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
