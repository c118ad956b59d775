//! `bowwave scenario`: an instructor's work on scenarios before they are played.

mod chart;
mod doubts;
mod rehearsal;
mod schema;

pub use self::{
    chart::{StrikeMark, draw_with},
    rehearsal::TrackLog,
};

use std::path::Path;

use anyhow::Result;
use bowwave_core::{
    time::Time,
    world::{
        boats::Behaviour,
        exercise::Engagement,
        scenario::{self, Scenario, Side},
        seeing::{SceneLight, Target},
    },
};
use glam::DVec2;
use serde::Serialize;

use crate::{
    cli::{ScenarioCheck, ScenarioCommand, ScenarioList, ScenarioNew, ScenarioPreview},
    loading::{LoadedScenario, load_scenario, parse_scenario, read_scenario},
    new_file::{refuse_to_replace, write_new},
    outcome::Outcome,
    stdout,
};

/// Runs a task of `scenario`.
pub fn run(command: &ScenarioCommand) -> Result<Outcome> {
    match command {
        ScenarioCommand::List(arguments) => list(arguments),
        ScenarioCommand::Check(arguments) => check(arguments),
        ScenarioCommand::Preview(arguments) => preview(arguments),
        ScenarioCommand::New(arguments) => new(arguments),
        ScenarioCommand::Schema => {
            stdout::print_json(&schema::scenario())?;
            Ok(Outcome::Done)
        }
    }
}

/// A scenario in a list.
#[derive(Debug, Serialize)]
struct Listed {
    name: String,
    title: String,
    hostile: usize,
    neutral: usize,
    crewed: usize,
    duration_s: Option<f64>,
    beaufort: u8,
    rules: Option<&'static str>,
    /// Points of the simulated novice and expert on average.
    par: Option<[f64; 2]>,
}

impl Listed {
    fn of(name: &str, scenario: &Scenario) -> Self {
        let of_side = |side: Side| scenario.boats.iter().filter(|b| b.side == side).count();
        Self {
            name: name.to_owned(),
            title: scenario.name.clone(),
            hostile: of_side(Side::Hostile),
            neutral: of_side(Side::Neutral),
            crewed: scenario.boats.iter().filter(|b| matches!(b.behaviour, Behaviour::Crewed(_))).count(),
            duration_s: scenario.duration_s,
            beaufort: scenario.water.force.get(),
            rules: scenario.exercise.rules.map(Engagement::name),
            par: scenario.exercise.goals.par,
        }
    }
}

fn list(arguments: &ScenarioList) -> Result<Outcome> {
    let listed = scenario::BUILT_IN
        .iter()
        .map(|(name, text)| Ok(Listed::of(name, &Scenario::parse(text, name)?)))
        .collect::<Result<Vec<_>>>()?;
    if arguments.json {
        stdout::print_json(&listed)?;
        return Ok(Outcome::Done);
    }
    let longest = |name: fn(&Listed) -> &str| listed.iter().map(|l| name(l).len()).max().unwrap_or(0);
    let (name_width, title_width) = (longest(|l| &l.name), longest(|l| &l.title));
    let mut text = format!(
        "{:<name_width$}  {:<title_width$} {:>7} {:>7} {:>6} {:>8} {:>8}  {:<5} {:>6} {:>6}\n",
        "name", "title", "hostile", "neutral", "crewed", "seconds", "Beaufort", "rules", "novice", "expert"
    );
    for l in &listed {
        let seconds = l.duration_s.map_or_else(|| "no end".to_owned(), |s| format!("{s:.0}"));
        let [novice, expert] =
            l.par.map_or_else(Default::default, |par| par.map(|points| format!("{points:.0}")));
        let rules = l.rules.unwrap_or("-");
        text += format!(
            "{:<name_width$}  {:<title_width$} {:>7} {:>7} {:>6} {seconds:>8} {:>8}  {rules:<5} {novice:>6} {expert:>6}",
            l.name, l.title, l.hostile, l.neutral, l.crewed, l.beaufort
        )
        .trim_end();
        text.push('\n');
    }
    text += "\nThe last columns are the points of a simulated novice and expert on average. Read an exercise with `bowwave scenario new FILE \
             --from NAME`, look at it with `bowwave scenario preview NAME`, play it with `bowwave simulate --scenario NAME`, have it \
             played with `bowwave simulate --gunner expert --scenario NAME`.\n";
    stdout::print(text)?;
    Ok(Outcome::Done)
}

