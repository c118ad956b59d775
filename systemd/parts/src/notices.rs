//! The licences of all that others have written: a table of the parts, and every text once.

use std::{collections::BTreeMap, fmt::Write as _, fs, path::Path};

use anyhow::{Context, Result, bail};

use crate::crate_graph::LinkedCrate;

/// A part that is no crate.
struct ForeignPart {
    name: &'static str,
    licence: &'static str,
    notice: &'static str,
    text: &'static str,
}

const MIT: &str = include_str!("../foreign/mit.txt");
const APACHE: &str = include_str!("../../../LICENSE-APACHE");

/// Third-party parts of the program beside crates.
const FOREIGN: [ForeignPart; 8] = [
    ForeignPart {
        name: "B612 Bold, the display's typeface",
        licence: "OFL-1.1",
        notice: "",
        text: include_str!("../../../daemon/render/assets/B612-LICENSE.txt"),
    },
    ForeignPart {
        name: "meshoptimizer",
        licence: "MIT",
        notice: "Copyright (c) 2016-2026 Arseny Kapoulkine",
        text: MIT,
    },
    ForeignPart {
        name: "OpenBridge's palettes",
        licence: "Apache-2.0",
        notice: "Copyright (c) The OpenBridge authors",
        text: APACHE,
    },
    ForeignPart {
        name: "the Rust standard library",
        licence: "MIT OR Apache-2.0",
        notice: "Copyright (c) The Rust Project Contributors",
        text: MIT,
    },
    ForeignPart {
        name: "SQLite",
        licence: "public domain",
        notice: "",
        text: include_str!("../foreign/sqlite.txt"),
    },
    ForeignPart {
        name: "three.js",
        licence: "MIT",
        notice: "",
        text: include_str!("../../../daemon/web/assets/vendor/three/LICENSE"),
    },
    ForeignPart {
        name: "uPlot",
        licence: "MIT",
        notice: "",
        text: include_str!("../../../daemon/web/assets/vendor/uplot/LICENSE"),
    },
    ForeignPart {
        name: "tag36h11, the code table of AprilTag",
        licence: "BSD-2-Clause",
        notice: "",
        text: include_str!("../foreign/bsd-2-clause-apriltag.txt"),
    },
];

/// The document.
///
/// # Errors
/// Names the crate whose licence has no text.
pub fn text(crates: &[LinkedCrate]) -> Result<String> {
    let mut table = String::new();
    let mut users: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for part in crates.iter().filter(|c| !c.is_own()) {
        let name = format!("{} {}", part.name, part.version);
        writeln!(table, "{name:<40} {}", part.licence)?;
        for text in texts_of(part)? {
            users.entry(text).or_default().push(name.clone());
        }
    }
    for part in &FOREIGN {
        writeln!(table, "{:<40} {}", part.name, part.licence)?;
        let text = format!("{}\n\n{}", part.notice, part.text);
        users.entry(tidied(&text)).or_default().push(part.name.to_owned());
    }
    let mut document = format!(
        "Bowwave itself is under MIT or Apache-2.0, at your choice. It holds these parts of others:\n\n{table}"
    );
    // By their first users, so that a new crate moves no text.
    let mut texts: Vec<(String, Vec<String>)> = users.into_iter().collect();
    texts.sort_by(|a, b| a.1.cmp(&b.1));
    for (text, names) in texts {
        write!(document, "\n{}\n{}\n\n{text}", "-".repeat(80), names.join(", "))?;
    }
    Ok(document)
}

/// The texts of a crate's licence: its own files, else the licence's common wording with the authors' names.
fn texts_of(part: &LinkedCrate) -> Result<Vec<String>> {
    let mut names: Vec<String> = fs::read_dir(&part.folder)
        .with_context(|| format!("cannot read the sources of {}", part.name))?
        .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()))
        .filter(|name| is_notice(name) && part.folder.join(name).is_file())
        .collect();
    names.sort();
    let names = chosen(&part.licence, names);
    if names.is_empty() {
        return Ok(vec![common(part)?]);
    }
    names.iter().map(|name| read_text(&part.folder.join(name))).collect()
}

fn is_notice(name: &str) -> bool {
    let name = name.to_ascii_uppercase();
    ["LICENSE", "LICENCE", "COPYING", "NOTICE", "UNLICENSE", "COPYRIGHT"]
        .iter()
        .any(|start| name.starts_with(start))
}

