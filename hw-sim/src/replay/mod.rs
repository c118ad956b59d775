//! Replays a recording as the daemon would meet it.
//!
//! Both modes put the same bytes on the same wires (`wire`): the inertial unit's samples become VectorNav packets, pictures
//! stay JPEG until a camera would deliver them. [`FastReplay`] reads them in process, as fast as they are wanted, the same
//! events every time. [`RealtimeReplay`] moves the recorded times onto the host's clock, writes the packets into a real
//! pseudo-terminal at their times and delivers pictures and trigger edges at theirs, through bounded queues in which the
//! newest wins.

mod decode;
mod fast;
mod laps;
mod rate;
mod realtime;
#[cfg(test)]
mod tests;
mod truth;
mod wire;

use std::{
    io,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread::{self, JoinHandle},
};

use bowwave_core::{event::Event, geometry::CameraPose, time::Time};
use bowwave_devices::{imu::ImuCounters, nmea::LineCounters, serial::SerialError};
use bowwave_record::{Properties, RecordError, RecordingReader};

pub(crate) use self::truth::STAMP_TOLERANCE_NS;
pub use self::{decode::FrameCounters, fast::FastReplay, realtime::RealtimeReplay};
use self::{
    laps::{Laps, Timeline},
    truth::Truth,
    wire::{Wire, WireCounters},
};
use crate::{fault::FaultPlan, panorama::PanoramaError};

/// How a recording is to be replayed.
#[derive(Clone, Debug)]
pub struct ReplayOptions {
    /// Where the replay ends, nanoseconds after its origin; `None`: at the recording's end, or never where it loops.
    pub duration_ns: Option<i64>,
    /// Whether a recording that can repeat without a seam does.
    pub looped: bool,
    /// What goes wrong on the way.
    pub faults: FaultPlan,
}

impl Default for ReplayOptions {
    fn default() -> Self {
        Self { duration_ns: None, looped: true, faults: FaultPlan::default() }
    }
}

/// What a replay delivered and what it left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReplayStats {
    /// Pictures decoded and left out.
    pub frames: FrameCounters,
    /// Pictures that were delivered and gave way to newer ones before they were fetched.
    pub frames_overwritten: u64,
    /// Pictures left out because they were due more than 100 ms ago: the computer is too slow.
    pub frames_late: u64,
    /// What the decoder of the inertial unit's line met.
    pub imu: ImuCounters,
    /// Samples dropped, oldest first, because nobody drained the queue.
    pub imu_overflow: u64,
    /// What the line of the ship's instruments carried.
    pub ship: LineCounters,
    /// Samples that no unit could have sent.
    pub imu_unsendable: u64,
    /// Bytes that the inertial unit's line lost because they were not read in time.
    pub line_lost_bytes: u64,
    /// Trigger edges delivered.
    pub triggers: u64,
    /// Trigger edges that gave way to newer ones before they were fetched.
    pub triggers_overwritten: u64,
    /// Rounds of the recording begun, as far as it was read.
    pub rounds: u64,
    /// Samples and pictures that faults altered or left out, as far as the recording was read.
    pub faults: u64,
}

impl ReplayStats {
    fn take(&mut self, wire: WireCounters) {
        self.imu_unsendable = wire.unsendable;
        self.rounds = wire.rounds;
        self.faults = wire.altered;
    }
}

