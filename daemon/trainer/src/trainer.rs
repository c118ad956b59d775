//! The main loop: the only place below which nothing reads a clock.

use std::{
    sync::{Arc, atomic::Ordering},
    thread,
    time::Duration,
};

use anyhow::{Context, Result, bail};
use bowwave_core::{
    act::TraineeAct,
    event::{Event, Mark, MarkKind},
    fault::{Change, DevicePart, Fault, FaultChange},
    frame::scene::Scene,
    guide::Guide,
    model::Model,
    order::{InstructorOrder, Order},
    session::{Note, Session, View},
    time::{NS_PER_S, Time},
};
use bowwave_devices::clock::now;
use bowwave_record::PoseEntry;
use bowwave_render::RenderError;

use crate::{
    clock::{DueFrame, TickClock},
    companion::Companion,
    instructor::{AskedScenario, InstructorPort, Request, status_of},
    options::{Ended, Finished, ReloadCause, Signals, TrainerOptions},
    presenter::{Handed, Presented, Presenter, PresenterOptions, UserEvent},
    source::Source,
    storage::Storage,
    summary::Tally,
    supervisor::{FaultLog, LoadWatch, Notifier, Pulse},
};

/// So often within a minute the GPU may be lost before the program ends: the driver needs a fresh process then.
const LOSSES_MAX: usize = 3;
const LOSSES_WINDOW_NS: i64 = 60 * NS_PER_S;
/// How long the end waits for its last frame to be seen.
const FAREWELL: Duration = Duration::from_millis(120);
/// A recording whose first picture takes longer than this has none to speak of.
const FIRST_PICTURE_NS: i64 = 5 * NS_PER_S;

