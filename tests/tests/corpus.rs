//! Every file that a fuzzer started from or broke something with, once through the very functions that are fuzzed.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on has failed")]

#[path = "../fuzz/src/targets/mod.rs"]
mod targets;

use std::{
    fs,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
};

fn fuzz() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz")
}

/// The files of a folder by name; none where there is no such folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths
}

#[test]
fn what_fuzzers_found_stays_mended() {
    let mut broken = Vec::new();
    for (name, target) in targets::ALL {
        let seeds = files(&fuzz().join("corpus").join(name));
        assert!(
            !seeds.is_empty(),
            "tests/fuzz/corpus/{name} is empty: a fuzzer needs something to start from"
        );
        let findings = files(&fuzz().join("findings").join(name));
        for path in seeds.into_iter().chain(findings) {
            let input = fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            if catch_unwind(AssertUnwindSafe(|| target(&input))).is_err() {
                broken.push(path);
            }
        }
    }
    assert!(broken.is_empty(), "these break the target that their folder is named after: {broken:#?}");
}

/// A target that is fuzzed but not listed would not be run here, one that is listed but has no binary never fuzzed.
#[test]
fn each_target_has_its_fuzzer() {
    let binaries: Vec<String> = files(&fuzz().join("src/bin"))
        .iter()
        .map(|path| path.file_stem().expect("a name").to_string_lossy().into_owned())
        .collect();
    let mut listed: Vec<&str> = targets::ALL.iter().map(|(name, _)| *name).collect();
    listed.sort_unstable();
    assert_eq!(binaries, listed);
}

#[test]
fn the_corpus_stays_small() {
    let bytes: u64 = targets::ALL
        .iter()
        .flat_map(|(name, _)| files(&fuzz().join("corpus").join(name)))
        .map(|path| fs::metadata(path).expect("a file").len())
        .sum();
    assert!(bytes < 200_000, "{bytes} bytes in tests/fuzz/corpus: keep only what opens a new way (-merge=1)");
}
