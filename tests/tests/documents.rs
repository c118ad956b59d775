//! Rules about the documents: their length, their links, the code that they name, and their examples.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on has failed")]

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use bowwave_core::world::scenario::Scenario;
use hw_sim::live::Script;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate lies in the workspace").to_path_buf()
}

/// Every document of the repository's top and of docs/, with its text.
fn documents() -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    for folder in ["", "docs", "docs/decisions"] {
        for entry in fs::read_dir(root().join(folder)).expect("a folder of documents") {
            let path = entry.expect("readable").path();
            if path.extension().is_some_and(|e| e == "md") {
                let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
                found.push((path, text));
            }
        }
    }
    assert!(found.len() > 40, "only {} documents", found.len());
    found
}

#[test]
fn the_first_documents_stay_short() {
    for (name, bytes_max) in [("README.md", 6_000), ("ARCHITECTURE.md", 10_000)] {
        let bytes = fs::metadata(root().join(name)).expect("a document").len();
        assert!(bytes <= bytes_max, "{name} has {bytes} bytes; at most {bytes_max} are read by a newcomer");
    }
}

#[test]
fn every_link_leads_somewhere() {
    let mut links = 0;
    for (path, text) in documents() {
        let folder = path.parent().expect("a document lies in a folder");
        for part in text.split("](").skip(1) {
            let target = part.split(')').next().unwrap_or_default();
            let file = target.split('#').next().unwrap_or_default();
            if file.is_empty() || file.starts_with("http") {
                continue;
            }
            assert!(folder.join(file).exists(), "{} points to {file}, which is not there", path.display());
            links += 1;
        }
    }
    assert!(links > 60, "only {links} links");
}

#[test]
fn every_page_of_docs_is_linked() {
    let all = documents();
    for (path, _) in all.iter().filter(|(path, _)| path.starts_with(root().join("docs"))) {
        let linked = all.iter().any(|(from, text)| {
            let folder = from.parent().expect("a document lies in a folder");
            let leads = |part: &str| {
                let file = part.split([')', '#']).next().unwrap_or_default();
                fs::canonicalize(folder.join(file))
                    .is_ok_and(|there| Ok(there) == fs::canonicalize(path).map_err(drop))
            };
            text.split("](").skip(1).any(leads)
        });
        assert!(linked, "no document leads to {}", path.display());
    }
}

#[test]
fn every_decision_tells_question_choice_figures_and_what_would_change_it() {
    let mut decisions = 0;
    for (path, text) in documents() {
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        if !path.starts_with(root().join("docs/decisions")) || name == "README.md" {
            continue;
        }
        let heads: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("## ")).collect();
        assert_eq!(heads, ["Question", "Choice", "Figures", "What would change it"], "{name}");
        assert!(text.starts_with(&format!("# {} ", &name[..4])), "{name} has another number in its title");
        assert!(!text.contains("\n\n\n"), "{name} has an empty section");
        decisions += 1;
    }
    assert!(decisions > 40, "only {decisions} decisions");
}

/// The limits that the threat model lists are those of the code.
#[test]
fn the_limits_that_are_told_are_those_of_the_code() {
    let text = fs::read_to_string(root().join("docs/threat-model.md")).expect("a document");
    let mut limits = 0;
    for row in text.lines().filter(|line| line.starts_with('|') && line.contains("_MAX")) {
        let quoted: Vec<&str> = row.split('`').skip(1).step_by(2).collect();
        let [path, limit] = quoted[..] else { panic!("a row names file and limit: {row}") };
        let (name, value) = limit.split_once(" = ").expect("a name and its value");
        let source = fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"));
        let found = source
            .lines()
            .any(|line| line.contains(&format!("const {name}: ")) && line.ends_with(&format!(" = {value};")));
        assert!(found, "{path} has no {limit}");
        limits += 1;
    }
    assert!(limits >= 15, "only {limits} limits");
}

/// Words in backquotes outside of blocks of code.
fn quoted(text: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut block = false;
    for line in text.lines() {
        if line.starts_with("```") {
            block = !block;
        } else if !block && !line.starts_with("    ") {
            words.extend(line.split('`').skip(1).step_by(2).map(str::to_owned));
        }
    }
    words
}

