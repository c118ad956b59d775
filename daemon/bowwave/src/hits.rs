//! `bowwave hits`: the rounds of a journal as a table, CSV or JSON.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail};
use bowwave_core::{
    text::{one_line, plain_cell},
    time::Time,
    world::{scenario::Side, score::Outcome},
};
use bowwave_record::journal::{RunSelection, ShotFilter, StoredShot, read_runs, read_shots, side_files};

use bowwave_trainer::storage::JOURNAL;

use crate::{
    cli::{Hits, HitsFormat},
    stdout,
};

/// Columns of the table for people: name, index into [`StoredShot::COLUMNS`]'s cells, digits after the point.
const TABLE: &[(&str, &str, Option<usize>)] = &[
    ("run", "run", None),
    ("shot", "shot", None),
    ("fired s", FIRED, Some(2)),
    ("outcome", "outcome", None),
    ("boat", "boat", None),
    ("side", "side", None),
    ("zone", "zone", None),
    ("range m", "range_m", Some(1)),
    ("miss m", "miss_m", Some(1)),
    ("cause", "cause", None),
    ("pose age ms", POSE_AGE, Some(1)),
];
const FIRED: &str = "fired_s";
const POSE_AGE: &str = "pose_age_ms";

/// When runs began, by their numbers; older journals do not say.
type Starts = BTreeMap<i64, Time>;

/// The journal that a path names: itself, or the one in the folder that a run left.
pub fn journal_at(named: &Path) -> Result<PathBuf> {
    let path = if named.is_dir() { named.join(JOURNAL) } else { named.to_owned() };
    if !path.exists() {
        bail!(
            "no journal at {}; name the folder that `bowwave simulate --out` left, or the database",
            path.display()
        );
    }
    Ok(path)
}

/// Prints the rounds.
pub fn run(arguments: &Hits) -> Result<()> {
    let path = journal_at(&arguments.journal)?;
    let runs = match arguments.run {
        Some(run) => RunSelection::Run(run),
        None if arguments.all_runs => RunSelection::All,
        None => RunSelection::Latest,
    };
    for file in side_files(&path).unwrap_or_default() {
        log::warn!(
            "{} has rounds that the journal does not; the next run that writes this journal takes them in or says why not",
            file.display()
        );
    }
    let shots = read_shots(&path, &ShotFilter { runs, hits_only: arguments.hits_only })?;
    match if arguments.json { HitsFormat::Json } else { arguments.format } {
        HitsFormat::Table => {
            let starts = read_runs(&path)?.into_iter().filter_map(|run| Some((run.id, run.run.started?)));
            stdout::print(table(&shots, &starts.collect()))
        }
        HitsFormat::Csv => stdout::print(&csv(&shots)?),
        HitsFormat::Json => stdout::print_json(&shots.iter().map(StoredShot::to_json).collect::<Vec<_>>()),
    }
}

fn csv(shots: &[StoredShot]) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(StoredShot::COLUMNS)?;
    for shot in shots {
        let cells = shot.cells();
        writer.write_record(StoredShot::COLUMNS.iter().zip(&cells).map(|(name, cell)| plain(name, cell)))?;
    }
    writer.into_inner().context("cannot write the CSV")
}

/// A cell in one line, whatever it holds; a name that a spreadsheet would take for a formula is marked.
fn plain(column: &str, cell: &str) -> String {
    let is_text = ["outcome", "boat", "zone", "cause"].contains(&column);
    if is_text { plain_cell(cell) } else { one_line(cell) }
}

