//! Replay on the host's clock, through a pseudo-terminal.

use std::{
    path::Path,
    sync::{Arc, Mutex},
    thread::JoinHandle,
};

use bowwave_core::{
    act::TraineeAct,
    event::{CameraFrame, Event, Mark, TriggerEdge},
    order::InstructorOrder,
    time::Time,
};
use bowwave_devices::{
    clock,
    queue::{NewestSender, newest},
    serial::{ImuPort, ShipPort},
};
use crossbeam_channel::{Receiver, Sender, bounded};

use super::{
    ReplayError, ReplayOptions, ReplayStats, Shared, Source,
    decode::FrameDecoder,
    locked, spawn,
    wire::{Item, RecordedPicture, Wire},
};
use crate::{
    pace::{StopFlag, StopOnDrop},
    pty::Terminal,
};

/// From opening to the recording's beginning: time to read and decode the first picture ahead.
const PREROLL_NS: i64 = 60_000_000;

/// How long before its time a picture is decoded: late enough that the decoder does not compete with the rendering of the
/// picture before, early enough for a big picture.
const DECODE_LEAD_NS: i64 = 12_000_000;

/// Pictures older than this when their turn comes are not decoded any more.
const LATE_MAX_NS: i64 = 100_000_000;

/// How long the line stays open after its last byte, for the reader to fetch it.
const LINGER_NS: i64 = 50_000_000;

/// Delivered and not yet fetched: pictures and trigger edges. Samples wait in the serial port's own queue.
const QUEUE_FRAMES: usize = 4;
const QUEUE_TRIGGERS: usize = 256;

/// Read ahead and not yet due: coded pictures, and bytes and edges of the time that those pictures span.
const AHEAD_FRAMES: usize = 8;
const AHEAD_LINE: usize = 4096;

/// The baud rate is a matter of form on a pseudo-terminal.
const BAUD: u32 = 921_600;
const SHIP_BAUD: u32 = 38_400;

/// A replay on the host's clock. Its times are the recorded ones moved by one constant; samples of the inertial unit
/// arrive when the serial code reads them, and keep the unit's own clock.
pub struct RealtimeReplay {
    source: Source,
    port: ImuPort,
    /// Where the recording has a ship's line.
    ship: Option<ShipPort>,
    frames: Receiver<Event>,
    triggers: Receiver<Event>,
    errors: Receiver<ReplayError>,
    stop: StopOnDrop,
    stats: Shared<ReplayStats>,
    reader: JoinHandle<()>,
    camera: JoinHandle<()>,
    /// Gives its terminals back at its end, so that no line hangs up before its port is closed.
    line: JoinHandle<Terminals>,
}

impl RealtimeReplay {
    pub(super) fn open(path: &Path, options: &ReplayOptions) -> Result<Self, ReplayError> {
        let (source, wire) = Source::open(path, options, Some(clock::now().plus_ns(PREROLL_NS)))?;
        let terminal = || Terminal::open().map_err(|source| ReplayError::Terminal { what: "open", source });
        let imu = terminal()?;
        let port = ImuPort::open(imu.slave(), BAUD)?;
        let ship_terminal = wire.has_ship().then(terminal).transpose()?;
        let ship =
            ship_terminal.as_ref().map(|terminal| ShipPort::open(terminal.slave(), SHIP_BAUD)).transpose()?;
        let terminals = Terminals { imu, ship: ship_terminal };
        let stop = StopFlag::default();
        let stats = Arc::new(Mutex::new(ReplayStats::default()));
        let pace = || Pace { stop: stop.clone(), stats: Arc::clone(&stats) };
        let (errors_in, errors) = bounded(2);
        let (coded_in, coded) = bounded(AHEAD_FRAMES);
        let (due_in, due) = bounded(AHEAD_LINE);
        let (frames_in, frames) = newest(QUEUE_FRAMES);
        let (triggers_in, triggers) = newest(QUEUE_TRIGGERS);
        let line = Line { pace: pace(), due, terminals, triggers: triggers_in, errors: errors_in.clone() };
        let camera = Camera { pace: pace(), coded, decoder: FrameDecoder::default(), frames: frames_in };
        let reader = Reader { pace: pace(), wire, coded: coded_in, due: due_in, errors: errors_in };
        // Where one cannot be started, those before it end with their channels.
        let line = spawn("replay-line", move || line.run())?;
        let camera = spawn("replay-camera", move || camera.run())?;
        let reader = spawn("replay-reader", move || reader.run())?;
        Ok(Self {
            source,
            port,
            ship,
            frames,
            triggers,
            errors,
            stop: StopOnDrop(stop),
            stats,
            reader,
            camera,
            line,
        })
    }

