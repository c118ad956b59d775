//! The inertial unit's line, whatever the unit: any bytes, and packets of every format with right check sums.
//!
//! Input: one byte that says which format is read (0 to 6: one alone; else it is detected), one with the size of the pieces in
//! which everything is pushed (0: steps at once); then steps. A step is two bytes and its content: the four highest bits say
//! whether it is sent as it is (0, 8 to 15) or as a packet of a format (1 to 7), the lowest ten how many bytes it has.

use bowwave_core::{event::ImuSample, time::Time};
use bowwave_devices::{
    imu::{ImuDecoder, ImuFormat},
    nmea::{ShipAttitude, ShipParser},
    vectornav::CommonOutput,
};

/// Good packets that are sent behind it all, of the format that is read or of one that is to be detected.
const GOOD: u64 = 120;
/// What a decoder may ask for at once: the scanners' buffers, samples of a piece, and what buffers grow by.
const MEMORY_BYTES: usize = 96 << 10;
/// More than what puts a format in doubt, and than any packet.
const SILENCE_BYTES: usize = 3 * 4096;

/// Whatever came before: samples are finite, everything is counted, and a good unit is recognised.
pub fn run(input: &[u8]) {
    let Some((&[format, piece], mut rest)) = input.split_first_chunk() else { return };
    let fixed = ImuFormat::ALL.get(usize::from(format)).copied();
    let mut line = Line {
        decoder: ImuDecoder::with(fixed),
        ship: ShipParser::new(),
        piece: usize::from(piece),
        ms: 0,
        sent: 0,
        samples: 0,
    };
    while let Some((bytes, behind)) = step(rest) {
        rest = behind;
        line.push(&bytes);
    }
    line.check_counters();
    if matches!(fixed, None | Some(ImuFormat::VectorNav)) {
        line.check_recovery();
        line.check_counters();
    }
}

/// The next step's bytes on the wire and the steps behind it.
fn step(input: &[u8]) -> Option<(Vec<u8>, &[u8])> {
    let (&[low, high], rest) = input.split_first_chunk()?;
    let head = u16::from_le_bytes([low, high]);
    let (content, rest) = rest.split_at(usize::from(head & 0x3ff).min(rest.len()));
    Some((packet(head >> 12, content), rest))
}

fn sum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, &b| sum.wrapping_add(b))
}

/// Packets around any content; check sums bit by bit, so that they share nothing with the decoders'.
fn packet(kind: u16, content: &[u8]) -> Vec<u8> {
    let sized = |size: usize| {
        let mut content = content.to_vec();
        content.resize(size, 0);
        content
    };
    match kind {
        1 => {
            let crc = content.iter().fold(0u16, |crc, byte| {
                (0..8).fold(crc ^ u16::from(*byte) << 8, |c, _| {
                    if c >> 15 == 0 { c << 1 } else { (c << 1) ^ 0x1021 }
                })
            });
            [&[0xfa], content, &crc.to_be_bytes()].concat()
        }
        2 => {
            let body = [b"VN", content].concat();
            let xor = body.iter().fold(0, |xor, b| xor ^ b);
            [b"$", &body[..], format!("*{xor:02X}\r\n").as_bytes()].concat()
        }
        3 => {
            let short = &content[..content.len().min(254)];
            let body = [&[0xff, 0x36, short.len() as u8], short].concat();
            [&[0xfa], &body[..], &[sum(&body).wrapping_neg()]].concat()
        }
        4 => {
            // Set, then fields.
            let (set, fields) = content.split_first().map_or((0x80, content), |(s, f)| (0x80 | s & 3, f));
            let fields = &fields[..fields.len().min(255)];
            let mut bytes = [&[0x75, 0x65, set, fields.len() as u8], fields].concat();
            let sums = bytes.iter().fold((0u8, 0u8), |(a, b), byte| {
                let a = a.wrapping_add(*byte);
                (a, b.wrapping_add(a))
            });
            bytes.extend([sums.0, sums.1]);
            bytes
        }
        5 => {
            let (message, data) = content.split_first().map_or((3, content), |(m, d)| (*m, d));
            let body = [&[message, 0], &(data.len() as u16).to_le_bytes()[..], data].concat();
            let crc = body.iter().fold(0u16, |crc, byte| {
                (0..8)
                    .fold(crc ^ u16::from(*byte), |c, _| if c & 1 == 0 { c >> 1 } else { (c >> 1) ^ 0x8408 })
            });
            [&[0xff, 0x5a], &body[..], &crc.to_le_bytes(), &[0x33]].concat()
        }
        6 => {
            let body = sized(16);
            [&[0xaa, 0xaa], &body[..], &[sum(&body)]].concat()
        }
        7 => {
            let mut bytes = [&[0x55], &sized(9)[..]].concat();
            bytes[1] = 0x50 + bytes[1] % 11;
            bytes.push(sum(&bytes));
            bytes
        }
        _ => content.to_vec(),
    }
}

