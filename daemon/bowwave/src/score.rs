//! `bowwave score`: what a run is worth, and why.

use anyhow::Result;
use bowwave_core::{text::one_line, world::score::ScoreSheet};
use bowwave_record::journal::RunSelection;
use bowwave_review::ScoredRun;

use crate::{cli::ScoreArgs, hits::journal_at, stdout};

/// Prints the score of a run.
pub fn run(arguments: &ScoreArgs) -> Result<()> {
    let path = journal_at(&arguments.run)?;
    let runs = arguments.number.map_or(RunSelection::Latest, RunSelection::Run);
    let scored = ScoredRun::read(&path, runs)?;
    if scored.unknown > 0 {
        log::warn!(
            "{} events of the run are of a newer version and do not count; score it with that",
            scored.unknown
        );
    }
    if arguments.json {
        return stdout::print_json(&scored);
    }
    stdout::print(format!("{}{}", text(&scored.sheet), misses(&scored)))
}

/// A score sheet for people.
pub fn text(sheet: &ScoreSheet) -> String {
    let points = match sheet.points {
        Some(points) => format!("{points:.0} of 100 points (score version {})", sheet.version),
        None => "no points: the run is of a version that kept no events of the exercise".to_owned(),
    };
    let nearest = sheet.nearest_m.map_or_else(String::new, |m| format!("; the nearest came to {m:.0} m"));
    let mut text = format!("score     {points}, {:.0} s\n", sheet.duration_s);
    if sheet.points.is_some() {
        let items: Vec<String> =
            sheet.items.iter().map(|i| format!("{} {:.0} of {:.0}", i.item, i.points, i.of)).collect();
        if !items.is_empty() {
            text += &format!("points    {}\n", items.join(", "));
        }
        text += &format!(
            "threats   {} of {} stopped, {} turned away{nearest}; {:.1} s within the range to be kept\n",
            sheet.stopped, sheet.hostile, sheet.turned_away, sheet.under_threat_s
        );
    }
    text += &rounds(sheet);
    let calls = sheet.calls;
    if calls.asked > 0 || calls.wrong > 0 {
        text += &format!(
            "calls     {} asked for: {} in time, {} late, {} missing; {} boats called what they are not\n",
            calls.asked, calls.in_time, calls.late, calls.missing, calls.wrong
        );
    }
    for breach in &sheet.breaches {
        let boat = breach.boat.as_deref().map_or_else(|| "nothing".to_owned(), one_line);
        text += &format!(
            "RULES     broken at {:.1} s: {} rounds at {boat} under \"{}\"\n",
            breach.at_s,
            breach.rounds,
            breach.rules.name()
        );
    }
    if sheet.rounds.neutral_hits > 0 {
        text += &format!("NEUTRALS  {} rounds struck a neutral boat\n", sheet.rounds.neutral_hits);
    }
    text += &detection(sheet);
    text + &boats(sheet)
}

/// The hostile boat that was detected last after it could be seen, and how many never were.
fn detection(sheet: &ScoreSheet) -> String {
    let hostile = || sheet.boats.iter().filter(|b| b.side == Some("hostile") && b.in_view_m.is_some());
    let seen = hostile().filter_map(|b| Some((b, b.detected_s?, b.in_view_m?)));
    let found = seen.clone().count();
    let Some((boat, after_s, range_m)) = seen.max_by(|a, b| a.1.total_cmp(&b.1)) else {
        return if hostile().next().is_some() {
            "seen      no hostile boat was detected\n".to_owned()
        } else {
            String::new()
        };
    };
    let name = one_line(&boat.name);
    let slowest = if found > 1 { format!("the slowest, {name},") } else { name };
    format!(
        "seen      {found} of {} hostile boats detected; {slowest} {after_s:.1} s after it could be seen at {range_m:.0} m\n",
        hostile().count()
    )
}

fn rounds(sheet: &ScoreSheet) -> String {
    let r = &sheet.rounds;
    let share = 100.0 * f64::from(r.hits) / f64::from(r.fired.max(1));
    let parts: Vec<String> = r.by_part.iter().map(|(part, hits)| format!("{part} {hits}")).collect();
    let mut text = format!("rounds    {} fired, {} hits", r.fired, r.hits);
    if r.hits > 0 {
        text += &format!(" ({share:.0} %: {})", parts.join(", "));
    }
    text += &format!("; {} bursts, {} hit with the first round", r.bursts, r.first_round_hits);
    text += &r.per_stop.map_or_else(String::new, |rounds| format!("; {rounds:.0} rounds a stop"));
    text += &r.left.map_or_else(String::new, |left| format!("; {left} left"));
    if r.not_scored > 0 {
        text += &format!("; {} NOT SCORED", r.not_scored);
    }
    if r.barrel_hot > 0 {
        text += "; barrel hot";
    }
    if r.stoppages > 0 {
        text += &format!("; {} stoppages", r.stoppages);
    }
    text + "\n"
}

fn boats(sheet: &ScoreSheet) -> String {
    if sheet.boats.is_empty() {
        return String::new();
    }
    let seconds = |s: Option<f64>| s.map_or_else(|| "-".to_owned(), |s| format!("{s:.1}"));
    let metres = |m: Option<f64>| m.map_or_else(|| "-".to_owned(), |m| format!("{m:.0}"));
    let mut rows = vec![
        [
            "boat",
            "side",
            "could be seen m",
            "detected s",
            "reported s",
            "called",
            "hits",
            "ended",
            "nearest m",
        ]
        .map(str::to_owned)
        .to_vec(),
    ];
    for boat in &sheet.boats {
        let fate = match (boat.sank, boat.burns) {
            (true, _) => ", sank",
            (false, true) => ", burns",
            (false, false) => "",
        };
        let ending = match (boat.ending, boat.ended_m) {
            (Some(ending), Some(m)) => {
                let how = match ending {
                    bowwave_core::world::score::Ending::Stopped => "stopped",
                    bowwave_core::world::score::Ending::TurnedAway => "turned away",
                };
                format!("{how} at {m:.0} m{fate}")
            }
            _ if fate.is_empty() => "-".to_owned(),
            _ => fate.trim_start_matches(", ").to_owned(),
        };
        rows.push(vec![
            one_line(&boat.name),
            boat.side.unwrap_or("-").to_owned(),
            metres(boat.in_view_m),
            seconds(boat.detected_s),
            seconds(boat.reported_s),
            boat.identified_as.unwrap_or("-").to_owned(),
            boat.hits.to_string(),
            ending,
            metres(boat.nearest_m),
        ]);
    }
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..rows[0].len()).map(width).collect();
    let mut text = "\n".to_owned();
    for row in &rows {
        let cells: Vec<String> =
            row.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
        text += cells.join("  ").trim_end();
        text.push('\n');
    }
    text
}

fn misses(scored: &ScoredRun) -> String {
    if scored.explained.is_empty() {
        return String::new();
    }
    let causes: Vec<String> =
        scored.sheet.misses.iter().map(|cause| format!("{} {}", cause.cause, cause.rounds)).collect();
    let causes = if causes.is_empty() { "none was fired at a boat".to_owned() } else { causes.join(", ") };
    let mut text = format!("\nmisses by their largest cause: {causes}\n");
    for round in &scored.explained {
        text += &format!("round {:>4}  {}: {}\n", round.shot, one_line(&round.boat), round.in_words);
    }
    text
}
