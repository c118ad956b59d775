//! From bytes of the inertial unit to samples that can be trusted, sans-io: shared by the serial line and by replays.
//!
//! A format's module knows its framing, its fields and its axes, and gives a `Reading`; `finish` makes samples of these,
//! `steady` and `wrap` see to the clocks, `detect` finds out which format a line carries.

pub(crate) mod axes;
mod detect;
mod finish;
#[cfg(test)]
mod pole_tests;
pub(crate) mod reading;
mod steady;
#[cfg(test)]
pub(crate) mod streams;
#[cfg(test)]
mod tests;
mod unit;
pub(crate) mod wrap;

use std::fmt;

use bowwave_core::{event::ImuSample, time::Time};

pub use self::reading::Fields;
use self::{detect::Detection, unit::Unit};

/// So many bytes without a packet put the format in doubt: more than any packet and its gaps.
const DOUBT_BYTES: u64 = 4096;

/// Bytes that are looked at together: what is kept of a line whose format is not known yet follows from it.
const PIECE_BYTES: usize = 1024;

/// A format that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ImuFormat {
    /// VectorNav's binary output.
    VectorNav,
    /// VectorNav's lines of text.
    VectorNavAscii,
    /// Xsens MTData2.
    Xsens,
    /// MicroStrain MIP.
    MicroStrain,
    /// SBG Systems' sbgECom.
    Sbg,
    /// UART-RVC of the BNO08x.
    Bno08x,
    /// Witmotion's standard protocol.
    Witmotion,
}

impl ImuFormat {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::VectorNav,
        Self::VectorNavAscii,
        Self::Xsens,
        Self::MicroStrain,
        Self::Sbg,
        Self::Bno08x,
        Self::Witmotion,
    ];

    /// Its name in the configuration.
    pub const fn key(self) -> &'static str {
        match self {
            Self::VectorNav => "vectornav",
            Self::VectorNavAscii => "vectornav-ascii",
            Self::Xsens => "xsens",
            Self::MicroStrain => "microstrain",
            Self::Sbg => "sbg",
            Self::Bno08x => "bno08x-rvc",
            Self::Witmotion => "witmotion",
        }
    }

    /// The format of that name.
    pub fn from_key(key: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.key() == key)
    }

    /// What to set on a unit of this format whose output lacks something.
    const fn remedy(self) -> &'static str {
        match self {
            Self::VectorNav => "add it to its binary output (common group, bits 0, 5 and 8)",
            Self::VectorNavAscii => "set its asynchronous output to VNYMR",
            Self::Xsens => "add it to its output configuration (1060, 2010, 4020, 8020)",
            Self::MicroStrain => {
                "add it to its message format (set 80: D5, 04, 05, 0A, or set 82: D5, 03, 0E, 1C)"
            }
            Self::Sbg => "switch its logs 3 (IMU data) and 7 (quaternion) on",
            Self::Bno08x => "power-cycle it",
            Self::Witmotion => "switch acceleration, rate and quaternion on in its output content",
        }
    }
}

impl fmt::Display for ImuFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::VectorNav => "VectorNav binary",
            Self::VectorNavAscii => "VectorNav ASCII",
            Self::Xsens => "Xsens MTData2",
            Self::MicroStrain => "MicroStrain MIP",
            Self::Sbg => "SBG sbgECom",
            Self::Bno08x => "BNO08x UART-RVC",
            Self::Witmotion => "Witmotion",
        })
    }
}

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
    /// Packets dropped because rate or acceleration stays missing: the unit's output is configured otherwise.
    pub unusable: u64,
    /// Packets that are a part of a sample, or about something else.
    pub other: u64,
}

impl ImuCounters {
    fn plus(self, more: Self) -> Self {
        Self {
            packets: self.packets + more.packets,
            bad_crc: self.bad_crc + more.bad_crc,
            skipped_bytes: self.skipped_bytes + more.skipped_bytes,
            samples: self.samples + more.samples,
            not_finite: self.not_finite + more.not_finite,
            unusable: self.unusable + more.unusable,
            other: self.other + more.other,
        }
    }
}

/// What a line is known to carry.
#[derive(Debug)]
enum Line {
    /// Nothing is proven yet: all formats read along.
    Detecting(Detection),
    /// A unit of this format, and the bytes that came since its last packet.
    Known(Box<Unit>, u64),
}

