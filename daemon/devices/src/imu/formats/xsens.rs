//! Xsens MTData2 (MT Low Level Communication Protocol Documentation, "MTData2"): `FA`, bus id `FF`, `36`, a length of one byte (or
//! `FF` and a big-endian one of two), items of a big-endian id, a length and big-endian numbers, a byte that makes the sum of
//! all bytes after `FA` zero.
//!
//! Body axes: x forward, y left, z up as printed on the unit, whatever the reference. The reference is the low nibble of an
//! item's id, bits 2 and 3: 0 east-north-up, 4 north-east-down, 8 north-west-up (footnote of the orientation group; MTi User
//! Manual, "NWU and NED reference coordinate frames"); bits 0 and 1 are the numbers' precision.

use glam::{DQuat, DVec3};

use super::ImuCodec;
use crate::{
    framing::{FoundPacket, Framing, PacketLook, byte_sum},
    imu::{
        axes::{ENU_FROM_NWU, ROLL_OVER, SWAP, from_yaw_pitch_roll, unit},
        reading::{Reading, ReadingStamp},
        unwrap::Unwrap,
    },
};

const SYNC: u8 = 0xfa;
/// Bus id of a master.
const MASTER: u8 = 0xff;
/// The message that carries measurements.
const MTDATA2: u8 = 0x36;
/// The longest payload that the protocol knows, bytes.
const PAYLOAD_MAX_BYTES: usize = 2048;

/// Kind of a message, and its payload's place and length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct XsensHead {
    message: u8,
    payload_at: usize,
    payload_bytes: usize,
}

impl Framing for XsensCodec {
    type Head = XsensHead;
    const SYNC: u8 = SYNC;
    const MAX_BYTES: usize = PAYLOAD_MAX_BYTES + 7;
    const WEAK: bool = true;

    fn look(bytes: &[u8]) -> PacketLook<XsensHead> {
        // A unit on a line of its own is its bus's master.
        match bytes.get(1) {
            None => return PacketLook::Incomplete,
            Some(&MASTER) => {}
            Some(_) => return PacketLook::Invalid,
        }
        let (Some(&message), Some(&short)) = (bytes.get(2), bytes.get(3)) else {
            return PacketLook::Incomplete;
        };
        let (payload_at, payload_bytes) = match (short, bytes.get(4..6)) {
            (0xff, None) => return PacketLook::Incomplete,
            (0xff, Some(&[high, low])) => (6, usize::from(u16::from_be_bytes([high, low]))),
            _ => (4, usize::from(short)),
        };
        if payload_bytes > PAYLOAD_MAX_BYTES {
            return PacketLook::Invalid;
        }
        let head = XsensHead { message, payload_at, payload_bytes };
        PacketLook::Packet { head, bytes: payload_at + payload_bytes + 1 }
    }

    /// The byte sum, and for measurements that the items fill the payload: eight bits alone are little.
    fn intact(packet: &[u8]) -> bool {
        let sum = packet.get(1..).map_or(0, byte_sum);
        let PacketLook::Packet { head, .. } = Self::look(packet) else { return false };
        sum == 0 && (head.message != MTDATA2 || items(packet, head).all(|item| item.is_some()))
    }
}

/// The items of a message: id and data. `None` once where they do not fill the payload.
fn items(packet: &[u8], head: XsensHead) -> impl Iterator<Item = Option<(u16, &[u8])>> {
    let mut rest = packet.get(head.payload_at..head.payload_at + head.payload_bytes).unwrap_or_default();
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let item = rest.split_first_chunk().and_then(|(&[high, low, bytes], behind)| {
            let (data, behind) = behind.split_at_checked(usize::from(bytes))?;
            rest = behind;
            Some((u16::from_be_bytes([high, low]), data))
        });
        if item.is_none() {
            rest = &[];
        }
        Some(item)
    })
}

/// The measurements of one message, in the unit's own units and axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct XsensMessage {
    /// XsensMessage counter.
    pub(crate) counter: Option<u16>,
    /// Fine sample time, ticks of 100 us.
    pub(crate) sample_time_fine: Option<u32>,
    /// Attitude, scalar first, and the low nibble of its id.
    pub(crate) quaternion: Option<([f64; 4], u16)>,
    /// Roll, pitch and yaw, degrees, and the low nibble of their id.
    pub(crate) euler_deg: Option<([f64; 3], u16)>,
    /// Specific force, m/s^2.
    pub(crate) accel: Option<[f64; 3]>,
    /// Angular rate, rad/s.
    pub(crate) rate: Option<[f64; 3]>,
}

