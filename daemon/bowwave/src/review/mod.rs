//! `bowwave review`: the debrief of a run as a page, and what other programs read of it.

mod address;
mod compare;

use std::{
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use anyhow::{Context, Result};
use bowwave_review::{ReviewedRun, export, page};

use self::compare::Comparison;
use crate::{
    cli::{ReviewArgs, ReviewFormat},
    hits::journal_at,
    new_file::{refuse_to_replace, write_new},
    outcome::Outcome,
    stdout,
};

/// Makes the page, says where it is, and opens it where that is wanted.
pub fn run(arguments: &ReviewArgs) -> Result<Outcome> {
    if let Some(out) = &arguments.out {
        refuse_to_replace(out, arguments.force)?;
    }
    if let Some(Comparison { text, path, is_whole }) = compare::compared(arguments)? {
        return finish(arguments, &path, &text, is_whole);
    }
    let journal = journal_at(arguments.run.first().context("no run is named")?)?;
    let reviewed = ReviewedRun::read(&journal, arguments.numbers.first().copied())?;
    let place = || beside(&journal, reviewed.stored.id, arguments.format);
    let path = arguments.out.clone().unwrap_or_else(place);
    let text = match arguments.format {
        ReviewFormat::Html | ReviewFormat::Pdf => page(&reviewed),
        ReviewFormat::Csv => export::csv(&reviewed),
        ReviewFormat::Jsonl => export::json_lines(&reviewed),
        ReviewFormat::Acmi => export::acmi(&reviewed),
    };
    // What is missing is said on the page, too.
    let is_whole = reviewed.tracks.missing == 0 && reviewed.scored.unknown == 0;
    finish(arguments, &path, &text, is_whole)
}

/// Writes what was made, says where it is, and opens it where that is wanted.
fn finish(arguments: &ReviewArgs, path: &Path, text: &str, is_whole: bool) -> Result<Outcome> {
    write_new(path, text)?;
    stdout::print(format!("{}\n", path.display()))?;
    if arguments.open {
        open(path)?;
    } else if arguments.format == ReviewFormat::Html {
        eprintln!("open it in a browser; it needs no other file and no network");
    }
    Ok(if is_whole { Outcome::Done } else { Outcome::Partly })
}

/// The file's place where none is named: in the journal's folder, one a run and format.
fn beside(journal: &Path, run: i64, format: ReviewFormat) -> PathBuf {
    let end = match format {
        // As Tacview knows its texts.
        ReviewFormat::Acmi => "txt.acmi",
        other => other.name(),
    };
    journal.with_file_name(format!("review-{run}.{end}"))
}

/// Has the desktop open the page.
fn open(path: &Path) -> Result<()> {
    let said = || {
        format!(
            "cannot open {} by xdg-open (package xdg-utils); open it in a browser yourself",
            path.display()
        )
    };
    let mut opener = Command::new("xdg-open");
    opener.arg(path).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let status = opener.status().with_context(said)?;
    anyhow::ensure!(status.success(), said());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_run_of_a_journal_has_a_page_of_its_own_beside_it() {
        let of = |journal, run, format| beside(Path::new(journal), run, format);
        assert_eq!(of("out/hits.sqlite", 3, ReviewFormat::Html), Path::new("out/review-3.html"));
        assert_eq!(of("hits.sqlite", 12, ReviewFormat::Acmi), Path::new("review-12.txt.acmi"));
    }
}
