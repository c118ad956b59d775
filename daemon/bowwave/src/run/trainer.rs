//! The main loop: thirty times a second from what the devices said to a frame on the LCD.

use std::{
    path::PathBuf,
    sync::Arc,
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::Duration,
};

use anyhow::{Context, Result};
use bowwave_core::{
    event::{Event, Mark, MarkKind, PixelFormat, Tick},
    fault::{Change, Fault, FaultChange},
    pacing::{FRAMES_PER_S, FrameClock},
    session::Session,
    time::{NS_PER_S, Time},
    world::scenario::{self, Scenario},
};
use bowwave_devices::clock::{now, sleep_until};
use bowwave_record::PoseEntry;
use bowwave_render::RenderError;

use super::{
    faults::Faults,
    hardware::Hardware,
    keeping::Keeping,
    notify::Notifier,
    pulse::Pulse,
    settings::Settings,
    stage::{Stage, StageOptions},
    starts::Mode,
    summary::{Summary, Tally},
};
use crate::{notes::tell, output::UserEvent};

/// Time between ticks, nanoseconds.
const PERIOD_NS: i64 = NS_PER_S / FRAMES_PER_S;
/// So often within a minute the GPU may be lost before the program ends: the driver needs a fresh process then.
const LOSSES_MAX: usize = 3;
const LOSSES_WINDOW_NS: i64 = 60 * NS_PER_S;
/// How long the end waits for its last frame to be seen.
const FAREWELL: Duration = Duration::from_millis(120);

/// What the outside asks of the loop.
#[derive(Debug, Default)]
pub struct Signals {
    /// End.
    pub stop: AtomicBool,
    /// Read the settings anew.
    pub reload: AtomicBool,
    /// The gun stands at its stow.
    pub rezero: AtomicBool,
}

/// Why the loop ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// It was asked to.
    Stopped,
    /// The settings are to be read anew, or the LCD has another size now.
    Reload {
        /// Size of the LCD at that time: one that is slow to start is not waited for again.
        lcd: Option<(u32, u32)>,
    },
}

/// What the loop is given besides settings.
#[derive(Clone, Debug)]
pub struct Surroundings {
    /// Folder of the journal and recordings.
    pub data: PathBuf,
    /// How careful to be.
    pub mode: Mode,
    /// This boot.
    pub boot_id: Option<String>,
    /// File for the hashes of frames.
    pub frame_hashes: Option<PathBuf>,
    /// Print each committed round's number.
    pub print_commits: bool,
    /// When the program began.
    pub program_start: Time,
    /// Size of the LCD before the settings were read anew.
    pub lcd_size: Option<(u32, u32)>,
}

/// Everything that a frame passes through.
pub struct Trainer {
    settings: Settings,
    surroundings: Surroundings,
    signals: Arc<Signals>,
    hardware: Hardware,
    session: Session,
    stage: Stage,
    stage_options: StageOptions,
    keeping: Option<Keeping>,
    clock: FrameClock,
    faults: Faults,
    losses: Vec<Time>,
    events: Vec<Event>,
    changes: Vec<FaultChange>,
    tally: Tally,
}

impl Trainer {
    /// Starts devices, journal and GPU.
    pub fn start(mut settings: Settings, surroundings: Surroundings, signals: Arc<Signals>) -> Result<Self> {
        let mut changes = std::mem::take(&mut settings.faults);
        if surroundings.mode == Mode::Safe {
            make_safe(&mut settings)?;
            let cause = "the program was started too often within a minute: video and this message only until it is stopped; \
                         the log has the reason (journalctl -u bowwave)";
            changes.push(FaultChange::raised(now(), Fault::CrashLoop, cause));
        }
        let hardware = Hardware::start(&settings, surroundings.mode, &mut changes)?;
        let lcd_size = || hardware.await_lcd_size().or(surroundings.lcd_size);
        if let Some(size) = settings.config.size.or_else(lcd_size) {
            settings.setup.screen = size;
        }
        let session = Session::new(settings.setup.clone())?;
        let mut stage_options = StageOptions {
            gpu: gpu(&settings, surroundings.mode),
            validation: settings.config.validation,
            hang: settings.config.hang,
            lcd: hardware.lcd(),
            window: settings.config.output == crate::config::ScreenOutput::Window,
            frame_hashes: surroundings.frame_hashes.clone(),
            reporter: hardware.output_reporter(),
        };
        let stage = match Stage::open(&session, &settings.setup.models, &stage_options) {
            // The GPU that the configuration names may be gone, or misspelt.
            Err(e) if settings.config.gpu.is_some() && stage_options.gpu == settings.config.gpu => {
                changes.push(FaultChange::raised(
                    now(),
                    Fault::Config,
                    format!("{e:#}; another GPU is used"),
                ));
                stage_options.gpu = None;
                Stage::open(&session, &settings.setup.models, &stage_options)?
            }
            opened => opened?,
        };
        let keeping = match surroundings.mode {
            Mode::Safe => None,
            Mode::Training => Some(Keeping::open(
                &surroundings.data,
                &settings,
                surroundings.boot_id.clone(),
                surroundings.print_commits,
                &mut changes,
            )),
        };
        let faults = Faults::new(surroundings.boot_id.clone());
        Ok(Self {
            settings,
            surroundings,
            signals,
            hardware,
            session,
            stage,
            stage_options,
            keeping,
            clock: FrameClock::new(),
            faults,
            losses: Vec::new(),
            events: Vec::with_capacity(256),
            changes,
            tally: Tally::default(),
        })
    }

