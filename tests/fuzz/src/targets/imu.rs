//! The line of an inertial unit of VectorNav: any bytes in any pieces.
//!
//! Input: one byte, the size of the pieces in which everything is pushed (0: steps at once); then steps. A step is two bytes
//! and its content: bit 15 says whether it is sent as it is or as a packet, with a sync byte before and the right check sum
//! behind, the lowest ten bits how many bytes it has. Without such packets a fuzzer would hardly ever pass the check sum.

use bowwave_core::{event::ImuSample, time::Time};
use bowwave_devices::{
    imu::{ImuDecoder, ImuFormat},
    vectornav::CommonOutput,
};

const SYNC: u8 = 0xfa;
/// The longest packet that the parser takes, bytes.
const PACKET_MAX_BYTES: usize = 600;
/// Good packets that are sent behind it all.
const GOOD: u64 = 64;
const GOOD_START_NS: u64 = 1 << 40;
const STEP_NS: u64 = 5_000_000;
/// What a decoder may hold: a packet, a piece, and room that buffers grow by.
const MEMORY_BYTES: usize = 16 << 10;

/// Whatever came before: samples are finite, everything is counted, and good packets come through again.
pub fn run(input: &[u8]) {
    let Some((&piece, steps)) = input.split_first() else { return };
    let mut line = FuzzedLine {
        decoder: ImuDecoder::fixed(ImuFormat::VectorNav),
        piece: usize::from(piece),
        ms: 0,
        sent: 0,
        samples: 0,
    };
    super::steps::of(steps, wire).for_each(|bytes| line.push(&bytes, |_| {}));
    line.check_counters();
    line.check_recovery();
    line.check_counters();
}

/// A step's bytes on the wire.
fn wire(head: u16, content: &[u8]) -> Vec<u8> {
    if head & 0x8000 == 0 {
        content.to_vec()
    } else {
        [&[SYNC], content, &crc16(content).to_be_bytes()].concat()
    }
}

/// CRC16-CCITT bit by bit, so that it shares nothing with the decoder's.
fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |crc, _| {
            if crc & 0x8000 == 0 { crc << 1 } else { (crc << 1) ^ 0x1021 }
        })
    })
}

struct FuzzedLine {
    decoder: ImuDecoder,
    piece: usize,
    ms: i64,
    sent: u64,
    samples: u64,
}

impl FuzzedLine {
    fn push(&mut self, bytes: &[u8], mut sink: impl FnMut(&ImuSample)) {
        let piece = if self.piece == 0 { bytes.len().max(1) } else { self.piece };
        for part in bytes.chunks(piece) {
            self.ms += 1;
            let arrival = Time::from_ns(self.ms * 1_000_000);
            let samples = &mut self.samples;
            super::memory::within(MEMORY_BYTES, || {
                for sample in self.decoder.samples(part, arrival) {
                    assert_eq!(sample.arrival, arrival);
                    super::steps::check_sample(&sample);
                    *samples += 1;
                    sink(&sample);
                }
            });
            self.sent += part.len() as u64;
        }
    }

    fn check_counters(&self) {
        let counters = self.decoder.counters();
        assert_eq!(counters.samples, self.samples, "{counters:?}");
        assert_eq!(
            counters.packets,
            counters.samples + counters.not_finite + counters.unusable + counters.other,
            "{counters:?}"
        );
        // The shortest packet has a sync byte, a group byte, a mask, a field of one byte and a check sum.
        let least = counters.skipped_bytes + 7 * counters.packets;
        assert!(least <= self.sent, "{} bytes were sent: {counters:?}", self.sent);
        assert!(counters.bad_crc <= counters.skipped_bytes, "{counters:?}");
    }

    /// Good packets behind garbage are lost only where a packet with a right check sum lay over them.
    fn check_recovery(&mut self) {
        // Whole packets: they are many, and pieces have been tried by now.
        self.piece = 0;
        let before = self.decoder.counters().packets;
        let mut came = 0;
        for n in 0..GOOD {
            let time = GOOD_START_NS + n * STEP_NS;
            let mut packet = Vec::with_capacity(CommonOutput::MAX_BYTES);
            let output = CommonOutput {
                time_startup_ns: time,
                quaternion: Some([0.5, -0.5, 0.5, 0.5]),
                angular_rate: [0.25, 0.0, -0.125],
                accel: [0.0, 0.5, -9.75],
            };
            output.encode(&mut packet);
            self.push(&packet, |sample| {
                let place = sample.device_time_ns as u64;
                came += u64::from((GOOD_START_NS..=time).contains(&place));
            });
        }
        let others = (self.decoder.counters().packets - before).saturating_sub(came);
        let overlap = others * (PACKET_MAX_BYTES / CommonOutput::MAX_BYTES + 2) as u64;
        assert!(came + overlap >= GOOD, "{came} of {GOOD} good packets came through, {others} others");
    }
}