/// Every word of the sources under a folder or in a file; empty where there are none.
fn words_of_sources(place: &Path) -> BTreeSet<String> {
    let mut words = BTreeSet::new();
    let mut left = vec![place.to_path_buf()];
    while let Some(path) = left.pop() {
        // What cargo makes is no source, and this file names what is not there.
        if path.ends_with("target") || path.ends_with("documents.rs") {
            continue;
        }
        if path.is_dir() {
            left.extend(
                fs::read_dir(&path).expect("a folder of sources").map(|e| e.expect("readable").path()),
            );
        } else if path.extension().is_some_and(|e| e == "rs") {
            let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            let code = text.lines().map(|line| line.split("//").next().unwrap_or_default());
            let each = code.flat_map(|line| line.split(|c: char| !c.is_alphanumeric() && c != '_'));
            words.extend(each.filter(|w| !w.is_empty()).map(str::to_owned));
        }
    }
    words
}

/// Sources of the crates that documents name by a short word.
const CRATES: [(&str, &str); 8] = [
    ("core", "daemon/core/src"),
    ("models", "daemon/models/src"),
    ("record", "daemon/record/src"),
    ("devices", "daemon/devices/src"),
    ("render", "daemon/render/src"),
    ("lab", "daemon/lab/src"),
    ("calibration", "calibration/src"),
    ("hw_sim", "hw-sim/src"),
];

/// Whether a path such as `core::event::Lent` leads to a module, and to a name in it.
fn is_there(path: &str, all: &BTreeSet<String>) -> bool {
    let parts: Vec<&str> = path.split("::").map(|part| part.trim_end_matches("()")).collect();
    let Some((_, sources)) = CRATES.iter().find(|(name, _)| *name == parts[0]) else {
        return parts.iter().all(|part| all.contains(*part));
    };
    let mut place = root().join(sources);
    for (i, part) in parts.iter().enumerate().skip(1) {
        if place.join(part).is_dir() {
            place.push(part);
        } else if place.join(format!("{part}.rs")).is_file() {
            place.push(format!("{part}.rs"));
        } else {
            let words = words_of_sources(&place);
            return parts[i..].iter().all(|name| words.contains(*name));
        }
    }
    true
}

#[test]
fn what_the_documents_name_in_the_code_is_there() {
    let all = ["calibration", "daemon", "hw-sim", "shaders-spirv", "tests"]
        .iter()
        .flat_map(|folder| words_of_sources(&root().join(folder)))
        .collect();
    let tops = ["calibration/", "daemon/", "docs/", "hw-sim/", "shaders-spirv/", "systemd/", "tests/"];
    let mut checked = 0;
    for (path, text) in documents() {
        // The log of changes names what was there.
        if path.ends_with("CHANGELOG.md") {
            continue;
        }
        for word in quoted(&text) {
            if word.contains([' ', '*', '{', '<']) {
                continue;
            }
            if tops.iter().any(|top| word.starts_with(top)) {
                assert!(root().join(&word).exists(), "{} names {word}, which is not there", path.display());
                checked += 1;
            } else if word.contains("::") {
                assert!(is_there(&word, &all), "{} names {word}, which no source has", path.display());
                checked += 1;
            }
        }
    }
    assert!(checked > 30, "only {checked} names");
    // The check can fail.
    assert!(
        !is_there("core::event::Lend", &all)
            && !is_there("core::evening", &all)
            && !is_there("Nowhere::never", &all)
    );
    assert!(is_there("core::event::Lent", &all) && is_there("core::time", &all));
}

#[test]
fn every_scenario_in_the_documents_is_read() {
    let mut read = 0;
    for (path, text) in documents() {
        for block in text.split("```toml\n").skip(1) {
            let block = block.split("```").next().unwrap_or_default();
            let scenario =
                Scenario::parse(block, &path.display().to_string()).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(scenario.warnings, [""; 0], "a document uses a former name");
            read += 1;
        }
        // Tables in an indented block are parts of a scenario, or of a script for `bowwave play`.
        let indented = text.lines().map(|line| line.strip_prefix("    ").unwrap_or_default());
        let lines: Vec<&str> = indented.collect();
        for start in (0..lines.len()).filter(|i| lines[*i].starts_with('[')) {
            let part: String =
                lines[start..].iter().take_while(|l| !l.is_empty()).map(|l| format!("{l}\n")).collect();
            if part.starts_with("[[step]]") {
                Script::parse(&part, &path.display().to_string()).unwrap_or_else(|e| panic!("{e}"));
                continue;
            }
            let scenario =
                Scenario::parse(&part, &path.display().to_string()).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(scenario.warnings, [""; 0], "a document uses a former name");
            read += 1;
        }
    }
    for (name, text) in bowwave_core::world::scenario::BUILT_IN {
        let scenario = Scenario::parse(text, name).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(scenario.warnings, [""; 0], "{name} uses a former name");
    }
    assert!(read >= 2, "only {read} scenarios");
}
