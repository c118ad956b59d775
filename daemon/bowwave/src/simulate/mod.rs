//! `bowwave simulate`: the trainer on a recording, as if its devices were there.

mod memory;
pub mod prepare;
mod recovery;
mod report;
mod run;
mod summary;

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::SystemTime,
};

use anyhow::{Context, Result};
use bowwave_core::{fault::Fault, time::Time};
use bowwave_record::{Journal, Run};
use bowwave_render::Renderer;

use crate::{
    cli::Simulate,
    drawing,
    hits::JOURNAL,
    outcome::Outcome,
    output::{Output, OutputOptions},
    recorder::Recorder,
};
use run::Loop;

/// Runs the trainer on a recording.
pub fn run(arguments: &Simulate, program_start: Time) -> Result<Outcome> {
    let stop = Arc::new(AtomicBool::new(false));
    let on_signal = Arc::clone(&stop);
    ctrlc::set_handler(move || on_signal.store(true, Ordering::Relaxed))
        .context("cannot catch interrupts")?;

    let prepared = prepare::prepare(arguments)?;
    std::fs::create_dir_all(&arguments.out).with_context(|| {
        format!("cannot make the folder {}; name another with --out", arguments.out.display())
    })?;
    let frames = expected_frames(arguments, prepared.duration_ns);
    let realtime = arguments.realtime || prepared.window;
    let replay = run::open_replay(&prepared.recording, realtime, arguments, frames)?;

    let session = bowwave_core::session::Session::new(prepared.setup.clone())?;
    let (renderer, completions) = Renderer::new(
        &drawing::config(session.plan(), prepared.gpu.clone(), prepared.validation),
        &prepared.setup.models,
    )?;
    let options = OutputOptions {
        folder: arguments.out.clone(),
        size: prepared.setup.screen,
        frames,
        video: arguments.video,
        sheet: arguments.sheet,
        stills: arguments.stills.clone(),
        window: prepared.window,
        hash: true,
        ..OutputOptions::default()
    };
    let output = Output::start(completions, options)?;
    let journal = open_journal(arguments, &prepared)?;
    let recorder = if prepared.record {
        let properties = prepare::properties_of_run(&prepared, replay.origin());
        Some(Recorder::start(&arguments.out.join("recording.mcap"), &properties, !realtime)?)
    } else {
        None
    };
    let faults = run::fault_plan(arguments, frames).faults;
    let trainer = Loop::new(replay, session, renderer, output, journal, recorder, stop, faults);
    let finished =
        if realtime { trainer.realtime(frames, arguments) } else { trainer.fast(frames, arguments) }?;
    finished.report(arguments, &prepared, program_start)
}

/// Frames of the run: as asked for, else once through the recording.
fn expected_frames(arguments: &Simulate, recording_ns: i64) -> u64 {
    let of_seconds = |s: f64| (s * bowwave_core::pacing::FRAMES_PER_S as f64).round().max(1.0) as u64;
    match (arguments.frames, arguments.duration) {
        (Some(frames), _) => frames,
        (None, Some(seconds)) => of_seconds(seconds),
        (None, None) => of_seconds(recording_ns as f64 * 1e-9),
    }
}

fn open_journal(arguments: &Simulate, prepared: &prepare::Prepared) -> Result<Journal> {
    let wall = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).ok();
    let run = Run {
        started_wall_ns: wall.and_then(|d| i64::try_from(d.as_nanos()).ok()),
        scenario: prepared.setup.scenario.name.clone(),
        recording: prepared.properties.source.clone(),
        seed: prepared.setup.scenario.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        boot_id: bowwave_record::boot_id(),
        started: Some(bowwave_devices::clock::now()),
    };
    let journal = Journal::open(&arguments.out.join(JOURNAL), &run)?;
    if let Some(damaged) = journal.quarantined() {
        log::warn!(
            "{} the journal was damaged ({}); it is kept as {} and a fresh one begun",
            Fault::DbQuarantine.code(),
            damaged.reason,
            damaged.kept_as.display()
        );
    }
    Ok(journal)
}
