//! The main loop: the only place below which nothing reads a clock.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use anyhow::{Context, Result, bail};
use bowwave_core::{
    event::{Event, Mark, MarkKind},
    fault::{Change, Fault, FaultChange},
    session::{Note, Session, Setup},
    time::{NS_PER_S, Time},
};
use bowwave_devices::clock::now;
use bowwave_record::PoseEntry;
use bowwave_render::RenderError;

use crate::{
    clock::{DueFrame, TickClock},
    presenter::{Handed, OutputReport, Presenter, PresenterOptions, UserEvent},
    source::Source,
    storage::Storage,
    summary::{Summary, SummaryOptions, Tally},
    supervisor::{FaultLog, Notifier, Pulse},
};

/// So often within a minute the GPU may be lost before the program ends: the driver needs a fresh process then.
const LOSSES_MAX: usize = 3;
const LOSSES_WINDOW_NS: i64 = 60 * NS_PER_S;
/// How long the end waits for its last frame to be seen.
const FAREWELL: Duration = Duration::from_millis(120);
/// A recording whose first picture takes longer than this has none to speak of.
const FIRST_PICTURE_NS: i64 = 5 * NS_PER_S;

/// Requests from outside to the loop.
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
    /// It was asked to, or has drawn all frames.
    Stopped,
    /// The settings are to be read anew, or the LCD has another size now.
    Reload {
        /// Size of the LCD at that time: one that is slow to start is not waited for again.
        lcd: Option<(u32, u32)>,
    },
}

/// Settings of a trainer. Source, clock and storage are opened by the caller, since what may be wrong with them differs.
#[derive(Debug)]
pub struct TrainerOptions {
    /// What the session is made from.
    pub setup: Setup,
    /// How frames are drawn and where they go.
    pub presenter: PresenterOptions,
    /// End after so many frames.
    pub frames: Option<u64>,
    /// The run is to reach the end of its recording, so that how that ends is looked at.
    pub plays_to_the_end: bool,
    /// A size of the LCD other than the session's asks for new settings.
    pub follow_lcd: bool,
    /// This boot, for the log.
    pub boot_id: Option<String>,
    /// What the summary says besides what was measured.
    pub summary: SummaryOptions,
    /// Faults that were found before the trainer was made.
    pub faults: Vec<FaultChange>,
}

/// A trainer that has ended.
#[derive(Debug)]
pub struct Finished {
    /// Why.
    pub ended: Ended,
    /// What it reports about itself.
    pub summary: Summary,
    /// What went wrong on the way without ending the run.
    pub wrong: Vec<String>,
    /// Messages of Vulkan's validation layer.
    pub validation: Vec<String>,
}

/// Everything that a frame passes through.
pub struct Trainer {
    options: TrainerOptions,
    signals: Arc<Signals>,
    source: Source,
    clock: TickClock,
    session: Session,
    presenter: Presenter,
    storage: Option<Storage>,
    faults: FaultLog,
    losses: Vec<Time>,
    events: Vec<Event>,
    changes: Vec<FaultChange>,
    tally: Tally,
}

impl Trainer {
    /// Makes session and renderer; what is opened already is handed in.
    pub fn start(
        mut options: TrainerOptions,
        source: Source,
        clock: TickClock,
        storage: Option<Storage>,
        signals: Arc<Signals>,
    ) -> Result<Self> {
        let session = Session::new(options.setup.clone())?;
        let mut changes = std::mem::take(&mut options.faults);
        let presenter = match Presenter::open(&session, &options.setup.models, &options.presenter) {
            // The GPU that the configuration of a gun names may be gone, or misspelt.
            Err(e) if options.presenter.gpu.is_some() && matches!(source, Source::Devices(_)) => {
                let cause = format!("{e:#}; another GPU is used");
                changes.push(FaultChange::raised(now(), Fault::Config, cause));
                options.presenter.gpu = None;
                Presenter::open(&session, &options.setup.models, &options.presenter)?
            }
            opened => opened?,
        };
        let faults = FaultLog::new(options.boot_id.clone());
        let tally = Tally::new(&options.summary);
        Ok(Self {
            options,
            signals,
            source,
            clock,
            session,
            presenter,
            storage,
            faults,
            losses: Vec::new(),
            events: Vec::with_capacity(256),
            changes,
            tally,
        })
    }

