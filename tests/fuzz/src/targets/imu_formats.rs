//! The inertial unit's line, whatever the unit: any bytes, and packets of every format with right check sums.
//!
//! Input: one byte that says which format is read (its place in the list of formats, from 0: that alone; beyond it: detected), one
//! with the size of the pieces in which everything is pushed (0: steps at once); then steps. A step is two bytes and its content: the
//! four highest bits say whether it is sent as it is (0, and beyond the list) or as a packet of a format (its place, from 1), the lowest
//! ten how many bytes it has.

use bowwave_core::time::Time;
use bowwave_devices::{
    imu::{ImuDecoder, ImuFormat},
    nmea::{ShipLine, ShipParser, ShipSaid},
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
    let Some((&[format, piece], steps)) = input.split_first_chunk() else { return };
    let fixed = ImuFormat::ALL.get(usize::from(format)).copied();
    let mut line = FuzzedLines {
        decoder: ImuDecoder::with(fixed),
        ship: ShipParser::new(),
        piece: usize::from(piece),
        ms: 0,
        sent: 0,
        samples: 0,
    };
    for bytes in super::steps::of(steps, wire) {
        line.push(&bytes);
    }
    line.check_counters();
    if matches!(fixed, None | Some(ImuFormat::VectorNav)) {
        line.check_recovery();
        line.check_counters();
    }
}

/// A step's bytes on the wire.
fn wire(head: u16, content: &[u8]) -> Vec<u8> {
    let format = usize::from(head >> 12).checked_sub(1).and_then(|n| ImuFormat::ALL.get(n));
    format.map_or_else(|| content.to_vec(), |format| format.wrap(content))
}

struct FuzzedLines {
    decoder: ImuDecoder,
    ship: ShipParser,
    piece: usize,
    ms: i64,
    sent: u64,
    samples: u64,
}

impl FuzzedLines {
    fn push(&mut self, bytes: &[u8]) {
        let piece = if self.piece == 0 { bytes.len().max(1) } else { self.piece };
        for part in bytes.chunks(piece) {
            self.ms += 5;
            let arrival = Time::from_ns(self.ms * 1_000_000);
            let Self { decoder, ship, samples, .. } = self;
            super::memory::within(MEMORY_BYTES, || {
                for sample in decoder.samples(part, arrival) {
                    super::steps::check_sample(&sample);
                    *samples += 1;
                }
                ship.lines(part, arrival).for_each(|said| check_ship(&said));
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

fn check_ship(line: &ShipLine) {
    let said = &line.said;
    // A place and a time cannot be made out of range.
    let ShipSaid::Attitude(ship) = said else { return };
    let turn = std::f64::consts::TAU;
    assert!(ship.heading.is_none_or(|v| (0.0..turn).contains(&v)), "{said:?}");
    assert!(
        ship.roll.is_none_or(|v| v.abs() <= turn / 2.0) && ship.pitch.is_none_or(|v| v.abs() <= turn / 4.0)
    );
}