    /// Runs until it is asked to end. What is recorded is complete when this returns, also with an error.
    pub fn run(mut self, notifier: &mut Notifier, pulse: &Pulse) -> Result<(Ended, Summary)> {
        let ended = self.frames(notifier, pulse);
        let _pulsing = pulse.during();
        if matches!(ended, Ok(Ended::Stopped) | Err(_)) {
            notifier.stopping();
        }
        if let Ok(Ended::Stopped) = ended {
            self.farewell(pulse);
        }
        let summary = self.end(&ended);
        ended.map(|ended| (ended, summary))
    }

    fn frames(&mut self, notifier: &mut Notifier, pulse: &Pulse) -> Result<Ended> {
        loop {
            let plan = self.clock.plan(now());
            sleep_until(plan.start);
            if self.signals.stop.load(Ordering::Relaxed) {
                return Ok(Ended::Stopped);
            }
            if self.signals.reload.swap(false, Ordering::Relaxed) || self.screen_changed() {
                return Ok(Ended::Reload { lcd: self.hardware.lcd_size() });
            }
            self.collect();
            match self.frame(plan.shown, pulse) {
                Ok(()) => {}
                Err(e) if is_lost(&e) => self.rebuild(&e, pulse)?,
                Err(e) => return Err(e),
            }
            self.supervise(notifier);
        }
    }

    /// An LCD of another size than the one drawn for has appeared, and no size is configured.
    fn screen_changed(&self) -> bool {
        self.settings.config.size.is_none()
            && self.hardware.lcd_size().is_some_and(|size| size != self.session.plan().size)
    }

    /// Fetches what has arrived; reports of faults become events too.
    fn collect(&mut self) {
        self.hardware.collect(&mut self.events, &mut self.changes);
        for event in &self.events {
            if let Event::Frame(frame) = event {
                self.clock.picture_arrived(frame.arrival);
            }
        }
        for change in self.changes.drain(..) {
            let power_fails =
                change.fault == Fault::Brownout && matches!(change.change, Change::Raised { .. });
            if power_fails && let Some(keeping) = &mut self.keeping {
                keeping.flush();
            }
            self.faults.take(change, &mut self.events);
        }
        for user in self.stage.user_events() {
            match user {
                UserEvent::Trigger(edge) => self.events.push(Event::Trigger(edge)),
                UserEvent::Rezero => {
                    self.events.push(Event::Mark(Mark { time: now(), kind: MarkKind::Stow }));
                }
                UserEvent::Quit => self.signals.stop.store(true, Ordering::Relaxed),
            }
        }
        if self.signals.rezero.swap(false, Ordering::Relaxed) {
            self.events.push(Event::Mark(Mark { time: now(), kind: MarkKind::Stow }));
        }
        for (time, period_ns) in self.hardware.flips() {
            self.clock.flipped(time, period_ns);
        }
        if self.hardware.lcd_size().is_none() {
            self.clock.display_lost();
        }
        for done in self.stage.done() {
            self.clock.rendered(done.complete.ns_since(done.begun));
            self.tally.done(done);
        }
        if let Some(wall) = self.hardware.health().clock_set()
            && let Some(keeping) = &mut self.keeping
        {
            keeping.clock_set(wall);
        }
    }

    fn open_stage_again(&mut self, pulse: &Pulse) -> Result<()> {
        let _pulsing = pulse.during();
        let stage = Stage::open(&self.session, &self.settings.setup.models, &self.stage_options)?;
        let old = std::mem::replace(&mut self.stage, stage);
        if let Err(e) = old.close() {
            log::debug!("the former renderer ended with: {e:#}");
        }
        Ok(())
    }

    /// One frame, to be seen at `shown`.
    fn frame(&mut self, shown: Time, pulse: &Pulse) -> Result<()> {
        let begun = now();
        if let Some(keeping) = &mut self.keeping {
            keeping.events(&self.events);
        }
        let planned = *self.session.plan();
        self.events.iter().for_each(|event| self.session.event(event));
        self.events.clear();
        if *self.session.plan() != planned {
            self.open_stage_again(pulse)?;
        }
        let step = self.session.tick(Tick { time: begun, shown });
        self.tally.records(step.records);
        if let Some(keeping) = &mut self.keeping {
            keeping.rounds(step.records);
        }
        step.faults.iter().for_each(|change| self.faults.tell(change));
        step.notes.iter().for_each(tell);
        let view = step.view;
        if let Some(keeping) = self.keeping.as_mut().filter(|_| view.picture_is_new && view.pose_known) {
            keeping.pose(PoseEntry { time: view.mid_exposure, pose: view.scene.camera });
        }
        self.tally.frame(view.scene, view.blind, begun);
        if !self.stage.show(&view, begun, shown)? {
            return Err(self.stage_error());
        }
        if let Some(keeping) = &mut self.keeping {
            keeping.tend(&mut self.faults, &mut self.events)?;
        }
        Ok(())
    }

