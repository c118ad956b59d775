//! Both documents on light and shadow, row by row: what a passage does as printed, where it breaks, what the product does instead, and the evidence for it:
//! tables and pictures that are measured and drawn in that run, with the command that makes them once more.

mod at_sea;
mod canvas;
mod contact;
mod crews;
mod exhibit;
mod heavens;
mod hughes;
mod kolivand;
mod partitions;
mod place;
mod quay;
mod relit;
mod review;
mod section;
mod stages;
mod study;

use std::path::PathBuf;

use anyhow::Result;

pub use exhibit::{Cell, Exhibit, Figure, Line, Table};
pub use section::Section;
pub use study::DocumentsStudy;

/// A source document.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Hughes, Konttinen and Pattanaik 2004.
    Hughes,
    /// Kolivand and Sunar 2014.
    Kolivand,
}

impl Source {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Hughes, Self::Kolivand];

    /// Authors, year and subject.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Hughes => "Hughes, Konttinen and Pattanaik 2004: light and shadow between real and virtual",
            Self::Kolivand => {
                "Kolivand and Sunar 2014: Realistic Real-Time Outdoor Rendering in Augmented Reality"
            }
        }
    }
}

/// Rows of a part of the report that measure what a passage does.
#[derive(Clone, Copy, Debug)]
pub struct PartTable {
    /// The part.
    pub part: &'static str,
    /// Words above the table.
    pub caption: &'static str,
    /// Only scenes and cases whose name holds one of these; all where there is none.
    pub scenes: &'static [&'static str],
    /// Only methods and settings whose name holds one of these, and what the product uses; all where there is none.
    pub methods: &'static [&'static str],
}

/// What makes a row's own evidence.
pub type MakeExhibits = fn(&Workshop) -> Result<Vec<Exhibit>>;

/// A row of a document.
#[derive(Clone, Copy)]
pub struct DocumentRow {
    /// Its name on the command line and in addresses.
    pub id: &'static str,
    /// The document.
    pub source: Source,
    /// Its name.
    pub name: &'static str,
    /// Sections and equations.
    pub passage: &'static str,
    /// The passage in our words.
    pub printed: &'static str,
    /// Where that breaks.
    pub breaks: &'static str,
    /// What the product does.
    pub product: &'static str,
    /// Commands that show it.
    pub commands: &'static [&'static str],
    /// Parts of the report that measure it.
    pub tables: &'static [PartTable],
    /// Tables and pictures of its own.
    pub exhibits: Option<MakeExhibits>,
}

/// All rows, document by document.
pub fn rows() -> impl Iterator<Item = &'static DocumentRow> {
    hughes::ROWS.iter().chain(kolivand::ROWS)
}

/// What evidence is made with.
#[derive(Clone, Debug)]
pub struct Workshop {
    /// The trainer's program, for rows that are about a whole run.
    pub program: PathBuf,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;
    use crate::parts::PARTS;

    #[test]
    fn every_row_has_a_passage_a_command_and_evidence() {
        let all: Vec<&DocumentRow> = rows().collect();
        let of = |source| all.iter().filter(|row| row.source == source).count();
        assert_eq!((of(Source::Hughes), of(Source::Kolivand)), (11, 7));
        for row in &all {
            assert!(all.iter().filter(|other| other.id == row.id).count() == 1, "{}", row.id);
            let words = [row.name, row.passage, row.printed, row.breaks, row.product];
            assert!(words.iter().all(|text| !text.is_empty()) && !row.commands.is_empty(), "{}", row.id);
            assert!(!row.tables.is_empty() || row.exhibits.is_some(), "{} has no evidence", row.id);
            for table in row.tables {
                assert!(
                    PARTS.iter().any(|part| part.about.part == table.part),
                    "{}: no part {}",
                    row.id,
                    table.part
                );
            }
        }
    }

    /// A command of the program, of the laboratory, or of this report.
    #[test]
    fn every_command_is_one() {
        let mut checked = 0;
        for row in rows() {
            for command in row.commands {
                let words = shell_words(command);
                let parsed = match words.iter().map(String::as_str).collect::<Vec<&str>>()[..] {
                    ["bowwave", ..] => bowwave::command_line().try_get_matches_from(&words).map(drop),
                    ["cargo", "run", "--release", "-p", "precision", "--", ..] => {
                        parse_report(&words[5..]);
                        Ok(())
                    }
                    _ => panic!("{}: {command} is no command of this project", row.id),
                };
                parsed.unwrap_or_else(|e| panic!("{}: {command}: {e}", row.id));
                checked += 1;
            }
        }
        assert!(checked >= 18, "{checked}");
    }

    /// `-- --part NAME` or `-- documents --only ROW`: parts and rows must be there. The program's own test parses both.
    fn parse_report(words: &[String]) {
        match words.iter().map(String::as_str).collect::<Vec<&str>>()[..] {
            ["--", "--part", part] => assert!(PARTS.iter().any(|p| p.about.part == part), "no part {part}"),
            ["--", "documents", "--only", id] => {
                assert!(rows().any(|row| row.id == id), "no row {id}");
                #[derive(clap::Parser)]
                struct Study {
                    #[command(flatten)]
                    study: DocumentsStudy,
                }
                let parsed = Study::command().try_get_matches_from(["documents", "--only", id]);
                assert!(parsed.is_ok(), "{parsed:?}");
            }
            _ => panic!("{words:?}"),
        }
    }

    fn shell_words(command: &str) -> Vec<String> {
        let mut words = Vec::new();
        for (i, part) in command.split('"').enumerate() {
            if i % 2 == 1 {
                words.push(part.to_owned());
            } else {
                words.extend(part.split_whitespace().map(str::to_owned));
            }
        }
        words
    }
}