    /// Runs until it is asked to end, or all frames are drawn. What is recorded is complete when this returns, also with an error.
    pub fn run(mut self, notifier: &mut Notifier, pulse: Option<&Pulse>) -> Result<Finished> {
        let ended = self.frames(notifier, pulse);
        let _pulsing = pulse.map(Pulse::during);
        if matches!(ended, Ok(Ended::Stopped) | Err(_)) {
            notifier.stopping();
        }
        if let (Ok(Ended::Stopped), Source::Devices(_)) = (&ended, &self.source) {
            self.farewell(pulse);
        }
        self.end(ended)
    }

    fn frames(&mut self, notifier: &mut Notifier, pulse: Option<&Pulse>) -> Result<Ended> {
        self.await_first_picture()?;
        while !self.is_over() {
            let due = self.clock.next();
            if self.signals.stop.load(Ordering::Relaxed) {
                break;
            }
            if self.signals.reload.swap(false, Ordering::Relaxed) || self.screen_changed() {
                return Ok(Ended::Reload { lcd: self.source.lcd_size() });
            }
            match self.frame(due, pulse) {
                Ok(()) => {}
                Err(e) if is_lost(&e) => self.rebuild(&e, pulse)?,
                Err(e) => return Err(e),
            }
            self.supervise(notifier);
        }
        Ok(Ended::Stopped)
    }

    fn is_over(&self) -> bool {
        let drawn = self.tally.frames() + self.clock.missed_and_slips().0;
        self.signals.stop.load(Ordering::Relaxed)
            || self.source.has_ended()
            || self.options.frames.is_some_and(|frames| drawn >= frames)
    }

    /// A recording's frames count from its first picture on; a gun shows at once that its camera is not there yet.
    fn await_first_picture(&mut self) -> Result<()> {
        if matches!(self.source, Source::Devices(_)) {
            return Ok(());
        }
        let begun = now();
        loop {
            let until = self.clock.next_on_recording().unwrap_or_else(now);
            self.source.collect(until, &mut self.events, &mut self.changes);
            if has_picture(&self.events)
                || self.source.has_ended()
                || self.signals.stop.load(Ordering::Relaxed)
            {
                return Ok(());
            }
            let waited_ns = match self.clock.skip() {
                Some(since_origin_ns) => since_origin_ns,
                None => {
                    thread::sleep(Duration::from_millis(1));
                    now().ns_since(begun)
                }
            };
            if waited_ns > FIRST_PICTURE_NS {
                bail!(
                    "no picture in the first {} s of the recording: it cannot be shown",
                    FIRST_PICTURE_NS / NS_PER_S
                );
            }
        }
    }

    /// An LCD of another size than the one drawn for has appeared, and no size is configured.
    fn screen_changed(&self) -> bool {
        self.options.follow_lcd && self.source.lcd_size().is_some_and(|size| size != self.session.plan().size)
    }

    /// Fetches what has arrived; changes of faults become events too.
    fn collect(&mut self, until: Time) {
        self.source.collect(until, &mut self.events, &mut self.changes);
        for change in self.changes.drain(..) {
            let power_fails =
                change.fault == Fault::Brownout && matches!(change.change, Change::Raised { .. });
            if power_fails && let Some(storage) = &mut self.storage {
                storage.flush();
            }
            self.faults.take(change, &mut self.events);
        }
        for user in self.presenter.user_events() {
            match user {
                UserEvent::Trigger(edge) => self.events.push(Event::Trigger(edge)),
                UserEvent::Rezero => self.events.push(at_stow()),
                UserEvent::Quit => self.signals.stop.store(true, Ordering::Relaxed),
            }
        }
        if self.signals.rezero.swap(false, Ordering::Relaxed) {
            self.events.push(at_stow());
        }
        self.tell_clock();
        if let Some(wall) = self.source.clock_set()
            && let Some(storage) = &mut self.storage
        {
            storage.clock_set(wall);
        }
    }