/// Of alternatives that include MIT, the files of the others are left out.
fn chosen(licence: &str, names: Vec<String>) -> Vec<String> {
    let mit = |name: &String| name.to_ascii_uppercase().contains("MIT");
    let other = |name: &String| {
        let name = name.to_ascii_uppercase();
        ["APACHE", "UNLICENSE", "ZLIB", "BSL", "BOOST", "0BSD", "GPL"].iter().any(|word| name.contains(word))
    };
    let offered = !licence.contains(" AND ") && licence.split(" OR ").any(|id| id.trim() == "MIT");
    if offered && names.iter().any(mit) {
        names.into_iter().filter(|n| mit(n) || !other(n)).collect()
    } else {
        names
    }
}

fn read_text(path: &Path) -> Result<String> {
    let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(tidied(&String::from_utf8_lossy(&bytes)))
}

/// The common wording of a crate's licence that brings no file.
fn common(part: &LinkedCrate) -> Result<String> {
    let authors = if part.authors.is_empty() {
        format!("the authors of {}", part.name)
    } else {
        part.authors.join(", ")
    };
    for id in part.licence.split(" OR ") {
        match id.trim() {
            "MIT" => return Ok(tidied(&format!("Copyright (c) {authors}\n\n{MIT}"))),
            "Apache-2.0" => return Ok(tidied(&format!("Copyright (c) {authors}\n\n{APACHE}"))),
            _ => {}
        }
    }
    bail!(
        "{} is under {} and brings no text of it; add one to systemd/parts/foreign",
        part.name,
        part.licence
    )
}

/// Text with line ends as everywhere, without space at lines' and the text's ends.
fn tidied(text: &str) -> String {
    let lines: Vec<&str> = text.lines().map(str::trim_end).collect();
    lines.join("\n").trim_matches('\n').to_owned() + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{crate_graph, workspace};

    #[test]
    fn every_part_of_this_program_has_its_licence() {
        let crates = crate_graph::of_program(&workspace()).unwrap();
        let document = text(&crates).unwrap();
        let (table, texts) = document.split_once("-----").unwrap();
        let foreign: Vec<_> = crates.iter().filter(|c| !c.is_own()).collect();
        assert!(foreign.len() > 100, "{} crates", foreign.len());
        for part in foreign {
            let name = format!("{} {}", part.name, part.version);
            assert!(table.contains(&name) && texts.contains(&name), "{name} is not told");
        }
        for words in ["SIL OPEN FONT LICENSE", "Arseny Kapoulkine", "AprilRobotics", "May you do good"] {
            assert!(texts.contains(words), "'{words}' is missing");
        }
    }

    fn part(licence: &str, folder: &Path) -> LinkedCrate {
        LinkedCrate {
            name: "part".to_owned(),
            version: "1.0.0".to_owned(),
            licence: licence.to_owned(),
            authors: vec!["A. Uthor".to_owned()],
            repository: None,
            folder: folder.to_owned(),
            checksum: Some(String::new()),
            uses: Vec::new(),
        }
    }

    #[test]
    fn a_crate_without_a_file_gets_the_common_wording_or_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let texts = texts_of(&part("MIT OR Apache-2.0", folder.path())).unwrap();
        assert!(texts[0].starts_with("Copyright (c) A. Uthor\n\nPermission is hereby granted"), "{texts:?}");
        let error = texts_of(&part("ISC", folder.path())).unwrap_err().to_string();
        assert!(error.contains("part is under ISC"), "{error}");
    }

    #[test]
    fn of_alternatives_the_simplest_is_taken_and_notices_stay() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["LICENSE-MIT", "LICENSE-APACHE", "NOTICE", "lib.rs"] {
            fs::write(folder.path().join(name), format!("text of {name}  \r\n")).unwrap();
        }
        let texts = texts_of(&part("MIT OR Apache-2.0", folder.path())).unwrap();
        assert_eq!(texts, ["text of LICENSE-MIT\n", "text of NOTICE\n"]);
        let all = texts_of(&part("MIT AND Apache-2.0", folder.path())).unwrap();
        assert_eq!(all.len(), 3);
    }
}
