//! Rules about core's modules: three stages, and no circles between files.

#![allow(clippy::expect_used, reason = "a test that cannot go on has failed")]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

type ModulePath = Vec<String>;

/// The modules of a crate by file, without its tests.
struct Modules {
    texts: BTreeMap<ModulePath, String>,
    /// What each module takes in by `use`, by the name that it gives it.
    names: BTreeMap<ModulePath, BTreeMap<String, ModulePath>>,
}

fn rust_files(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            rust_files(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

/// The code of a file: neither comments nor what stands after the first `#[cfg(test)]`.
fn code_of(text: &str) -> String {
    let code = text.split("#[cfg(test)]").next().unwrap_or("");
    code.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// The single paths of a tree of imports, as `a::{b, c::d}`.
fn expand(tree: &str) -> Vec<String> {
    let Some(open) = tree.find('{') else {
        let path = tree.split(" as ").next().unwrap_or("").trim();
        return if path.is_empty() { Vec::new() } else { vec![path.to_owned()] };
    };
    let (prefix, rest) = tree.split_at(open);
    let inner = rest[1..].rsplit_once('}').map_or("", |(inner, _)| inner);
    let (mut depth, mut from, mut parts) = (0, 0, Vec::new());
    for (i, c) in inner.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&inner[from..i]);
                from = i + 1;
            }
            _ => {}
        }
    }
    parts.push(&inner[from..]);
    parts.iter().flat_map(|part| expand(part.trim())).map(|path| format!("{}{path}", prefix.trim())).collect()
}

/// What stands before and in each `use` of some code, statement by statement.
fn statements(code: &str) -> impl Iterator<Item = (&str, Option<&str>)> {
    code.split(';').map(|statement| {
        let begin = statement
            .rfind("use ")
            .filter(|&i| i == 0 || statement[..i].ends_with(|c: char| c.is_whitespace()));
        begin.map_or((statement, None), |i| (&statement[..i], Some(&statement[i + 4..])))
    })
}

/// All paths of the `use` lines.
fn imports(code: &str) -> Vec<String> {
    let trees = statements(code).filter_map(|(_, tree)| tree);
    trees.flat_map(|tree| expand(&tree.split_whitespace().collect::<Vec<_>>().join(" "))).collect()
}

/// Paths that stand in code outside of imports and begin with `crate` or `super`.
fn inline_paths(code: &str) -> Vec<String> {
    let word = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let words = statements(code).flat_map(|(before, _)| before.split(move |c| !word(c)));
    words.filter(|w| w.starts_with("crate::") || w.starts_with("super::")).map(str::to_owned).collect()
}

impl Modules {
    fn of(source: &Path) -> Self {
        let mut files = Vec::new();
        rust_files(source, &mut files);
        let is_test = |p: &PathBuf| {
            let name = p.file_name().unwrap_or_default().to_string_lossy().into_owned();
            name == "tests.rs" || name == "test_data.rs" || name.ends_with("_tests.rs")
        };
        let texts: BTreeMap<ModulePath, String> = files
            .iter()
            .filter(|p| !is_test(p))
            .map(|p| {
                let inside = p.strip_prefix(source).expect("below the source").with_extension("");
                let mut path: ModulePath =
                    inside.iter().map(|part| part.to_string_lossy().into_owned()).collect();
                if path.last().is_some_and(|last| last == "mod" || last == "lib") {
                    path.pop();
                }
                (path, code_of(&fs::read_to_string(p).expect("a source")))
            })
            .collect();
        let mut modules = Self { texts, names: BTreeMap::new() };
        for (module, code) in &modules.texts {
            let named = imports(code).into_iter().filter_map(|path| {
                let path = modules.absolute(module, &path)?;
                Some((path.last()?.clone(), path))
            });
            let named = named.collect();
            modules.names.insert(module.clone(), named);
        }
        modules
    }

    /// The path from the crate's root on; `None` for what is of another crate.
    fn absolute(&self, module: &ModulePath, path: &str) -> Option<ModulePath> {
        let mut parts = path.split("::").map(str::trim).filter(|p| !p.is_empty()).map(str::to_owned);
        let first = parts.next()?;
        let mut base = module.clone();
        let mut rest: Vec<String> = parts.collect();
        match first.as_str() {
            "crate" => base.clear(),
            "self" => {}
            "super" => {
                base.pop();
                while rest.first().is_some_and(|p| p == "super") {
                    rest.remove(0);
                    base.pop();
                }
            }
            child => {
                base.push(child.to_owned());
                if !self.texts.contains_key(&base) {
                    return None;
                }
            }
        }
        base.extend(rest);
        Some(base)
    }

