//! The thread that watches the lines.

use std::{
    os::fd::AsFd,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
};

use bowwave_core::{
    event::{Event, Mark, MarkKind},
    fault::{Fault, FaultChange},
    time::Time,
};
use crossbeam_channel::Receiver;

use super::{
    LineState, TriggerCounters, TriggerError, TriggerSettings, TriggerStatus,
    chips::clock_is_monotonic,
    debounce::Debouncer,
    guard::{Interlock, Power},
    input::{Edge, Input, InputLine},
    switch::{Output, Switch},
};
use crate::{
    clock,
    queue::{self, NewestSender},
    report::Reporter,
    wake::{Ended, Wake, join_within},
};

/// Edges that wait to be drained.
const QUEUE_EDGES: usize = 256;
/// Edges taken from a line before the others have their turn. The kernel's queue holds 16.
const BURST: usize = 64;
/// Longest wait: the thread is seen to live, and the interlock arms in time.
const WAIT_NS: i64 = 25_000_000;
/// How often a line that is not there is looked for.
const SEARCH_NS: i64 = 200_000_000;
/// How often a quiet line's level is read back.
const LEVEL_NS: i64 = 1_000_000_000;
/// How long [`TriggerPort::stop`] waits.
const STOP_NS: i64 = 180_000_000;

struct Shared {
    stop: AtomicBool,
    wake: Wake,
    status: Mutex<TriggerStatus>,
}

impl Shared {
    /// Plain numbers: whole even where a holder panicked.
    fn status(&self) -> MutexGuard<'_, TriggerStatus> {
        self.status.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The trigger and the inputs beside it, watched by a thread of their own.
pub struct TriggerPort {
    events: Receiver<Event>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl std::fmt::Debug for TriggerPort {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("TriggerPort").field(&self.status()).finish()
    }
}

impl TriggerPort {
    /// Begins to watch. Lines that are not there are looked for, and told of by `reporter`, as all that happens later. Where
    /// an interlock is wired, [`Fault::NotInert`] is reported before this returns, until the line shows otherwise.
    pub fn start(settings: TriggerSettings, reporter: Reporter) -> Result<Self, TriggerError> {
        Self::start_in(Path::new("/dev"), settings, reporter)
    }

    pub(super) fn start_in(
        dev: &Path,
        settings: TriggerSettings,
        reporter: Reporter,
    ) -> Result<Self, TriggerError> {
        settings.check()?;
        let (queue, events) = queue::newest(QUEUE_EDGES);
        let wake = Wake::new().map_err(TriggerError::Thread)?;
        let shared = Arc::new(Shared {
            stop: AtomicBool::new(false),
            wake,
            status: Mutex::new(TriggerStatus::default()),
        });
        let mut watch = Watch::new(dev.to_owned(), &settings, Arc::clone(&shared), reporter, queue);
        watch.publish();
        let thread = thread::Builder::new()
            .name("trigger".to_owned())
            .spawn(move || watch.run())
            .map_err(TriggerError::Thread)?;
        Ok(Self { events, shared, thread: Some(thread) })
    }

    /// Edges not yet drained, [`Event::Trigger`] with the kernel's times, without chatter, presses and releases in turn; and
    /// [`Event::Mark`] for each press of a button.
    pub fn events(&self) -> &Receiver<Event> {
        &self.events
    }

    /// How the lines do.
    pub fn status(&self) -> TriggerStatus {
        *self.shared.status()
    }

    /// Ends the watch and gives the lines back, within 200 ms.
    pub fn stop(mut self) -> Result<TriggerCounters, TriggerError> {
        self.ask_to_stop();
        match join_within(self.thread.take().into_iter().collect(), STOP_NS) {
            Ended::Well => Ok(self.status().counters),
            Ended::BrokeDown => Err(TriggerError::BrokeDown),
            Ended::NotInTime => Err(TriggerError::Blocked),
        }
    }

    fn ask_to_stop(&self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        self.shared.wake.notify();
    }
}

impl Drop for TriggerPort {
    fn drop(&mut self) {
        if self.thread.is_some() {
            log::warn!("the trigger's port was dropped without stop()");
            self.ask_to_stop();
        }
    }
}

/// What a line is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    Trigger,
    Interlock,
    PowerFail,
    Press(MarkKind),
}

