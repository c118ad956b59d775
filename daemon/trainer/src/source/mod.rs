//! Where a session's events come from: the gun's own devices, or a recording as if its devices were there.

mod devices;
mod live;

use bowwave_core::{
    event::Event,
    fault::{DevicePart, FaultChange},
    frame::scene::Status,
    geometry::CameraPose,
    time::Time,
    world::World,
};
use crossbeam_channel::{Receiver, TryRecvError};
use hw_sim::replay::{Replay, ReplayError, ReplayStats};

use crate::supervisor::WallTime;

pub use devices::{DeviceSettings, Devices, LampChoice};
pub use live::LiveSource;

/// A source of events.
pub enum Source {
    /// The gun's own devices.
    Devices(Box<Devices>),
    /// A recording.
    Recording(Box<RecordingSource>),
    /// A simulated gun that somebody aims.
    Live(Box<LiveSource>),
    /// Events that another thread hands over, at the pace at which they are taken.
    Feed(EventFeed),
}

/// Events that another thread hands over. It has ended when that thread closes the queue.
#[derive(Debug)]
pub struct EventFeed {
    events: Receiver<Event>,
    is_closed: bool,
}

impl EventFeed {
    /// The reading end of a queue.
    pub const fn new(events: Receiver<Event>) -> Self {
        Self { events, is_closed: false }
    }

    fn collect(&mut self, events: &mut Vec<Event>) {
        loop {
            match self.events.try_recv() {
                Ok(event) => events.push(event),
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => {
                    self.is_closed = true;
                    return;
                }
            }
        }
    }
}

/// A recording that is replayed.
pub struct RecordingSource {
    replay: Replay,
    error: Option<ReplayError>,
}

impl RecordingSource {
    /// Of a replay that has begun.
    pub const fn new(replay: Replay) -> Self {
        Self { replay, error: None }
    }

    /// When the recording begins, on the clock of its events.
    pub fn origin(&self) -> Time {
        self.replay.origin()
    }
}

impl Source {
    /// Fetches what has arrived, by arrival, and the changes of faults. A recording that is replayed as fast as it goes gives what arrived up
    /// to `until`.
    pub fn collect(&mut self, until: Time, events: &mut Vec<Event>, faults: &mut Vec<FaultChange>) {
        match self {
            Self::Devices(devices) => devices.collect(events, faults),
            Self::Recording(recording) => {
                // An error of the recording ends the run; what came before it is still shown.
                if let Err(e) = recording.replay.collect(until, events) {
                    recording.error = Some(e);
                }
            }
            Self::Live(live) => live.collect(until, events),
            Self::Feed(feed) => feed.collect(events),
        }
    }

    /// Turns a simulated gun to the right and upwards, in widths of the picture. Real guns are turned by hand.
    pub fn turn(&self, turn: [f64; 2]) {
        if let Self::Live(live) = self {
            live.turn(turn);
        }
    }

    /// Shows a simulated gun the world: its gunner aims by it, and its mount feels the rounds.
    pub fn watch(&mut self, world: &World) {
        if let Self::Live(live) = self {
            live.watch(world);
        }
    }

    /// Parts that it has, or simulates.
    pub fn parts(&self) -> Vec<DevicePart> {
        match self {
            Self::Devices(devices) => devices.parts(),
            Self::Recording(_) | Self::Live(_) | Self::Feed(_) => {
                use DevicePart as P;
                vec![P::Camera, P::Imu, P::Registration, P::Trigger, P::Storage, P::Gpu, P::Computer]
            }
        }
    }

    /// Whether no further event will come.
    pub fn has_ended(&self) -> bool {
        match self {
            Self::Devices(_) => false,
            Self::Recording(recording) => recording.error.is_some() || recording.replay.finished(),
            Self::Live(live) => live.has_ended(),
            Self::Feed(feed) => feed.is_closed,
        }
    }

    /// Why the recording cannot be read further, once.
    pub fn take_error(&mut self) -> Option<ReplayError> {
        match self {
            Self::Devices(_) | Self::Feed(_) => None,
            Self::Recording(recording) => recording.error.take(),
            Self::Live(live) => live.take_error(),
        }
    }

    /// Where the camera really was at a picture's mid-exposure; only recordings with truth know.
    pub fn truth_at(&self, mid_exposure: Time) -> Option<CameraPose> {
        match self {
            Self::Devices(_) | Self::Feed(_) => None,
            Self::Recording(recording) => recording.replay.truth_at(mid_exposure),
            Self::Live(live) => live.truth_at(mid_exposure),
        }
    }

    /// Size of the LCD that shows now.
    pub fn lcd_size(&self) -> Option<(u32, u32)> {
        match self {
            Self::Devices(devices) => devices.lcd_size(),
            Self::Recording(_) | Self::Live(_) | Self::Feed(_) => None,
        }
    }

    /// Vertical blanks at which frames came on the LCD, with their period in nanoseconds.
    pub fn flips(&self) -> impl Iterator<Item = (Time, i64)> + '_ {
        match self {
            Self::Devices(devices) => Some(devices.flips()),
            Self::Recording(_) | Self::Live(_) | Self::Feed(_) => None,
        }
        .into_iter()
        .flatten()
    }

    /// The wall clock, told once, when it is known to be set.
    pub fn clock_set(&self) -> Option<WallTime> {
        match self {
            Self::Devices(devices) => devices.health().clock_set(),
            Self::Recording(_) | Self::Live(_) | Self::Feed(_) => None,
        }
    }

    /// The thread that has given no sign of life for too long, if any.
    pub fn hanging(&self, now: Time) -> Option<&'static str> {
        match self {
            Self::Devices(devices) => devices.hanging(now),
            Self::Recording(_) | Self::Live(_) | Self::Feed(_) => None,
        }
    }

    /// Lights the lamps that belong to `status`.
    pub fn light(&mut self, status: &Status) {
        if let Self::Devices(devices) = self {
            devices.light(status);
        }
    }

    /// Names and counters for the summary.
    pub fn counters(&self) -> Vec<(&'static str, u64)> {
        match self {
            Self::Devices(devices) => devices.counters(),
            Self::Recording(recording) => replay_counters(&recording.replay.stats()),
            Self::Live(live) => live.counters(),
            Self::Feed(_) => Vec::new(),
        }
    }

    /// Ends all threads of the source.
    pub fn stop(self) -> Result<(), ReplayError> {
        match self {
            Self::Devices(devices) => devices.stop(),
            Self::Recording(recording) => drop(recording.replay.stop()?),
            Self::Live(live) => live.stop()?,
            Self::Feed(_) => {}
        }
        Ok(())
    }
}

fn replay_counters(r: &ReplayStats) -> Vec<(&'static str, u64)> {
    vec![
        ("imu_not_finite", r.imu.not_finite),
        ("imu_bad_checksums", r.imu.bad_crc),
        ("imu_skipped_bytes", r.imu.skipped_bytes),
        ("imu_overwritten", r.imu_overflow),
        ("pictures_other_size", r.frames.other_size),
        ("pictures_undecodable", r.frames.undecodable),
        ("pictures_overwritten", r.frames_overwritten),
        ("pictures_late", r.frames_late),
        ("faults_injected", r.faults),
        ("trigger_edges", r.triggers),
    ]
}
