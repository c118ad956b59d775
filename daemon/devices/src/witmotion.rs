//! Witmotion's standard protocol (WT901 specification sheet, "Communication Protocol"): packets of eleven bytes, `55`, a kind
//! from `50` to `5A`, four little-endian i16, the sum of the ten bytes before. A measurement is a group of packets that follow
//! one another by kind: acceleration `51`, rate `52`, angles `53`, quaternion `59`. There is no counter, and the clock of `50`
//! counts milliseconds of a calendar: time is made from arrivals.
//!
//! Axes: x right, y forward, z up; reference east-north-up; angles about z, then y, then x.

use glam::{DQuat, DVec3};

use crate::{
    framing::{Framing, Look},
    imu::{
        axes::{G, SWAP, from_yaw_pitch_roll, unit},
        reading::{Reading, Stamp},
    },
};

/// Bytes of a packet.
const PACKET_BYTES: usize = 11;

/// The framing of the standard protocol.
#[derive(Debug)]
pub(crate) struct Standard;

/// A packet's kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Kind(u8);

impl Framing for Standard {
    type Head = Kind;
    const SYNC: u8 = 0x55;
    const MAX_BYTES: usize = PACKET_BYTES;
    const WEAK: bool = true;

    fn look(bytes: &[u8]) -> Look<Kind> {
        match bytes.get(1) {
            None => Look::Incomplete,
            Some(&kind @ 0x50..=0x5a) => Look::Packet { head: Kind(kind), bytes: PACKET_BYTES },
            Some(_) => Look::Invalid,
        }
    }

    fn intact(packet: &[u8]) -> bool {
        packet
            .split_last()
            .is_some_and(|(&sum, body)| body.iter().fold(0u8, |sum, &b| sum.wrapping_add(b)) == sum)
    }
}

/// A packet in the unit's own units and axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Packet {
    /// Specific force, g.
    Accel([f64; 3]),
    /// Angular rate, degrees a second.
    Rate([f64; 3]),
    /// Roll, pitch and yaw, degrees.
    Angles([f64; 3]),
    /// Attitude of the body with respect to east-north-up, scalar first.
    Quaternion([f64; 4]),
    /// Time, field, ports, position.
    Other,
}

impl Packet {
    /// Reads a whole packet.
    pub(crate) fn parse(packet: &[u8], kind: Kind) -> Option<Self> {
        let (words, _) = packet.get(2..10)?.as_chunks::<2>();
        let shares: [f64; 4] = words.first_chunk::<4>()?.map(|w| f64::from(i16::from_le_bytes(w)) / 32_768.0);
        let [x, y, z, _] = shares;
        Some(match kind.0 {
            0x51 => Self::Accel([x, y, z].map(|v| v * 16.0)),
            0x52 => Self::Rate([x, y, z].map(|v| v * 2000.0)),
            0x53 => Self::Angles([x, y, z].map(|v| v * 180.0)),
            0x59 => Self::Quaternion(shares),
            _ => Self::Other,
        })
    }
}

/// The measurement that is being put together, and which packet of it comes last.
#[derive(Debug, Default)]
pub(crate) struct Unit {
    accel: Option<DVec3>,
    rate: Option<DVec3>,
    attitude: Option<DQuat>,
    /// Of the group before: it had a quaternion, it had angles.
    quaternions: bool,
    angles: bool,
    seen_quaternion: bool,
    seen_angles: bool,
}

impl Unit {
    /// What the packet completes, in our axes: right, forward, up become forward, right, down. Angles of a unit that sends
    /// quaternions as well are left aside.
    pub(crate) fn reading(&mut self, packet: &Packet) -> Option<Reading> {
        let body = |v: [f64; 3], scale: f64| SWAP * (DVec3::from_array(v) * scale);
        match *packet {
            Packet::Accel(v) => {
                // The first of a group. Where the one before had no attitude, that is no longer waited for.
                (self.quaternions, self.angles) = (self.seen_quaternion, self.seen_angles);
                (self.seen_quaternion, self.seen_angles) = (false, false);
                (self.accel, self.rate, self.attitude) = (Some(body(v, G)), None, None);
            }
            Packet::Rate(v) => self.rate = Some(body(v, 1f64.to_radians())),
            Packet::Angles([roll, pitch, yaw]) => {
                self.seen_angles = true;
                if !self.quaternions {
                    let angles = [yaw, pitch, roll].map(f64::to_radians);
                    self.attitude = Some(from_yaw_pitch_roll(angles) * SWAP);
                }
            }
            Packet::Quaternion([w, x, y, z]) => {
                self.seen_quaternion = true;
                self.attitude = Some(unit(DQuat::from_xyzw(x, y, z, w)) * SWAP);
            }
            Packet::Other => return None,
        }
        let waits = self.attitude.is_none() && (self.quaternions || self.angles);
        if waits || self.accel.is_none() || (self.rate.is_none() && self.attitude.is_none()) {
            return None;
        }
        // A unit whose gyro is off is known by the attitude that comes without a rate before it.
        Some(Reading {
            rate: self.rate.take(),
            accel: self.accel.take(),
            world_from_imu: self.attitude.take(),
            ..Reading::at(Stamp::Arrival)
        })
    }
}

#[cfg(test)]
#[path = "witmotion_tests.rs"]
mod tests;