/// Everything that a frame passes through.
pub struct Trainer {
    options: TrainerOptions,
    signals: Arc<Signals>,
    source: Source,
    clock: TickClock,
    session: Session,
    presenter: Option<Presenter>,
    storage: Option<Storage>,
    faults: FaultLog,
    losses: Vec<Time>,
    events: Vec<Event>,
    changes: Vec<FaultChange>,
    tally: Tally,
    load: LoadWatch,
    /// Parts that the source has.
    parts: Vec<DevicePart>,
    /// The scenario that the instructor asked for.
    asked: Option<AskedScenario>,
    /// The companion has ended.
    is_dialogue_over: bool,
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
        let is_gun = matches!(source, Source::Devices(_));
        let presenter = match &mut options.presenter {
            None => None,
            Some(presenter) => {
                Some(open_presenter(&session, &options.setup.models, presenter, is_gun, &mut changes)?)
            }
        };
        let faults = FaultLog::new(options.boot_id.clone());
        let mut events = Vec::with_capacity(256);
        if options.waits {
            events.push(Event::Order(InstructorOrder { time: now(), order: Order::Pause }));
        }
        let tally = Tally::new(&options.summary);
        let parts = source.parts();
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
            events,
            changes,
            tally,
            load: LoadWatch::default(),
            parts,
            asked: None,
            is_dialogue_over: false,
        })
    }

    /// Runs until it is asked to end, or all frames are drawn. What is recorded is complete when this returns, also with an error.
    pub fn run(self, notifier: &mut Notifier, pulse: Option<&Pulse>) -> Result<Finished> {
        self.run_with(notifier, pulse, None, None)
    }

    /// The same with an instructor joined.
    pub fn run_instructed(
        self,
        notifier: &mut Notifier,
        pulse: Option<&Pulse>,
        instructor: &mut InstructorPort,
    ) -> Result<Finished> {
        self.run_with(notifier, pulse, None, Some(instructor))
    }

    /// Runs until `companion` ends.
    pub fn accompany(self, companion: &mut dyn Companion) -> Result<Finished> {
        self.run_with(&mut Notifier::from_environment(), None, Some(companion), None)
    }

    fn run_with(
        mut self,
        notifier: &mut Notifier,
        pulse: Option<&Pulse>,
        companion: Option<&mut dyn Companion>,
        instructor: Option<&mut InstructorPort>,
    ) -> Result<Finished> {
        let trains = companion.is_none();
        let ended = self.frames(notifier, pulse, companion, instructor);
        let _pulsing = pulse.map(Pulse::during);
        if matches!(ended, Ok(Ended::Stopped) | Err(_)) {
            notifier.stopping();
        }
        if let (Ok(Ended::Stopped), Source::Devices(_), true) = (&ended, &self.source, trains) {
            self.farewell(pulse);
        }
        self.end(ended)
    }

    fn frames(
        &mut self,
        notifier: &mut Notifier,
        pulse: Option<&Pulse>,
        mut companion: Option<&mut dyn Companion>,
        mut instructor: Option<&mut InstructorPort>,
    ) -> Result<Ended> {
        if companion.is_none() {
            self.await_first_picture()?;
        }
        let mut source_ended = false;
        while !self.is_over(companion.is_some()) {
            let due = self.clock.await_next();
            let asked_to_stop = self.signals.stop.swap(false, Ordering::Relaxed);
            if let Some(companion) = &mut companion {
                if asked_to_stop {
                    companion.quit();
                }
                if !source_ended && self.source.has_ended() {
                    source_ended = true;
                    companion.source_ended();
                }
            } else if asked_to_stop {
                break;
            }
            if let Some(cause) = self.reload_cause() {
                return Ok(Ended::Reload { lcd: self.source.lcd_size(), cause });
            }
            // What is ordered before another scenario is asked for is obeyed in this frame.
            if let Some(instructor) = &mut instructor {
                self.obey(instructor);
            }
            // Once more as a plain reference: the loop goes on with it.
            match self.frame(due, pulse, companion.as_mut().map(|c| &mut **c as &mut dyn Companion)) {
                Ok(()) => {}
                Err(e) if is_lost(&e) => self.rebuild(&e, pulse)?,
                Err(e) => return Err(e),
            }
            if companion.is_none() {
                self.supervise(notifier);
            }
        }
        Ok(Ended::Stopped)
    }

    fn reload_cause(&mut self) -> Option<ReloadCause> {
        if let Some(asked) = self.asked.take() {
            return Some(ReloadCause::Asked(asked));
        }
        if self.signals.reload.swap(false, Ordering::Relaxed) {
            return Some(ReloadCause::Settings);
        }
        self.screen_changed().then_some(ReloadCause::Screen)
    }

    /// Takes in what the instructor asks for, and says how things are.
    fn obey(&mut self, instructor: &mut InstructorPort) {
        for request in instructor.requests() {
            match request {
                Request::Act(act) => self.events.push(Event::Act(TraineeAct { time: now(), act })),
                Request::Order(order) => match self.session.world().refuses(&order) {
                    Some(why) => instructor.refuse(why),
                    None => self.events.push(Event::Order(InstructorOrder { time: now(), order })),
                },
                Request::Load(asked) => {
                    self.asked = Some(asked);
                    break;
                }
            }
        }
        // What waits is known to wait with its first frame.
        if self.tally.frames() > 0 {
            instructor.tell(now(), || status_of(&self.session, &self.parts));
        }
    }

    fn is_over(&self, is_dialogue: bool) -> bool {
        if is_dialogue {
            return self.is_dialogue_over;
        }
        let drawn = self.tally.frames() + self.clock.missed_and_slips().0;
        self.signals.stop.load(Ordering::Relaxed)
            || self.source.has_ended()
            || self.options.frames.is_some_and(|frames| drawn >= frames)
    }

    /// A recording's frames count from its first picture on; a gun shows at once that its camera is not there yet.
    fn await_first_picture(&mut self) -> Result<()> {
        if !matches!(self.source, Source::Recording(_) | Source::Live(_)) {
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

    /// Fetches what has arrived; changes of faults become events too. A dialogue tells of them itself.
    fn collect(&mut self, until: Time, dialogue: Option<&dyn Companion>) {
        if dialogue.is_none_or(|companion| !companion.waits() || matches!(self.source, Source::Devices(_))) {
            self.source.collect(until, &mut self.events, &mut self.changes);
        }
        if dialogue.is_some() {
            self.events.extend(self.changes.drain(..).map(Event::Fault));
        }
        for change in self.changes.drain(..) {
            let power_fails =
                change.fault == Fault::Brownout && matches!(change.change, Change::Raised { .. });
            if power_fails && let Some(storage) = &mut self.storage {
                storage.flush();
            }
            self.faults.take(change, &mut self.events);
        }
        for user in self.presenter.iter().flat_map(Presenter::user_events) {
            match user {
                UserEvent::Trigger(edge) => self.events.push(Event::Trigger(edge)),
                UserEvent::Turn(turn) => self.source.turn(turn),
                UserEvent::Rezero => self.events.push(at_stow()),
                UserEvent::Act(act) => self.events.push(Event::Act(act)),
                UserEvent::Quit => self.signals.stop.store(true, Ordering::Relaxed),
            }
        }
        if self.signals.rezero.swap(false, Ordering::Relaxed) {
            self.events.push(at_stow());
        }
        self.tell_clock();
        if dialogue.is_none() {
            self.shed_load();
        }
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
        for done in self.presenter.iter().flat_map(Presenter::done) {
            if let Some(lock) = &mut lock {
                lock.rendered(done.complete.ns_since(done.begun));
                self.load.drawn(done.complete.secs_since(done.begun) * 1e3, done.is_late);
            }
            self.tally.completed();
        }
    }

    /// Leaves out what a busy computer cannot draw in time, and tells of it.
    fn shed_load(&mut self) {
        if !self.clock.is_paced() {
            return;
        }
        self.load.missed(self.clock.missed_and_slips().0);
        for (fault, why) in self.load.decide() {
            self.faults.set(fault, why, &mut self.events);
        }
        if let Some(storage) = &mut self.storage {
            storage.spare(self.load.leaves_unseen_out());
        }
    }

    /// One frame.
    fn frame(
        &mut self,
        due: DueFrame,
        pulse: Option<&Pulse>,
        companion: Option<&mut dyn Companion>,
    ) -> Result<()> {
        let entered = now();
        self.collect(due.tick.time, companion.as_deref());
        let collected = now();
        if let Some(storage) = &mut self.storage {
            storage.inputs(&self.events, due.tick, self.session.digest());
        }
        let page = match companion {
            None => None,
            Some(companion) => match companion.frame(&self.events, due.tick)? {
                Some(page) => Some(Arc::new(page)),
                None => {
                    self.is_dialogue_over = true;
                    return Ok(());
                }
            },
        };
        let planned = self.session.plan().clone();
        for event in self.events.drain(..) {
            if page.is_none() || matches!(event, Event::Frame(_)) {
                self.session.event(&event);
            }
        }
        if *self.session.plan() != planned {
            self.open_presenter_again(pulse)?;
        }
        self.step(due, page, [entered, collected])
    }

    /// Steps the session and hands its frame on.
    fn step(
        &mut self,
        due: DueFrame,
        page: Option<Arc<Guide>>,
        [entered, collected]: [Time; 2],
    ) -> Result<()> {
        let is_dialogue = page.is_some();
        let step = self.session.tick(due.tick);
        let stepped = now();
        self.tally.records(step.records);
        if let Some(storage) = &mut self.storage {
            storage.take(step.records, step.events, step.tracks);
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
        let with_page = page.map(|page| Scene { guide: Some(page), ..view.scene.clone() });
        let view = View { scene: with_page.as_ref().unwrap_or(view.scene), ..view };
        let handed = match &mut self.presenter {
            Some(presenter) => presenter.show(&view, due.begun, due.deadline).map_err(anyhow::Error::from),
            None => Ok(Handed::Taken { waited: false }),
        };
        match handed {
            Ok(Handed::Taken { waited }) => self.tally.times(waited, [entered, collected, stepped, now()]),
            // The terminal goes on with the dialogue.
            Ok(Handed::OutputEnded) if is_dialogue => self.lose_display(),
            Ok(Handed::OutputEnded) => return Err(self.output_error()),
            Err(e) if is_dialogue => {
                log::error!("{e:#}");
                self.lose_display();
            }
            Err(e) => return Err(e),
        }
        self.source.watch(self.session.world());
        if let Some(storage) = &mut self.storage {
            storage.poll(&mut self.faults, &mut self.events)?;
        }
        Ok(())
    }

    fn lose_display(&mut self) {
        let why = self.output_error();
        log::error!("the display is lost, the rest goes on: {why:#}");
        self.presenter = None;
    }

    fn open_presenter_again(&mut self, pulse: Option<&Pulse>) -> Result<()> {
        let _pulsing = pulse.map(Pulse::during);
        match (&mut self.presenter, &self.options.presenter) {
            (Some(presenter), Some(options)) => {
                presenter.reopen(&self.session, &self.options.setup.models, options)
            }
            _ => Ok(()),
        }
    }

    /// Why the output thread has ended.
    fn output_error(&mut self) -> anyhow::Error {
        match self.presenter.as_mut().and_then(Presenter::take_error) {
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
        let due = self.clock.await_next();
        if let Err(e) = self.frame(due, pulse, None) {
            log::debug!("no last frame: {e:#}");
            return;
        }
        let until = now().plus_ns(FAREWELL.as_nanos() as i64);
        while now() < until && !self.presenter.iter().flat_map(Presenter::done).any(|d| d.frame >= frame) {
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
        let (rounds, exercise) = self.session.finish();
        let (left, exercise) = (rounds.to_vec(), exercise.to_vec());
        self.tally.records(&left);
        let mut lost_entries = 0;
        if let Some(mut storage) = self.storage.take() {
            storage.take(&left, &exercise, self.session.tracks());
            let (lost, failed) = storage.finish();
            lost_entries = lost;
            wrong.extend(failed.iter().map(|e| format!("{e:#}")));
        }
        if let Err(e) = &ended
            && is_hung(e)
        {
            // Nothing that touches the GPU returns any more. The journal is complete; systemd starts a fresh process.
            wrong.iter().for_each(|line| log::error!("{line}"));
            log::error!("{} {e:#}", Fault::GpuHang.code());
            std::process::exit(1);
        }
        let presented =
            self.presenter.take().map_or_else(Presented::default, |presenter| presenter.end(&mut wrong));
        let mut counters = self.source.counters();
        counters.push(("recording_entries_dropped", lost_entries));
        let summary = self.tally.summary(
            &self.session,
            presented.output,
            &self.clock,
            (&presented.device, &presented.video),
            self.faults.counts(),
            counters,
            &self.options.summary,
        );
        // The last owner of the LCD's port but the source is gone with these.
        drop(self.options);
        if let Err(e) = self.source.stop() {
            wrong.push(e.to_string());
        }
        wrong.iter().for_each(|line| log::error!("{line}"));
        if matches!(ended, Ok(Ended::Reload { .. })) {
            // What is still wrong is found again, and told again.
            self.faults.end_all();
        }
        Ok(Finished { ended: ended?, summary, wrong, validation: presented.validation })
    }
}

/// Opens renderer and output. A gun does without the GPU that its configuration names, since it may be gone or misspelt.
fn open_presenter(
    session: &Session,
    models: &[Model],
    options: &mut PresenterOptions,
    is_gun: bool,
    faults: &mut Vec<FaultChange>,
) -> Result<Presenter> {
    match Presenter::open(session, models, options) {
        Err(e) if options.gpu.device.is_some() && is_gun => {
            faults.push(FaultChange::raised(now(), Fault::Config, format!("{e:#}; another GPU is used")));
            options.gpu.device = None;
            Presenter::open(session, models, options)
        }
        opened => opened,
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
