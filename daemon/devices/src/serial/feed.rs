//! Content of a serial line, as far as its reader must know.

use std::path::Path;

use bowwave_core::{event::Event, fault::Fault, time::Time};

use crate::{queue::NewestSender, report::Reporter};

/// How the device on a line is called, which faults tell of it, and how fast it speaks.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct LineKind {
    /// Its name in messages.
    pub(super) name: &'static str,
    /// Names of its threads.
    pub(super) threads: [&'static str; 2],
    /// It is gone.
    pub(super) lost: Fault,
    /// A kernel call of its reader does not return.
    pub(super) blocked: Fault,
    /// Bytes come that are no packets.
    pub(super) baud: Fault,
    /// It came back under another name.
    pub(super) renumbered: Fault,
    /// A line that carries nothing for this long is silent, nanoseconds.
    pub(super) silent_ns: i64,
    /// How long a rate is tried: several packets of the slowest device.
    pub(super) dwell_ns: i64,
    /// A line silent for this long during the scan is not garbled but dead.
    pub(super) dead_ns: i64,
    /// How long a port is listened to, where any port may be the right one, before the next one is tried.
    pub(super) roam_ns: i64,
}

/// The inertial unit: forty packets a second or more.
pub(super) static IMU: LineKind = LineKind {
    name: "inertial unit",
    threads: ["imu-serial", "imu-watch"],
    lost: Fault::ImuLost,
    blocked: Fault::ImuBlocked,
    baud: Fault::ImuBaud,
    renumbered: Fault::ImuRenumbered,
    silent_ns: 100_000_000,
    dwell_ns: 300_000_000,
    dead_ns: 1_000_000_000,
    roam_ns: 1_500_000_000,
};

/// The ship's instruments: a line a second or more.
pub(super) static SHIP: LineKind = LineKind {
    name: "ship feed",
    threads: ["ship-serial", "ship-watch"],
    lost: Fault::ShipLost,
    blocked: Fault::ShipBlocked,
    baud: Fault::ShipBaud,
    renumbered: Fault::ShipRenumbered,
    silent_ns: 3_000_000_000,
    dwell_ns: 2_500_000_000,
    dead_ns: 6_000_000_000,
    roam_ns: 6_000_000_000,
};

/// The codec of a line, with judgement of what is said on it.
pub(super) trait LineFeed: Send + 'static {
    /// Its report to its owner.
    type Report: Clone + Default + Send + std::fmt::Debug;

    /// The kind of device.
    const KIND: &'static LineKind;

    /// Takes bytes and puts what they complete into `queue`. Gives how many packets that were, those of no concern included.
    fn take(&mut self, bytes: &[u8], arrival: Time, queue: &mut NewestSender<Event>) -> u64;

    /// The line was opened, or its rate changed: bytes that follow have nothing to do with those before.
    fn restart(&mut self);

    /// Nothing was heard since the last packets: they say nothing of the present.
    fn forget(&mut self);

    /// Raises and clears what is known from what the device on `path` said.
    fn judge(&mut self, path: &Path, now: Time, reporter: &Reporter);

    /// How it does.
    fn report(&self) -> Self::Report;
}