    /// Tells the clock when pictures arrived, frames were shown, and how long they took.
    fn tell_clock(&mut self) {
        let mut lock = self.clock.lock();
        if let Some(lock) = &mut lock {
            for event in &self.events {
                if let Event::Frame(frame) = event {
                    lock.picture_arrived(frame.arrival);
                }
            }
            self.source.flips().for_each(|(time, period_ns)| lock.flipped(time, period_ns));
            if self.source.lcd_size().is_none() {
                lock.display_lost();
            }
        }
        for done in self.presenter.done() {
            if let Some(lock) = &mut lock {
                lock.rendered(done.complete.ns_since(done.begun));
            }
            self.tally.completed();
        }
    }

    /// One frame.
    fn frame(&mut self, due: DueFrame, pulse: Option<&Pulse>) -> Result<()> {
        let entered = now();
        self.collect(due.tick.time);
        let collected = now();
        if let Some(storage) = &mut self.storage {
            storage.inputs(&self.events, due.tick, self.session.digest());
        }
        let planned = *self.session.plan();
        self.events.iter().for_each(|event| self.session.event(event));
        self.events.clear();
        if *self.session.plan() != planned {
            self.open_presenter_again(pulse)?;
        }
        let step = self.session.tick(due.tick);
        let stepped = now();
        self.tally.records(step.records);
        if let Some(storage) = &mut self.storage {
            storage.rounds(step.records);
        }
        step.faults.iter().for_each(|change| self.faults.tell(change));
        step.notes.iter().for_each(tell);
        let view = step.view;
        let truth = self.source.truth_at(view.mid_exposure);
        self.tally.frame(&view, due, truth);
        if let Some(storage) = self.storage.as_mut().filter(|_| view.picture_is_new && !view.blind) {
            let entry = |pose| PoseEntry { time: view.mid_exposure, pose };
            storage.poses(view.pose_known.then(|| entry(view.scene.camera)), truth.map(entry));
        }
        match self.presenter.show(&view, due.begun, due.deadline)? {
            Handed::Taken { waited } => self.tally.times(waited, [entered, collected, stepped, now()]),
            Handed::OutputEnded => return Err(self.output_error()),
        }
        if let Some(storage) = &mut self.storage {
            storage.poll(&mut self.faults, &mut self.events)?;
        }
        Ok(())
    }

    fn open_presenter_again(&mut self, pulse: Option<&Pulse>) -> Result<()> {
        let _pulsing = pulse.map(Pulse::during);
        self.presenter.reopen(&self.session, &self.options.setup.models, &self.options.presenter)
    }

    /// Why the output thread has ended.
    fn output_error(&mut self) -> anyhow::Error {
        match self.presenter.take_error() {
            Some(e) => e,
            None => anyhow::anyhow!("the output thread has ended without a word; report it with the log"),
        }
    }

    /// The GPU was lost: everything on it is made anew.
    fn rebuild(&mut self, why: &anyhow::Error, pulse: Option<&Pulse>) -> Result<()> {
        let begun = now();
        self.losses.retain(|t| begun.ns_since(*t) < LOSSES_WINDOW_NS);
        self.losses.push(begun);
        self.faults.set(Fault::GpuLost, Some(format!("{why:#}")), &mut self.events);
        if self.losses.len() >= LOSSES_MAX {
            bail!("the GPU was lost {} times in a minute: a fresh process may help", self.losses.len());
        }
        self.open_presenter_again(pulse).context("the renderer could not be made anew")?;
        self.faults.set(Fault::GpuLost, None, &mut self.events);
        Ok(())
    }

