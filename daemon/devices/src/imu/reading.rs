//! Measurement in one packet of any format, in our axes and units.

use std::fmt;

use glam::{DQuat, DVec3};

/// When a packet's measurement was made, as the unit tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ReadingStamp {
    /// By its clock, nanoseconds since its start-up, unwrapped.
    Device {
        /// Nanoseconds.
        ns: i64,
    },
    /// By a counter of packets, unwrapped.
    Count {
        /// The counter.
        n: i64,
    },
    /// Not at all.
    Arrival,
}

/// Measurement of the body's motion: axes x forward, y right, z down; world x east, y north, z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reading {
    /// When.
    pub(crate) stamp: ReadingStamp,
    /// Angular rate, rad/s.
    pub(crate) rate: Option<DVec3>,
    /// Specific force, m/s^2.
    pub(crate) accel: Option<DVec3>,
    /// Attitude.
    pub(crate) world_from_imu: Option<DQuat>,
}

impl Reading {
    /// A reading that says nothing yet.
    pub(crate) const fn at(stamp: ReadingStamp) -> Self {
        Self { stamp, rate: None, accel: None, world_from_imu: None }
    }
}

/// Fields that a unit sends, of those that the trainer uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fields {
    /// A clock of its own.
    pub clock: bool,
    /// A counter of its packets.
    pub counter: bool,
    /// Angular rate.
    pub rate: bool,
    /// Specific force.
    pub accel: bool,
    /// Attitude.
    pub attitude: bool,
}

impl Fields {
    /// Remembers what `reading` has.
    pub(crate) fn note(&mut self, reading: &Reading) {
        self.clock |= matches!(reading.stamp, ReadingStamp::Device { .. });
        self.counter |= matches!(reading.stamp, ReadingStamp::Count { .. });
        self.rate |= reading.rate.is_some();
        self.accel |= reading.accel.is_some();
        self.attitude |= reading.world_from_imu.is_some();
    }

    /// The fields without which no sample can be made.
    pub(crate) fn missing(self) -> Vec<&'static str> {
        let rate = self.rate || self.attitude;
        [(!rate).then_some("angular rate"), (!self.accel).then_some("acceleration")]
            .into_iter()
            .flatten()
            .collect()
    }
}

/// The fields that it sends, then those that it lacks and how they are made instead.
impl fmt::Display for Fields {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { clock, counter, rate, accel, attitude } = *self;
        let has = [
            (clock, "device time"),
            (counter && !clock, "packet counter"),
            (rate, "angular rate"),
            (accel, "acceleration"),
            (attitude, "attitude"),
        ];
        let has: Vec<_> = has.into_iter().filter_map(|(is, name)| is.then_some(name)).collect();
        let lacks = [
            (!clock && counter, "device time (made from its counter)"),
            (!clock && !counter, "device time (made from arrivals)"),
            (!rate && attitude, "angular rate (made from its attitudes)"),
            (!rate && !attitude, "angular rate"),
            (!accel, "acceleration"),
            (!attitude, "attitude (integrated from its rate)"),
        ];
        let lacks: Vec<_> = lacks.into_iter().filter_map(|(is, name)| is.then_some(name)).collect();
        let none = "nothing that the trainer uses".to_owned();
        write!(f, "sends {}", if has.is_empty() { none } else { has.join(", ") })?;
        if lacks.is_empty() { Ok(()) } else { write!(f, "; lacks {}", lacks.join(", ")) }
    }
}
