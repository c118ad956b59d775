//! VectorNav's ASCII output (interface control document, "ASCII measurements"): `$VNYMR`, `$VNQMR` and `$VNIMU`.
//!
//! Axes and reference as in the binary output. These lines carry no time: it is made from their arrivals.

use glam::{DQuat, DVec3};

use super::{super::ImuCodec, CRC};
use crate::{
    framing::FoundPacket,
    imu::{
        axes::{SWAP, from_yaw_pitch_roll, unit},
        reading::{Reading, ReadingStamp},
    },
    lines::{self, LineFraming, number},
};

/// VectorNav's lines.
#[derive(Debug, Default)]
pub(crate) struct VectorNavLines;

impl LineFraming for VectorNavLines {
    const PREFIX: &'static [u8] = b"VN";

    fn intact_text(line: &[u8]) -> Option<&str> {
        checked(line)
    }
}

impl ImuCodec for VectorNavLines {
    const KEY: &'static str = "vectornav-ascii";
    const NAME: &'static str = "VectorNav ASCII";
    const REMEDY: &'static str = "set its asynchronous output to VNYMR";
    const PROOF_PACKETS: usize = 2;

    fn reading(&mut self, packet: &FoundPacket<'_, ()>) -> Option<Reading> {
        Some(VectorNavLine::parse(packet.bytes)?.reading())
    }

    /// The line behind `$VN`.
    fn wrap(content: &[u8]) -> Vec<u8> {
        lines::seal(&[b"VN", content].concat())
    }
}

/// The line between `$` and its check sum, which may also be a CRC of four digits, or left unchecked.
fn checked(line: &[u8]) -> Option<&str> {
    let (body, sum) = lines::parts(line)?;
    let right = match sum.len() {
        // A unit whose check sums are off writes the letters themselves.
        2 if sum == "XX" => true,
        2 => lines::hex(sum)? == u32::from(lines::xor(body.as_bytes())),
        4 => lines::hex(sum)? == u32::from(CRC.checksum(body.as_bytes())),
        _ => false,
    };
    right.then_some(body)
}

/// A measurement in the unit's own units and axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct VectorNavLine {
    /// Yaw, pitch and roll, degrees.
    pub(crate) yaw_pitch_roll_deg: Option<[f64; 3]>,
    /// Attitude of the body with respect to north-east-down, scalar last.
    pub(crate) quaternion: Option<[f64; 4]>,
    /// Magnetic field, gauss, body.
    pub(crate) mag: Option<[f64; 3]>,
    /// Specific force, m/s^2, body.
    pub(crate) accel: Option<[f64; 3]>,
    /// Angular rate, rad/s, body.
    pub(crate) rate: Option<[f64; 3]>,
}

impl VectorNavLine {
    /// Reads a whole line; `None` for one of another kind. Fields that are missing or no numbers are absent.
    pub(crate) fn parse(line: &[u8]) -> Option<Self> {
        let mut fields = checked(line)?.split(',');
        let address = fields.next()?;
        let mut numbers = fields.map(number);
        let mut parsed = Self::default();
        match address {
            "VNYMR" => parsed.yaw_pitch_roll_deg = take(&mut numbers),
            "VNQMR" => parsed.quaternion = take(&mut numbers),
            "VNIMU" => {}
            _ => return None,
        }
        parsed.mag = take(&mut numbers);
        parsed.accel = take(&mut numbers);
        parsed.rate = take(&mut numbers);
        Some(parsed)
    }

    /// In our axes: rate and force as they are, the attitude turned from north-east-down into our world.
    pub(crate) fn reading(&self) -> Reading {
        let attitude = self.yaw_pitch_roll_deg.map(|a| from_yaw_pitch_roll(a.map(f64::to_radians)));
        let quaternion = self.quaternion.map(|[x, y, z, w]| unit(DQuat::from_xyzw(x, y, z, w)));
        Reading {
            rate: self.rate.map(DVec3::from_array),
            accel: self.accel.map(DVec3::from_array),
            world_from_imu: quaternion.or(attitude).map(|ned_from_imu| SWAP * ned_from_imu),
            ..Reading::at(ReadingStamp::Arrival)
        }
    }
}

/// The next `N` numbers; `None` unless all are there.
fn take<const N: usize>(numbers: &mut impl Iterator<Item = Option<f64>>) -> Option<[f64; N]> {
    let mut taken = [0.0; N];
    for place in &mut taken {
        *place = numbers.next()??;
    }
    Some(taken)
}

#[cfg(test)]
mod tests {
    use bowwave_core::{event::ImuSample, time::Time};

    use super::*;
    use crate::{
        framing::Scanner,
        imu::{
            ImuDecoder, ImuFormat,
            streams::{FormatTolerance, SimulatedUnit, ned, recording, world_of, yaw_pitch_roll},
        },
    };

    impl SimulatedUnit for VectorNavLines {
        const TOLERANCE: FormatTolerance =
            FormatTolerance { rate: 1e-6, accel: 1e-3, attitude: 2e-5, time_ns: 1_000_000 };

