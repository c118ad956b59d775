//! Witmotion's standard protocol (WT901 specification sheet, "Communication Protocol"): packets of eleven bytes, `55`, a kind
//! from `50` to `5A`, four little-endian i16, the sum of the ten bytes before. A measurement is a group of packets that follow
//! one another by kind: acceleration `51`, rate `52`, angles `53`, quaternion `59`. There is no counter, and the clock of `50`
//! counts milliseconds of a calendar: time is made from arrivals.
//!
//! Axes: x right, y forward, z up; reference east-north-up; angles about z, then y, then x.

use glam::{DQuat, DVec3};

use super::{ImuCodec, PATIENCE_PARTS};
use crate::{
    framing::{FoundPacket, Framing, PacketLook, byte_sum},
    imu::{
        axes::{G, SWAP, from_yaw_pitch_roll, unit},
        reading::{Reading, ReadingStamp},
    },
};

/// Bytes of a packet.
const PACKET_BYTES: usize = 11;

/// A packet's kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct WitmotionKind(u8);

impl Framing for WitmotionCodec {
    type Head = WitmotionKind;
    const SYNC: u8 = 0x55;
    const MAX_BYTES: usize = PACKET_BYTES;
    const WEAK: bool = true;

    fn look(bytes: &[u8]) -> PacketLook<WitmotionKind> {
        match bytes.get(1) {
            None => PacketLook::Incomplete,
            Some(&kind @ 0x50..=0x5a) => {
                PacketLook::Packet { head: WitmotionKind(kind), bytes: PACKET_BYTES }
            }
            Some(_) => PacketLook::Invalid,
        }
    }

    fn intact(packet: &[u8]) -> bool {
        packet.split_last().is_some_and(|(&sum, body)| byte_sum(body) == sum)
    }
}

/// A packet in the unit's own units and axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum WitmotionPacket {
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

impl WitmotionPacket {
    /// Reads a whole packet.
    pub(crate) fn parse(packet: &[u8], kind: WitmotionKind) -> Option<Self> {
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

/// The standard protocol: the measurement that is being put together, and which packet of it comes last.
#[derive(Debug, Default)]
pub(crate) struct WitmotionCodec {
    accel: Option<DVec3>,
    rate: Option<DVec3>,
    attitude: Option<DQuat>,
    /// Of the group before: it had a quaternion, it had angles.
    quaternions: bool,
    angles: bool,
    seen_quaternion: bool,
    seen_angles: bool,
}

impl ImuCodec for WitmotionCodec {
    const KEY: &'static str = "witmotion";
    const NAME: &'static str = "Witmotion";
    const REMEDY: &'static str = "switch acceleration, rate and quaternion on in its output content";
    const PROOF_PACKETS: usize = 6;
    const PATIENCE: u32 = PATIENCE_PARTS;

    fn reading(&mut self, packet: &FoundPacket<'_, WitmotionKind>) -> Option<Reading> {
        self.take(&WitmotionPacket::parse(packet.bytes, packet.head)?)
    }

    /// Kind and data.
    fn wrap(content: &[u8]) -> Vec<u8> {
        let mut bytes = [&[0x55], content].concat();
        bytes.resize(PACKET_BYTES - 1, 0);
        bytes[1] = 0x50 + bytes[1] % 11;
        bytes.push(byte_sum(&bytes));
        bytes
    }
}

impl WitmotionCodec {
    /// The measurement that the packet completes, in our axes: right, forward, up become forward, right, down. Angles of a unit that sends
    /// quaternions as well are left aside.
    fn take(&mut self, packet: &WitmotionPacket) -> Option<Reading> {
        let body = |v: [f64; 3], scale: f64| SWAP * (DVec3::from_array(v) * scale);
        match *packet {
            WitmotionPacket::Accel(v) => {
                // The first of a group. Where the one before had no attitude, that is no longer waited for.
                (self.quaternions, self.angles) = (self.seen_quaternion, self.seen_angles);
                (self.seen_quaternion, self.seen_angles) = (false, false);
                (self.accel, self.rate, self.attitude) = (Some(body(v, G)), None, None);
            }
            WitmotionPacket::Rate(v) => self.rate = Some(body(v, 1f64.to_radians())),
            WitmotionPacket::Angles([roll, pitch, yaw]) => {
                self.seen_angles = true;
                if !self.quaternions {
                    let angles = [yaw, pitch, roll].map(f64::to_radians);
                    self.attitude = Some(from_yaw_pitch_roll(angles) * SWAP);
                }
            }
            WitmotionPacket::Quaternion([w, x, y, z]) => {
                self.seen_quaternion = true;
                self.attitude = Some(unit(DQuat::from_xyzw(x, y, z, w)) * SWAP);
            }
            WitmotionPacket::Other => return None,
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
            ..Reading::at(ReadingStamp::Arrival)
        })
    }
}

#[cfg(test)]
mod tests;
