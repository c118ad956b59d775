//! SBG Systems' sbgECom (Firmware Reference Manual, "sbgECom binary protocol"): `FF 5A`, message, class, a little-endian
//! length, data, CRC16 (polynomial 8408, reflected, from 0) over message to data, `33`.
//!
//! Body axes: x forward, y right, z down; reference north-east-down. All logs carry the unit's clock in microseconds, which
//! wraps in 71.6 minutes. Rates and attitudes come in logs of their own.

use crc::{CRC_16_KERMIT, Crc};

use super::{ImuCodec, PATIENCE_PARTS};
use crate::{
    framing::{FoundPacket, Framing, PacketLook},
    imu::{
        axes::{SWAP, from_yaw_pitch_roll, rotation, vector},
        reading::{Reading, ReadingStamp},
        unwrap::Unwrap,
    },
};

/// The longest data that the protocol knows, bytes.
const DATA_MAX_BYTES: usize = 4086;
/// Bit 10 of the status in its second byte: rates beyond what the fine scale can hold.
const HIGH_RATES: u8 = 1 << 2;
/// Class of the unit's own logs.
const LOGS: u8 = 0;

/// Message, class and data length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SbgHead {
    message: u8,
    class: u8,
    data_bytes: usize,
}

impl Framing for SbgCodec {
    type Head = SbgHead;
    const SYNC: u8 = 0xff;
    const MAX_BYTES: usize = DATA_MAX_BYTES + 9;
    const WEAK: bool = false;

    fn look(bytes: &[u8]) -> PacketLook<SbgHead> {
        match bytes.get(1) {
            None => return PacketLook::Incomplete,
            Some(0x5a) => {}
            Some(_) => return PacketLook::Invalid,
        }
        let Some(&[message, class, low, high]) = bytes.get(2..6) else { return PacketLook::Incomplete };
        let data_bytes = usize::from(u16::from_le_bytes([low, high]));
        if data_bytes > DATA_MAX_BYTES {
            return PacketLook::Invalid;
        }
        PacketLook::Packet { head: SbgHead { message, class, data_bytes }, bytes: data_bytes + 9 }
    }

    fn intact(packet: &[u8]) -> bool {
        let Some((front, &[low, high, end])) = packet.split_last_chunk() else { return false };
        let body = front.get(2..).unwrap_or_default();
        end == 0x33 && CRC.checksum(body) == u16::from_le_bytes([low, high])
    }
}

/// The frames' check sum: CRC-16/KERMIT in the catalogue of Greg Cook.
const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_KERMIT);

/// A log in the unit's own units and axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum SbgLog {
    /// Specific force (m/s^2) and angular rate (rad/s): logs 3 and 44.
    Motion {
        /// Microseconds since power-up.
        time_us: u32,
        /// Specific force.
        accel: [f32; 3],
        /// Angular rate.
        rate: [f32; 3],
    },
    /// Roll, pitch and yaw, radians: log 6.
    Euler {
        /// Microseconds since power-up.
        time_us: u32,
        /// The angles.
        roll_pitch_yaw: [f32; 3],
    },
    /// Attitude of the body with respect to north-east-down, scalar first: log 7.
    Quaternion {
        /// Microseconds since power-up.
        time_us: u32,
        /// The quaternion.
        wxyz: [f32; 4],
    },
}

