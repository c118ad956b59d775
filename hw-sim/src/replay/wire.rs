//! What the simulated hardware puts on its wires, faults included: the same for both modes.

use std::sync::Arc;

use bowwave_core::{
    act::TraineeAct,
    event::{ImuSample, Mark, TriggerEdge},
    order::InstructorOrder,
    time::Time,
};
use bowwave_devices::vectornav::CommonOutput;
use bowwave_record::{Entry, FrameEntry, PictureEntry, RecordError};

use super::laps::Laps;
use crate::fault::{FaultPlan, Injector, Picture};

/// Something on a wire.
pub(super) enum Item {
    /// Bytes on the inertial unit's line.
    Bytes {
        /// When the last of them reaches the host.
        due: Time,
        /// A packet, and what precedes it.
        bytes: Vec<u8>,
    },
    /// A picture as it is recorded.
    Frame(RecordedPicture),
    /// A trigger edge.
    Trigger(TriggerEdge),
    /// Bytes on the line of the ship's instruments.
    Ship {
        /// When the last of them reaches the host.
        due: Time,
        /// A line.
        bytes: Vec<u8>,
    },
    /// The operator's press.
    Mark(Mark),
    Act(TraineeAct),
    Order(InstructorOrder),
}

/// A picture as it is recorded.
pub(super) enum RecordedPicture {
    /// As JPEG.
    Coded(FrameEntry),
    /// As pixels.
    Raw(PictureEntry),
}

impl RecordedPicture {
    /// When it reaches the host.
    pub(super) const fn arrival(&self) -> Time {
        match self {
            Self::Coded(frame) => frame.arrival,
            Self::Raw(picture) => picture.arrival,
        }
    }
}

/// Items by replay time.
pub(super) struct Wire {
    laps: Laps,
    origin: Time,
    injector: Injector,
    unsendable: u64,
}

/// What was put on the wires.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WireCounters {
    pub(super) rounds: u64,
    pub(super) altered: u64,
    pub(super) unsendable: u64,
}

impl Wire {
    pub(super) fn new(laps: Laps, origin: Time, faults: FaultPlan) -> Self {
        Self { laps, origin, injector: Injector::new(faults), unsendable: 0 }
    }

    /// Whether there is a ship's line at all.
    pub(super) const fn has_ship(&self) -> bool {
        self.laps.has_ship()
    }

    pub(super) const fn counters(&self) -> WireCounters {
        WireCounters {
            rounds: self.laps.rounds(),
            altered: self.injector.altered(),
            unsendable: self.unsendable,
        }
    }

    fn bytes(&mut self, sample: ImuSample) -> Option<Item> {
        let due = sample.arrival;
        let since = due.ns_since(self.origin);
        let sent = self.injector.sample(sample, since)?;
        let Some(output) = CommonOutput::from_sample(&sent) else {
            if self.unsendable == 0 {
                log::warn!(
                    "{}: a sample of the inertial unit at {due} has a device time before the unit's start-up and cannot be \
                     sent; such samples are left out",
                    self.laps.path().display()
                );
            }
            self.unsendable += 1;
            return None;
        };
        let mut bytes = Vec::with_capacity(CommonOutput::MAX_BYTES);
        self.injector.garbage(since, &mut bytes);
        output.encode(&mut bytes);
        Some(Item::Bytes { due, bytes })
    }

    fn frame(&mut self, frame: FrameEntry) -> Option<Item> {
        let since = frame.arrival.ns_since(self.origin);
        match self.injector.picture(&frame.jpeg, self.laps.picture(), since) {
            Picture::Same => Some(Item::Frame(RecordedPicture::Coded(frame))),
            Picture::None => None,
            Picture::Other(jpeg) => {
                Some(Item::Frame(RecordedPicture::Coded(FrameEntry { jpeg: Arc::from(jpeg), ..frame })))
            }
        }
    }
}

impl Iterator for Wire {
    type Item = Result<Item, RecordError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let item = match self.laps.next()? {
                Ok(Entry::Imu(sample)) => self.bytes(sample),
                Ok(Entry::Frame(frame)) => self.frame(frame),
                Ok(Entry::Trigger(edge)) => Some(Item::Trigger(edge)),
                Ok(Entry::Ship(line)) => {
                    Some(Item::Ship { due: line.arrival, bytes: line.sentence.into_bytes() })
                }
                Ok(Entry::Mark(mark)) => Some(Item::Mark(mark)),
                Ok(Entry::Act(act)) => Some(Item::Act(act)),
                Ok(Entry::Order(order)) => Some(Item::Order(order)),
                Ok(Entry::Picture(picture)) => Some(Item::Frame(RecordedPicture::Raw(picture))),
                // Comes over no wire: known afterwards, or of the run that was recorded.
                Ok(
                    Entry::Truth(_)
                    | Entry::Pose(_)
                    | Entry::ShipValues(_)
                    | Entry::ShipFix(_)
                    | Entry::Fault(_)
                    | Entry::Tick(_),
                ) => None,
                Err(error) => return Some(Err(error)),
            };
            if let Some(item) = item {
                return Some(Ok(item));
            }
        }
    }
}
