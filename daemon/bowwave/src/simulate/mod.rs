//! `bowwave simulate`: the trainer on a recording, as if its devices were there.

mod gunner;
mod leftovers;
pub mod prepare;

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::SystemTime,
};

use anyhow::{Context, Result, bail};
use bowwave_core::{
    pacing::FRAMES_PER_S,
    time::{NS_PER_S, Time},
};
use bowwave_record::{JournalOptions, Run};
use bowwave_trainer::{
    Finished, Signals, TickClock, Trainer, TrainerOptions,
    presenter::{OutputOptions, PresenterOptions},
    source::{RecordingSource, Source},
    storage::{RecorderOptions, Storage, StorageOptions},
    summary::SummaryOptions,
    supervisor::Notifier,
};
use hw_sim::{
    fault::FaultPlan,
    replay::{Replay, ReplayOptions},
};
use prepare::Prepared;

use crate::{cli::Simulate, outcome::Outcome, stdout};

/// Runs the trainer on a recording.
pub fn run(arguments: &Simulate, program_start: Time) -> Result<Outcome> {
    if let Some(gunner) = &arguments.gunner {
        return gunner::run(arguments, gunner).map(|()| Outcome::Done);
    }
    let signals = Arc::new(Signals::default());
    let on_signal = Arc::clone(&signals);
    let interrupted = Arc::new(AtomicBool::new(false));
    let is_interrupted = Arc::clone(&interrupted);
    ctrlc::set_handler(move || {
        interrupted.store(true, Ordering::Relaxed);
        on_signal.stop.store(true, Ordering::Relaxed);
    })
    .context("cannot catch interrupts")?;

    let prepared = prepare::prepare(arguments)?;
    std::fs::create_dir_all(&arguments.out).with_context(|| {
        format!("cannot make the folder {}; name another with --out", arguments.out.display())
    })?;
    let frames = expected_frames(arguments, prepared.duration_ns);
    if let Some(still) = arguments.stills.iter().find(|still| **still >= frames) {
        bail!("--stills {still}: the run has frames 0 to {}", frames.saturating_sub(1));
    }
    let run_s = frames as f64 / FRAMES_PER_S as f64;
    if let Some(lasts_s) = prepared.setup.scenario.duration_s.filter(|lasts_s| *lasts_s > run_s + 0.5) {
        log::warn!(
            "the scenario lasts {lasts_s} s, and this run ends after {run_s:.1} s; --duration {lasts_s} in place of --frames plays all of it"
        );
    }
    let realtime = arguments.realtime || prepared.window;
    let plan = fault_plan(arguments, frames);
    let replay = RecordingSource::new(open_replay(&prepared, realtime, arguments, frames, plan.clone())?);
    let origin = replay.origin();
    let clock = if realtime { TickClock::paced() } else { TickClock::fast(origin) };
    let mut faults = Vec::new();
    let storage = Storage::open(storage(arguments, &prepared, realtime, origin), &mut faults)?;
    // Not before the folder is this run's own.
    leftovers::clear(&arguments.out, prepared.record)?;
    let options = TrainerOptions {
        setup: prepared.setup.clone(),
        presenter: Some(presenter(arguments, &prepared, realtime, frames)),
        frames: Some(frames),
        plays_to_the_end: arguments.frames.is_none() && arguments.duration.is_none(),
        follow_lcd: false,
        boot_id: None,
        summary: SummaryOptions {
            program_start,
            recording: Some(prepared.recording.display().to_string()),
            injected: Some((origin, plan.faults)),
        },
        faults,
    };
    let source = Source::Recording(Box::new(replay));
    let trainer = Trainer::start(options, source, clock, Some(storage), signals)?;
    let mut finished = trainer.run(&mut Notifier::from_environment(), None)?;
    let summary = &finished.summary;
    if is_interrupted.load(Ordering::Relaxed) && summary.frames < frames {
        let cut = format!(
            "interrupted after {} of {frames} frames: what there was until then is written",
            summary.frames
        );
        log::warn!("{cut}");
        finished.wrong.push(cut);
    }
    report(finished, arguments)
}

/// Writes the summary, tells the user, and says how the run ended.
fn report(finished: Finished, arguments: &Simulate) -> Result<Outcome> {
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

/// Frames of the run: as asked for, else once through the recording.
fn expected_frames(arguments: &Simulate, recording_ns: i64) -> u64 {
    let of_seconds = |s: f64| (s * FRAMES_PER_S as f64).round().max(1.0) as u64;
    match (arguments.frames, arguments.duration) {
        (Some(frames), _) => frames,
        (None, Some(seconds)) => of_seconds(seconds),
        (None, None) => of_seconds(recording_ns as f64 * 1e-9),
    }
}

/// The faults that the arguments ask for.
fn fault_plan(arguments: &Simulate, frames: u64) -> FaultPlan {
    let plan = FaultPlan { seed: arguments.seed.unwrap_or(0), faults: arguments.fault.clone() };
    let until_ns = frames as i64 * NS_PER_S / FRAMES_PER_S;
    match arguments.fault_every {
        Some(seconds) => plan.with_one_every((seconds * NS_PER_S as f64) as i64, until_ns),
        None => plan,
    }
}

fn open_replay(
    prepared: &Prepared,
    realtime: bool,
    arguments: &Simulate,
    frames: u64,
    faults: FaultPlan,
) -> Result<Replay> {
    let asked = arguments.frames.is_some() || arguments.duration.is_some();
    // A little more than asked for, so that the last frames do not run dry.
    let duration_ns = asked.then(|| (frames as i64 + FRAMES_PER_S) * NS_PER_S / FRAMES_PER_S);
    let options = ReplayOptions { duration_ns, looped: asked, faults };
    let path = &prepared.recording;
    Ok(if realtime { Replay::realtime(path, &options)? } else { Replay::fast(path, &options)? })
}

fn presenter(arguments: &Simulate, prepared: &Prepared, realtime: bool, frames: u64) -> PresenterOptions {
    PresenterOptions {
        gpu: prepared.gpu.clone(),
        output: OutputOptions {
            folder: arguments.out.clone(),
            frames,
            video: arguments.video,
            sheet: arguments.sheet,
            stills: arguments.stills.clone(),
            window: prepared.window,
            // A frame's hash costs time that a paced run does not have.
            hash: !realtime,
            ..OutputOptions::default()
        },
    }
}

fn storage(arguments: &Simulate, prepared: &Prepared, realtime: bool, origin: Time) -> StorageOptions {
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
        },
        journal: JournalOptions::default(),
        recording: prepared.record.then(|| RecorderOptions {
            path: arguments.out.join(leftovers::RECORDING),
            properties: prepare::properties_of_run(prepared, origin),
            lossless: !realtime,
            exact_pixels: true,
        }),
        strict: true,
        print_commits: arguments.print_commits,
    }
}
