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
};
use bowwave_files::plain_text;
use bowwave_trainer::{
    TickClock,
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
    desk::{self, DeskRun, PreparedRun},
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

/// Plays a scenario.
pub fn run(arguments: &Play, program_start: Time) -> Result<Outcome> {
    let desk_args = &arguments.desk;
    let config = desk::config(desk_args)?;
    let aimer = aimer(&arguments.aim)?;
    if matches!(aimer, Aimer::Mouse) && (arguments.fast || desk_args.headless) {
        bail!(
            "somebody who aims with the mouse needs a window and a clock: leave --headless and --fast out, or let a simulated gunner aim (--aim expert)"
        );
    }
    let (text, base) = read_scenario(&arguments.scenario)?;
    let mut loaded = parse_scenario(&text, &arguments.scenario.display().to_string(), &base)?;
    // The sea is the scenario's, whatever the seed of its chance.
    let recipe = PanoramaRecipe::of_scenario(&loaded.scenario, arguments.camera);
    if let Some(seed) = desk_args.seed {
        loaded.scenario.seed = seed;
    }
    let scenario = &loaded.scenario;
    let frames = desk::frames_asked(desk_args).unwrap_or_else(|| desk::frames_of(desk::length_s(scenario)));
    desk::check(desk_args, frames)?;
    let drawable = "the sea of this scenario cannot be drawn: change mount.eye_height_m or sea.beaufort in it, or give another --camera";
    recipe.check().context(drawable)?;
    let panorama = cache::panorama(&recipe)?;
    // Not before: an interrupt ends the making of a sea at once.
    let interrupts = desk::catch_interrupts()?;
    if let Some(briefing) = scenario.exercise.briefing.as_deref().filter(|_| !desk_args.json) {
        stdout::print(format!("{}\n\n{briefing}\n\n", scenario.name))?;
    }
    let (gunner, script) = match &aimer {
        Aimer::Mouse => (None, None),
        Aimer::Gunner(skill) => (Some(Gunner::new(scenario, skill).within(TRAVERSE_MAX)), None),
        Aimer::Script(script) => (None, Some(script.clone())),
    };
    let prepared = prepare(arguments, config, &aimer, &recipe, (loaded, text, base));
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
            summary: SummaryOptions { program_start, recording: None, injected: None },
        },
        desk_args,
        &interrupts,
    )?;
    let late = finished.summary.counts.get("pictures_late").copied().unwrap_or(0);
    if late > 0 {
        log::warn!(
            "the simulated camera left out {late} pictures: this computer cuts them too slowly; play without --record and --video, or \
             give --camera 640x360, which is a quarter of the work"
        );
    }
    let outcome = desk::report(finished, desk_args)?;
    if !desk_args.json {
        score::run(&ScoreArgs { run: desk_args.out.clone(), number: None, json: false })?;
    }
    Ok(outcome)
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
