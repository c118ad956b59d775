//! `bowwave simulate --gunner`: a scenario without pictures, played by a simulated gunner, once or many times.

use std::{
    path::Path,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::Instant,
};

use anyhow::{Context, Result};
use bowwave_core::{
    gunner::{Skill, play},
    model::Model,
    world::{scenario::Scenario, score::ScoreSheet},
};
use serde::Serialize;

use crate::{
    cli::Simulate,
    desk,
    loading::{LoadedScenario, load_scenario},
    score, stdout,
};

/// The spread of a number over runs.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spread {
    /// The mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
    /// The least.
    pub least: f64,
    /// A tenth of the runs have less.
    pub tenth: f64,
    /// Half of the runs have less.
    pub median: f64,
    /// Nine tenths have less.
    pub nine_tenths: f64,
    /// The most.
    pub most: f64,
}

impl Spread {
    /// Of these numbers; `None` for none.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<f64> = values.into_iter().collect();
        values.sort_by(f64::total_cmp);
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        let at = |share: f64| values[((count - 1.0) * share).round() as usize];
        (!values.is_empty()).then(|| Self {
            mean,
            deviation: (squares / (count - 1.0).max(1.0)).sqrt(),
            least: at(0.0),
            tenth: at(0.1),
            median: at(0.5),
            nine_tenths: at(0.9),
            most: at(1.0),
        })
    }
}

/// Runs of one gunner.
#[derive(Debug, Serialize)]
struct Runs {
    scenario: String,
    gunner: &'static str,
    runs: usize,
    first_seed: u64,
    /// Seconds of the exercise for one of the computer, all processors together.
    times_real_time: f64,
    points: Option<Spread>,
    stopped_or_turned_away: Option<Spread>,
    hit_percent: Option<Spread>,
    rounds: Option<Spread>,
    under_threat_s: Option<Spread>,
    nearest_m: Option<Spread>,
    breaches: Option<Spread>,
    neutral_hits: Option<Spread>,
}

/// Plays the scenario and prints the scores.
pub fn run(arguments: &Simulate, gunner: &str) -> Result<()> {
    let (name, skill) = Skill::named(gunner).context("no such gunner")?;
    let path = arguments.scenario.as_deref().unwrap_or(Path::new("default"));
    let LoadedScenario { scenario, models, of_boats } = load_scenario(path)?;
    let models: Arc<[Model]> = models.into();
    let limit_s = arguments.desk.duration.unwrap_or_else(|| desk::length_s(&scenario));
    let first_seed = arguments.desk.seed.unwrap_or(scenario.seed);
    let begun = Instant::now();
    let played = |index: u64| {
        let scenario = Scenario { seed: first_seed.wrapping_add(index), ..scenario.clone() };
        let played = play(&scenario, Arc::clone(&models), &of_boats, &skill, limit_s);
        (played.fold().sheet(), played.seconds)
    };
    let Some(runs) = arguments.runs else {
        let (sheet, _) = played(0);
        return if arguments.desk.json {
            stdout::print_json(&sheet)
        } else {
            stdout::print(score::text(&sheet))
        };
    };
    let sheets = side_by_side(runs, &played);
    let seconds: f64 = sheets.iter().map(|(_, seconds)| seconds).sum();
    let spread = |value: &dyn Fn(&ScoreSheet) -> Option<f64>| {
        Spread::of(sheets.iter().filter_map(|(sheet, _)| value(sheet)))
    };
    let runs = Runs {
        scenario: scenario.name.clone(),
        gunner: name,
        runs: sheets.len(),
        first_seed,
        times_real_time: seconds / begun.elapsed().as_secs_f64(),
        points: spread(&|s| s.points),
        stopped_or_turned_away: spread(&|s| Some(f64::from(s.stopped + s.turned_away))),
        hit_percent: spread(&|s| {
            (s.rounds.fired > 0).then(|| 100.0 * f64::from(s.rounds.hits) / f64::from(s.rounds.fired))
        }),
        rounds: spread(&|s| Some(f64::from(s.rounds.fired))),
        under_threat_s: spread(&|s| Some(s.under_threat_s)),
        nearest_m: spread(&|s| s.nearest_m),
        breaches: spread(&|s| Some(s.breaches.len() as f64)),
        neutral_hits: spread(&|s| Some(f64::from(s.rounds.neutral_hits))),
    };
    if arguments.desk.json { stdout::print_json(&runs) } else { stdout::print(table(&runs)) }
}

/// Runs in the order of their seeds, as many at once as there are processors.
fn side_by_side(runs: u64, played: &(impl Fn(u64) -> (ScoreSheet, f64) + Sync)) -> Vec<(ScoreSheet, f64)> {
    let (next, done) = (AtomicU64::new(0), Mutex::new(Vec::new()));
    let threads = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= runs {
                        return;
                    }
                    let run = played(index);
                    done.lock().unwrap_or_else(PoisonError::into_inner).push((index, run));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(index, _)| *index);
    done.into_iter().map(|(_, run)| run).collect()
}

fn table(runs: &Runs) -> String {
    let mut text = format!(
        "{}: {} runs of a simulated gunner ({}), seeds {} on; {:.0} times real time\n\n{:<26}{:>9}{:>11}{:>9}{:>9}{:>9}{:>9}{:>9}\n",
        runs.scenario,
        runs.runs,
        runs.gunner,
        runs.first_seed,
        runs.times_real_time,
        "",
        "mean",
        "deviation",
        "least",
        "tenth",
        "median",
        "9 tenths",
        "most"
    );
    let rows = [
        ("points", runs.points),
        ("stopped or turned away", runs.stopped_or_turned_away),
        ("hits, % of rounds", runs.hit_percent),
        ("rounds", runs.rounds),
        ("within range to keep, s", runs.under_threat_s),
        ("nearest, m", runs.nearest_m),
        ("bursts against the rules", runs.breaches),
        ("hits on neutrals", runs.neutral_hits),
    ];
    for (name, spread) in rows {
        let Some(s) = spread else { continue };
        let numbers = [s.mean, s.deviation, s.least, s.tenth, s.median, s.nine_tenths, s.most];
        text += &format!("{name:<26}");
        for (i, number) in numbers.iter().enumerate() {
            let width = if i == 1 { 11 } else { 9 };
            text += &format!("{number:>width$.1}");
        }
        text.push('\n');
    }
    text
}
