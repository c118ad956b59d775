//! MicroStrain MIP (Data Communications Protocol manuals of the 3DM family): `75 65`, descriptor set, payload length, fields
//! of a length (itself included), a descriptor and big-endian numbers, a Fletcher check sum of two bytes over all before it.
//!
//! Body axes: x forward, y right, z down; reference north-east-down. Sets `80` (sensor) and `82` (filter) are read; both may
//! carry a time of the unit's clock (`D5`) or of GPS (`D3`, `12`, `11`).

use super::{ImuCodec, PATIENCE_PARTS};
use crate::{
    framing::{FoundPacket, Framing, PacketLook},
    imu::{
        axes::{G, SWAP, from_yaw_pitch_roll, rotation, vector},
        reading::{Reading, ReadingStamp},
    },
};

const SENSOR: u8 = 0x80;
const FILTER: u8 = 0x82;
const WEEK_S: f64 = 604_800.0;

/// Descriptor set and payload length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MipHead {
    set: u8,
    payload_bytes: u8,
}

impl Framing for MicroStrainCodec {
    type Head = MipHead;
    const SYNC: u8 = 0x75;
    const MAX_BYTES: usize = 4 + 255 + 2;
    const WEAK: bool = false;

    fn look(bytes: &[u8]) -> PacketLook<MipHead> {
        match bytes.get(1) {
            None => return PacketLook::Incomplete,
            Some(0x65) => {}
            Some(_) => return PacketLook::Invalid,
        }
        match (bytes.get(2), bytes.get(3)) {
            (Some(0), _) | (_, Some(0)) => PacketLook::Invalid,
            (Some(&set), Some(&payload_bytes)) => PacketLook::Packet {
                head: MipHead { set, payload_bytes },
                bytes: 4 + usize::from(payload_bytes) + 2,
            },
            _ => PacketLook::Incomplete,
        }
    }

    fn intact(packet: &[u8]) -> bool {
        let Some((body, &[first, second])) = packet.split_last_chunk() else { return false };
        fletcher(body) == [first, second]
    }
}

/// Fletcher's check sum.
fn fletcher(bytes: &[u8]) -> [u8; 2] {
    bytes.iter().fold([0u8; 2], |[a, b], &byte| {
        let a = a.wrapping_add(byte);
        [a, b.wrapping_add(a)]
    })
}

/// The fields of a packet: descriptor and data. Ends early where a length is impossible.
fn fields(packet: &[u8], head: MipHead) -> impl Iterator<Item = (u8, &[u8])> {
    let mut rest = packet.get(4..4 + usize::from(head.payload_bytes)).unwrap_or_default();
    std::iter::from_fn(move || {
        let &length = rest.first()?;
        let (field, behind) = rest.split_at_checked(usize::from(length))?;
        let (&[_, descriptor], data) = field.split_first_chunk()?;
        rest = behind;
        Some((descriptor, data))
    })
}

/// The measurements of one packet, in the unit's own units and axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct MipPacket {
    /// The unit's own clock, nanoseconds.
    pub(crate) reference_ns: Option<u64>,
    /// Time of week of GPS and the week, as far as the unit knows them.
    pub(crate) gps: Option<(f64, u16)>,
    /// Specific force, g (sensor) or m/s^2 (filter).
    pub(crate) accel: Option<[f32; 3]>,
    /// Angular rate, rad/s.
    pub(crate) rate: Option<[f32; 3]>,
    /// Attitude of the body with respect to north-east-down, scalar first.
    pub(crate) quaternion: Option<[f32; 4]>,
    /// Roll, pitch and yaw, radians.
    pub(crate) euler: Option<[f32; 3]>,
    from_filter: bool,
}

impl MipPacket {
    /// Reads a whole packet; `None` for one of another set.
    pub(crate) fn parse(packet: &[u8], head: MipHead) -> Option<Self> {
        if head.set != SENSOR && head.set != FILTER {
            return None;
        }
        let mut parsed = Self { from_filter: head.set == FILTER, ..Self::default() };
        for (descriptor, data) in fields(packet, head) {
            match (head.set, descriptor) {
                (_, 0xd5) => parsed.reference_ns = data.try_into().ok().map(u64::from_be_bytes),
                (_, 0xd3) | (SENSOR, 0x12) | (FILTER, 0x11) => parsed.gps = gps(data),
                (SENSOR, 0x04) => parsed.accel = floats(data),
                (SENSOR, 0x05) => parsed.rate = floats(data),
                (SENSOR, 0x0a) => parsed.quaternion = floats(data),
                (SENSOR, 0x0c) => parsed.euler = floats(data),
                (FILTER, 0x03) => parsed.quaternion = valid(data),
                (FILTER, 0x05) => parsed.euler = valid(data),
                (FILTER, 0x0e) => parsed.rate = valid(data),
                (FILTER, 0x1c) => parsed.accel = valid(data),
                _ => {}
            }
        }
        Some(parsed)
    }