impl XsensMessage {
    /// Reads a whole message; `None` for one that carries no measurements.
    pub(crate) fn parse(packet: &[u8], head: XsensHead) -> Option<Self> {
        if head.message != MTDATA2 {
            return None;
        }
        let mut parsed = Self::default();
        for (id, data) in items(packet, head).flatten() {
            let low = id & 0x0f;
            match id & 0xfff0 {
                0x1020 => parsed.counter = data.try_into().ok().map(u16::from_be_bytes),
                0x1060 => parsed.sample_time_fine = data.try_into().ok().map(u32::from_be_bytes),
                0x2010 => parsed.quaternion = numbers(data, low).map(|q| (q, low)),
                0x2030 => parsed.euler_deg = numbers(data, low).map(|e| (e, low)),
                // The high-rate items are the same quantities before the filter's own rate.
                0x4020 => parsed.accel = numbers(data, low),
                0x4040 if parsed.accel.is_none() => parsed.accel = numbers(data, low),
                0x8020 => parsed.rate = numbers(data, low),
                0x8040 if parsed.rate.is_none() => parsed.rate = numbers(data, low),
                _ => {}
            }
        }
        Some(parsed)
    }
}

/// `N` numbers of the precision that an id's low nibble states; `None` if the length is another.
fn numbers<const N: usize>(data: &[u8], low: u16) -> Option<[f64; N]> {
    let size = [4, 4, 6, 8][usize::from(low & 3)];
    if data.len() != N * size {
        return None;
    }
    let mut values = [0.0; N];
    for (value, bytes) in values.iter_mut().zip(data.chunks_exact(size)) {
        *value = match (low & 3, bytes) {
            (0, &[a, b, c, d]) => f64::from(f32::from_be_bytes([a, b, c, d])),
            // Fixed point with 20 bits behind the point.
            (1, &[a, b, c, d]) => f64::from(i32::from_be_bytes([a, b, c, d])) / f64::from(1 << 20),
            // Fixed point: 32 bits behind the point come first, then 16 before it.
            (2, &[a, b, c, d, high, low]) => {
                let fraction = f64::from(u32::from_be_bytes([a, b, c, d]));
                f64::from(i16::from_be_bytes([high, low])) + fraction * 2f64.powi(-32)
            }
            (3, bytes) => f64::from_be_bytes(bytes.try_into().ok()?),
            _ => return None,
        };
    }
    Some(values)
}

/// East-north-up from the reference that an id's low nibble states; `None` for the one that is not assigned.
fn world_from_reference(low: u16) -> Option<DQuat> {
    match low & 0x0c {
        0x0 => Some(DQuat::IDENTITY),
        0x4 => Some(SWAP),
        0x8 => Some(ENU_FROM_NWU),
        _ => None,
    }
}

/// All messages that a single unit sends: its clock and its counter.
#[derive(Debug, Default)]
pub(crate) struct XsensCodec {
    fine: Unwrap<32>,
    counter: Unwrap<16>,
}

impl ImuCodec for XsensCodec {
    const KEY: &'static str = "xsens";
    const NAME: &'static str = "Xsens MTData2";
    const REMEDY: &'static str = "add it to its output configuration (1060, 2010, 4020, 8020)";
    const PROOF_PACKETS: usize = 3;

    fn reading(&mut self, packet: &FoundPacket<'_, XsensHead>) -> Option<Reading> {
        Some(self.convert(&XsensMessage::parse(packet.bytes, packet.head)?))
    }

    /// The payload of a measurement, at most 254 bytes.
    fn wrap(content: &[u8]) -> Vec<u8> {
        let payload = &content[..content.len().min(254)];
        let body = [&[MASTER, MTDATA2, payload.len() as u8], payload].concat();
        [&[SYNC], &body[..], &[byte_sum(&body).wrapping_neg()]].concat()
    }
}

impl XsensCodec {
    /// The measurements in our axes: the body's y and z are turned over, the reference becomes east-north-up.
    fn convert(&mut self, packet: &XsensMessage) -> Reading {
        /// Nanoseconds of the fine sample time's tick (10 kHz).
        const FINE_TICK_NS: i64 = 100_000;
        let count = packet.counter.map(|n| self.counter.next(u64::from(n)));
        let stamp = match (packet.sample_time_fine, count) {
            (Some(ticks), _) => {
                ReadingStamp::Device { ns: self.fine.next(u64::from(ticks)).saturating_mul(FINE_TICK_NS) }
            }
            (None, Some(n)) => ReadingStamp::Count { n },
            (None, None) => ReadingStamp::Arrival,
        };
        let quaternion = packet.quaternion.and_then(|([w, x, y, z], low)| {
            Some((unit(DQuat::from_xyzw(x, y, z, w)), world_from_reference(low)?))
        });
        let euler = packet.euler_deg.and_then(|([roll, pitch, yaw], low)| {
            Some((from_yaw_pitch_roll([yaw, pitch, roll].map(f64::to_radians)), world_from_reference(low)?))
        });
        let body = |v: [f64; 3]| ROLL_OVER * DVec3::from_array(v);
        Reading {
            stamp,
            rate: packet.rate.map(body),
            accel: packet.accel.map(body),
            world_from_imu: quaternion
                .or(euler)
                .map(|(reference_from_unit, world)| world * reference_from_unit * ROLL_OVER),
        }
    }
}

#[cfg(test)]
mod tests;
