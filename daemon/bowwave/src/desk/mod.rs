//! A run of the trainer on a desk: on a recording, or with a simulated gun that somebody aims.

mod leftovers;

use std::{
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, SystemTime},
};

use anyhow::{Context, Result, bail};
use bowwave_core::{pacing::FRAMES_PER_S, session::Setup, time::Time, world::scenario::Scenario};
use bowwave_record::{JournalOptions, Properties, Run, RunDetails};
use bowwave_trainer::{
    Finished, Signals, TickClock, Trainer, TrainerOptions,
    instructor::InstructorPort,
    presenter::{GpuSettings, OutputOptions, PresenterOptions, Seat},
    replay::session_properties,
    source::Source,
    storage::{JOURNAL, RecorderOptions, Storage, StorageOptions},
    summary::SummaryOptions,
    supervisor::Notifier,
};

use crate::{
    cli::DeskArgs,
    config::{self, Config, ScreenOutput},
    outcome::Outcome,
    stdout,
};

/// Screen size where nothing else is said.
const SIZE: (u32, u32) = (1280, 720);

/// A run, ready to begin.
#[derive(Debug)]
pub struct PreparedRun {
    /// Properties of the recording, or of the simulated hardware.
    pub properties: Properties,
    /// Setup of the session.
    pub setup: Setup,
    /// Text of the scenario in use.
    pub scenario_toml: String,
    /// Text of the calibration in use.
    pub calibration_toml: String,
    /// Folder that the paths of the scenario's models start from.
    pub models_base: PathBuf,
    /// The GPU.
    pub gpu: GpuSettings,
    /// A window is shown.
    pub window: bool,
    /// Seat before the window.
    pub seat: Seat,
    /// Source of its events, for people.
    pub source: String,
    /// Inputs are kept.
    pub record: bool,
}

/// A run with its source.
pub struct DeskRun<'a> {
    /// Setup, files and outputs.
    pub prepared: &'a PreparedRun,
    /// Frames until its end.
    pub frames: u64,
    /// Source of its events.
    pub source: Source,
    /// Its ticks.
    pub clock: TickClock,
    /// Begin, on the clock of its events.
    pub origin: Time,
    /// It is to reach the end of its recording, so that how that ends is looked at.
    pub plays_to_the_end: bool,
    /// Part of the summary that is not measured.
    pub summary: SummaryOptions,
    /// The instructor, where one may join.
    pub instruction: Option<Instruction<'a>>,
}

/// Part of a run with an instructor.
pub struct Instruction<'a> {
    /// The socket.
    pub port: &'a mut InstructorPort,
    /// It is the program's first run: what lies in the folder is of others.
    pub is_first: bool,
    /// It is what is shown between exercises.
    pub is_stand_by: bool,
}

/// The user's interrupts.
pub struct Interrupts {
    signals: Arc<Signals>,
    interrupted: Arc<AtomicBool>,
}

/// Has interrupts end the run instead of the program.
pub fn catch_interrupts() -> Result<Interrupts> {
    let (signals, interrupted) = (Arc::new(Signals::default()), Arc::new(AtomicBool::new(false)));
    let (on_signal, is_interrupted) = (Arc::clone(&signals), Arc::clone(&interrupted));
    ctrlc::set_handler(move || {
        is_interrupted.store(true, Ordering::Relaxed);
        on_signal.stop.store(true, Ordering::Relaxed);
    })
    .context("cannot catch interrupts")?;
    Ok(Interrupts { signals, interrupted })
}

/// The configuration that the arguments name; an empty one without.
pub fn config(arguments: &DeskArgs) -> Result<Config> {
    arguments.config.as_deref().map_or_else(|| Ok(Config::default()), config::read)
}

/// Size of the screen.
pub fn screen(arguments: &DeskArgs, config: &Config) -> (u32, u32) {
    arguments.size.or(config.size).unwrap_or(SIZE)
}

/// Tests whether a window is asked for.
pub fn shows_window(arguments: &DeskArgs, config: &Config) -> bool {
    arguments.window || config.output == ScreenOutput::Window && !arguments.headless
}

/// The GPU's settings.
pub fn gpu(arguments: &DeskArgs, config: GpuSettings) -> GpuSettings {
    GpuSettings {
        device: arguments.gpu.clone().or(config.device),
        validation: arguments.validation || config.validation,
        // A desk may do other work than to draw: half a second without a frame is no hung GPU there.
        timeout: Some(Duration::from_secs(5)),
    }
}

/// Time that a scenario is played for, seconds.
pub fn length_s(scenario: &Scenario) -> f64 {
    /// The same of one without an end.
    const ENDLESS_S: f64 = 300.0;
    scenario.duration_s.unwrap_or(ENDLESS_S)
}

/// Frames of so many seconds.
pub fn frames_of(seconds: f64) -> u64 {
    (seconds * FRAMES_PER_S as f64).round().max(1.0) as u64
}

/// Frames that the arguments ask for.
pub fn frames_asked(arguments: &DeskArgs) -> Option<u64> {
    arguments.frames.or_else(|| arguments.duration.map(frames_of))
}

