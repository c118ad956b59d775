//! Rules about the tree itself.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on has failed")]

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use serde_json::Value;

/// Crates by rank: a crate may depend only on crates of lower rank (ARCHITECTURE.md).
const RANKS: &[(&str, u8)] = &[
    ("bowwave-core", 0),
    ("bowwave-files", 0),
    ("bowwave-web", 0),
    ("shaders-spirv", 0),
    // A tool of tests that knows nothing of the product.
    ("gpu-fault-layer", 0),
    ("bowwave-link", 1),
    ("bowwave-record", 1),
    ("bowwave-devices", 1),
    ("bowwave-render", 1),
    ("bowwave-models", 1),
    ("bowwave-calibration", 2),
    ("bowwave-review", 2),
    ("bowwave-instructor", 3),
    ("hw-sim", 3),
    ("bowwave-import", 3),
    ("bowwave-trainer", 4),
    ("bowwave", 5),
    ("bowwave-lab", 6),
    ("bowwave-package", 6),
    ("bowwave-tests", 7),
    ("precision", 7),
    ("bowwave-hil", 7),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate lies in the workspace").to_path_buf()
}

fn tracked(pattern: &str) -> Vec<PathBuf> {
    let out = Command::new("git")
        .args(["ls-files", "-z", "--", pattern])
        .current_dir(root())
        .output()
        .expect("git runs");
    assert!(out.status.success(), "git ls-files failed: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8_lossy(&out.stdout)
        .split('\0')
        .filter(|s| !s.is_empty())
        .map(|s| root().join(s))
        .collect()
}

fn lines_where(pattern: &str, mut is_bad: impl FnMut(&Path, &str) -> bool) -> Vec<String> {
    let mut found = Vec::new();
    for path in tracked(pattern) {
        let Ok(text) = fs::read_to_string(&path) else { continue };
        for (i, line) in text.lines().enumerate() {
            if is_bad(&path, line) {
                found.push(format!(
                    "{}:{}: {}",
                    path.strip_prefix(root()).expect("under root").display(),
                    i + 1,
                    line.trim()
                ));
            }
        }
    }
    found
}

#[test]
fn crates_depend_only_on_lower_ranks() {
    let out = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline", "--locked"])
        .current_dir(root())
        .output()
        .expect("cargo runs");
    assert!(out.status.success(), "cargo metadata failed: {}", String::from_utf8_lossy(&out.stderr));
    let metadata: Value = serde_json::from_slice(&out.stdout).expect("cargo writes JSON");
    let ranks: BTreeMap<&str, u8> = RANKS.iter().copied().collect();
    let mut seen = 0;
    for package in metadata["packages"].as_array().expect("packages") {
        let name = package["name"].as_str().expect("name");
        let rank = *ranks
            .get(name)
            .unwrap_or_else(|| panic!("{name} has no rank: add it here and to ARCHITECTURE.md"));
        seen += 1;
        for dependency in package["dependencies"].as_array().expect("dependencies") {
            let on = dependency["name"].as_str().expect("name");
            // What only tests use does not shape the product.
            if dependency["kind"].as_str() == Some("dev") {
                continue;
            }
            if let Some(other) = ranks.get(on) {
                assert!(*other < rank, "{name} (rank {rank}) must not depend on {on} (rank {other})");
            }
        }
    }
    assert_eq!(seen, RANKS.len(), "a ranked crate is gone: take it off the list");
}

#[test]
fn unsafe_code_stays_in_devices_and_render() {
    let found = lines_where("*.rs", |path, line| {
        let code = line.split("//").next().unwrap_or("");
        // What speaks to drivers, and what stands in for one.
        let allowed =
            ["daemon/devices/", "daemon/render/", "daemon/trainer/tests/disk/", "tests/hil/gpu-fault-layer/"]
                .iter()
                .any(|d| path.starts_with(root().join(d)));
        let says = code.contains("unsafe {") || code.contains("unsafe fn") || code.contains("unsafe impl");
        says && !allowed && !path.ends_with("tests/tests/tidy.rs")
    });
    assert!(found.is_empty(), "unsafe outside devices and render:\n{}", found.join("\n"));
}

#[test]
fn each_crate_but_those_that_speak_to_drivers_forbids_unsafe_code() {
    let roots = tracked("*/src/lib.rs").into_iter().chain(tracked("*/src/main.rs"));
    let (mut seen, mut open) = (0, Vec::new());
    for path in roots {
        let folder = path.strip_prefix(root()).expect("under root").to_owned();
        let free = ["daemon/devices", "daemon/render", "tests/hil/gpu-fault-layer", "tests/fuzz"];
        seen += 1;
        if !free.iter().any(|crate_of| folder.starts_with(crate_of))
            && !fs::read_to_string(&path).expect("a source").contains("#![forbid(unsafe_code)]")
        {
            open.push(folder);
        }
    }
    assert!(seen > 15, "only {seen} crates");
    assert!(open.is_empty(), "these do not forbid unsafe code: {open:?}");
}

#[test]
fn the_core_has_no_io_no_clock_and_no_threads() {
    let words =
        ["std::fs", "std::net", "std::thread", "Instant::now", "SystemTime::now", "std::process", "println!"];
    let found = lines_where("daemon/core/src/*.rs", |path, line| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        // Tests read tables of numbers and list folders.
        if name.ends_with("_tests.rs") || name == "test_data.rs" {
            return false;
        }
        let code = line.split("//").next().unwrap_or("");
        words.iter().any(|w| code.contains(w))
    });
    assert!(found.is_empty(), "the core does I/O:\n{}", found.join("\n"));
    let lib = fs::read_to_string(root().join("daemon/core/src/lib.rs")).expect("core/src/lib.rs");
    assert!(lib.contains("#![forbid(unsafe_code)]"));
}

#[test]
fn renderer_and_session_read_no_clock() {
    let found = lines_where("daemon/render/src/*.rs", |_, line| {
        let code = line.split("//").next().unwrap_or("");
        code.contains("Instant::now") || code.contains("SystemTime::now")
    });
    assert!(found.is_empty(), "time is an argument:\n{}", found.join("\n"));
}

#[test]
fn no_file_is_longer_than_600_lines() {
    let long: Vec<String> = tracked("*.rs")
        .into_iter()
        .filter_map(|path| {
            let lines = fs::read_to_string(&path).ok()?.lines().count();
            (lines > 600).then(|| format!("{}: {lines}", path.display()))
        })
        .collect();
    assert!(long.is_empty(), "split these:\n{}", long.join("\n"));
}

#[test]
fn nothing_is_left_unfinished() {
    let marks = ["TO", "FIX", "XX"].map(|m| {
        format!(
            "{m}{}",
            match m {
                "TO" => "DO",
                "FIX" => "ME",
                _ => "X",
            }
        )
    });
    let found = lines_where("*.rs", |_, line| marks.iter().any(|m| line.contains(m.as_str())));
    assert!(found.is_empty(), "unfinished:\n{}", found.join("\n"));
}

#[test]
fn the_repository_stays_small() {
    let bytes: u64 = tracked("*").iter().filter_map(|p| fs::metadata(p).ok()).map(|m| m.len()).sum();
    assert!(bytes < 60_000_000, "{bytes} bytes are tracked");
}