    /// Whether rate and force are both there.
    fn moves(&self) -> bool {
        self.rate.is_some() && self.accel.is_some()
    }

    fn stamp(&self) -> ReadingStamp {
        let own_ns = self.reference_ns.and_then(|ns| i64::try_from(ns).ok());
        let gps_ns = self.gps.and_then(|(tow_s, week)| {
            let whole = tow_s.floor();
            let since_s = i64::from(week) * WEEK_S as i64 + whole as i64;
            // A week beyond the year 2272 is none.
            since_s.checked_mul(1_000_000_000)?.checked_add(((tow_s - whole) * 1e9) as i64)
        });
        own_ns.or(gps_ns).map_or(ReadingStamp::Arrival, |ns| ReadingStamp::Device { ns })
    }
}

/// MIP: which set of a unit that sends two is believed. Both have an attitude of their own (and they differ by degrees), at
/// times of their own; the filter's is the better one.
#[derive(Debug, Default)]
pub(crate) struct MicroStrainCodec {
    filter_attitude: bool,
    filter_motion: bool,
}

impl ImuCodec for MicroStrainCodec {
    const KEY: &'static str = "microstrain";
    const NAME: &'static str = "MicroStrain MIP";
    const REMEDY: &'static str =
        "add it to its message format (set 80: D5, 04, 05, 0A, or set 82: D5, 03, 0E, 1C)";
    const PROOF_PACKETS: usize = 2;
    const PATIENCE: u32 = PATIENCE_PARTS;

    fn reading(&mut self, packet: &FoundPacket<'_, MipHead>) -> Option<Reading> {
        Some(self.convert(&MipPacket::parse(packet.bytes, packet.head)?))
    }

    /// Set (one of 80 to 83) and fields.
    fn wrap(content: &[u8]) -> Vec<u8> {
        let (set, fields) = content.split_first().map_or((SENSOR, content), |(s, f)| (SENSOR | s & 3, f));
        let fields = &fields[..fields.len().min(255)];
        let mut bytes = [&[0x75, 0x65, set, fields.len() as u8], fields].concat();
        bytes.extend(fletcher(&bytes));
        bytes
    }
}

impl MicroStrainCodec {
    /// In our axes: forces in m/s^2, the attitude turned from north-east-down into our world.
    fn convert(&mut self, packet: &MipPacket) -> Reading {
        let quaternion = packet.quaternion.map(|[w, x, y, z]| rotation([x, y, z, w]));
        let euler =
            packet.euler.map(|[roll, pitch, yaw]| from_yaw_pitch_roll([yaw, pitch, roll].map(f64::from)));
        let mut attitude = quaternion.or(euler).map(|ned_from_imu| SWAP * ned_from_imu);
        let mut motion = (packet.rate, packet.accel);
        if packet.from_filter {
            self.filter_attitude |= attitude.is_some();
            self.filter_motion |= packet.moves();
            if !packet.moves() {
                motion = (None, None);
            }
        } else {
            attitude = attitude.filter(|_| !self.filter_attitude);
            if self.filter_motion {
                motion = (None, None);
            }
        }
        let unit = if packet.from_filter { 1.0 } else { G };
        Reading {
            rate: motion.0.map(vector),
            accel: motion.1.map(|a| vector(a) * unit),
            world_from_imu: attitude,
            ..Reading::at(packet.stamp())
        }
    }
}

fn floats<const N: usize>(data: &[u8]) -> Option<[f32; N]> {
    let (values, []) = data.as_chunks::<4>() else { return None };
    let values: &[[u8; 4]; N] = values.try_into().ok()?;
    Some(values.map(f32::from_be_bytes))
}

/// Numbers of the filter: behind them stands whether they are valid.
fn valid<const N: usize>(data: &[u8]) -> Option<[f32; N]> {
    let (values, &[high, low]) = data.split_last_chunk()?;
    if u16::from_be_bytes([high, low]) == 0 { None } else { floats(values) }
}

/// Time of week (s), week, flags.
fn gps(data: &[u8]) -> Option<(f64, u16)> {
    let (tow, rest) = data.split_first_chunk()?;
    let tow_s = f64::from_be_bytes(*tow);
    let &[high, low, _, _] = rest else { return None };
    // A unit without a fix counts from its start-up, in the same field.
    (0.0..WEEK_S).contains(&tow_s).then(|| (tow_s, u16::from_be_bytes([high, low])))
}

#[cfg(test)]
mod tests;