fn table(shots: &[StoredShot], starts: &Starts) -> String {
    let mut rows: Vec<Vec<String>> = vec![TABLE.iter().map(|(title, ..)| (*title).to_owned()).collect()];
    for shot in shots {
        let cells = shot.cells();
        let cell = |(_, name, digits): &(&str, &str, Option<usize>)| {
            let text = StoredShot::COLUMNS.iter().position(|c| c == name).map_or("", |i| cells[i].as_str());
            match (digits, text.parse::<f64>()) {
                // As the display counts, from the run's beginning; programs get the time since the computer's start.
                (Some(digits), Ok(since_boot)) if *name == FIRED => {
                    let since = starts.get(&shot.run).map(|start| shot.record.fired.secs_since(*start));
                    format!("{:.digits$}", since.unwrap_or(since_boot))
                }
                // A pose between two readings is not old: how far before the newest one it lies is for programs.
                (Some(digits), Ok(value)) if *name == POSE_AGE => format!("{:.digits$}", value.max(0.0)),
                (Some(digits), Ok(value)) => format!("{value:.digits$}"),
                _ => one_line(text),
            }
        };
        rows.push(TABLE.iter().map(cell).collect());
    }
    let width = |column: usize| rows.iter().map(|r| r[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..TABLE.len()).map(width).collect();
    let mut text = String::new();
    for row in &rows {
        let line: Vec<String> = row
            .iter()
            .zip(&widths)
            .zip(TABLE)
            .map(|((cell, width), (_, name, digits))| match digits {
                None if *name != "run" && *name != "shot" => format!("{cell:<width$}"),
                _ => format!("{cell:>width$}"),
            })
            .collect();
        text.push_str(line.join("  ").trim_end());
        text.push('\n');
    }
    let struck = |neutral: bool| {
        let counts = |s: &&StoredShot| match s.record.outcome {
            Outcome::Hit { side, .. } => neutral == (side == Some(Side::Neutral)),
            _ => false,
        };
        shots.iter().filter(counts).count()
    };
    text.push_str(&format!("{} rounds, {} hits", shots.len(), struck(false)));
    match struck(true) {
        0 => {}
        neutral => text.push_str(&format!(", {neutral} HIT A NEUTRAL")),
    }
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use bowwave_core::{
        model::Zone,
        world::score::{NotScored, ShotRecord},
    };
    use glam::DVec3;

    use super::*;

    fn round(pose_age_ns: i64, outcome: Outcome) -> StoredShot {
        let (shot, fired) = (1, Time::from_ns(103_200_000_000));
        let record = ShotRecord { shot, fired, muzzle: DVec3::ZERO, bore: DVec3::Y, pose_age_ns, outcome };
        StoredShot { run: 7, record }
    }

    #[test]
    fn a_round_is_told_at_the_time_that_the_display_had() {
        let stale = round(0, Outcome::NotScored { cause: NotScored::ImuStale });
        let starts = Starts::from([(7, Time::from_ns(100_000_000_000))]);
        assert!(table(std::slice::from_ref(&stale), &starts).lines().any(|line| line.contains("  3.20  ")));
        assert!(String::from_utf8(csv(&[stale]).unwrap()).unwrap().contains(",103.2"));
    }

    #[test]
    fn a_struck_neutral_is_told_apart_and_no_name_is_a_formula_or_a_line() {
        let hit = |boat: &str, side| {
            let (zone, time) = (Zone::ALL[0], Time::from_ns(103_900_000_000));
            round(
                0,
                Outcome::Hit { boat: boat.to_owned(), side, zone, time, range_m: 200.0, point: DVec3::ZERO },
            )
        };
        let shots = [hit("a", Some(Side::Hostile)), hit("=1+1\nFORGED", Some(Side::Neutral))];
        let told = table(&shots, &Starts::new());
        assert!(told.contains("2 rounds, 1 hits, 1 HIT A NEUTRAL") && told.contains("neutral"), "{told}");
        let csv = String::from_utf8(csv(&shots).unwrap()).unwrap();
        assert!(csv.contains(",'=1+1 FORGED,neutral,") && csv.lines().count() == 3, "{csv}");
    }

    #[test]
    fn a_round_that_came_close_to_no_boat_has_no_distance_to_one() {
        let (time, range_m) = (Time::from_ns(104_000_000_000), 1234.0);
        let lost = round(0, Outcome::Miss { boat: None, miss_m: f64::INFINITY, time, range_m });
        let told = table(std::slice::from_ref(&lost), &Starts::new());
        let line = told.lines().find(|line| line.contains("1234.0")).expect("the round");
        assert!(line.contains("miss") && !line.contains("inf"), "{line}");
        // The range, and the age of the pose; no distance of a hull that was not there.
        assert_eq!(line.split_whitespace().filter(|cell| *cell == "0.0").count(), 1, "{line}");
    }

    #[test]
    fn no_pose_is_younger_than_nothing() {
        let shot = |pose_age_ns| round(pose_age_ns, Outcome::NotScored { cause: NotScored::ImuStale });
        let told = table(&[shot(-5_000_000), shot(1_500_000)], &Starts::new());
        let ages: Vec<&str> = told.lines().skip(1).take(2).filter_map(|l| l.split("  ").last()).collect();
        assert_eq!(ages.iter().map(|a| a.trim()).collect::<Vec<_>>(), ["0.0", "1.5"], "{told}");
        // Programs get the number.
        assert!(String::from_utf8(csv(&[shot(-5_000_000)]).unwrap()).unwrap().contains(",-5"));
    }
}
