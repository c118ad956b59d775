//! VectorNav's binary output: sync byte `FA`, a byte that names the groups, a little-endian mask of fields for each group,
//! the fields in the order of their bits, a CRC16-CCITT. Sans-io: bytes in, packets out.
//!
//! Body axes: x forward, y right, z down. The unit's reference is north, east, down; see [`VectorNavPacket::to_sample`] for the way
//! into our world.

pub(crate) mod ascii;
mod layout;
#[cfg(test)]
mod tests;

use bowwave_core::{event::ImuSample, time::Time};
use crc::{CRC_16_XMODEM, Crc};
use glam::DVec3;

use self::layout::{MAX_PACKET, PacketField, PacketHeader, PacketLayout, SYNC};
use super::ImuCodec;
use crate::{
    framing::{FoundPacket, Framing, PacketLook},
    imu::{
        axes::{SWAP, from_yaw_pitch_roll, rotation, vector},
        reading::{Reading, ReadingStamp},
    },
};

/// CRC16-CCITT as VectorNav uses it (CRC-16/XMODEM in the catalogue of Greg Cook): polynomial 1021, most significant bit first,
/// from 0. Over a packet's bytes after the sync byte, its own two CRC bytes included, the result is 0.
pub(crate) const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_XMODEM);

/// VectorNav's binary output.
#[derive(Debug, Default)]
pub(crate) struct VectorNavCodec;

impl Framing for VectorNavCodec {
    type Head = PacketLayout;
    const SYNC: u8 = SYNC;
    const MAX_BYTES: usize = MAX_PACKET;
    const WEAK: bool = false;

    fn look(bytes: &[u8]) -> PacketLook<PacketLayout> {
        match PacketLayout::parse(bytes) {
            PacketHeader::Incomplete => PacketLook::Incomplete,
            PacketHeader::Invalid => PacketLook::Invalid,
            PacketHeader::Valid(layout) => PacketLook::Packet { head: layout, bytes: layout.packet_bytes() },
        }
    }

    fn intact(packet: &[u8]) -> bool {
        packet.get(1..).is_some_and(|body| CRC.checksum(body) == 0)
    }
}

impl ImuCodec for VectorNavCodec {
    const KEY: &'static str = "vectornav";
    const NAME: &'static str = "VectorNav binary";
    const REMEDY: &'static str = "add it to its binary output (common group, bits 0, 5 and 8)";
    const PROOF_PACKETS: usize = 2;

    fn reading(&mut self, packet: &FoundPacket<'_, PacketLayout>) -> Option<Reading> {
        Some(VectorNavPacket::decode(packet.bytes, &packet.head).reading())
    }

    /// Groups, masks and fields.
    fn wrap(content: &[u8]) -> Vec<u8> {
        [&[SYNC], content, &CRC.checksum(content).to_be_bytes()].concat()
    }
}

/// The fields of one packet that the trainer can use, in the unit's own units and axes. Fields of the packet that are
/// not listed here are skipped by their length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VectorNavPacket {
    /// Time since start-up, nanoseconds.
    pub time_startup_ns: Option<u64>,
    /// Yaw, pitch and roll (3-2-1 Euler angles, body with respect to north-east-down), degrees.
    pub yaw_pitch_roll_deg: Option<[f32; 3]>,
    /// Attitude of the body with respect to north-east-down, scalar last.
    pub quaternion: Option<[f32; 4]>,
    /// Attitude matrix, row by row as sent.
    pub dcm: Option<[f32; 9]>,
    /// Compensated angular rate, rad/s, body.
    pub angular_rate: Option<[f32; 3]>,
    /// Compensated specific force, m/s^2, body.
    pub accel: Option<[f32; 3]>,
    /// Uncompensated magnetic field, gauss, body.
    pub raw_mag: Option<[f32; 3]>,
    /// Uncompensated specific force, m/s^2, body.
    pub raw_accel: Option<[f32; 3]>,
    /// Uncompensated angular rate, rad/s, body.
    pub raw_rate: Option<[f32; 3]>,
    /// Temperature of the sensors, degrees Celsius.
    pub temperature_c: Option<f32>,
    /// Air pressure, kilopascal.
    pub pressure_kpa: Option<f32>,
    /// Magnetic field in north-east-down, gauss.
    pub mag_ned: Option<[f32; 3]>,
    /// Specific force in north-east-down, m/s^2.
    pub accel_ned: Option<[f32; 3]>,
}

impl VectorNavPacket {
    /// Decodes a whole packet whose check sum is right and whose header is `layout`.
    fn decode(bytes: &[u8], layout: &PacketLayout) -> Self {
        let mut packet = Self::default();
        for PacketField { group, bit, offset, bytes: length } in layout.fields() {
            if let Some(field) = bytes.get(offset..offset + length) {
                packet.set(group, bit, field);
            }
        }
        packet
    }

