//! `bowwave review`: the debrief of a run as a page.

use std::{
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use anyhow::{Context, Result};
use bowwave_review::{ReviewedRun, page};

use crate::{
    cli::ReviewArgs,
    hits::journal_at,
    new_file::{refuse_to_replace, write_new},
    outcome::Outcome,
    stdout,
};

/// Makes the page, says where it is, and opens it where that is wanted.
pub fn run(arguments: &ReviewArgs) -> Result<Outcome> {
    let journal = journal_at(&arguments.run)?;
    let reviewed = ReviewedRun::read(&journal, arguments.number)?;
    if let Some(out) = &arguments.out {
        refuse_to_replace(out, arguments.force)?;
    }
    let path = arguments.out.clone().unwrap_or_else(|| beside(&journal, reviewed.stored.id));
    write_new(&path, &page(&reviewed))?;
    stdout::print(format!("{}\n", path.display()))?;
    if arguments.open {
        open(&path)?;
    } else {
        eprintln!("open it in a browser; it needs no other file and no network");
    }
    // What is missing is said on the page, too.
    let is_whole = reviewed.tracks.missing == 0 && reviewed.scored.unknown == 0;
    Ok(if is_whole { Outcome::Done } else { Outcome::Partly })
}

/// The page's place where none is named: in the journal's folder, one a run.
fn beside(journal: &Path, run: i64) -> PathBuf {
    journal.with_file_name(format!("review-{run}.html"))
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
        assert_eq!(beside(Path::new("out/hits.sqlite"), 3), Path::new("out/review-3.html"));
        assert_eq!(beside(Path::new("hits.sqlite"), 12), Path::new("review-12.html"));
    }
}