/// Turns the bytes of a unit's line into samples. Memory is bounded.
#[derive(Debug)]
pub struct ImuDecoder {
    line: Line,
    /// The only format that is read; `None`: it is detected.
    fixed: Option<ImuFormat>,
    /// Of units before.
    before: ImuCounters,
    /// What was warned of.
    warned_not_finite: bool,
    warned_unusable: bool,
}

impl Default for ImuDecoder {
    fn default() -> Self {
        Self::new()
    }
}

impl ImuDecoder {
    /// A decoder that finds out which format comes, and again where another one comes.
    pub fn new() -> Self {
        Self::with(None)
    }

    /// A decoder of this format alone.
    pub fn fixed(format: ImuFormat) -> Self {
        Self::with(Some(format))
    }

    /// [`Self::fixed`], or [`Self::new`] where there is no format.
    pub fn with(format: Option<ImuFormat>) -> Self {
        Self {
            line: start(format),
            fixed: format,
            before: ImuCounters::default(),
            warned_not_finite: false,
            warned_unusable: false,
        }
    }

    /// What has been met so far. Packets count once their format is known.
    pub fn counters(&self) -> ImuCounters {
        self.before.plus(match &self.line {
            Line::Known(unit, _) => unit.counters(),
            Line::Detecting(detection) => {
                let (bad_crc, skipped_bytes) = detection.least();
                ImuCounters { bad_crc, skipped_bytes, ..ImuCounters::default() }
            }
        })
    }

    /// The format that the line carries, once it is known.
    pub fn format(&self) -> Option<ImuFormat> {
        match &self.line {
            Line::Known(unit, _) => Some(unit.format()),
            Line::Detecting(_) => None,
        }
    }

    /// What the unit sends, as far as it has sent it.
    pub fn fields(&self) -> Fields {
        match &self.line {
            Line::Known(unit, _) => unit.fields(),
            Line::Detecting(_) => Fields::default(),
        }
    }

    /// Another unit may come: the line was opened anew, or its rate changed. Bytes of an unfinished packet are dropped.
    pub fn restart(&mut self) {
        self.before = self.counters();
        self.line = start(self.fixed);
    }

    /// Takes bytes that arrived together at `arrival` and calls `sink` with each good sample that they complete. A detected
    /// format's first few come together, each with its own arrival.
    pub fn push(&mut self, bytes: &[u8], arrival: Time, mut sink: impl FnMut(ImuSample)) {
        for piece in bytes.chunks(PIECE_BYTES) {
            self.take(piece, arrival, &mut sink);
        }
        self.warn();
    }

    fn take(&mut self, bytes: &[u8], arrival: Time, sink: &mut impl FnMut(ImuSample)) {
        match &mut self.line {
            Line::Known(unit, since_packet) => {
                let packets = unit.counters().packets;
                unit.push(bytes, arrival, &mut |sample, _| {
                    if let Some(sample) = sample {
                        sink(sample);
                    }
                });
                *since_packet =
                    if unit.counters().packets > packets { 0 } else { *since_packet + bytes.len() as u64 };
                if *since_packet > DOUBT_BYTES && self.fixed.is_none() {
                    self.restart();
                }
            }
            Line::Detecting(detection) => {
                if let Some((unit, samples)) = detection.push(bytes, arrival) {
                    log::info!("the inertial unit speaks {}", unit.format());
                    self.line = Line::Known(Box::new(unit), 0);
                    samples.into_iter().for_each(sink);
                }
            }
        }
    }

    /// Says once what is wrong with what the unit sends.
    fn warn(&mut self) {
        let Line::Known(unit, _) = &self.line else { return };
        let counters = unit.counters();
        if counters.unusable > 0 && !self.warned_unusable {
            self.warned_unusable = true;
            log::warn!(
                "the inertial unit's packets lack {}: {}",
                unit.fields().missing().join(" and "),
                unit.format().remedy()
            );
        }
        if counters.not_finite > 0 && !self.warned_not_finite {
            self.warned_not_finite = true;
            log::warn!("the inertial unit sends numbers that are not finite: dropped; power-cycle the unit");
        }
    }
}

fn start(fixed: Option<ImuFormat>) -> Line {
    match fixed {
        Some(format) => Line::Known(Box::new(Unit::new(format)), 0),
        None => Line::Detecting(Detection::new()),
    }
}
