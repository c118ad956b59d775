//! The main loop: the only place below which nothing reads a clock.

use std::{
    collections::VecDeque,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use anyhow::{Context, Result, bail};
use bowwave_core::{
    estimate::{SeaReport, SensorCounts, clock::ClockReport, pose::registration_error_px},
    event::{Event, Mark, MarkKind, Picture, Tick},
    geometry::CameraPose,
    pacing::{FRAMES_PER_S, Pacer},
    session::Session,
    time::{NS_PER_S, Time},
    world::score::{Outcome as RoundOutcome, ShotRecord},
};
use bowwave_devices::clock::now;
use bowwave_record::{Journal, JournalError, PoseEntry};
use bowwave_render::Renderer;
use hw_sim::{
    fault::{Fault, FaultPlan},
    replay::{Replay, ReplayError, ReplayOptions},
};
use sha2::{Digest, Sha256};

use super::{memory::MemoryWatch, recovery::Recovery, summary::PassCounts};
use crate::{
    cli::Simulate,
    commits,
    headings::HeadingSummary,
    notes::tell,
    output::{Output, OutputReport, Ticket, UserEvent},
    recorder::Recorder,
    stats::Samples,
};

/// A tick comes this long after a picture's arrival: pictures that come a little late still make it.
const TICK_AFTER_PICTURE_NS: i64 = 5_000_000;
/// A recording whose first picture takes longer than this has none to speak of.
const FIRST_PICTURE_NS: i64 = 5 * NS_PER_S;
/// A driver that compiles for longer than this is not waited for.
const REHEARSAL: Duration = Duration::from_secs(10);
/// Rounds that wait for room in the journal's queue before the run gives up on them.
const ROUNDS_WAITING_MAX: usize = 100_000;

/// Opens the recording for replay.
pub fn open_replay(path: &Path, realtime: bool, arguments: &Simulate, frames: u64) -> Result<Replay> {
    let asked = arguments.frames.is_some() || arguments.duration.is_some();
    // A little more than asked for, so that the last frames do not run dry.
    let duration_ns = asked.then(|| (frames as i64 + FRAMES_PER_S) * NS_PER_S / FRAMES_PER_S);
    let options = ReplayOptions { duration_ns, looped: asked, faults: fault_plan(arguments, frames) };
    Ok(if realtime { Replay::realtime(path, &options)? } else { Replay::fast(path, &options)? })
}

/// The faults that the arguments ask for.
pub fn fault_plan(arguments: &Simulate, frames: u64) -> FaultPlan {
    let plan = FaultPlan { seed: arguments.seed.unwrap_or(0), faults: arguments.fault.clone() };
    let until_ns = frames as i64 * NS_PER_S / FRAMES_PER_S;
    match arguments.fault_every {
        Some(seconds) => plan.with_one_every((seconds * NS_PER_S as f64) as i64, until_ns),
        None => plan,
    }
}

/// Everything that a frame passes through.
pub struct Loop {
    replay: Replay,
    session: Session,
    renderer: Renderer,
    output: Output,
    journal: Journal,
    recorder: Option<Recorder>,
    stop: Arc<AtomicBool>,
    waiting: VecDeque<ShotRecord>,
    events: Vec<Event>,
    tally: Tally,
    replay_error: Option<ReplayError>,
    recovery: Recovery,
    memory: MemoryWatch,
}

/// What the loop counts.
#[derive(Debug, Default)]
pub struct Tally {
    /// Frames handed to the GPU.
    pub frames: u64,
    /// Ticks that were skipped.
    pub skipped: u64,
    /// Passes that ran, and why the others did not.
    pub passes: PassCounts,
    /// Registration error by frame, pixels.
    pub registration: Samples,
    /// Frames with both truth and pose.
    pub registered: u64,
    /// Fetching events, ms.
    pub events_ms: Samples,
    /// Stepping the session, ms.
    pub step_ms: Samples,
    /// Handing the frame to the GPU, ms.
    pub submit_ms: Samples,
    /// Frames that had to wait for a slot of the ring.
    pub ring_waits: u64,
    /// Rounds fired, struck, not scored.
    pub rounds: [u64; 3],
    /// Over poses and records.
    pub hash: Sha256,
}

/// A run that has ended.
pub struct Finished {
    /// What the loop counted.
    pub tally: Tally,
    /// What the output thread measured.
    pub output: OutputReport,
    /// What the replay delivered and left out.
    pub replay: hw_sim::replay::ReplayStats,
    /// What the sensors counted.
    pub sensors: SensorCounts,
    /// The heading at the end.
    pub heading: Option<HeadingSummary>,
    /// How the unit's clock did.
    pub unit_clock: Option<ClockReport>,
    /// Vulkan device and driver.
    pub device: String,
    /// Whether frames had deadlines.
    pub realtime: bool,
    /// Entries that the recorder had no room for.
    pub dropped_entries: u64,
    /// Whether injected faults were ridden out.
    pub recovery: Recovery,
    /// Resident memory on the way.
    pub memory: MemoryWatch,
    /// The sea in the video.
    pub sea: Option<SeaReport>,
    /// What went wrong on the way without ending the run.
    pub faults: Vec<String>,
}

fn ms_between(from: Time, to: Time) -> f64 {
    to.secs_since(from) * 1e3
}

impl Loop {
    /// A loop that has not begun.
    #[allow(clippy::too_many_arguments, reason = "it takes over what was opened, once")]
    pub fn new(
        replay: Replay,
        session: Session,
        renderer: Renderer,
        output: Output,
        journal: Journal,
        recorder: Option<Recorder>,
        stop: Arc<AtomicBool>,
        faults: Vec<Fault>,
    ) -> Self {
        let recovery = Recovery::new(replay.origin(), faults);
        Self {
            replay,
            session,
            renderer,
            output,
            journal,
            recorder,
            stop,
            waiting: VecDeque::new(),
            events: Vec::with_capacity(256),
            tally: Tally::default(),
            replay_error: None,
            recovery,
            memory: MemoryWatch::default(),
        }
    }

    /// Draws everything once, to nobody: drivers compile shaders when they are first used, and the first frames must not wait
    /// for that.
    fn rehearse(&mut self) -> Result<()> {
        let scene = self.session.rehearsal();
        let plan = self.session.plan();
        let (width, height) = plan.picture;
        let black = vec![0u8; plan.video.byte_len(width, height)];
        let picture =
            Picture::new(plan.video, width, height, black.into()).context("no picture of this size")?;
        let begun = now();
        self.output.announce(Ticket { frame: 0, begun, submitted: begun, deadline: None, rehearsal: true });
        self.renderer.submit(&scene, &picture, true)?;
        Ok(())
    }

    /// As fast as it goes: time is the recording's.
    pub fn fast(mut self, frames: u64, arguments: &Simulate) -> Result<Finished> {
        let mut tick = 0i64;
        while self.tally.frames < frames && !self.ends() {
            tick += 1;
            let frame_time = self.replay.origin().plus_ns(tick * NS_PER_S / FRAMES_PER_S);
            let begun = now();
            let shown = self.frame(frame_time, begun, None, arguments)?;
            if !shown && frame_time.ns_since(self.replay.origin()) > FIRST_PICTURE_NS {
                self.no_picture()?;
            }
        }
        self.finish(false, arguments)
    }

    /// On the host's clock, 30 frames a second.
    pub fn realtime(mut self, frames: u64, arguments: &Simulate) -> Result<Finished> {
        self.rehearse()?;
        if !self.output.await_rehearsal(REHEARSAL) {
            log::warn!(
                "the rehearsal was not complete after {} s; the first frames may be late",
                REHEARSAL.as_secs()
            );
        }
        self.await_first_picture()?;
        let mut pacer = Pacer::new(now().plus_ns(TICK_AFTER_PICTURE_NS));
        while self.tally.frames + pacer.missed() < frames && !self.ends() {
            let wait_ns = pacer.next_time().ns_since(now()).max(0);
            thread::sleep(Duration::from_nanos(wait_ns as u64));
            if let Some(tick) = pacer.tick(now()) {
                self.frame(tick.time, tick.time, Some(tick.deadline), arguments)?;
            }
        }
        self.tally.skipped = pacer.missed();
        self.finish(true, arguments)
    }

    fn ends(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.replay_error.is_some() || self.replay.finished()
    }

    fn no_picture(&self) -> Result<()> {
        bail!(
            "no picture in the first {} s of the recording: it cannot be shown",
            FIRST_PICTURE_NS / NS_PER_S
        )
    }

    /// Waits for a picture to arrive, so that ticks fall shortly after arrivals.
    fn await_first_picture(&mut self) -> Result<()> {
        let begun = now();
        loop {
            self.collect(now());
            if self.events.iter().any(|e| matches!(e, Event::Frame(_))) || self.ends() {
                return Ok(());
            }
            if now().ns_since(begun) > FIRST_PICTURE_NS {
                return self.no_picture();
            }
            thread::sleep(Duration::from_millis(1));
        }
    }

    /// Fetches what has arrived. An error of the recording ends the run, but what came before it is still shown.
    fn collect(&mut self, until: Time) {
        let first_new = self.events.len();
        if let Err(e) = self.replay.collect(until, &mut self.events) {
            self.replay_error = Some(e);
        }
        for user in self.output.user_events() {
            match user {
                UserEvent::Trigger(edge) => self.events.push(Event::Trigger(edge)),
                UserEvent::Rezero => {
                    self.events.push(Event::Mark(Mark { time: now(), kind: MarkKind::Stow }));
                }
                UserEvent::Quit => self.stop.store(true, Ordering::Relaxed),
            }
        }
        if let Some(recorder) = &mut self.recorder {
            self.events[first_new..].iter().for_each(|e| recorder.event(e));
        }
    }

    /// One frame. `false` while there is no picture yet.
    fn frame(
        &mut self,
        frame_time: Time,
        begun: Time,
        deadline: Option<Time>,
        arguments: &Simulate,
    ) -> Result<bool> {
        let entered = now();
        self.collect(frame_time);
        let collected = now();
        self.events.iter().for_each(|event| self.session.event(event));
        self.events.clear();
        let step = self.session.tick(Tick::at(frame_time));
        let stepped = now();
        self.tally.records(step.records);
        self.waiting.extend(step.records.iter().cloned());
        step.notes.iter().for_each(tell);
        let view = step.view;
        if view.blind {
            self.journal_rounds(arguments)?;
            return Ok(false);
        }
        self.recovery.frame(frame_time, &view.scene.hud.status);
        self.memory.frame(view.scene.frame);
        let truth = self.replay.truth_at(view.mid_exposure);
        self.tally.pose(&view, truth);
        if let Some(recorder) = self.recorder.as_mut().filter(|_| view.picture_is_new) {
            let entry = |pose| PoseEntry { time: view.mid_exposure, pose };
            if view.pose_known {
                recorder.pose(entry(view.scene.camera));
            }
            truth.into_iter().for_each(|pose| recorder.truth(entry(pose)));
        }
        let ticket =
            Ticket { frame: view.scene.frame, begun, submitted: stepped, deadline, rehearsal: false };
        let waited = self.renderer.submit(view.scene, view.picture, view.picture_is_new)?;
        if !self.output.announce(ticket) {
            // The output thread has failed; `finish` says why.
            self.stop.store(true, Ordering::Relaxed);
        }
        if let Some(report) = self.session.sea() {
            self.tally.sea(&report);
        }
        self.tally.frame(waited, [entered, collected, stepped, now()]);
        self.journal_rounds(arguments)?;
        Ok(true)
    }

    /// Hands rounds to the journal, and prints which ones it has committed.
    fn journal_rounds(&mut self, arguments: &Simulate) -> Result<()> {
        while let Some(record) = self.waiting.front() {
            match self.journal.shot(record) {
                Ok(()) => drop(self.waiting.pop_front()),
                // They are tried again with the next frame.
                Err(JournalError::QueueFull { .. }) if self.waiting.len() < ROUNDS_WAITING_MAX => break,
                Err(e) => return Err(e).context("rounds cannot be kept"),
            }
        }
        if arguments.print_commits {
            commits::print(self.journal.commits().try_iter())?;
        }
        Ok(())
    }

    fn finish(mut self, realtime: bool, arguments: &Simulate) -> Result<Finished> {
        let mut faults = Vec::new();
        if arguments.frames.is_none() && arguments.duration.is_none() {
            // The last frame was drawn a little before the recording's end: whether it ends well shows only there.
            self.collect(Time::from_ns(i64::MAX));
            self.events.clear();
        }
        if let Some(e) = self.replay_error.take() {
            faults.push(e.to_string());
        }
        let left = self.session.finish().to_vec();
        self.tally.records(&left);
        self.waiting.extend(left);
        // Room comes as the journal writes.
        while !self.waiting.is_empty() {
            self.journal_rounds(arguments)?;
            thread::sleep(Duration::from_millis(if self.waiting.is_empty() { 0 } else { 5 }));
        }
        let device = format!("{} ({})", self.renderer.device().name, self.renderer.device().driver);
        let messages = self.renderer.validation_messages();
        drop(self.renderer);
        let output = self.output.finish();
        let committed = self.journal.commits().clone();
        let journal = self.journal.finish();
        if arguments.print_commits {
            commits::print(committed.try_iter())?;
        }
        let mut dropped_entries = 0;
        if let Some(recorder) = self.recorder.take() {
            dropped_entries = recorder.dropped();
            if let Err(e) = recorder.finish() {
                faults.push(format!("{e:#}"));
            }
        }
        let replay = self.replay.stop()?;
        if let Err(e) = journal {
            faults.push(e.to_string());
        }
        let output = output?;
        if !messages.is_empty() {
            bail!("Vulkan's validation layer reports: {}", messages.join("; "));
        }
        let sensors = self.session.sensor_counts();
        let sea = self.session.sea();
        let heading = HeadingSummary::of(&self.session);
        let unit_clock = self.session.unit_clock();
        Ok(Finished {
            unit_clock,
            heading,
            tally: self.tally,
            output,
            replay,
            sensors,
            device,
            realtime,
            dropped_entries,
            recovery: self.recovery,
            memory: self.memory,
            sea,
            faults,
        })
    }
}

impl Tally {
    fn records(&mut self, records: &[ShotRecord]) {
        for record in records {
            // The shortest text that gives back the same bits: the record's canonical form.
            self.hash.update(format!("{record:?}\n"));
            self.rounds[0] += 1;
            self.rounds[1] += u64::from(matches!(record.outcome, RoundOutcome::Hit { .. }));
            self.rounds[2] += u64::from(matches!(record.outcome, RoundOutcome::NotScored { .. }));
        }
    }

    fn pose(&mut self, view: &bowwave_core::session::View<'_>, truth: Option<CameraPose>) {
        let scene = view.scene;
        self.passes.count(scene);
        self.hash.update(format!("{:?} {:?}\n", scene.frame, view.pose_known.then_some(scene.camera)));
        if let Some(truth) = truth.filter(|_| view.pose_known) {
            let error =
                registration_error_px(&scene.lens, truth.world_from_camera, scene.camera.world_from_camera);
            // Poses too far apart to compare are as bad as the screen is wide.
            self.registration.push(error.unwrap_or(f64::from(scene.lens.width)));
            self.registered += 1;
        }
    }

    fn sea(&mut self, report: &SeaReport) {
        self.hash.update(format!("{:?} {}\n", report.in_use, report.wind_m_s));
    }

    fn frame(&mut self, waited: bool, [begun, collected, stepped, submitted]: [Time; 4]) {
        self.frames += 1;
        self.ring_waits += u64::from(waited);
        self.events_ms.push(ms_between(begun, collected));
        self.step_ms.push(ms_between(collected, stepped));
        self.submit_ms.push(ms_between(stepped, submitted));
    }
}
