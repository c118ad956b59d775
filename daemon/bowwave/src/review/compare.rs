//! Several runs on one page.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use bowwave_review::{
    Document,
    compare::{ComparedRun, compare_page, in_order, run_numbers},
};

use super::{
    address::{address, same_file},
    beside,
};
use crate::{
    cli::{ReviewArgs, ReviewFormat},
    hits::journal_at,
};

/// Most runs on a page.
const RUNS_MOST: usize = 60;
/// File's name where none is given.
const NAME: &str = "review-compare";

/// The page of several runs.
pub struct Comparison {
    /// The page.
    pub page: Document,
    /// Its place.
    pub path: PathBuf,
    /// No event is of a newer version.
    pub is_whole: bool,
}

/// Makes the page; `None` where the arguments name one run.
pub fn compared(arguments: &ReviewArgs) -> Result<Option<Comparison>> {
    let wanted = wanted(arguments)?;
    if wanted.len() < 2 && !arguments.all_runs {
        return Ok(None);
    }
    ensure!(
        matches!(arguments.format, ReviewFormat::Html | ReviewFormat::Pdf),
        "--format {} is of one run, and {} are named; leave the others out, or make the page",
        arguments.format.name(),
        wanted.len()
    );
    ensure!(
        arguments.video.is_none() && arguments.video_at.is_none(),
        "--video is of one run, and {} are named; leave the others out",
        wanted.len()
    );
    ensure!(
        wanted.len() <= RUNS_MOST,
        "{} runs are named, and one page compares {RUNS_MOST} at most; name fewer with --run N,N,...",
        wanted.len()
    );
    let first = wanted.first().context("the journal has no run")?;
    let path = arguments
        .out
        .clone()
        .unwrap_or_else(|| first.0.with_file_name(format!("{NAME}.{}", arguments.format.name())));
    let mut runs = Vec::new();
    for (journal, number) in &wanted {
        runs.extend(ComparedRun::read(journal, &[*number])?);
    }
    for run in &mut runs {
        run.link = link(&path, &run.journal, run.id());
    }
    in_order(&mut runs);
    let is_whole = runs.iter().all(ComparedRun::counts_all_events);
    Ok(Some(Comparison { page: Document::new(compare_page(&runs), None), path, is_whole }))
}

/// Journals with numbers of runs in them, each once.
fn wanted(arguments: &ReviewArgs) -> Result<Vec<(PathBuf, i64)>> {
    if arguments.run.len() > 1 && !arguments.numbers.is_empty() {
        bail!(
            "--run names runs of one journal, and {} are named; leave --run out to take the newest of each, or add --all-runs",
            arguments.run.len()
        );
    }
    let mut wanted: Vec<(PathBuf, i64)> = Vec::new();
    for named in &arguments.run {
        let journal = journal_at(named)?;
        let all = run_numbers(&journal)?;
        let numbers = if arguments.all_runs {
            all
        } else if arguments.numbers.is_empty() {
            vec![all.last().copied().unwrap_or(0)]
        } else {
            arguments.numbers.clone()
        };
        for number in numbers {
            let is_there = |(other, known): &(PathBuf, i64)| *known == number && same_file(other, &journal);
            if wanted.iter().any(is_there) {
                log::warn!("run {number} of {} is named twice; it is taken once", journal.display());
            } else {
                wanted.push((journal.clone(), number));
            }
        }
    }
    Ok(wanted)
}

/// Address of a run's own page as seen from the page at `from`, where there is one.
fn link(from: &Path, journal: &Path, run: i64) -> Option<String> {
    let page = beside(journal, run, ReviewFormat::Html);
    page.is_file().then(|| address(from, &page)).flatten()
}
