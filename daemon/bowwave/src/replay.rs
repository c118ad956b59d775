//! `bowwave replay`: does a recording give the records and scenes of the run that it was made in? And where do two runs diverge?

use std::path::Path;

use anyhow::Result;
use bowwave_core::{
    side::Side,
    text::one_line,
    world::score::{Outcome, ScoreSheet},
};
use bowwave_trainer::{
    divergence::{Divergence, RoundDivergence, divergence},
    replay::{Replayed, replay, replay_noting, scenario_of},
};
use serde::Serialize;

use crate::{
    cli::ReplayRecording,
    new_file::{refuse_to_replace, write_new},
    outcome::Outcome as Exit,
    scenario::{StrikeMark, TrackLog, draw_with},
    stdout,
};

#[derive(Debug, Serialize)]
struct ReplaySummary {
    /// Ticks that were stepped.
    ticks: u64,
    /// Inputs that were read, ticks included.
    inputs: u64,
    /// Inputs that the recording lacks.
    missing: u64,
    /// Pictures whose pixels are not those that the session saw.
    recoded: u64,
    /// Whether the file was cut short.
    cut: bool,
    /// Whether records and scenes were the same up to the last tick.
    same: bool,
    /// Seconds of the host's clock at which they were first found to differ.
    differs_from_s: Option<f64>,
    /// As in the run's summary.json.
    records_digest: String,
    /// As in the run's summary.json.
    scenes_digest: String,
    /// Rounds fired.
    shots: u64,
    /// Rounds that struck.
    hits: u64,
    /// The score, as `bowwave score` has it of the run's journal.
    score: ScoreSheet,
}

/// Replays and tells. Exit code 0: the same; 1: not; 3: the recording does not tell, since not all that the session met is in it.
pub fn run(arguments: &ReplayRecording) -> Result<Exit> {
    if let Some(other) = &arguments.against {
        return compare(arguments, other);
    }
    let result = match &arguments.chart {
        Some(file) => charted(&arguments.recording, file)?,
        None => replay(&arguments.recording)?,
    };
    if arguments.json {
        stdout::print_json(&summary(&result))?;
    }
    eprintln!("{}", words(&result));
    Ok(match (result.differs_from, result.is_complete()) {
        (None, true) => Exit::Done,
        (Some(_), true) => Exit::Failed,
        (_, false) => Exit::Partly,
    })
}

/// Replays, and draws the run from above.
fn charted(recording: &Path, file: &Path) -> Result<Replayed> {
    refuse_to_replace(file, false)?;
    let (mut log, mut strikes, mut seconds) = (TrackLog::default(), Vec::new(), 0.0);
    let result = replay_noting(recording, &mut |world, records, _| {
        let Some(running) = world.running() else { return };
        seconds = running.now.secs_since(running.start);
        while log.next_second() as f64 <= seconds {
            log.note(&running.fleet);
        }
        for record in records {
            let Outcome::Hit { boat, side, time, .. } = &record.outcome else { continue };
            let struck = (0..running.fleet.len()).find(|i| running.fleet.name(*i) == boat);
            let at = struck.and_then(|boat| running.fleet.pose(boat, *time));
            strikes.extend(at.map(|pose| StrikeMark {
                at: pose.position.truncate(),
                side: side.unwrap_or(Side::Hostile),
            }));
        }
    })?;
    let scenario = scenario_of(recording)?;
    let words = format!("as it was sailed, with {} strikes of rounds", strikes.len());
    write_new(file, &draw_with(&scenario, &log.tracks(), seconds, &words, &strikes))?;
    eprintln!("{}: the run from above; open it in a browser", file.display());
    Ok(result)
}

/// Exit code 0: the runs are the same; 1: they are not; 3: a recording does not tell what its run met.
fn compare(arguments: &ReplayRecording, other: &Path) -> Result<Exit> {
    let recording = arguments.recording.as_path();
    let (replays, found) = divergence([recording, other])?;
    if arguments.json {
        stdout::print_json(&found)?;
    }
    eprint!("{}", apart(&found));
    let mut is_told = true;
    for (path, replayed) in [recording, other].into_iter().zip(&replays) {
        if !replayed.is_complete() || replayed.differs_from.is_some() {
            is_told = false;
            let words = words(replayed);
            eprintln!(
                "{}: its replay is not that run, so that rounds and events may be others: {words}",
                path.display()
            );
        }
    }
    Ok(match (found.is_none(), is_told) {
        (_, false) => Exit::Partly,
        (true, true) => Exit::Done,
        (false, true) => Exit::Failed,
    })
}

/// Divergence of two runs, in words.
fn apart(found: &Divergence) -> String {
    if found.is_none() {
        return format!("the runs are the same in {} ticks\n", found.ticks);
    }
    let mut text = String::new();
    if !found.settings.is_empty() {
        text += &format!("settings  {} differ\n", found.settings.join(", "));
    }
    match &found.input {
        None => text += "inputs    are the same\n",
        Some(input) => {
            let [one, other] = input.kinds.map(|kind| kind.unwrap_or("end of the run"));
            let at_s = input.at_s;
            text += &if one == other {
                format!("inputs    differ from {at_s:.3} s on: another {one}\n")
            } else {
                format!("inputs    differ from {at_s:.3} s on: {one} here, {other} there\n")
            };
        }
    }
    if let Some(from_s) = found.scenes_from_s {
        text += &format!("scenes    differ from {from_s:.3} s on\n");
    }
    if let Some(RoundDivergence { shot, outcomes: [one, other] }) = &found.round {
        let (one, other) = (one_line(one), one_line(other));
        text += &format!("rounds    differ from round {shot} on: {one} here, {other} there\n");
    }
    if let Some(event) = &found.event {
        let told = |i: usize| match (&event.facts[i], event.at_s[i]) {
            (Some(fact), Some(at_s)) => format!("{at_s:.3} s {}", one_line(fact)),
            _ => "none".to_owned(),
        };
        text += &format!("events    first apart: {} here, {} there\n", told(0), told(1));
    }
    text
}

fn summary(result: &Replayed) -> ReplaySummary {
    ReplaySummary {
        ticks: result.ticks,
        inputs: result.inputs,
        missing: result.missing,
        recoded: result.recoded,
        cut: result.cut,
        same: result.differs_from.is_none(),
        differs_from_s: result.differs_from.map(|t| t.ns() as f64 * 1e-9),
        records_digest: format!("{:016x}", result.digest.records.get()),
        scenes_digest: format!("{:016x}", result.digest.scenes.get()),
        shots: result.score.0,
        hits: result.score.1,
        score: result.sheet.clone(),
    }
}

fn words(result: &Replayed) -> String {
    let mut text = match result.differs_from {
        None => {
            format!("records and scenes are the same in {} ticks with {} inputs", result.ticks, result.inputs)
        }
        Some(from) => format!("records or scenes differ before {from}"),
    };
    if let Some(points) = result.sheet.points {
        text.push_str(&format!("; {points:.0} points"));
    }
    if result.missing > 0 {
        text.push_str(&format!(
            "; {} inputs are missing, since the disk was too slow or an entry could not be written",
            result.missing
        ));
    }
    if result.recoded > 0 {
        text.push_str(&format!(
            "; {} pictures came without a JPEG and were coded for the recording: set files.record_exact to keep their pixels",
            result.recoded
        ));
    }
    if result.cut {
        text.push_str("; the file was cut short");
    }
    text
}
