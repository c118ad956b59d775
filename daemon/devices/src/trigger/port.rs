//! The thread that watches the lines.

use std::{
    os::fd::AsFd,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use bowwave_core::{
    act::TraineeAct,
    event::{Event, Mark},
    fault::{Fault, FaultChange},
    time::Time,
};
use crossbeam_channel::Receiver;

use super::{
    InterlockWiring, LineState, PressKind, TriggerCounters, TriggerError, TriggerSettings, TriggerStatus,
    guard::{Interlock, PowerSupply},
    switch::{Switch, SwitchOutput},
};
use crate::{
    clock,
    gpio::{Debouncer, GpioEdge, GpioError, InputHandle, InputLine, clock_is_monotonic},
    queue::{self, NewestSender},
    report::Reporter,
    worker::{PortLink, PortWorker},
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

/// The trigger and the inputs beside it, watched by a thread of their own.
#[derive(Debug)]
pub struct TriggerPort {
    events: Receiver<Event>,
    worker: PortWorker<TriggerStatus>,
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
        let link = PortLink::new(TriggerStatus::default()).map_err(TriggerError::Thread)?;
        let mut watch = TriggerWatch::new(dev.to_owned(), &settings, Arc::clone(&link), reporter, queue);
        watch.publish();
        let worker = PortWorker::start("trigger", link, move || watch.run()).map_err(TriggerError::Thread)?;
        Ok(Self { events, worker })
    }

    /// Edges not yet drained, [`Event::Trigger`] with the kernel's times, without chatter, presses and releases in turn; and
    /// [`Event::Mark`] for each press of a button.
    pub const fn events(&self) -> &Receiver<Event> {
        &self.events
    }

    /// How the lines do.
    pub fn status(&self) -> TriggerStatus {
        *self.worker.link().status()
    }

    /// Ends the watch and gives the lines back, within 200 ms.
    pub fn stop(self) -> Result<TriggerCounters, TriggerError> {
        let link = Arc::clone(self.worker.link());
        self.worker.stop_in_time()?;
        Ok(link.status().counters)
    }
}

/// Purpose of a line, and what is kept for it alone.
enum Role {
    Trigger,
    /// A contact of the interlock, by its number.
    Interlock(usize),
    PowerFail,
    /// A button of the operator; its contacts while the line is open.
    Button(PressKind, Option<Debouncer>),
}

/// A line that is wanted, and open where it can be.
struct WatchedLine {
    role: Role,
    wanted: InputLine,
    input: Option<InputHandle>,
    /// Label of the chip that it was on: it is looked for on no other, because another line read as the interlock would arm a gun
    /// that is not inert.
    label: Option<String>,
    /// Earliest time of the next try, or of the next look at a quiet line.
    next: Time,
    /// Its loss has been told.
    told: bool,
    state: LineState,
}

impl WatchedLine {
    const fn new(role: Role, wanted: InputLine) -> Self {
        Self {
            role,
            wanted,
            input: None,
            label: None,
            next: Time::MIN,
            told: false,
            state: LineState::Absent,
        }
    }

    /// Tries to open the line where it is not and the time has come.
    fn search(&mut self, dev: &Path, meaning: &mut Meaning) {
        let now = clock::now();
        if self.input.is_some() || now < self.next {
            return;
        }
        let opened = InputHandle::open(dev, &self.wanted, self.label.as_deref()).and_then(|input| {
            let level = input.level()?;
            Ok((input, level))
        });
        match opened {
            Ok((input, (now, level))) => {
                self.label = Some(input.label().to_owned()).filter(|label| !label.is_empty());
                self.told = false;
                self.next = now.plus_ns(LEVEL_NS);
                self.state = state(level);
                meaning.opened(&mut self.role, input.asked(), now, level);
                self.input = Some(input);
            }
            Err(e) => self.lost(&e, meaning),
        }
    }

    /// Takes the edges that wait, then reads the level back.
    fn read(&mut self, meaning: &mut Meaning) -> Result<(), GpioError> {
        let Some(input) = &mut self.input else { return Ok(()) };
        for _ in 0..BURST {
            let Some(edge) = input.edge()? else { break };
            self.state = state(edge.active);
            meaning.edge(&mut self.role, edge);
        }
        let (now, level) = input.level()?;
        // One that came meanwhile belongs before the level.
        let late = input.edge()?;
        self.next = now.plus_ns(LEVEL_NS);
        if let Some(edge) = late {
            self.state = state(edge.active);
            meaning.edge(&mut self.role, edge);
        } else {
            self.state = state(level);
            meaning.level(&mut self.role, now, level);
        }
        Ok(())
    }

    fn lost(&mut self, error: &GpioError, meaning: &mut Meaning) {
        let now = clock::now();
        self.input = None;
        self.state = LineState::Absent;
        self.next = now.plus_ns(SEARCH_NS);
        let first = !std::mem::replace(&mut self.told, true);
        meaning.lost(&mut self.role, now, error, first);
    }
}

/// The watching thread.
struct TriggerWatch {
    dev: PathBuf,
    link: Arc<PortLink<TriggerStatus>>,
    lines: Vec<WatchedLine>,
    meaning: Meaning,
}

impl TriggerWatch {
    fn new(
        dev: PathBuf,
        settings: &TriggerSettings,
        link: Arc<PortLink<TriggerStatus>>,
        reporter: Reporter,
        queue: NewestSender<Event>,
    ) -> Self {
        let contacts = settings.interlock.iter().flat_map(InterlockWiring::contacts).enumerate();
        let contacts = contacts.map(|(number, line)| (Role::Interlock(number), line));
        let power_fail = settings.power_fail.iter().map(|line| (Role::PowerFail, line));
        let presses = settings.presses.iter().map(|p| (Role::Button(p.kind, None), &p.line));
        let lines = std::iter::once((Role::Trigger, &settings.trigger))
            .chain(contacts)
            .chain(power_fail)
            .chain(presses)
            .map(|(role, wanted)| WatchedLine::new(role, wanted.clone()))
            .collect();
        Self { dev, link, lines, meaning: Meaning::new(settings, reporter, queue) }
    }

    fn run(mut self) {
        while !self.link.is_stopping() {
            self.meaning.reporter.beat();
            let Self { dev, lines, meaning, .. } = &mut self;
            lines.iter_mut().for_each(|line| line.search(dev, meaning));
            self.wait();
            self.meaning.tick(&mut self.lines);
            self.publish();
        }
    }

    /// Waits for edges and takes them in.
    fn wait(&mut self) {
        let Self { link, lines, meaning, .. } = self;
        let deadline = meaning.switch.deadline();
        let now = clock::now();
        let until_ns = deadline.map_or(WAIT_NS, |t| t.ns_since(now).clamp(0, WAIT_NS));
        let files: Vec<_> = lines.iter().filter_map(|l| l.input.as_ref()).map(AsFd::as_fd).collect();
        let Ok(ready) = link.wait(&files, until_ns) else {
            link.pause(WAIT_NS);
            return;
        };
        let now = clock::now();
        let soon = deadline.is_some_and(|t| now >= t);
        for (line, ready) in lines.iter_mut().filter(|l| l.input.is_some()).zip(ready) {
            let due = now >= line.next || (soon && matches!(line.role, Role::Trigger));
            if (!ready.is_empty() || due)
                && let Err(e) = line.read(meaning)
            {
                line.lost(&e, meaning);
            }
        }
    }

    /// Hands on what has come of it.
    fn publish(&mut self) {
        self.meaning.send();
        let of = |is: fn(&Role) -> bool| self.lines.iter().find(|l| is(&l.role)).map(|l| l.state);
        let Meaning { switch, interlock, queue, .. } = &self.meaning;
        *self.link.status() = TriggerStatus {
            life: switch.life(),
            trigger: of(|role| matches!(role, Role::Trigger)).unwrap_or_default(),
            interlock: of(|role| matches!(role, Role::Interlock(0))),
            second_interlock: of(|role| matches!(role, Role::Interlock(1))),
            power_fail: of(|role| matches!(role, Role::PowerFail)),
            armed: interlock.as_ref().map(Interlock::armed),
            counters: TriggerCounters { overflow: queue.dropped(), ..switch.counters() },
        };
    }
}

/// Meaning of the lines: what each edge and level does, and to whom it is told.
struct Meaning {
    switch: Switch,
    interlock: Option<Interlock>,
    power: PowerSupply,
    /// How long contacts chatter, nanoseconds.
    debounce_ns: i64,
    reporter: Reporter,
    queue: NewestSender<Event>,
}

impl Meaning {
    fn new(settings: &TriggerSettings, reporter: Reporter, queue: NewestSender<Event>) -> Self {
        let now = clock::now();
        let ns = |d: Duration| i64::try_from(d.as_nanos()).unwrap_or(i64::MAX);
        let debounce_ns = ns(settings.debounce);
        let mut switch = Switch::new(debounce_ns, ns(settings.stuck_after), settings.interlock.is_none());
        if let Err(e) = clock_is_monotonic() {
            switch.refuse(now, &e.to_string());
        }
        Self {
            switch,
            interlock: settings
                .interlock
                .as_ref()
                .map(|wiring| Interlock::new(now, wiring.contacts().count(), ns(wiring.discrepancy))),
            power: PowerSupply::default(),
            debounce_ns,
            reporter,
            queue,
        }
    }

    fn opened(&mut self, role: &mut Role, asked: Time, now: Time, level: bool) {
        match role {
            Role::Trigger => self.switch.opened(asked, now, level),
            Role::Button(_, contacts) => *contacts = Some(Debouncer::new(self.debounce_ns, level, now)),
            Role::Interlock(_) | Role::PowerFail => self.level(role, now, level),
        }
    }

    fn edge(&mut self, role: &mut Role, edge: GpioEdge) {
        let now = clock::now();
        match role {
            Role::Trigger => self.switch.edge(now, edge.time, edge.active),
            Role::Interlock(contact) => {
                self.guard(now, |interlock| interlock.edge(*contact, now, edge.active));
            }
            Role::PowerFail => self.power.level(now, edge.active),
            Role::Button(kind, contacts) => {
                if let Some(contacts) = contacts {
                    contacts.edge(edge.time, edge.active, |time, pressed| {
                        press(&mut self.queue, *kind, time, pressed);
                    });
                }
            }
        }
        self.send();
    }

    fn level(&mut self, role: &mut Role, now: Time, level: bool) {
        match role {
            Role::Trigger => self.switch.level(now, level),
            Role::Interlock(contact) => self.guard(now, |interlock| interlock.level(*contact, now, level)),
            Role::PowerFail => self.power.level(now, level),
            Role::Button(_, contacts) => {
                if let Some(contacts) = contacts.as_mut().filter(|c| c.level() != level) {
                    contacts.correct(now, level);
                }
            }
        }
    }

    fn lost(&mut self, role: &mut Role, now: Time, error: &GpioError, first: bool) {
        let noted = match role {
            Role::Trigger => return self.switch.lost(now, &format!("trigger: {error}")),
            Role::Interlock(contact) => {
                let cause = format!("interlock: {error}");
                return self.guard(now, |interlock| interlock.lost(*contact, now, &cause));
            }
            Role::Button(kind, _) => match kind {
                PressKind::Mark(_) => format!("button: {error}; the heading cannot be set by it"),
                PressKind::Act(act) => format!("button {}: {error}; it does nothing", act.name()),
            },
            Role::PowerFail => {
                self.power.lost();
                // Training goes on: the log is told that power may fail unannounced.
                format!("power-fail input: {error}; a power cut will not be announced")
            }
        };
        if first {
            self.reporter.send(FaultChange::noted(now, Fault::TriggerLost, noted));
        }
    }

    /// Something happens to the interlock: the switch is armed as that is.
    fn guard(&mut self, now: Time, happens: impl FnOnce(&mut Interlock)) {
        if let Some(interlock) = &mut self.interlock {
            happens(interlock);
            self.switch.arm(now, interlock.armed());
        }
    }

    fn tick(&mut self, lines: &mut [WatchedLine]) {
        let now = clock::now();
        if let Some(interlock) = &mut self.interlock {
            interlock.tick(now);
            if interlock.armed() {
                self.switch.arm(now, true);
            }
        }
        self.power.tick(now);
        for line in lines {
            if let Role::Button(kind, Some(contacts)) = &mut line.role {
                contacts.settle(now, |time, pressed| press(&mut self.queue, *kind, time, pressed));
            }
        }
        self.switch.tick(now);
    }

    fn send(&mut self) {
        let Self { switch, queue, reporter, interlock, power, .. } = self;
        if let Some(interlock) = interlock {
            interlock.out().for_each(|change| reporter.send(change));
        }
        power.out().for_each(|change| reporter.send(change));
        for output in switch.out() {
            match output {
                SwitchOutput::Edge(edge) => queue.send(Event::Trigger(edge)),
                SwitchOutput::Fault(change) => reporter.send(change),
            }
        }
    }
}

/// A button tells by being pressed; that it is let go means nothing.
fn press(queue: &mut NewestSender<Event>, kind: PressKind, time: Time, pressed: bool) {
    if pressed {
        queue.send(match kind {
            PressKind::Mark(kind) => Event::Mark(Mark { time, kind }),
            PressKind::Act(act) => Event::Act(TraineeAct { time, act }),
        });
    }
}

const fn state(level: bool) -> LineState {
    if level { LineState::Active } else { LineState::Inactive }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use bowwave_core::event::MarkKind;

    use super::*;
    use crate::{
        gpio::LineBias,
        report::reporting,
        trigger::{Press, TriggerLife},
    };

    fn line(line: &str) -> InputLine {
        InputLine { chip: "no-such-chip".into(), line: line.into(), active_low: true, bias: LineBias::PullUp }
    }

    #[test]
    fn without_a_chip_it_says_so_lives_and_does_not_arm() {
        let dev = tempfile::tempdir().expect("temporary folder");
        let (reporter, reports) = reporting();
        let settings = TriggerSettings {
            interlock: Some(InterlockWiring::single(line("INERT"))),
            power_fail: Some(line("PFAIL")),
            presses: vec![Press { line: line("REZERO"), kind: PressKind::Mark(MarkKind::Stow) }],
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
        let button = Press { line: line("TRIGGER"), kind: PressKind::Mark(MarkKind::Landmark) };
        let same = TriggerSettings { presses: vec![button], ..good.clone() };
        let message = refused(same).to_string();
        assert!(message.contains("landmark and trigger are both line TRIGGER"), "{message}");
        let wired = |interlock| TriggerSettings { interlock: Some(interlock), ..good.clone() };
        let dangerous = InputLine { bias: LineBias::PullDown, ..line("INERT") };
        assert!(matches!(refused(wired(InterlockWiring::single(dangerous))), TriggerError::Wiring(_)));
        let twice = wired(InterlockWiring::single(line("TRIGGER")));
        let message = refused(twice).to_string();
        assert!(message.contains("interlock and trigger are both line TRIGGER"), "{message}");
    }
}