/// Makes the folder, and refuses stills that a run of so many frames does not have.
pub fn check(arguments: &DeskArgs, frames: u64) -> Result<()> {
    std::fs::create_dir_all(&arguments.out).with_context(|| {
        format!("cannot make the folder {}; name another with --out", arguments.out.display())
    })?;
    if let Some(still) = arguments.stills.iter().find(|still| **still >= frames) {
        bail!("--stills {still}: the run has frames 0 to {}", frames.saturating_sub(1));
    }
    Ok(())
}

/// Runs the trainer until the run's end, or until it is interrupted.
pub fn run(run: DeskRun<'_>, arguments: &DeskArgs, interrupts: &Interrupts) -> Result<Finished> {
    let DeskRun { prepared, frames, source, clock, origin, plays_to_the_end, summary, instruction } = run;
    let realtime = clock.is_paced();
    let mut faults = Vec::new();
    let is_kept = instruction.as_ref().is_none_or(|instruction| !instruction.is_stand_by);
    let storage = is_kept.then(|| Storage::open(storage(arguments, prepared, realtime, origin), &mut faults));
    let storage = storage.transpose()?;
    if instruction.as_ref().is_none_or(|instruction| instruction.is_first) {
        // Not before the folder is this run's own.
        leftovers::clear(&arguments.out, prepared.record)?;
    }
    let mut outputs = presenter(arguments, prepared, realtime, frames);
    outputs.output.tap = instruction.as_ref().map(|instruction| instruction.port.tap());
    let options = TrainerOptions {
        setup: prepared.setup.clone(),
        presenter: Some(outputs),
        frames: Some(frames),
        plays_to_the_end,
        follow_lcd: false,
        boot_id: None,
        summary,
        faults,
        waits: instruction.is_some(),
    };
    let trainer = Trainer::start(options, source, clock, storage, Arc::clone(&interrupts.signals))?;
    let mut notifier = Notifier::from_environment();
    if let Some(Instruction { port, is_stand_by, .. }) = instruction {
        port.begin_session(Some(&arguments.out.join(JOURNAL)), is_stand_by);
        // An interrupt is its usual end.
        return trainer.run_instructed(&mut notifier, None, port);
    }
    let mut finished = trainer.run(&mut notifier, None)?;
    let done = finished.summary.frames;
    if interrupts.interrupted.load(Ordering::Relaxed) && done < frames {
        let cut =
            format!("interrupted after {done} of {frames} frames: what there was until then is written");
        log::warn!("{cut}");
        finished.wrong.push(cut);
    }
    Ok(finished)
}

/// Writes the summary, tells the user, and says how the run ended.
pub fn report(finished: Finished, arguments: &DeskArgs) -> Result<Outcome> {
    if !finished.validation.is_empty() {
        bail!("Vulkan's validation layer reports: {}", finished.validation.join("; "));
    }
    let summary = finished.summary;
    summary.write(&arguments.out.join("summary.json"))?;
    if arguments.json {
        stdout::print_json(&summary)?;
    }
    eprint!("{}", summary.lines());
    Ok(if finished.wrong.is_empty() { Outcome::Done } else { Outcome::Partly })
}

fn presenter(arguments: &DeskArgs, prepared: &PreparedRun, realtime: bool, frames: u64) -> PresenterOptions {
    PresenterOptions {
        gpu: prepared.gpu.clone(),
        output: OutputOptions {
            folder: arguments.out.clone(),
            frames,
            video: arguments.video,
            sheet: arguments.sheet,
            stills: arguments.stills.clone(),
            window: prepared.window,
            seat: prepared.seat,
            // A frame's hash costs time that a paced run does not have.
            hash: !realtime,
            ..OutputOptions::default()
        },
    }
}

fn storage(arguments: &DeskArgs, prepared: &PreparedRun, realtime: bool, origin: Time) -> StorageOptions {
    let wall = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).ok();
    StorageOptions {
        folder: arguments.out.clone(),
        run: Run {
            started_wall_ns: wall.and_then(|d| i64::try_from(d.as_nanos()).ok()),
            scenario: prepared.setup.scenario.name.clone(),
            recording: prepared.properties.source.clone(),
            seed: prepared.setup.scenario.seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            boot_id: bowwave_record::boot_id(),
            started: Some(origin),
            details: Some(RunDetails::of(&prepared.setup, &prepared.models_base).to_json()),
        },
        journal: JournalOptions::default(),
        recording: prepared.record.then(|| RecorderOptions {
            path: arguments.out.join(leftovers::RECORDING),
            properties: properties_of_run(prepared, origin),
            lossless: !realtime,
            exact_pixels: true,
        }),
        strict: true,
        print_commits: arguments.print_commits,
    }
}

/// The properties of a recording of this run: the same hardware, with the calibration and scenario in use.
fn properties_of_run(prepared: &PreparedRun, start: Time) -> Properties {
    let mut extra = prepared.properties.extra.clone();
    extra.extend(session_properties(&prepared.setup, &prepared.models_base));
    Properties {
        calibration_toml: prepared.calibration_toml.clone(),
        scenario_toml: Some(prepared.scenario_toml.clone()),
        // What is kept is a stretch of the original: it need not close.
        loop_ns: None,
        start,
        source: prepared.source.clone(),
        extra,
        ..prepared.properties.clone()
    }
}