impl SbgLog {
    /// Reads a whole frame; `None` for another log, one that is too short, and an attitude before the filter has started.
    /// Later firmware appends fields, so a longer one is read.
    pub(crate) fn parse(frame: &[u8], head: SbgHead) -> Option<Self> {
        let data = frame.get(6..6 + head.data_bytes)?;
        if head.class != LOGS {
            return None;
        }
        let (time, rest) = data.split_first_chunk()?;
        let time_us = u32::from_le_bytes(*time);
        match head.message {
            // Status (2 bytes), then force and rate.
            3 => {
                let [ax, ay, az, x, y, z] = floats(rest.get(2..)?)?;
                Some(Self::Motion { time_us, accel: [ax, ay, az], rate: [x, y, z] })
            }
            // The same as integers: 2^20 a m/s^2, and by a bit of the status 2^26 or fewer a rad/s.
            44 => {
                let (&[_, status], rest) = rest.split_first_chunk()?;
                let rate_scale = if status & HIGH_RATES == 0 { (1 << 26) as f32 } else { 12_304_174.0 };
                let ints: [i32; 6] = words(rest)?.map(i32::from_le_bytes);
                let [ax, ay, az, x, y, z] = ints.map(|v| v as f32);
                let accel = [ax, ay, az].map(|v| v / (1 << 20) as f32);
                Some(Self::Motion { time_us, accel, rate: [x, y, z].map(|v| v / rate_scale) })
            }
            6 => {
                let [roll, pitch, yaw, ..] = floats::<6>(rest)?;
                started(rest.get(24..)?)
                    .then_some(Self::Euler { time_us, roll_pitch_yaw: [roll, pitch, yaw] })
            }
            7 => {
                let [w, x, y, z, ..] = floats::<7>(rest)?;
                started(rest.get(28..)?).then_some(Self::Quaternion { time_us, wxyz: [w, x, y, z] })
            }
            _ => None,
        }
    }
}

/// The first `N` words; `None` if there are fewer.
fn words<const N: usize>(data: &[u8]) -> Option<[[u8; 4]; N]> {
    data.as_chunks::<4>().0.first_chunk::<N>().copied()
}

fn floats<const N: usize>(data: &[u8]) -> Option<[f32; N]> {
    words(data).map(|words| words.map(f32::from_le_bytes))
}

/// Whether the filter's status (its mode in the lowest four bits) is another than "uninitialised".
fn started(status: &[u8]) -> bool {
    status.first().is_some_and(|low| low & 0x0f != 0)
}

/// The protocol: the clock of its logs, and whether quaternions come.
#[derive(Debug, Default)]
pub(crate) struct SbgCodec {
    time_us: Unwrap<32>,
    quaternions: bool,
}

impl ImuCodec for SbgCodec {
    const KEY: &'static str = "sbg";
    const NAME: &'static str = "SBG sbgECom";
    const REMEDY: &'static str = "switch its logs 3 (IMU data) and 7 (quaternion) on";
    const PROOF_PACKETS: usize = 2;
    const PATIENCE: u32 = PATIENCE_PARTS;

    fn reading(&mut self, packet: &FoundPacket<'_, SbgHead>) -> Option<Reading> {
        self.convert(&SbgLog::parse(packet.bytes, packet.head)?)
    }

    /// Message and data, of the unit's own logs; of log 3 where nothing is given.
    fn wrap(content: &[u8]) -> Vec<u8> {
        let (message, data) = content.split_first().map_or((3, content), |(m, d)| (*m, d));
        let body = [&[message, LOGS], &(data.len() as u16).to_le_bytes()[..], data].concat();
        [&[0xff, 0x5a], &body[..], &CRC.checksum(&body).to_le_bytes(), &[0x33]].concat()
    }
}

impl SbgCodec {
    /// The log in our axes, the attitude turned from north-east-down into our world. Angles of a unit that sends quaternions
    /// as well are left aside.
    fn convert(&mut self, log: &SbgLog) -> Option<Reading> {
        let (SbgLog::Motion { time_us, .. }
        | SbgLog::Euler { time_us, .. }
        | SbgLog::Quaternion { time_us, .. }) = *log;
        let ns = self.time_us.next(u64::from(time_us)).saturating_mul(1000);
        let at = Reading::at(ReadingStamp::Device { ns });
        Some(match *log {
            SbgLog::Motion { accel, rate, .. } => {
                Reading { rate: Some(vector(rate)), accel: Some(vector(accel)), ..at }
            }
            SbgLog::Euler { roll_pitch_yaw: [roll, pitch, yaw], .. } => {
                if self.quaternions {
                    return None;
                }
                let ned_from_imu = from_yaw_pitch_roll([yaw, pitch, roll].map(f64::from));
                Reading { world_from_imu: Some(SWAP * ned_from_imu), ..at }
            }
            SbgLog::Quaternion { wxyz: [w, x, y, z], .. } => {
                self.quaternions = true;
                Reading { world_from_imu: Some(SWAP * rotation([x, y, z, w])), ..at }
            }
        })
    }
}

#[cfg(test)]
mod tests;