/// A line that is wanted, and open where it can be.
struct Place {
    role: Role,
    wanted: InputLine,
    input: Option<Input>,
    /// Of the chip that it was on: it is looked for on no other, because another line read as the interlock would arm a gun
    /// that is not inert.
    label: Option<String>,
    /// Earliest time of the next try, or of the next look at a quiet line.
    next: Time,
    /// Its loss has been told.
    told: bool,
    state: LineState,
    /// Of a button of the operator.
    button: Option<Debouncer>,
}

/// The watching thread.
struct Watch {
    dev: PathBuf,
    shared: Arc<Shared>,
    reporter: Reporter,
    queue: NewestSender<Event>,
    places: Vec<Place>,
    switch: Switch,
    interlock: Option<Interlock>,
    power: Power,
    /// How long contacts chatter, nanoseconds.
    debounce_ns: i64,
}

impl Watch {
    fn new(
        dev: PathBuf,
        settings: &TriggerSettings,
        shared: Arc<Shared>,
        reporter: Reporter,
        queue: NewestSender<Event>,
    ) -> Self {
        let now = clock::now();
        let presses = settings.presses.iter().map(|press| (Role::Press(press.kind), Some(&press.line)));
        let lines = [
            (Role::Trigger, Some(&settings.trigger)),
            (Role::Interlock, settings.interlock.as_ref()),
            (Role::PowerFail, settings.power_fail.as_ref()),
        ];
        let place = |(role, wanted): (Role, Option<&InputLine>)| {
            let wanted = wanted?.clone();
            Some(Place {
                role,
                wanted,
                input: None,
                label: None,
                next: Time::MIN,
                told: false,
                state: LineState::Absent,
                button: None,
            })
        };
        let ns = |d: std::time::Duration| i64::try_from(d.as_nanos()).unwrap_or(i64::MAX);
        let mut switch =
            Switch::new(ns(settings.debounce), ns(settings.stuck_after), settings.interlock.is_none());
        if let Err(e) = clock_is_monotonic() {
            switch.refuse(now, &e.to_string());
        }
        Self {
            dev,
            shared,
            reporter,
            queue,
            places: lines.into_iter().chain(presses).filter_map(place).collect(),
            switch,
            interlock: settings.interlock.as_ref().map(|_| Interlock::new(now)),
            power: Power::default(),
            debounce_ns: ns(settings.debounce),
        }
    }

    fn run(mut self) {
        while !self.shared.stop.load(Ordering::Relaxed) {
            self.reporter.beat();
            self.search();
            self.wait();
            self.tick();
            self.publish();
        }
    }

    /// Tries to open what is not open.
    fn search(&mut self) {
        for i in 0..self.places.len() {
            let now = clock::now();
            let Some(place) = self.places.get_mut(i).filter(|p| p.input.is_none() && now >= p.next) else {
                continue;
            };
            place.next = now.plus_ns(SEARCH_NS);
            let opened = Input::open(&self.dev, &place.wanted, place.label.as_deref()).and_then(|input| {
                let level = input.level()?;
                Ok((input, level))
            });
            match opened {
                Ok((input, (now, level))) => {
                    let asked = input.asked();
                    place.label = Some(input.label().to_owned()).filter(|label| !label.is_empty());
                    place.input = Some(input);
                    place.told = false;
                    place.next = now.plus_ns(LEVEL_NS);
                    self.opened(i, asked, now, level);
                }
                Err(e) => self.lost(i, &e),
            }
        }
    }

    /// Waits for edges and takes them in.
    fn wait(&mut self) {
        let now = clock::now();
        let until = self.switch.deadline().map_or(WAIT_NS, |t| t.ns_since(now).clamp(0, WAIT_NS));
        let open: Vec<_> = (0..self.places.len()).filter(|i| self.input(*i).is_some()).collect();
        let files: Vec<_> = open.iter().filter_map(|i| self.input(*i).map(AsFd::as_fd)).collect();
        let ready = self.shared.wake.wait(&files, until);
        let Ok(ready) = ready else {
            self.shared.wake.pause(WAIT_NS);
            return;
        };
        let now = clock::now();
        let soon = self.switch.deadline().is_some_and(|t| now >= t);
        for (i, ready) in open.into_iter().zip(ready) {
            let due = self.places.get(i).is_some_and(|p| now >= p.next || (soon && p.role == Role::Trigger));
            if (!ready.is_empty() || due)
                && let Err(e) = self.read(i)
            {
                self.lost(i, &e);
            }
        }
    }

    fn input(&self, i: usize) -> Option<&Input> {
        self.places.get(i)?.input.as_ref()
    }

