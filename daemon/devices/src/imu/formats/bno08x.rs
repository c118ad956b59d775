//! UART-RVC of the BNO08x (data sheet 1000-3927, section 1.3.5.2): `AA AA`, index, yaw, pitch and roll in hundredths of a
//! degree, acceleration in thousandths of g, three reserved bytes, the sum of all after the two `AA`; 100 a second at 115200
//! baud. Numbers are little-endian. There is no gyro and no clock: rates come from successive angles, time from the index.
//!
//! Axes: acceleration is measured along x right, y forward, z up. The data sheet's own example fixes how the angles belong to
//! these: its roll turns about y (forward) and its pitch about x, for only then is its acceleration gravity (to 0.05
//! degrees), applied in the order yaw, pitch, roll. Yaw is zero where the unit faced at its reset and counts
//! counter-clockwise seen from above, as all its rotations (section 4); no recording that we have shows that sign.

use glam::{DQuat, DVec3};

use super::ImuCodec;
use crate::{
    framing::{FoundPacket, Framing, PacketLook, byte_sum},
    imu::{
        axes::{G, SWAP},
        reading::{Reading, ReadingStamp},
        unwrap::Unwrap,
    },
};

/// Bytes of a packet.
const PACKET_BYTES: usize = 19;

/// UART-RVC, and the count of its packets.
#[derive(Debug, Default)]
pub(crate) struct Bno08xCodec {
    index: Unwrap<8>,
}

impl Framing for Bno08xCodec {
    type Head = ();
    const SYNC: u8 = 0xaa;
    const MAX_BYTES: usize = PACKET_BYTES;
    const WEAK: bool = true;

    fn look(bytes: &[u8]) -> PacketLook<()> {
        match bytes.get(1) {
            None => PacketLook::Incomplete,
            Some(0xaa) => PacketLook::Packet { head: (), bytes: PACKET_BYTES },
            Some(_) => PacketLook::Invalid,
        }
    }

    /// The byte sum, and angles within their ranges: eight bits alone are little.
    fn intact(packet: &[u8]) -> bool {
        let Some((&sum, body)) = packet.split_last() else { return false };
        let right = body.get(2..).map(byte_sum) == Some(sum);
        right
            && Bno08xPacket::parse(packet).is_some_and(|p| {
                let [yaw, pitch, roll] = p.yaw_pitch_roll_deg.map(f64::abs);
                yaw <= 180.0 && pitch <= 90.0 && roll <= 180.0
            })
    }
}

/// A packet in the unit's own units and axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bno08xPacket {
    /// Counts packets.
    pub(crate) index: u8,
    /// Yaw, pitch and roll, degrees.
    pub(crate) yaw_pitch_roll_deg: [f64; 3],
    /// Specific force, g.
    pub(crate) accel_g: [f64; 3],
}

impl Bno08xPacket {
    /// Reads a whole packet.
    pub(crate) fn parse(packet: &[u8]) -> Option<Self> {
        let &index = packet.get(2)?;
        let (words, _) = packet.get(3..15)?.as_chunks::<2>();
        let &[yaw, pitch, roll, x, y, z] = words.first_chunk()?;
        let number = |word| f64::from(i16::from_le_bytes(word));
        Some(Self {
            index,
            yaw_pitch_roll_deg: [yaw, pitch, roll].map(|w| number(w) / 100.0),
            accel_g: [x, y, z].map(|w| number(w) / 1000.0),
        })
    }
}

impl ImuCodec for Bno08xCodec {
    const KEY: &'static str = "bno08x-rvc";
    const NAME: &'static str = "BNO08x UART-RVC";
    const REMEDY: &'static str = "power-cycle it";
    const PROOF_PACKETS: usize = 5;
    const PERIOD_NS: Option<u32> = Some(10_000_000);

    fn reading(&mut self, packet: &FoundPacket<'_, ()>) -> Option<Reading> {
        Some(self.convert(&Bno08xPacket::parse(packet.bytes)?))
    }

    fn wrap(content: &[u8]) -> Vec<u8> {
        let mut body = content.to_vec();
        body.resize(PACKET_BYTES - 3, 0);
        [&[0xaa, 0xaa], &body[..], &[byte_sum(&body)]].concat()
    }
}

impl Bno08xCodec {
    /// A packet in our axes: right, forward, up become forward, right, down. Where yaw is zero the unit is taken to face north.
    fn convert(&mut self, packet: &Bno08xPacket) -> Reading {
        let [yaw, pitch, roll] = packet.yaw_pitch_roll_deg.map(f64::to_radians);
        let world_from_unit =
            DQuat::from_rotation_z(yaw) * DQuat::from_rotation_x(pitch) * DQuat::from_rotation_y(roll);
        Reading {
            accel: Some(SWAP * (DVec3::from_array(packet.accel_g) * G)),
            world_from_imu: Some(world_from_unit * SWAP),
            ..Reading::at(ReadingStamp::Count { n: self.index.next(u64::from(packet.index)) })
        }
    }
}

#[cfg(test)]
mod tests;