    pub(super) const fn source(&self) -> &Source {
        &self.source
    }

    /// Appends what has been delivered since the last call, by arrival; never waits. What went wrong comes after all events
    /// before it.
    pub fn drain(&mut self, out: &mut Vec<Event>) -> Result<(), ReplayError> {
        let ended = self.threads_ended();
        let before = out.len();
        out.extend(self.port.events().try_iter());
        if let Some(ship) = &self.ship {
            out.extend(ship.events().try_iter());
        }
        out.extend(self.frames.try_iter());
        out.extend(self.triggers.try_iter());
        if let Some(fetched) = out.get_mut(before..) {
            fetched.sort_by_key(Event::arrival);
        }
        if ended && let Ok(error) = self.errors.try_recv() {
            return Err(error);
        }
        Ok(())
    }

    /// Whether everything was delivered and fetched.
    pub fn finished(&self) -> bool {
        self.threads_ended()
            && self.port.events().is_empty()
            && self.ship.as_ref().is_none_or(|ship| ship.events().is_empty())
            && self.frames.is_empty()
            && self.triggers.is_empty()
            && self.errors.is_empty()
    }

    fn threads_ended(&self) -> bool {
        self.reader.is_finished() && self.camera.is_finished() && self.line.is_finished()
    }

    /// What was delivered and left out so far.
    pub fn stats(&self) -> ReplayStats {
        let ship = self.ship.as_ref().map(|ship| ship.status().said.lines).unwrap_or_default();
        let imu = self.port.status();
        ReplayStats { imu: imu.said.counters, imu_overflow: imu.line.overflow, ship, ..*locked(&self.stats) }
    }

    /// Ends the threads and closes the line.
    pub fn stop(self) -> Result<ReplayStats, ReplayError> {
        self.stop.0.stop();
        let broke_down = |name| move |_| ReplayError::BrokeDown { name };
        // All are asked to end before any failure is reported.
        let line = self.line.join().map_err(broke_down("replay-line"));
        let camera = self.camera.join().map_err(broke_down("replay-camera"));
        let reader = self.reader.join().map_err(broke_down("replay-reader"));
        let imu = self.port.stop()?;
        let ship = self.ship.map(ShipPort::stop).transpose()?.map(|ship| ship.said.lines).unwrap_or_default();
        drop(line?);
        camera?;
        reader?;
        let (imu, imu_overflow) = (imu.said.counters, imu.line.overflow);
        Ok(ReplayStats { imu, imu_overflow, ship, ..*locked(&self.stats) })
    }
}

/// What the threads share.
struct Pace {
    stop: StopFlag,
    stats: Shared<ReplayStats>,
}

impl Pace {
    fn stopped(&self) -> bool {
        self.stop.is_stopped()
    }

    fn wait(&self, due: Time) -> bool {
        self.stop.wait(due)
    }

    fn count(&self, change: impl FnOnce(&mut ReplayStats)) {
        change(&mut locked(&self.stats));
    }
}

/// Reads ahead and parts the wires.
struct Reader {
    pace: Pace,
    wire: Wire,
    coded: Sender<RecordedPicture>,
    due: Sender<Due>,
    errors: Sender<ReplayError>,
}

/// What the line's thread does at a time.
enum Due {
    Bytes(Time, Vec<u8>),
    Ship(Time, Vec<u8>),
    Trigger(TriggerEdge),
    Mark(Mark),
    Act(TraineeAct),
    Order(InstructorOrder),
}

