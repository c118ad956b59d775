//! `bowwave review`: the debrief of a run as a page, and what other programs read of it.

mod address;
mod compare;
mod paper;
mod video;

use std::{
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use anyhow::{Context, Result};
use bowwave_review::{Document, ReviewedRun, compare::run_numbers, export, page};

use self::compare::Comparison;
use crate::{
    cli::{ReviewArgs, ReviewFormat},
    hits::journal_at,
    new_file::{refuse_to_replace, write_new},
    outcome::Outcome,
    stdout,
};

/// Remedies for a run whose place on the Earth is not known.
const NO_PLACE: &str = "the run's place on the Earth is not known; add --place LAT,LON, or give latitude_deg, longitude_deg and utc in [light] of its \
                        scenario before it is played";

/// Makes the page, says where it is, and opens it where that is wanted.
pub fn run(arguments: &ReviewArgs) -> Result<Outcome> {
    if let Some(out) = &arguments.out {
        refuse_to_replace(out, arguments.force)?;
    }
    if let Some(Comparison { page, path, is_whole }) = compare::compared(arguments)? {
        write_page(arguments, &page, &path)?;
        return finish(arguments, &path, is_whole);
    }
    let journal = journal_at(arguments.run.first().context("no run is named")?)?;
    let mut reviewed = ReviewedRun::read(&journal, arguments.numbers.first().copied())?;
    reviewed.place = arguments.place.or(reviewed.place);
    let path =
        arguments.out.clone().unwrap_or_else(|| beside(&journal, reviewed.stored.id, arguments.format));
    match arguments.format {
        ReviewFormat::Html => {
            let is_newest = run_numbers(&journal)?.last() == Some(&reviewed.stored.id);
            let video = video::video_for(arguments, (&journal, &reviewed, is_newest), &path)?;
            write_page(arguments, &page(&reviewed, video.as_ref()), &path)?;
            video.iter().for_each(|video| eprintln!("{}", video::words(video)));
        }
        ReviewFormat::Pdf => write_page(arguments, &page(&reviewed, None), &path)?,
        ReviewFormat::Csv => write_new(&path, &export::csv(&reviewed))?,
        ReviewFormat::Jsonl => write_new(&path, &export::json_lines(&reviewed))?,
        ReviewFormat::Acmi => write_new(&path, &export::acmi(&reviewed))?,
        ReviewFormat::Geojson => write_new(&path, &export::geojson(&reviewed).context(NO_PLACE)?)?,
    }
    // What is missing is said on the page, too.
    let is_whole = reviewed.tracks.missing == 0 && reviewed.scored.unknown == 0;
    finish(arguments, &path, is_whole)
}

/// Writes a page, or prints it.
fn write_page(arguments: &ReviewArgs, page: &Document, path: &Path) -> Result<()> {
    if arguments.format == ReviewFormat::Pdf {
        return paper::print(page, path, arguments.browser.as_deref());
    }
    let cannot =
        || format!("cannot write {}; check the folder, its permissions and the disk", path.display());
    page.write(path).with_context(cannot)
}

/// Says where the file is, and opens it where that is wanted.
fn finish(arguments: &ReviewArgs, path: &Path, is_whole: bool) -> Result<Outcome> {
    stdout::print(format!("{}\n", path.display()))?;
    if arguments.open {
        open(path)?;
    } else if arguments.format == ReviewFormat::Html {
        eprintln!("open it in a browser; it needs no network");
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