/// Why a replay cannot begin or go on.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The recording cannot be read, or no further.
    #[error(transparent)]
    Recording(#[from] RecordError),
    /// The recording says that it repeats after a length that is not its own.
    #[error(
        "{}: it says that it repeats every {period_s:.3} s, but its entries reach to {length_s:.3} s: make it again, or replay \
         it once (without looping)",
        path.display()
    )]
    Loop {
        /// The recording.
        path: PathBuf,
        /// Stated period, seconds.
        period_s: f64,
        /// From its start to its last entry, seconds.
        length_s: f64,
    },
    /// No pseudo-terminal for a simulated device.
    #[error("cannot {what} the pseudo-terminal of a simulated device: {source}; is /dev/pts mounted?")]
    Terminal {
        /// What was tried.
        what: &'static str,
        /// The kernel's answer.
        source: io::Error,
    },
    /// The serial code cannot use the pseudo-terminal.
    #[error("a simulated device's line: {0}")]
    Serial(#[from] SerialError),
    /// The sea that a simulated camera looks at cannot be read.
    #[error(transparent)]
    Panorama(#[from] PanoramaError),
    /// A thread could not be started.
    #[error("cannot start the replay's thread {name}: {source}; are too many processes running?")]
    Thread {
        /// The thread.
        name: &'static str,
        /// The kernel's answer.
        source: io::Error,
    },
    /// A thread panicked: a defect of this program.
    #[error("the replay's thread {name} broke down: report it with the log")]
    BrokeDown {
        /// The thread.
        name: &'static str,
    },
}

/// A replay in one of its modes.
pub enum Replay {
    /// In process, without a clock.
    Fast(FastReplay),
    /// On the host's clock, through a pseudo-terminal.
    Realtime(RealtimeReplay),
}

impl Replay {
    /// Begins to read `path` ahead, for a replay without a clock.
    pub fn fast(path: &Path, options: &ReplayOptions) -> Result<Self, ReplayError> {
        FastReplay::open(path, options).map(Self::Fast)
    }

    /// Begins to replay `path` on the host's clock, now.
    pub fn realtime(path: &Path, options: &ReplayOptions) -> Result<Self, ReplayError> {
        RealtimeReplay::open(path, options).map(Self::Realtime)
    }

    /// What the recording says about itself.
    pub fn properties(&self) -> &Properties {
        &self.source().properties
    }

    /// When the recording begins, on the clock of the events: the recorded time in a fast replay, the host's in real time.
    pub fn origin(&self) -> Time {
        self.source().timeline.origin
    }

    /// Appends the events that have arrived and were not yet fetched, by arrival. A fast replay gives those up to and with
    /// `until` and waits for its reader; in real time `until` means nothing and nothing waits. An error comes after all
    /// events before it, once; the replay then has ended.
    pub fn collect(&mut self, until: Time, out: &mut Vec<Event>) -> Result<(), ReplayError> {
        match self {
            Self::Fast(replay) => replay.next_until(until, out),
            Self::Realtime(replay) => replay.drain(out),
        }
    }

    /// Where the camera really was at a frame's mid-exposure, which must be one of the recording's, to the microsecond;
    /// `None` where the recording does not know. Known for every frame that has been fetched, in every round of a loop.
    pub fn truth_at(&self, mid_exposure: Time) -> Option<CameraPose> {
        self.source().truth().at(mid_exposure)
    }

    /// Whether no further event will come.
    pub fn finished(&self) -> bool {
        match self {
            Self::Fast(replay) => replay.finished(),
            Self::Realtime(replay) => replay.finished(),
        }
    }

    /// What was delivered and left out so far.
    pub fn stats(&self) -> ReplayStats {
        match self {
            Self::Fast(replay) => replay.stats(),
            Self::Realtime(replay) => replay.stats(),
        }
    }

    /// Ends the replay and its threads. Events not fetched are lost.
    pub fn stop(self) -> Result<ReplayStats, ReplayError> {
        match self {
            Self::Fast(replay) => replay.stop(),
            Self::Realtime(replay) => replay.stop(),
        }
    }

    fn source(&self) -> &Source {
        match self {
            Self::Fast(replay) => replay.source(),
            Self::Realtime(replay) => replay.source(),
        }
    }
}

/// What both modes know of the recording.
struct Source {
    properties: Properties,
    timeline: Timeline,
    truth: Arc<Mutex<Truth>>,
}

impl Source {
    /// Opens `path`; `origin` is where the replay begins on its own clock, the recorded time where absent.
    fn open(path: &Path, options: &ReplayOptions, origin: Option<Time>) -> Result<(Self, Wire), ReplayError> {
        let reader = RecordingReader::open(path)?;
        let mut timeline = Timeline::of(&reader, options.looped)?;
        timeline.origin = origin.unwrap_or(timeline.base);
        timeline.end = options.duration_ns.map(|ns| timeline.origin.plus_ns(ns.max(0)));
        let truth = Arc::new(Mutex::new(Truth::new(timeline.origin, timeline.period_ns)));
        let properties = reader.properties().clone();
        let laps = Laps::new(reader, timeline, Arc::clone(&truth))?;
        let wire = Wire::new(laps, timeline.origin, options.faults.clone());
        Ok((Self { properties, timeline, truth }, wire))
    }

    /// Whole poses in order, even where a holder panicked.
    fn truth(&self) -> MutexGuard<'_, Truth> {
        self.truth.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Numbers that threads share.
pub(crate) type Shared<T> = Arc<Mutex<T>>;

/// Plain numbers are whole even where a holder panicked.
pub(crate) fn locked<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts a thread.
pub(crate) fn spawn<T: Send + 'static>(
    name: &'static str,
    run: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, ReplayError> {
    thread::Builder::new()
        .name(name.to_owned())
        .spawn(run)
        .map_err(|source| ReplayError::Thread { name, source })
}
