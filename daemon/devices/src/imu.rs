//! From bytes of the inertial unit to samples that can be trusted, sans-io: shared by the serial line and by replays.

use bowwave_core::{event::ImuSample, time::Time};

use crate::vectornav::Parser;

/// What came over the line and what became of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ImuCounters {
    /// Packets with a right check sum.
    pub packets: u64,
    /// Damaged packets and false preambles.
    pub bad_crc: u64,
    /// Bytes that belonged to no packet.
    pub skipped_bytes: u64,
    /// Samples handed on.
    pub samples: u64,
    /// Packets dropped because a number in them was not finite or the attitude no rotation.
    pub not_finite: u64,
    /// Packets dropped because time, rate or acceleration was missing: the unit's output is configured otherwise.
    pub unusable: u64,
}

/// Turns the bytes of a unit's line into samples.
#[derive(Debug, Default)]
pub struct ImuDecoder {
    parser: Parser,
    samples: u64,
    not_finite: u64,
    unusable: u64,
}

impl ImuDecoder {
    /// A decoder that has met nothing.
    pub fn new() -> Self {
        Self::default()
    }

    /// What has been met so far.
    pub const fn counters(&self) -> ImuCounters {
        let parser = self.parser.counters();
        ImuCounters {
            packets: parser.packets,
            bad_crc: parser.bad_crc,
            skipped_bytes: parser.skipped_bytes,
            samples: self.samples,
            not_finite: self.not_finite,
            unusable: self.unusable,
        }
    }

    /// Takes bytes that arrived together at `arrival` and calls `sink` with each good sample that they complete.
    pub fn push(&mut self, bytes: &[u8], arrival: Time, mut sink: impl FnMut(ImuSample)) {
        let Self { parser, samples, not_finite, unusable } = self;
        parser.push(bytes, |packet| match packet.to_sample(arrival) {
            None => {
                if *unusable == 0 {
                    log::warn!(
                        "the inertial unit's packets lack time since start-up, angular rate or acceleration: \
                         add them to its binary output (common group, bits 0, 5 and 8)"
                    );
                }
                *unusable += 1;
            }
            Some(sample) if !sample.is_finite() => {
                if *not_finite == 0 {
                    log::warn!(
                        "the inertial unit sends numbers that are not finite: dropped; power-cycle the unit"
                    );
                }
                *not_finite += 1;
            }
            Some(sample) => {
                *samples += 1;
                sink(sample);
            }
        });
    }
}