impl Reader {
    /// Ends with the recording, or when the other threads have.
    fn run(mut self) {
        while let Some(item) = self.wire.next() {
            let taken = match item {
                Ok(Item::Frame(frame)) => self.coded.send(frame).is_ok(),
                Ok(Item::Bytes { due, bytes }) => self.due.send(Due::Bytes(due, bytes)).is_ok(),
                Ok(Item::Ship { due, bytes }) => self.due.send(Due::Ship(due, bytes)).is_ok(),
                Ok(Item::Trigger(edge)) => self.due.send(Due::Trigger(edge)).is_ok(),
                Ok(Item::Mark(mark)) => self.due.send(Due::Mark(mark)).is_ok(),
                Ok(Item::Act(act)) => self.due.send(Due::Act(act)).is_ok(),
                Ok(Item::Order(order)) => self.due.send(Due::Order(order)).is_ok(),
                Err(error) => {
                    // Room for one from each sender; where it is full something else has been reported.
                    drop(self.errors.try_send(error.into()));
                    true
                }
            };
            self.pace.count(|stats| stats.take(self.wire.counters()));
            if !taken || self.pace.stopped() {
                return;
            }
        }
    }
}

/// The ends of the lines that the devices hold.
struct Terminals {
    imu: Terminal,
    ship: Option<Terminal>,
}

/// The inertial unit, the ship's instruments, the trigger switch and the operator.
struct Line {
    pace: Pace,
    due: Receiver<Due>,
    terminals: Terminals,
    triggers: NewestSender<Event>,
    errors: Sender<ReplayError>,
}

impl Line {
    fn run(mut self) -> Terminals {
        while let Ok(due) = self.due.recv() {
            let time = match &due {
                Due::Bytes(time, _) | Due::Ship(time, _) => *time,
                Due::Trigger(edge) => edge.time,
                Due::Mark(mark) => mark.time,
                Due::Act(act) => act.time,
                Due::Order(order) => order.time,
            };
            if !self.pace.wait(time) {
                return self.terminals;
            }
            let sent = match due {
                Due::Bytes(_, bytes) => self.terminals.imu.send(&bytes),
                Due::Ship(_, bytes) => self.terminals.ship.as_ref().map_or(Ok(0), |t| t.send(&bytes)),
                Due::Trigger(edge) => {
                    self.triggers.send(Event::Trigger(edge));
                    let overwritten = self.triggers.dropped();
                    self.pace.count(|stats| {
                        stats.triggers += 1;
                        stats.triggers_overwritten = overwritten;
                    });
                    Ok(0)
                }
                Due::Mark(mark) => {
                    self.triggers.send(Event::Mark(mark));
                    Ok(0)
                }
                Due::Act(act) => {
                    self.triggers.send(Event::Act(act));
                    Ok(0)
                }
                Due::Order(order) => {
                    self.triggers.send(Event::Order(order));
                    Ok(0)
                }
            };
            match sent {
                Ok(0) => {}
                Ok(lost) => self.pace.count(|stats| stats.line_lost_bytes += lost as u64),
                Err(source) => {
                    // As above: the first report is enough.
                    drop(self.errors.try_send(ReplayError::Terminal { what: "write to", source }));
                    return self.terminals;
                }
            }
        }
        self.pace.wait(clock::now().plus_ns(LINGER_NS));
        self.terminals
    }
}

/// The camera.
struct Camera {
    pace: Pace,
    coded: Receiver<RecordedPicture>,
    decoder: FrameDecoder,
    frames: NewestSender<Event>,
}

impl Camera {
    fn run(mut self) {
        while let Ok(frame) = self.coded.recv() {
            if !self.deliver(frame) {
                return;
            }
        }
    }

    /// Decodes ahead of time and delivers in time; `false` where the replay is stopped.
    fn deliver(&mut self, frame: RecordedPicture) -> bool {
        let due = frame.arrival();
        if !self.pace.wait(due.plus_ns(-DECODE_LEAD_NS)) {
            return false;
        }
        if clock::now().ns_since(due) > LATE_MAX_NS {
            self.pace.count(|stats| stats.frames_late += 1);
            return true;
        }
        let frame = self.decoder.frame(frame);
        if !self.pace.wait(due) {
            return false;
        }
        if let Some(frame) = frame {
            self.frames.send(Event::Frame(CameraFrame { arrival: clock::now(), ..frame }));
        }
        let (counters, overwritten) = (self.decoder.counters(), self.frames.dropped());
        self.pace.count(|stats| {
            stats.frames = counters;
            stats.frames_overwritten = overwritten;
        });
        true
    }
}