    fn supervise(&mut self, notifier: &mut Notifier) {
        let at = now();
        if self.tally.shown() {
            notifier.ready();
        }
        let hud = self.session.hud();
        self.source.light(&hud.status);
        notifier.status(hud, self.faults.warnings(), at);
        match self.source.hanging(at) {
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
    fn farewell(&mut self, pulse: Option<&Pulse>) {
        self.faults.set(Fault::Stop, Some("asked to stop".to_owned()), &mut self.events);
        let frame = self.tally.frames();
        let due = self.clock.next();
        if let Err(e) = self.frame(due, pulse) {
            log::debug!("no last frame: {e:#}");
            return;
        }
        let until = now().plus_ns(FAREWELL.as_nanos() as i64);
        while now() < until && !self.presenter.done().any(|d| d.frame >= frame) {
            thread::sleep(Duration::from_millis(2));
        }
    }

    /// Writes what is to be kept, then ends everything.
    fn end(mut self, ended: Result<Ended>) -> Result<Finished> {
        let mut wrong = Vec::new();
        if self.options.plays_to_the_end {
            // The last frame was drawn a little before the recording's end: whether it ends well shows only there.
            self.source.collect(Time::from_ns(i64::MAX), &mut self.events, &mut self.changes);
        }
        wrong.extend(self.source.take_error().map(|e| e.to_string()));
        let left = self.session.finish().to_vec();
        self.tally.records(&left);
        let mut lost_entries = 0;
        if let Some(mut storage) = self.storage.take() {
            storage.rounds(&left);
            let (lost, failed) = storage.finish();
            lost_entries = lost;
            for e in failed {
                log::error!("{e:#}");
                wrong.push(format!("{e:#}"));
            }
        }
        if let Err(e) = &ended
            && is_hung(e)
        {
            // Nothing that touches the GPU returns any more. The journal is complete; systemd starts a fresh process.
            log::error!("{} {e:#}", Fault::GpuHang.code());
            std::process::exit(1);
        }
        let (device, video) = (self.presenter.device(), self.presenter.picture_path());
        let messages = self.presenter.validation_messages();
        for message in &messages {
            log::error!("Vulkan's validation layer reports: {message}");
        }
        let output = match self.presenter.close() {
            Ok(report) => report,
            Err(e) => {
                wrong.push(format!("{e:#}"));
                OutputReport::default()
            }
        };
        let mut counters = self.source.counters();
        counters.push(("recording_entries_dropped", lost_entries));
        let summary = self.tally.summary(
            &self.session,
            output,
            &self.clock,
            (&device, &video),
            self.faults.counts(),
            counters,
            &self.options.summary,
        );
        // The last owner of the LCD's port but the source is gone with these.
        drop(self.options);
        if let Err(e) = self.source.stop() {
            wrong.push(e.to_string());
        }
        if matches!(ended, Ok(Ended::Reload { .. })) {
            // What is still wrong is found again, and told again.
            self.faults.end_all();
        }
        Ok(Finished { ended: ended?, summary, wrong, validation: messages })
    }
}

fn has_picture(events: &[Event]) -> bool {
    events.iter().any(|event| matches!(event, Event::Frame(_)))
}

fn at_stow() -> Event {
    Event::Mark(Mark { time: now(), kind: MarkKind::Stow })
}

fn tell(note: &Note) {
    if note.warning {
        log::warn!("{}", note.text);
    } else {
        log::info!("{}", note.text);
    }
}

fn is_lost(e: &anyhow::Error) -> bool {
    matches!(e.downcast_ref(), Some(RenderError::DeviceLost { .. }))
}

fn is_hung(e: &anyhow::Error) -> bool {
    matches!(e.downcast_ref(), Some(RenderError::Hung { .. } | RenderError::Stalled { .. }))
}