struct Line {
    decoder: ImuDecoder,
    ship: ShipParser,
    piece: usize,
    ms: i64,
    sent: u64,
    samples: u64,
}

impl Line {
    fn push(&mut self, bytes: &[u8]) {
        let piece = if self.piece == 0 { bytes.len().max(1) } else { self.piece };
        for part in bytes.chunks(piece) {
            self.ms += 5;
            let arrival = Time::from_ns(self.ms * 1_000_000);
            let Self { decoder, ship, samples, .. } = self;
            super::memory::within(MEMORY_BYTES, || {
                decoder.push(part, arrival, |sample| {
                    check_sample(&sample);
                    *samples += 1;
                });
                ship.push(part, arrival, |said| check_ship(&said));
            });
            self.sent += part.len() as u64;
        }
    }

    fn check_counters(&self) {
        let c = self.decoder.counters();
        assert_eq!(c.samples, self.samples, "{c:?}");
        assert_eq!(c.packets, c.samples + c.not_finite + c.unusable + c.other, "{c:?}");
        // The shortest packet is a message of Xsens without content.
        assert!(c.skipped_bytes + 5 * c.packets <= self.sent, "{} bytes were sent: {c:?}", self.sent);
        assert!(c.bad_crc <= c.skipped_bytes, "{c:?}");
        let ship = self.ship.counters();
        assert!(ship.skipped_bytes <= self.sent && ship.bad_crc <= ship.skipped_bytes, "{ship:?}");
    }

    /// A line that falls silent (spaces) and then carries a good unit is that unit's soon.
    fn check_recovery(&mut self) {
        self.piece = 0;
        for _ in 0..SILENCE_BYTES / 64 {
            self.push(&[b' '; 64]);
        }
        let before = self.samples;
        for n in 0..GOOD {
            let mut packet = Vec::with_capacity(CommonOutput::MAX_BYTES);
            CommonOutput {
                time_startup_ns: (1 << 40) + n * 5_000_000,
                quaternion: Some([0.5, -0.5, 0.5, 0.5]),
                angular_rate: [0.25, 0.0, -0.125],
                accel: [0.0, 0.5, -9.75],
            }
            .encode(&mut packet);
            self.push(&packet);
        }
        assert_eq!(self.decoder.format(), Some(ImuFormat::VectorNav));
        assert_eq!(self.samples - before, GOOD, "{:?}", self.decoder.counters());
    }
}

fn check_sample(sample: &ImuSample) {
    assert!(sample.device_time_ns >= 0, "{sample:?}");
    assert!(sample.rate.is_finite() && sample.accel.is_finite(), "{sample:?}");
    if let Some(attitude) = sample.world_from_imu {
        assert!((attitude.length() - 1.0).abs() < 1e-6, "an attitude that is no rotation: {sample:?}");
    }
}

fn check_ship(said: &ShipAttitude) {
    let (turn, ship) = (std::f64::consts::TAU, &said.sample);
    assert!(ship.heading.is_none_or(|v| (0.0..turn).contains(&v)), "{said:?}");
    assert!(
        ship.roll.is_none_or(|v| v.abs() <= turn / 2.0) && ship.pitch.is_none_or(|v| v.abs() <= turn / 4.0)
    );
    assert!(said.utc_day_s.is_none_or(|v| (0.0..86_402.0).contains(&v)), "{said:?}");
}
