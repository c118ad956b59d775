//! `bowwave play`: the trainer on a simulated gun that somebody aims.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use bowwave_calibration::to_toml;
use bowwave_core::{
    event::PixelFormat,
    gunner::{Gunner, Skill},
    session::Setup,
    text::toml::TEXT_BYTES_MAX,
    time::Time,
    world::{exercise::ExerciseSpec, scenario::Scenario},
};
use bowwave_files::plain_text;
use bowwave_trainer::{
    Ended, Finished, ReloadCause, TickClock,
    presenter::Seat,
    source::{LiveSource, Source},
    summary::SummaryOptions,
};
use hw_sim::{
    live::{self, Hands, Live, LiveOptions, Script},
    panorama::{PanoramaRecipe, TRAVERSE_MAX},
};

use crate::{
    cache,
    cli::{Play, ScoreArgs},
    config::Config,
    desk::{self, DeskRun, Instruction, Interrupts, PreparedRun},
    instructed,
    loading::{LoadedScenario, parse_scenario, read_scenario},
    outcome::Outcome,
    score, stdout,
};

/// Somebody or something that aims.
enum Aimer {
    /// Somebody at the window.
    Mouse,
    /// A simulated gunner.
    Gunner(Skill),
    /// A script.
    Script(Script),
}

/// Plays a scenario, and where an instructor may join those that are asked for.
pub fn run(arguments: &Play, program_start: Time) -> Result<Outcome> {
    let desk_args = &arguments.desk;
    let aimer = aimer(&arguments.aim)?;
    if matches!(aimer, Aimer::Mouse) && (arguments.fast || desk_args.headless) {
        bail!(
            "somebody who aims with the mouse needs a window and a clock: leave --headless and --fast out, or let a simulated gunner aim (--aim expert)"
        );
    }
    let (text, base) = read_scenario(&arguments.scenario)?;
    let loaded = parse_scenario(&text, &arguments.scenario.display().to_string(), &base)?;
    let mut playing = Playing { loaded, text, base: base.clone(), is_stand_by: false };
    let config = desk::config(desk_args)?;
    let scenarios = config.instructor.scenarios.clone().unwrap_or(base);
    let camera = arguments.camera;
    let sea = move |scenario: &Scenario| cache::panorama(&recipe_of(scenario, camera)?).map(drop);
    let listen = |socket: &PathBuf| instructed::listen(socket, scenarios.clone(), sea);
    let mut port = arguments.instructor.as_ref().map(listen).transpose()?;
    // Making a sea is ended at once by an interrupt, so these are caught once the first one is made.
    if let Some(port) = &port {
        port.prepare("THE SEA OF THE SCENARIO IS MADE");
    }
    let mut interrupts = None;
    let mut is_first = true;
    let seat = PlayerSeat { arguments, aimer, config, program_start };
    loop {
        let instruction =
            port.as_mut().map(|port| Instruction { port, is_first, is_stand_by: playing.is_stand_by });
        let scenario = playing.loaded.scenario.clone();
        let finished = seat.play(playing, instruction, &mut interrupts)?;
        is_first = false;
        if let Some(port) = &port {
            port.prepare("ANOTHER SCENARIO BEGINS");
        }
        if let Ended::Reload { cause: ReloadCause::Asked(asked), .. } = &finished.ended {
            let (loaded, is_stand_by) = match instructed::load(asked, &scenarios) {
                Ok(loaded) if !asked.is_stand_by => (loaded, false),
                Ok(loaded) => (stand_by(loaded.scenario, scenario), true),
                // It was sound as it was asked for, but files change.
                Err(why) => {
                    port.iter().for_each(|port| port.refuse(format!("{why:#}")));
                    let empty = Scenario { name: "Stand by".to_owned(), ..scenario.clone() };
                    (stand_by(Scenario { exercise: ExerciseSpec::default(), ..empty }, scenario), true)
                }
            };
            playing = Playing { loaded, text: asked.text.clone(), base: scenarios.clone(), is_stand_by };
            continue;
        }
        let outcome = desk::report(finished, desk_args)?;
        // An instructor's review has the score of each run.
        if !desk_args.json && port.is_none() {
            score::run(&ScoreArgs { run: desk_args.out.clone(), number: None, json: false })?;
        }
        return Ok(outcome);
    }
}

/// The scenario between exercises: nobody on the sea of the one before, which goes on.
fn stand_by(empty: Scenario, before: Scenario) -> LoadedScenario {
    let Scenario { name, exercise, weapon, .. } = empty;
    let scenario = Scenario { name, exercise, weapon, boats: Vec::new(), duration_s: None, ..before };
    LoadedScenario { scenario, models: Vec::new(), of_boats: Vec::new() }
}

/// A scenario that is played.
struct Playing {
    loaded: LoadedScenario,
    text: String,
    base: PathBuf,
    is_stand_by: bool,
}

/// The recipe of a scenario's sea for such a camera.
fn recipe_of(scenario: &Scenario, camera: (u32, u32)) -> Result<PanoramaRecipe> {
    let recipe = PanoramaRecipe::of_scenario(scenario, camera);
    let drawable = "the sea of this scenario cannot be drawn: change mount.eye_height_m or sea.beaufort in it, or give another --camera";
    recipe.check().context(drawable)?;
    Ok(recipe)
}