    /// Why the output thread has ended.
    fn stage_error(&mut self) -> anyhow::Error {
        match self.stage.take_error() {
            Some(e) => e,
            None => anyhow::anyhow!("the output thread has ended without a word; report it with the log"),
        }
    }

    /// The GPU was lost: everything on it is made anew.
    fn rebuild(&mut self, why: &anyhow::Error, pulse: &Pulse) -> Result<()> {
        let begun = now();
        self.losses.retain(|t| begun.ns_since(*t) < LOSSES_WINDOW_NS);
        self.losses.push(begun);
        self.faults.set(Fault::GpuLost, Some(format!("{why:#}")), &mut self.events);
        if self.losses.len() >= LOSSES_MAX {
            anyhow::bail!(
                "the GPU was lost {} times in a minute: a fresh process may help",
                self.losses.len()
            );
        }
        self.open_stage_again(pulse).context("the renderer could not be made anew")?;
        self.faults.set(Fault::GpuLost, None, &mut self.events);
        Ok(())
    }

    fn supervise(&mut self, notifier: &mut Notifier) {
        let at = now();
        if self.tally.shown() {
            notifier.ready();
        }
        let hud = self.session.hud();
        self.hardware.light(&hud.status);
        notifier.status(hud, self.faults.warnings(), at);
        match self.hardware.hanging(at) {
            None => {
                self.faults.set(Fault::Watchdog, None, &mut self.events);
                notifier.feed(at);
            }
            Some(name) => {
                let cause =
                    format!("the {name} thread gives no sign of life: systemd will restart the trainer");
                self.faults.set(Fault::Watchdog, Some(cause), &mut self.events);
            }
        }
    }

    /// Says STOPPED on the LCD.
    fn farewell(&mut self, pulse: &Pulse) {
        self.faults.set(Fault::Stop, Some("asked to stop".to_owned()), &mut self.events);
        let frame = self.tally.frames;
        if let Err(e) = self.frame(now().plus_ns(PERIOD_NS), pulse) {
            log::debug!("no last frame: {e:#}");
            return;
        }
        let until = now().plus_ns(FAREWELL.as_nanos() as i64);
        while now() < until && !self.stage.done().any(|d| d.frame >= frame) {
            thread::sleep(Duration::from_millis(2));
        }
    }

    /// Writes what is to be kept, then ends everything.
    fn end(mut self, ended: &Result<Ended>) -> Summary {
        let left = self.session.finish().to_vec();
        self.tally.records(&left);
        if let Some(mut keeping) = self.keeping.take() {
            keeping.rounds(&left);
            if let Err(e) = keeping.finish() {
                log::error!("{e:#}");
            }
        }
        if let Err(e) = ended
            && is_hung(e)
        {
            // Nothing that touches the GPU returns any more. The journal is complete; systemd starts a fresh process.
            log::error!("{} {e:#}", Fault::GpuHang.code());
            std::process::exit(1);
        }
        let summary =
            self.tally.summary(&self.session, &self.stage, &self.hardware, &self.faults, &self.clock);
        for message in self.stage.validation_messages() {
            log::error!("Vulkan's validation layer reports: {message}");
        }
        if let Err(e) = self.stage.close() {
            log::debug!("the output thread ended with: {e:#}");
        }
        drop(self.stage_options);
        self.hardware.stop();
        if matches!(ended, Ok(Ended::Reload { .. })) {
            // What is still wrong is found again, and told again.
            self.faults.end_all();
        }
        log::info!("ran for {:.1} s", now().secs_since(self.surroundings.program_start));
        summary
    }
}

/// Video and message only.
fn make_safe(settings: &mut Settings) -> Result<()> {
    let empty =
        scenario::BUILT_IN.iter().find(|(name, _)| *name == "empty").context("no built-in empty scenario")?;
    settings.setup.scenario = Scenario::parse(empty.1, "built-in empty scenario")?;
    settings.setup.models = Vec::new().into();
    settings.setup.boat_models = Vec::new();
    settings.setup.video = PixelFormat::Yuyv;
    settings.config.record = false;
    Ok(())
}

/// The configured device; in SAFE MODE software where there is one, for it may be the GPU's driver that crashes.
fn gpu(settings: &Settings, mode: Mode) -> Option<String> {
    let software = || {
        let devices = bowwave_render::devices().ok()?;
        devices.iter().find(|d| d.software).map(|d| d.index.to_string())
    };
    match mode {
        Mode::Training => settings.config.gpu.clone(),
        Mode::Safe => software().or_else(|| settings.config.gpu.clone()),
    }
}

fn is_lost(e: &anyhow::Error) -> bool {
    matches!(e.downcast_ref(), Some(RenderError::DeviceLost { .. }))
}

fn is_hung(e: &anyhow::Error) -> bool {
    matches!(e.downcast_ref(), Some(RenderError::Hung { .. } | RenderError::Stalled { .. }))
}