    fn set(&mut self, group: usize, bit: usize, field: &[u8]) {
        match (group, bit) {
            (1 | 2, 0) => self.time_startup_ns = field.try_into().ok().map(u64::from_le_bytes),
            (1, 3) | (5, 1) => self.yaw_pitch_roll_deg = floats(field),
            (1, 4) | (5, 2) => self.quaternion = floats(field),
            (1, 5) | (3, 10) => self.angular_rate = floats(field),
            (1, 8) | (3, 9) => self.accel = floats(field),
            (3, 1) => self.raw_mag = floats(field),
            (3, 2) => self.raw_accel = floats(field),
            (3, 3) => self.raw_rate = floats(field),
            (3, 4) => self.temperature_c = floats(field).map(|[v]| v),
            (3, 5) => self.pressure_kpa = floats(field).map(|[v]| v),
            (5, 3) => self.dcm = floats(field),
            (5, 4) => self.mag_ned = floats(field),
            (5, 5) => self.accel_ned = floats(field),
            _ => {}
        }
    }

    /// The measurement in our axes. Rate and specific force (compensated ones are preferred) stay in the body's axes. The
    /// attitude comes from the quaternion, or else from yaw, pitch and roll, and is turned from north-east-down into our world.
    pub(crate) fn reading(&self) -> Reading {
        let ned_from_imu = self.quaternion.map(rotation).or_else(|| {
            let angles = self.yaw_pitch_roll_deg?;
            Some(from_yaw_pitch_roll(angles.map(|v| f64::from(v).to_radians())))
        });
        let time_ns = self.time_startup_ns.and_then(|ns| i64::try_from(ns).ok());
        Reading {
            stamp: time_ns.map_or(ReadingStamp::Arrival, |ns| ReadingStamp::Device { ns }),
            rate: self.angular_rate.or(self.raw_rate).map(vector),
            accel: self.accel.or(self.raw_accel).map(vector),
            world_from_imu: ned_from_imu.map(|q| SWAP * q),
        }
    }

    /// The packet as a sample that arrived at `arrival`; `None` unless it has the time since start-up, a rate and an
    /// acceleration.
    pub fn to_sample(&self, arrival: Time) -> Option<ImuSample> {
        let Reading { stamp: ReadingStamp::Device { ns }, rate, accel, world_from_imu } = self.reading()
        else {
            return None;
        };
        Some(ImuSample { arrival, device_time_ns: ns, rate: rate?, accel: accel?, world_from_imu })
    }
}

/// `N` little-endian floats; `None` if the length is another.
fn floats<const N: usize>(bytes: &[u8]) -> Option<[f32; N]> {
    let (values, []) = bytes.as_chunks::<4>() else { return None };
    let values: &[[u8; 4]; N] = values.try_into().ok()?;
    Some(values.map(f32::from_le_bytes))
}

/// Output of the simulated unit: fields of the common group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommonOutput {
    /// Time since start-up, nanoseconds.
    pub time_startup_ns: u64,
    /// Attitude of the body with respect to north-east-down, scalar last; left off the wire where absent.
    pub quaternion: Option<[f32; 4]>,
    /// Compensated angular rate, rad/s, body.
    pub angular_rate: [f32; 3],
    /// Compensated specific force, m/s^2, body.
    pub accel: [f32; 3],
}

impl CommonOutput {
    /// The longest encoding: header, time, quaternion, rate, acceleration, CRC.
    pub const MAX_BYTES: usize = 4 + 8 + 16 + 12 + 12 + 2;

    /// The output of a unit for `sample`; `None` where its device time is before the unit's start-up.
    pub fn from_sample(sample: &ImuSample) -> Option<Self> {
        let narrow = |v: DVec3| [v.x as f32, v.y as f32, v.z as f32];
        Some(Self {
            time_startup_ns: u64::try_from(sample.device_time_ns).ok()?,
            quaternion: sample.world_from_imu.map(|world_from_imu| {
                let q = SWAP.inverse() * world_from_imu;
                [q.x as f32, q.y as f32, q.z as f32, q.w as f32]
            }),
            angular_rate: narrow(sample.rate),
            accel: narrow(sample.accel),
        })
    }

    /// Appends the packet to `out`.
    pub fn encode(&self, out: &mut Vec<u8>) {
        const TIME: u16 = 1 << 0;
        const QUATERNION: u16 = 1 << 4;
        const RATE: u16 = 1 << 5;
        const ACCEL: u16 = 1 << 8;
        let begin = out.len() + 1;
        let mask = TIME | RATE | ACCEL | if self.quaternion.is_some() { QUATERNION } else { 0 };
        out.extend([SYNC, 0x01]);
        out.extend(mask.to_le_bytes());
        out.extend(self.time_startup_ns.to_le_bytes());
        let attitude = self.quaternion.iter().flatten();
        for value in attitude.chain(&self.angular_rate).chain(&self.accel) {
            out.extend(value.to_le_bytes());
        }
        let crc = CRC.checksum(&out[begin..]);
        out.extend(crc.to_be_bytes());
    }
}