        fn send(s: &ImuSample, _: i64, _: bool) -> Vec<u8> {
            let world = world_of(s);
            let [yaw, pitch, roll] = yaw_pitch_roll(ned(world)).map(f64::to_degrees);
            let (a, w) = (s.accel, s.rate);
            let body = format!(
                "VNYMR,{yaw:+08.3},{pitch:+08.3},{roll:+08.3},+00.1000,-00.2000,+00.3000,{:+07.3},{:+07.3},{:+07.3},\
                 {:+010.6},{:+010.6},{:+010.6}",
                a.x, a.y, a.z, w.x, w.y, w.z
            );
            lines::seal(body.as_bytes())
        }
    }

    fn line(body: &str) -> Vec<u8> {
        lines::seal(body.as_bytes())
    }

    #[test]
    fn check_sums_of_two_and_four_digits_and_none() {
        // A real line with its own sum.
        let line = b"$VNYMR,-165.918,-008.770,+000.198*7D\r\n";
        assert_eq!(checked(line), Some("VNYMR,-165.918,-008.770,+000.198"));
        let crc = format!("$VNRRG,05*{:04X}\r\n", CRC.checksum(b"VNRRG,05"));
        assert_eq!(checked(crc.as_bytes()), Some("VNRRG,05"));
        assert_eq!(checked(b"$VNRRG,05*XX\n"), Some("VNRRG,05"));
        for wrong in [
            &b"$VNRRG,05*77\r\n"[..],
            b"$VNRRG,05*+6\r\n",
            b"$VNRRG,05*761\r\n",
            b"$VNRRG,05\r\n",
            b"$VNRRG,05*0000\r\n",
        ] {
            assert_eq!(checked(wrong), None, "{}", String::from_utf8_lossy(wrong));
        }
    }

    /// Lines that others quote in public drivers: what is decoded is what they print, and gravity points down in ours.
    #[test]
    fn quoted_lines_are_decoded() {
        let Some(text) = recording("vnymr_ascii_lines.txt") else { return };
        let (lines, counters) =
            Scanner::<VectorNavLines>::parsed(&text, |bytes, ()| VectorNavLine::parse(bytes));
        assert_eq!((counters.packets, counters.bad_crc, counters.skipped_bytes), (9, 0, 0));
        assert_eq!(lines[0].yaw_pitch_roll_deg, Some([-165.918, -8.770, 0.198]));
        assert_eq!(lines[0].rate, None, "that line was cut by who quoted it, with its own check sum");
        assert_eq!(lines[7].yaw_pitch_roll_deg, Some([164.618, 22.062, -3.757]));
        assert_eq!(lines[7].mag, Some([-0.3611, -0.0797, 0.2916]));
        assert_eq!(lines[7].accel, Some([3.553, 0.595, -8.826]));
        assert_eq!(lines[7].rate, Some([0.004, -0.000_843, 0.000_141]));
        let mut level = 0;
        for line in &lines[1..] {
            let reading = line.reading();
            let up = reading.world_from_imu.expect("angles") * reading.accel.expect("given").normalize();
            // Most were quoted from units at rest; magnetically calibrated on a desk, they are level to some degrees.
            level += usize::from(up.z > 0.97);
        }
        eprintln!("{level} of {} lines feel gravity upwards within 14 degrees", lines.len() - 1);
        assert!(level >= 7, "{level}");
    }

    #[test]
    fn all_three_kinds_become_the_same_sample() {
        let mut samples: Vec<ImuSample> = Vec::new();
        let rest = "+01.0640,-00.2531,+03.0614,+00.005,+00.344,-09.758,-00.001222,-00.000450,-00.001218";
        for body in [
            format!("VNYMR,+090.000,+000.000,+000.000,{rest}"),
            format!("VNQMR,+0.000000,+0.000000,+0.707107,+0.707107,{rest}"),
            format!("VNIMU,{rest},+20.5,+101.3"),
            format!("VNYMR,+090.000,+000.000,+000.000,{rest},T0001234567"),
        ] {
            let mut decoder = ImuDecoder::fixed(ImuFormat::VectorNavAscii);
            samples.extend(decoder.samples(&line(&body), Time::from_ns(5)));
        }
        assert_eq!(samples.len(), 4);
        for sample in &samples {
            assert_eq!(sample.accel, DVec3::new(0.005, 0.344, -9.758));
            assert_eq!(sample.rate, DVec3::new(-0.001_222, -0.000_45, -0.001_218));
        }
        for i in [0, 1, 3] {
            let forward = samples[i].world_from_imu.expect("given") * DVec3::X;
            assert!(forward.abs_diff_eq(DVec3::X, 1e-6), "90 degrees of yaw look east: {forward}");
        }
        assert_eq!(samples[2].world_from_imu, None);
    }

    #[test]
    fn other_lines_and_fields_that_are_no_numbers_give_nothing() {
        assert_eq!(VectorNavLine::parse(&line("VNRRG,05,115200")), None);
        let odd = VectorNavLine::parse(&line("VNYMR,nan,0,0,0,0,0,0,0,0,0,0,0")).expect("a line");
        assert_eq!(odd.yaw_pitch_roll_deg, None);
        let short = VectorNavLine::parse(&line("VNYMR,1,2,3,4,5,6,7,8")).expect("a line");
        assert_eq!((short.mag, short.accel, short.rate), (Some([4.0, 5.0, 6.0]), None, None));
    }
}
