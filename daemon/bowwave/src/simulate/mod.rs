//! `bowwave simulate`: the trainer on a recording, as if its devices were there.

mod contradictions;
mod gunner;
pub mod prepare;

use anyhow::Result;
use bowwave_core::{
    pacing::FRAMES_PER_S,
    time::{NS_PER_S, Time},
};
use bowwave_trainer::{
    TickClock,
    source::{RecordingSource, Source},
    summary::SummaryOptions,
};
use hw_sim::{
    fault::FaultPlan,
    replay::{Replay, ReplayOptions},
};
use prepare::PreparedRecording;

use crate::{
    cli::Simulate,
    desk::{self, DeskRun, PreparedRun},
    outcome::Outcome,
};

/// Runs the trainer on a recording.
pub fn run(arguments: &Simulate, program_start: Time) -> Result<Outcome> {
    if let Some(gunner) = &arguments.gunner {
        return gunner::run(arguments, gunner).map(|()| Outcome::Done);
    }
    let interrupts = desk::catch_interrupts()?;
    let prepared = prepare::prepare(arguments)?;
    let desk_args = &arguments.desk;
    let frames = expected_frames(arguments, prepared.duration_ns);
    desk::check(desk_args, frames)?;
    let run_s = frames as f64 / FRAMES_PER_S as f64;
    let PreparedRun { setup, properties, .. } = &prepared.run;
    let contradictions = contradictions::contradictions(&setup.scenario, properties, run_s);
    if !contradictions.is_empty() {
        log::warn!(
            "the recording is not of this scenario: {}; `bowwave play` shows a scenario on a sea of its own",
            contradictions.join("; ")
        );
    }
    let realtime = arguments.realtime || prepared.run.window;
    let plan = fault_plan(arguments, frames);
    let replay = RecordingSource::new(open_replay(&prepared, realtime, arguments, frames, plan.clone())?);
    let origin = replay.origin();
    let finished = desk::run(
        DeskRun {
            prepared: &prepared.run,
            frames,
            source: Source::Recording(Box::new(replay)),
            clock: if realtime { TickClock::paced() } else { TickClock::fast(origin) },
            origin,
            plays_to_the_end: desk_args.frames.is_none() && desk_args.duration.is_none(),
            summary: SummaryOptions {
                program_start,
                recording: Some(prepared.path.display().to_string()),
                injected: Some((origin, plan.faults)),
            },
            instruction: None,
        },
        desk_args,
        &interrupts,
    )?;
    desk::report(finished, desk_args)
}

/// Frames of the run: as asked for, else once through the recording.
fn expected_frames(arguments: &Simulate, recording_ns: i64) -> u64 {
    desk::frames_asked(&arguments.desk).unwrap_or_else(|| desk::frames_of(recording_ns as f64 * 1e-9))
}

/// The faults that the arguments ask for.
fn fault_plan(arguments: &Simulate, frames: u64) -> FaultPlan {
    let plan = FaultPlan { seed: arguments.desk.seed.unwrap_or(0), faults: arguments.fault.clone() };
    let until_ns = frames as i64 * NS_PER_S / FRAMES_PER_S;
    match arguments.fault_every {
        Some(seconds) => plan.with_one_every((seconds * NS_PER_S as f64) as i64, until_ns),
        None => plan,
    }
}

fn open_replay(
    prepared: &PreparedRecording,
    realtime: bool,
    arguments: &Simulate,
    frames: u64,
    faults: FaultPlan,
) -> Result<Replay> {
    let asked = desk::frames_asked(&arguments.desk).is_some();
    // A little more than asked for, so that the last frames do not run dry.
    let duration_ns = asked.then(|| (frames as i64 + FRAMES_PER_S) * NS_PER_S / FRAMES_PER_S);
    let options = ReplayOptions { duration_ns, looped: asked, faults };
    let path = &prepared.path;
    Ok(if realtime { Replay::realtime(path, &options)? } else { Replay::fast(path, &options)? })
}