/// A sentence about the ranges at which a small boat is seen as a scenario begins.
fn seen_from(scenario: &Scenario) -> String {
    /// A skiff that shows neither bow nor side, grey and without lights.
    const SKIFF: Target =
        Target { breadth_m: 4.0, height_m: 1.2, reflectance: 0.3, lamp_lux: 0.0, candela: 0.0 };
    let seeing = SceneLight::new(&scenario.daylight, scenario.wind.length()).at(Time::from_ns(0));
    let first =
        scenario.boats.iter().map(|boat| boat.behaviour.begin().position).find(|at| at.length() > 1.0);
    let direction = first.unwrap_or(DVec2::Y).extend(0.0).normalize();
    let range_m = seeing.farthest_m(scenario.eye_height_m, direction, &SKIFF, 20_000.0);
    format!(
        "a skiff without lights could be seen from {:.0} m on, in the direction of the first boat",
        range_m
    )
}

fn check(arguments: &ScenarioCheck) -> Result<Outcome> {
    let mut outcome = Outcome::Done;
    for path in &arguments.files {
        match checked(path) {
            Ok(loaded) => {
                let l = Listed::of(&path.display().to_string(), &loaded.scenario);
                stdout::print(format!(
                    "{}: \"{}\" is sound: {} hostile and {} neutral boats, {} with crews\n",
                    l.name, l.title, l.hostile, l.neutral, l.crewed
                ))?;
                stdout::print(format!("{}: {}\n", l.name, seen_from(&loaded.scenario)))?;
                for doubt in doubts::of(&loaded.scenario) {
                    eprintln!("{}: look at this: {}", l.name, bowwave_core::text::one_line(&doubt));
                }
            }
            Err(mistakes) => {
                for mistake in mistakes {
                    eprintln!("bowwave: {}", bowwave_core::text::one_line(&mistake));
                }
                outcome = Outcome::Failed;
            }
        }
    }
    Ok(outcome)
}

/// A scenario, or all that is wrong with it.
fn checked(path: &Path) -> Result<LoadedScenario, Vec<String>> {
    let (text, base) = read_scenario(path).map_err(|e| vec![format!("{e:#}")])?;
    let origin = path.display().to_string();
    parse_scenario(&text, &origin, &base).map_err(|e| {
        let mistakes = scenario::read::mistakes(&text, &origin);
        // A sound text may name a model that cannot be used.
        if mistakes.is_empty() {
            return vec![format!("{e:#}")];
        }
        mistakes.iter().map(ToString::to_string).collect()
    })
}

fn preview(arguments: &ScenarioPreview) -> Result<Outcome> {
    let loaded = load_scenario(&arguments.scenario)?;
    let out = arguments.out.clone().unwrap_or_else(|| {
        let stem = arguments.scenario.file_stem().map_or_else(|| "scenario".into(), |s| s.to_string_lossy());
        format!("{stem}.svg").into()
    });
    refuse_to_replace(&out, arguments.force)?;
    let seconds = arguments.seconds.or(loaded.scenario.duration_s).unwrap_or(180.0).min(3600.0);
    let tracks = rehearsal::tracks(&loaded.scenario, loaded.models, &loaded.of_boats, seconds);
    let picture = chart::draw(&loaded.scenario, &tracks, seconds);
    write_new(&out, &picture)?;
    eprintln!(
        "{}: where {} boats go in {seconds:.0} s while nobody fires or shines a light; open it in a browser",
        out.display(),
        tracks.len()
    );
    Ok(Outcome::Done)
}

fn new(arguments: &ScenarioNew) -> Result<Outcome> {
    refuse_to_replace(&arguments.file, arguments.force)?;
    let text = match &arguments.from {
        Some(path) => read_scenario(path)?.0,
        None => scenario::TEMPLATE.to_owned(),
    };
    write_new(&arguments.file, &text)?;
    let file = arguments.file.display();
    eprintln!(
        "{file}: change it in an editor, then `bowwave scenario check {file}`, `bowwave scenario preview {file}` and \
         `bowwave simulate --scenario {file}`"
    );
    Ok(Outcome::Done)
}