/// Arguments and settings that all scenarios of a run share.
struct PlayerSeat<'a> {
    arguments: &'a Play,
    aimer: Aimer,
    config: Config,
    program_start: Time,
}

impl PlayerSeat<'_> {
    /// Plays one scenario to its end.
    fn play(
        &self,
        playing: Playing,
        instruction: Option<Instruction<'_>>,
        interrupts: &mut Option<Interrupts>,
    ) -> Result<Finished> {
        let Self { arguments, aimer, config, program_start } = self;
        let desk_args = &arguments.desk;
        let Playing { mut loaded, text, base, .. } = playing;
        // The sea is the scenario's, whatever the seed of its chance.
        let recipe = recipe_of(&loaded.scenario, arguments.camera)?;
        if let Some(seed) = desk_args.seed {
            loaded.scenario.seed = seed;
        }
        let scenario = &loaded.scenario;
        let asked = desk::frames_asked(desk_args);
        // An instructor ends the exercise.
        let length =
            || if instruction.is_some() { u64::MAX } else { desk::frames_of(desk::length_s(scenario)) };
        let frames = asked.unwrap_or_else(length);
        desk::check(desk_args, frames)?;
        let panorama = cache::panorama(&recipe)?;
        if interrupts.is_none() {
            *interrupts = Some(desk::catch_interrupts()?);
        }
        let interrupts = interrupts.as_ref().context("interrupts are caught")?;
        if let Some(briefing) = scenario.exercise.briefing.as_deref().filter(|_| !desk_args.json) {
            stdout::print(format!("{}\n\n{briefing}\n\n", scenario.name))?;
        }
        let (gunner, script) = match aimer {
            Aimer::Mouse => (None, None),
            Aimer::Gunner(skill) => (Some(Gunner::new(scenario, skill).within(TRAVERSE_MAX)), None),
            Aimer::Script(script) => (None, Some(script.clone())),
        };
        let prepared = prepare(arguments, config.clone(), aimer, &recipe, (loaded, text, base));
        let realtime = !arguments.fast;
        let simulated = Live::start(LiveOptions {
            recipe: &recipe,
            panorama: &panorama,
            hands: Hands::default(),
            script,
            realtime,
            is_coded: prepared.record,
        })?;
        let lens = &prepared.setup.calibration.lens;
        let source = LiveSource::new(simulated, f64::from(lens.width) / lens.focal.x, gunner);
        let origin = source.origin();
        let finished = desk::run(
            DeskRun {
                prepared: &prepared,
                frames,
                source: Source::Live(Box::new(source)),
                clock: if realtime { TickClock::paced() } else { TickClock::fast(origin) },
                origin,
                plays_to_the_end: false,
                summary: SummaryOptions { program_start: *program_start, recording: None, injected: None },
                instruction,
            },
            desk_args,
            interrupts,
        )?;
        let late = finished.summary.counts.get("pictures_late").copied().unwrap_or(0);
        if late > 0 {
            log::warn!(
                "the simulated camera left out {late} pictures: this computer cuts them too slowly; play without --record and --video, or \
             give --camera 640x360, which is a quarter of the work"
            );
        }
        Ok(finished)
    }
}

/// The run of a loaded scenario, whose text and folder are given, on a simulated gun.
fn prepare(
    arguments: &Play,
    config: Config,
    aimer: &Aimer,
    recipe: &PanoramaRecipe,
    (loaded, text, base): (LoadedScenario, String, PathBuf),
) -> PreparedRun {
    let desk_args = &arguments.desk;
    let calibration = live::calibration(recipe);
    let calibration_toml = to_toml(&calibration);
    let properties = live::properties(recipe, &calibration, &arguments.aim);
    // Somebody who aims sees; others are watched where that is asked for. Without a clock nobody's keys have a time.
    let is_mouse = matches!(aimer, Aimer::Mouse);
    PreparedRun {
        source: properties.source.clone(),
        properties,
        scenario_toml: text,
        calibration_toml,
        models_base: base,
        window: is_mouse || desk::shows_window(desk_args, &config),
        seat: match (is_mouse, arguments.fast) {
            (true, _) => Seat::Gunner,
            (false, true) => Seat::Watcher,
            (false, false) => Seat::Driver,
        },
        record: desk_args.record || config.files.record,
        setup: Setup {
            scenario: loaded.scenario,
            own_ship: calibration.own_ship(),
            calibration: calibration.calibration,
            models: loaded.models.into(),
            boat_models: loaded.of_boats,
            screen: desk::screen(desk_args, &config),
            video: PixelFormat::Rgb,
            orientation: config.orientation,
            heading: config.heading.settings,
        },
        gpu: desk::gpu(desk_args, config.gpu),
    }
}

/// The aimer of a name.
fn aimer(name: &str) -> Result<Aimer> {
    if name == "mouse" {
        return Ok(Aimer::Mouse);
    }
    if let Some((_, skill)) = Skill::named(name) {
        return Ok(Aimer::Gunner(skill));
    }
    let text = plain_text(Path::new(name), TEXT_BYTES_MAX).with_context(|| {
        let skills = Skill::NAMED.map(|(name, _)| name).join(", ");
        format!("cannot read the script {name}; --aim takes mouse, {skills}, or an existing script")
    })?;
    Ok(Aimer::Script(Script::parse(&text, name)?))
}