    /// The module that defines what a path leads to: what a module only hands on is looked up where that has it from.
    fn defining(&self, path: &ModulePath, hops: u8) -> ModulePath {
        let mut module = path.clone();
        while !self.texts.contains_key(&module) {
            module.pop();
        }
        let handed_on = path.get(module.len()).and_then(|name| self.names.get(&module)?.get(name));
        match handed_on {
            Some(from) if from != path && hops > 0 => {
                let rest = path.get(module.len() + 1..).unwrap_or_default();
                self.defining(&from.iter().chain(rest).cloned().collect(), hops - 1)
            }
            _ => module,
        }
    }

    /// The modules that each uses.
    fn arrows(&self) -> BTreeMap<ModulePath, BTreeSet<ModulePath>> {
        let arrows = self.texts.iter().map(|(module, code)| {
            let used = imports(code).into_iter().chain(inline_paths(code));
            let used = used.filter_map(|path| self.absolute(module, &path));
            let used = used.map(|path| self.defining(&path, 8)).filter(|m| m != module && !m.is_empty());
            (module.clone(), used.collect())
        });
        arrows.collect()
    }
}

/// Modules that can be reached from `from`, itself only where an arrow leads back.
fn reachable(arrows: &BTreeMap<ModulePath, BTreeSet<ModulePath>>, from: &ModulePath) -> BTreeSet<ModulePath> {
    let (mut seen, mut waiting) = (BTreeSet::new(), vec![from]);
    while let Some(module) = waiting.pop() {
        for next in arrows.get(module).into_iter().flatten() {
            if seen.insert(next.clone()) {
                waiting.push(next);
            }
        }
    }
    seen
}

fn core() -> Modules {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate lies in the workspace");
    Modules::of(&root.join("daemon/core/src"))
}

#[test]
fn each_stage_sees_only_those_before_it() {
    let arrows = core().arrows();
    let stage = |m: &ModulePath| m.first().cloned().unwrap_or_default();
    let stages = ["estimate", "world", "frame", "session", "gunner"];
    let rank = |name: &str| stages.iter().position(|s| *s == name);
    let mut seen = BTreeSet::new();
    for (module, used) in &arrows {
        let own = rank(&stage(module));
        for other in used {
            let theirs = rank(&stage(other));
            assert!(
                theirs.is_none() || own >= theirs,
                "{} uses {}: {stages:?} see only what stands before them, and the vocabulary sees none",
                module.join("::"),
                other.join("::")
            );
            seen.insert((own, theirs));
        }
    }
    // The test sees anything at all: the frame asks world and estimates, the session all three.
    for pair in [(2, 0), (2, 1), (3, 0), (3, 1), (3, 2)] {
        assert!(
            seen.contains(&(Some(pair.0), Some(pair.1))),
            "{} no longer uses {}",
            stages[pair.0],
            stages[pair.1]
        );
    }
}

#[test]
fn no_files_of_core_use_each_other_in_a_circle() {
    let arrows = core().arrows();
    assert!(arrows.len() > 80, "only {} modules were found", arrows.len());
    let circles: Vec<String> = arrows
        .keys()
        .filter(|module| reachable(&arrows, module).contains(*module))
        .map(|module| {
            let used = arrows[module].iter().map(|m| m.join("::")).collect::<Vec<_>>().join(", ");
            format!("{} -> {used}", module.join("::"))
        })
        .collect();
    assert!(circles.is_empty(), "these lie on a circle:\n{}", circles.join("\n"));
}

#[test]
fn imports_are_read_as_they_are_written() {
    let code = code_of(
        "pub use a::{b, c::{d, e as f}};\n// use no::comment;\nfn x() { crate::y::z(); }\n#[cfg(test)]\nuse t::t;",
    );
    assert_eq!(imports(&code), ["a::b", "a::c::d", "a::c::e"]);
    assert_eq!(inline_paths(&code), ["crate::y::z"]);
}