    /// Takes the edges that wait on a line, then reads its level back.
    fn read(&mut self, i: usize) -> Result<(), TriggerError> {
        for _ in 0..BURST {
            let Some(input) = self.places.get_mut(i).and_then(|p| p.input.as_mut()) else { return Ok(()) };
            let Some(edge) = input.edge()? else { break };
            self.edge(i, edge);
        }
        let Some(place) = self.places.get_mut(i) else { return Ok(()) };
        let Some(input) = &mut place.input else { return Ok(()) };
        let (now, level) = input.level()?;
        // One that came meanwhile belongs before the level.
        let late = input.edge()?;
        place.next = now.plus_ns(LEVEL_NS);
        if let Some(edge) = late {
            self.edge(i, edge);
        } else {
            self.level(i, now, level);
        }
        Ok(())
    }

    fn role(&self, i: usize) -> Option<Role> {
        self.places.get(i).map(|p| p.role)
    }

    fn show(&mut self, i: usize, state: LineState) {
        if let Some(place) = self.places.get_mut(i) {
            place.state = state;
        }
    }

    fn opened(&mut self, i: usize, asked: Time, now: Time, level: bool) {
        self.show(i, state(level));
        match self.role(i) {
            Some(Role::Trigger) => self.switch.opened(asked, now, level),
            Some(Role::Press(_)) => {
                let button = Debouncer::new(self.debounce_ns, level, now);
                if let Some(place) = self.places.get_mut(i) {
                    place.button = Some(button);
                }
            }
            Some(Role::Interlock | Role::PowerFail) | None => self.level(i, now, level),
        }
    }

    fn edge(&mut self, i: usize, edge: Edge) {
        let now = clock::now();
        self.show(i, state(edge.active));
        match self.role(i) {
            Some(Role::Trigger) => self.switch.edge(now, edge.time, edge.active),
            Some(Role::Interlock) => {
                if let Some(interlock) = &mut self.interlock {
                    interlock.edge(now, edge.active);
                    self.switch.arm(now, interlock.armed());
                }
            }
            Some(Role::PowerFail) => self.power.level(now, edge.active),
            Some(Role::Press(kind)) => {
                let Self { places, queue, .. } = self;
                if let Some(button) = places.get_mut(i).and_then(|p| p.button.as_mut()) {
                    button.edge(edge.time, edge.active, |time, pressed| press(queue, kind, time, pressed));
                }
            }
            None => {}
        }
        self.publish();
    }

    fn level(&mut self, i: usize, now: Time, level: bool) {
        self.show(i, state(level));
        match self.role(i) {
            Some(Role::Trigger) => self.switch.level(now, level),
            Some(Role::Interlock) => {
                if let Some(interlock) = &mut self.interlock {
                    interlock.level(now, level);
                    self.switch.arm(now, interlock.armed());
                }
            }
            Some(Role::PowerFail) => self.power.level(now, level),
            Some(Role::Press(_)) => {
                if let Some(button) = self.places.get_mut(i).and_then(|p| p.button.as_mut())
                    && button.level() != level
                {
                    button.correct(now, level);
                }
            }
            None => {}
        }
    }

    fn lost(&mut self, i: usize, error: &TriggerError) {
        let now = clock::now();
        let Some(place) = self.places.get_mut(i) else { return };
        place.input = None;
        place.state = LineState::Absent;
        place.next = now.plus_ns(SEARCH_NS);
        let first = !std::mem::replace(&mut place.told, true);
        match place.role {
            Role::Trigger => self.switch.lost(now, &format!("trigger: {error}")),
            Role::Interlock => {
                if let Some(interlock) = &mut self.interlock {
                    interlock.lost(now, &format!("interlock: {error}"));
                    self.switch.arm(now, false);
                }
            }
            Role::Press(_) => {
                if first {
                    let cause = format!("button: {error}; the heading cannot be set by it");
                    self.reporter.send(FaultChange::noted(now, Fault::TriggerLost, cause));
                }
            }
            Role::PowerFail => {
                self.power.lost();
                if first {
                    // Training goes on: the log is told that power may fail unannounced.
                    let cause = format!("power-fail input: {error}; a power cut will not be announced");
                    self.reporter.send(FaultChange::noted(now, Fault::TriggerLost, cause));
                }
            }
        }
    }

    fn tick(&mut self) {
        let now = clock::now();
        if let Some(interlock) = &mut self.interlock {
            interlock.tick(now);
            if interlock.armed() {
                self.switch.arm(now, true);
            }
        }
        self.power.tick(now);
        let Self { places, queue, .. } = self;
        for place in places {
            if let (Role::Press(kind), Some(button)) = (place.role, &mut place.button) {
                button.settle(now, |time, pressed| press(queue, kind, time, pressed));
            }
        }
        self.switch.tick(now);
    }

