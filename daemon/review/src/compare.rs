//! Several runs on one page: their scores side by side, their misses in one plot, and how each item went from run to run.

mod differences;
mod mark;
mod misses;
mod progress;
mod scores;

use std::path::{Path, PathBuf};

use bowwave_record::{JournalError, RunDetails, RunSelection, StoredRun, read_runs};
use bowwave_web::{Module, Page};
use jiff::Timestamp;
use maud::{Markup, html};
use serde_json::Value;

use crate::{page::light, scored::ScoredRun};
use mark::mark;

const STYLE: &str = concat!(include_str!("../assets/page.css"), include_str!("../assets/compare.css"));
const MODULES: [Module; 2] = [
    Module { name: "compare.js", source: include_str!("../assets/compare.js") },
    Module { name: "theme.js", source: include_str!("../assets/theme.js") },
];

/// A run among others.
#[derive(Clone, Debug)]
pub struct ComparedRun {
    /// Its journal.
    pub journal: PathBuf,
    /// Link to its own page, where it has one.
    pub link: Option<String>,
    stored: StoredRun,
    details: RunDetails,
    scored: ScoredRun,
    /// Wall time that it is put in order by.
    around_ns: Option<i64>,
}

impl ComparedRun {
    /// Reads runs of the journal at `path`: those of these numbers, or the newest where none is named.
    ///
    /// # Errors
    /// Where the journal cannot be read, or has no such run.
    pub fn read(path: &Path, numbers: &[i64]) -> Result<Vec<Self>, JournalError> {
        let all = read_runs(path)?;
        let newest = all.last().map(|stored| stored.id);
        let wanted = if numbers.is_empty() { vec![newest.unwrap_or(0)] } else { numbers.to_vec() };
        let (first, last) = (all.first().map(|stored| stored.id), newest);
        wanted
            .into_iter()
            .map(|run| {
                let no_such = || JournalError::NoSuchRun { path: path.into(), run, first, last };
                let at = all.iter().position(|stored| stored.id == run).ok_or_else(no_such)?;
                let stored = all[at].clone();
                let details = stored.run.details.as_deref().and_then(RunDetails::from_json);
                Ok(Self {
                    journal: path.to_owned(),
                    link: None,
                    details: details.unwrap_or_default(),
                    scored: ScoredRun::read(path, RunSelection::Run(run))?,
                    around_ns: around(&all, at),
                    stored,
                })
            })
            .collect()
    }

    /// Its number in the journal.
    pub const fn id(&self) -> i64 {
        self.stored.id
    }

    /// No event of it is of a newer version.
    pub const fn counts_all_events(&self) -> bool {
        self.scored.unknown == 0
    }

    /// When it began, in words.
    fn began(&self) -> String {
        self.stored.run.started_wall_ns.map_or_else(|| "clock not set".to_owned(), utc)
    }
}

/// Wall time of a run's beginning, to be put in order by: the latest that the journal has up to this run, since it is kept in order while clocks
/// jump; else that of the next run whose clock was set.
fn around(all: &[StoredRun], at: usize) -> Option<i64> {
    let wall = |stored: &StoredRun| stored.run.started_wall_ns;
    all[..=at].iter().filter_map(wall).max().or_else(|| all[at..].iter().find_map(wall))
}

/// Numbers of all runs of the journal at `path`.
///
/// # Errors
/// Where the journal cannot be read.
pub fn run_numbers(path: &Path) -> Result<Vec<i64>, JournalError> {
    Ok(read_runs(path)?.iter().map(|stored| stored.id).collect())
}

/// Puts runs in the order of their beginnings. Runs of one journal stay in its order, since clocks may be set while it is kept; where no
/// clock of a journal was ever set, its runs come last, in the order in which journals were named.
pub fn in_order(runs: &mut [ComparedRun]) {
    let journals: Vec<PathBuf> = runs.iter().map(|run| run.journal.clone()).collect();
    let place = |run: &ComparedRun| journals.iter().position(|journal| *journal == run.journal);
    runs.sort_by_key(|run| (run.around_ns.unwrap_or(i64::MAX), place(run), run.stored.id));
}

/// The page of these runs, one file that needs no other. They are shown in their order.
pub fn compare_page(runs: &[ComparedRun]) -> String {
    let scores: Vec<Value> =
        runs.iter().map(|run| serde_json::to_value(&run.scored).unwrap_or_default()).collect();
    let title = if runs.len() == 1 { "1 run".to_owned() } else { format!("{} runs compared", runs.len()) };
    let notes = differences::notes(runs);
    let body = html! {
        header.bar {
            h1.grow { (title) }
            (light())
        }
        main {
            @if !notes.is_empty() {
                section.panel.notes aria-label="Notes" { ul { @for note in &notes { li { (note) } } } }
            }
            (listed(runs))
            (scores::table(runs, &scores))
            (misses::plot(runs))
            (progress::plots(runs, &scores))
        }
    };
    Page {
        title: &title,
        style: STYLE,
        body,
        data: "{}",
        modules: &MODULES,
        main: "compare.js",
        plays_files: false,
    }
    .to_html()
}

/// All runs, each with its mark, and where its own page is.
fn listed(runs: &[ComparedRun]) -> Markup {
    html! {
        section.panel {
            h2 { "Runs" }
            p.muted { "In the order of their beginnings. A run has the same number and mark in every table and plot." }
            div.scroll tabindex="0" role="region" aria-label="Runs" { table {
                thead { tr {
                    th scope="col" { "Run" } th scope="col" { "Began" } th scope="col" { "Scenario" } th scope="col" { "Weapon" }
                    th.number scope="col" { "Seed" } th scope="col" { "Version" } th scope="col" { "Journal" } th scope="col" { "Its page" }
                } }
                tbody { @for (i, run) in runs.iter().enumerate() {
                    tr id={ "run-" (i + 1) } {
                        th scope="row" { (mark(i)) " " (i + 1) }
                        td { (run.began()) }
                        td { (run.stored.run.scenario) }
                        td { (run.details.weapon.as_deref().unwrap_or("-")) }
                        td.number { (run.stored.run.seed) }
                        td { (run.stored.run.version) }
                        td { (run.journal.display()) ", run " (run.stored.id) }
                        td { @match &run.link {
                            Some(link) => a href=(link) { "debrief of run " (i + 1) },
                            None => code { "bowwave review " (run.journal.display()) " --run " (run.stored.id) },
                        } }
                    }
                } }
            } }
        }
    }
}

/// Wall time, nanoseconds since 1970, to the minute.
fn utc(wall_ns: i64) -> String {
    let time = Timestamp::from_second(wall_ns.div_euclid(1_000_000_000)).unwrap_or_default();
    time.strftime("%Y-%m-%d %H:%M UTC").to_string()
}

/// Numbers of runs as a list in words.
fn numbers(of: &[usize]) -> String {
    let words: Vec<String> = of.iter().map(|i| (i + 1).to_string()).collect();
    match words.as_slice() {
        [one] => format!("run {one}"),
        [first @ .., last] => format!("runs {} and {last}", first.join(", ")),
        [] => "no run".to_owned(),
    }
}
