//! Replay in process, without a clock.

use std::{
    path::Path,
    sync::{Arc, Mutex},
    thread::{self, JoinHandle},
};

use bowwave_core::{event::Event, time::Time};
use bowwave_devices::{
    imu::{ImuDecoder, ImuFormat},
    nmea::ShipParser,
};
use crossbeam_channel::{Receiver, Sender, bounded};

use super::{
    ReplayError, ReplayOptions, ReplayStats, Shared, Source,
    decode::FrameDecoder,
    locked,
    wire::{Item, Wire},
};

/// Events decoded ahead: two pictures at 200 Hz and 30 Hz, and never more pictures than memory bears.
const AHEAD: usize = 16;

/// A replay without a clock: the same recording, options and faults give the same events. A thread reads and decodes
/// ahead while the last ones are worked on.
pub struct FastReplay {
    source: Source,
    events: Receiver<Result<Event, ReplayError>>,
    /// The first event later than what was asked for.
    next: Option<Event>,
    ended: bool,
    stats: Shared<ReplayStats>,
    thread: Option<JoinHandle<()>>,
}

impl FastReplay {
    pub(super) fn open(path: &Path, options: &ReplayOptions) -> Result<Self, ReplayError> {
        const NAME: &str = "replay-decode";
        let (source, wire) = Source::open(path, options, None)?;
        let (sender, events) = bounded(AHEAD);
        let stats = Arc::new(Mutex::new(ReplayStats::default()));
        let producer = Producer {
            wire,
            // What is simulated is known: no sample waits for a proof of its format.
            imu: ImuDecoder::fixed(ImuFormat::VectorNav),
            ship: ShipParser::new(),
            frames: FrameDecoder::default(),
            triggers: 0,
            events: sender,
            stats: Arc::clone(&stats),
        };
        let thread = thread::Builder::new()
            .name(NAME.to_owned())
            .spawn(move || producer.run())
            .map_err(|source| ReplayError::Thread { name: NAME, source })?;
        Ok(Self { source, events, next: None, ended: false, stats, thread: Some(thread) })
    }

    pub(super) const fn source(&self) -> &Source {
        &self.source
    }

    /// Appends the events that arrived up to and with `until` and were not yet fetched, by arrival. Waits for the reader.
    pub fn next_until(&mut self, until: Time, out: &mut Vec<Event>) -> Result<(), ReplayError> {
        loop {
            let event = match self.next.take() {
                Some(event) => event,
                None => match self.events.recv() {
                    Ok(event) => event?,
                    Err(_) => {
                        self.ended = true;
                        return Ok(());
                    }
                },
            };
            if event.arrival() > until {
                self.next = Some(event);
                return Ok(());
            }
            out.push(event);
        }
    }

    /// Whether the last event was fetched, or an error ended the replay.
    pub const fn finished(&self) -> bool {
        self.ended
    }

    /// What was decoded so far; the reader is a few events ahead.
    pub fn stats(&self) -> ReplayStats {
        *locked(&self.stats)
    }

    /// Ends the reader.
    pub fn stop(mut self) -> Result<ReplayStats, ReplayError> {
        // The reader ends where nobody takes its events.
        drop(std::mem::replace(&mut self.events, crossbeam_channel::never()));
        match self.thread.take().map(JoinHandle::join) {
            Some(Err(_)) => Err(ReplayError::BrokeDown { name: "replay-decode" }),
            Some(Ok(())) | None => Ok(self.stats()),
        }
    }
}

struct Producer {
    wire: Wire,
    imu: ImuDecoder,
    ship: ShipParser,
    frames: FrameDecoder,
    triggers: u64,
    events: Sender<Result<Event, ReplayError>>,
    stats: Shared<ReplayStats>,
}

impl Producer {
    fn run(mut self) {
        let mut ready = Vec::new();
        while let Some(item) = self.wire.next() {
            match item {
                Ok(item) => self.receive(item, &mut ready),
                Err(error) => ready.push(Err(error.into())),
            }
            self.publish();
            for event in ready.drain(..) {
                if self.events.send(event).is_err() {
                    return;
                }
            }
        }
        self.publish();
    }

    /// Does what the daemon's devices would do with the item.
    fn receive(&mut self, item: Item, ready: &mut Vec<Result<Event, ReplayError>>) {
        match item {
            Item::Bytes { due, bytes } => {
                ready.extend(self.imu.samples(&bytes, due).map(|sample| Ok(Event::Imu(sample))));
            }
            Item::Frame(frame) => {
                ready.extend(self.frames.frame(frame).map(|frame| Ok(Event::Frame(frame))));
            }
            Item::Ship { due, bytes } => {
                ready.extend(self.ship.lines(&bytes, due).map(|line| Ok(line.said.into())));
            }
            Item::Mark(mark) => ready.push(Ok(Event::Mark(mark))),
            Item::Act(act) => ready.push(Ok(Event::Act(act))),
            Item::Order(order) => ready.push(Ok(Event::Order(order))),
            Item::Trigger(edge) => {
                self.triggers += 1;
                ready.push(Ok(Event::Trigger(edge)));
            }
        }
    }

    fn publish(&self) {
        let mut stats = locked(&self.stats);
        stats.frames = self.frames.counters();
        stats.imu = self.imu.counters();
        stats.ship = self.ship.counters();
        stats.triggers = self.triggers;
        stats.take(self.wire.counters());
    }
}