    /// Hands on what has come of it.
    fn publish(&mut self) {
        let Self { switch, queue, reporter, interlock, power, .. } = self;
        if let Some(interlock) = interlock {
            interlock.out().for_each(|change| reporter.send(change));
        }
        power.out().for_each(|change| reporter.send(change));
        for output in switch.out() {
            match output {
                Output::Edge(edge) => queue.send(Event::Trigger(edge)),
                Output::Fault(change) => reporter.send(change),
            }
        }
        let of = |role| self.places.iter().find(|p| p.role == role).map(|p| p.state);
        *self.shared.status() = TriggerStatus {
            life: self.switch.life(),
            trigger: of(Role::Trigger).unwrap_or_default(),
            interlock: of(Role::Interlock),
            power_fail: of(Role::PowerFail),
            armed: self.interlock.as_ref().map(Interlock::armed),
            counters: TriggerCounters { overflow: self.queue.dropped(), ..self.switch.counters() },
        };
    }
}

/// A button tells by being pressed; that it is let go means nothing.
fn press(queue: &mut NewestSender<Event>, kind: MarkKind, time: Time, pressed: bool) {
    if pressed {
        queue.send(Event::Mark(Mark { time, kind }));
    }
}

const fn state(level: bool) -> LineState {
    if level { LineState::Active } else { LineState::Inactive }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::{
        report::reporting,
        trigger::{Bias, Press, TriggerLife},
    };

    fn line(line: &str) -> InputLine {
        InputLine { chip: "no-such-chip".into(), line: line.into(), active_low: true, bias: Bias::PullUp }
    }

    #[test]
    fn without_a_chip_it_says_so_lives_and_does_not_arm() {
        let dev = tempfile::tempdir().expect("temporary folder");
        let (reporter, reports) = reporting();
        let settings = TriggerSettings {
            interlock: Some(line("INERT")),
            power_fail: Some(line("PFAIL")),
            presses: vec![Press { line: line("REZERO"), kind: MarkKind::Stow }],
            ..TriggerSettings::new(line("TRIGGER"))
        };
        let port =
            TriggerPort::start_in(dev.path(), settings, reporter).expect("absence is no error of the start");
        let first: Vec<_> = reports.changes().map(|c| c.fault).collect();
        assert!(first.contains(&Fault::NotInert), "told before anything else can happen: {first:?}");
        let begin = clock::now();
        let mut seen = first;
        while clock::now().ns_since(begin) < 500_000_000 {
            clock::sleep_until(clock::now().plus_ns(10_000_000));
            assert!(clock::now().ns_since(reports.last_beat()) < 250_000_000);
            seen.extend(reports.changes().map(|c| c.fault));
        }
        seen.sort_unstable();
        // The power-fail input and the button are noted as lost, the trigger raised, each once.
        assert_eq!(seen, [Fault::NotInert, Fault::TriggerLost, Fault::TriggerLost, Fault::TriggerLost]);
        let status = port.status();
        assert_eq!((status.life, status.armed), (TriggerLife::Searching, Some(false)));
        let before = clock::now();
        port.stop().expect("stops");
        assert!(clock::now().ns_since(before) < 200_000_000);
    }

    #[test]
    fn settings_that_cannot_be_are_refused() {
        let refused = |settings| match TriggerPort::start(settings, reporting().0) {
            Ok(_) => panic!("started"),
            Err(e) => e,
        };
        let good = TriggerSettings::new(line("TRIGGER"));
        let long = TriggerSettings { debounce: Duration::from_millis(50), ..good.clone() };
        assert!(matches!(refused(long), TriggerError::Debounce { ms: 50 }));
        let short = TriggerSettings { stuck_after: Duration::ZERO, ..good.clone() };
        assert!(matches!(refused(short), TriggerError::StuckAfter { .. }));
        let button = Press { line: line("TRIGGER"), kind: MarkKind::Landmark };
        let same = TriggerSettings { presses: vec![button], ..good.clone() };
        let message = refused(same).to_string();
        assert!(message.contains("landmark and trigger are both line TRIGGER"), "{message}");
        let twice = TriggerSettings { interlock: Some(line("TRIGGER")), ..good };
        let message = refused(twice).to_string();
        assert!(message.contains("interlock and trigger are both line TRIGGER"), "{message}");
    }
}
