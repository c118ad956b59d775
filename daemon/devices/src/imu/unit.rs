//! A unit of a known format: its bytes in, samples out.

use bowwave_core::{event::ImuSample, time::Time};

use super::{
    ImuCounters, ImuFormat,
    finish::{Finisher, Outcome},
    reading::{Fields, Reading},
};
use crate::{
    bno08x,
    framing::{Found, Framing, LineCounters, Scanner},
    microstrain, sbg,
    vectornav::{self, ascii},
    witmotion, xsens,
};

/// Packets without a sample that a unit may send whose packets are samples...
const PATIENCE_WHOLE: u32 = 4;
/// ...and one that sends a sample in parts, among packets about other things.
const PATIENCE_PARTS: u32 = 24;

/// The closed set of formats: a scanner of each, and what each remembers between packets.
#[derive(Debug)]
enum Wire {
    VectorNav(Scanner<vectornav::Binary>),
    VectorNavAscii(Scanner<ascii::Lines>),
    Xsens(Scanner<xsens::Xbus>, xsens::Unit),
    MicroStrain(Scanner<microstrain::Mip>, microstrain::Unit),
    Sbg(Scanner<sbg::Ecom>, sbg::Unit),
    Bno08x(Scanner<bno08x::Rvc>, bno08x::Unit),
    Witmotion(Scanner<witmotion::Standard>, witmotion::Unit),
}

/// Where a packet lay, for the detection of formats.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Its length, bytes.
    pub(super) bytes: usize,
    /// Bytes skipped before it since the line began.
    pub(super) skipped_bytes: u64,
}

impl Wire {
    fn new(format: ImuFormat) -> Self {
        match format {
            ImuFormat::VectorNav => Self::VectorNav(Scanner::new()),
            ImuFormat::VectorNavAscii => Self::VectorNavAscii(Scanner::new()),
            ImuFormat::Xsens => Self::Xsens(Scanner::new(), xsens::Unit::default()),
            ImuFormat::MicroStrain => Self::MicroStrain(Scanner::new(), microstrain::Unit::default()),
            ImuFormat::Sbg => Self::Sbg(Scanner::new(), sbg::Unit::default()),
            ImuFormat::Bno08x => Self::Bno08x(Scanner::new(), bno08x::Unit::default()),
            ImuFormat::Witmotion => Self::Witmotion(Scanner::new(), witmotion::Unit::default()),
        }
    }

    const fn counters(&self) -> LineCounters {
        match self {
            Self::VectorNav(scanner) => scanner.counters(),
            Self::VectorNavAscii(scanner) => scanner.counters(),
            Self::Xsens(scanner, _) => scanner.counters(),
            Self::MicroStrain(scanner, _) => scanner.counters(),
            Self::Sbg(scanner, _) => scanner.counters(),
            Self::Bno08x(scanner, _) => scanner.counters(),
            Self::Witmotion(scanner, _) => scanner.counters(),
        }
    }

    /// Calls `sink` with what each packet says and where it lay.
    fn push(&mut self, bytes: &[u8], sink: &mut dyn FnMut(Option<Reading>, Place)) {
        match self {
            Self::VectorNav(scanner) => {
                scan(scanner, bytes, sink, |p| Some(vectornav::Packet::of(&p).reading()));
            }
            Self::VectorNavAscii(scanner) => {
                scan(scanner, bytes, sink, |p| Some(ascii::Line::parse(p.bytes)?.reading()));
            }
            Self::Xsens(scanner, unit) => {
                scan(scanner, bytes, sink, |p| Some(unit.reading(&xsens::Packet::parse(p.bytes, p.head)?)))
            }
            Self::MicroStrain(scanner, unit) => scan(scanner, bytes, sink, |p| {
                Some(unit.reading(&microstrain::Packet::parse(p.bytes, p.head)?))
            }),
            Self::Sbg(scanner, unit) => {
                scan(scanner, bytes, sink, |p| unit.reading(&sbg::Log::parse(p.bytes, p.head)?));
            }
            Self::Bno08x(scanner, unit) => {
                scan(scanner, bytes, sink, |p| Some(unit.reading(&bno08x::Packet::parse(p.bytes)?)));
            }
            Self::Witmotion(scanner, unit) => {
                scan(scanner, bytes, sink, |p| unit.reading(&witmotion::Packet::parse(p.bytes, p.head)?))
            }
        }
    }
}

fn scan<F: Framing>(
    scanner: &mut Scanner<F>,
    bytes: &[u8],
    sink: &mut dyn FnMut(Option<Reading>, Place),
    mut read: impl FnMut(Found<'_, F::Head>) -> Option<Reading>,
) {
    scanner.push(bytes, |found| {
        let place = Place { bytes: found.bytes.len(), skipped_bytes: found.skipped_bytes };
        sink(read(found), place);
    });
}

/// A unit of a known format.
#[derive(Debug)]
pub(super) struct Unit {
    format: ImuFormat,
    wire: Wire,
    finisher: Finisher,
    samples: u64,
    not_finite: u64,
    unusable: u64,
    other: u64,
}

impl Unit {
    pub(super) fn new(format: ImuFormat) -> Self {
        let (period_ns, patience) = match format {
            ImuFormat::VectorNav | ImuFormat::VectorNavAscii | ImuFormat::Xsens => (None, PATIENCE_WHOLE),
            ImuFormat::Bno08x => (Some(bno08x::PERIOD_NS), PATIENCE_WHOLE),
            ImuFormat::MicroStrain | ImuFormat::Sbg | ImuFormat::Witmotion => (None, PATIENCE_PARTS),
        };
        Self {
            format,
            wire: Wire::new(format),
            finisher: Finisher::new(period_ns, patience),
            samples: 0,
            not_finite: 0,
            unusable: 0,
            other: 0,
        }
    }

    /// How many places of a stream begin something with a right check sum.
    #[cfg(test)]
    pub(super) fn intact_places(format: ImuFormat, bytes: &[u8]) -> usize {
        use crate::framing::intact_places as places;
        match format {
            ImuFormat::VectorNav => places::<vectornav::Binary>(bytes),
            ImuFormat::VectorNavAscii => places::<ascii::Lines>(bytes),
            ImuFormat::Xsens => places::<xsens::Xbus>(bytes),
            ImuFormat::MicroStrain => places::<microstrain::Mip>(bytes),
            ImuFormat::Sbg => places::<sbg::Ecom>(bytes),
            ImuFormat::Bno08x => places::<bno08x::Rvc>(bytes),
            ImuFormat::Witmotion => places::<witmotion::Standard>(bytes),
        }
        .len()
    }

    pub(super) const fn format(&self) -> ImuFormat {
        self.format
    }

    pub(super) const fn fields(&self) -> Fields {
        self.finisher.fields()
    }

    pub(super) const fn counters(&self) -> ImuCounters {
        let line = self.wire.counters();
        ImuCounters {
            packets: line.packets,
            bad_crc: line.bad_crc,
            skipped_bytes: line.skipped_bytes,
            samples: self.samples,
            not_finite: self.not_finite,
            unusable: self.unusable,
            other: self.other,
        }
    }

    /// So many of its samples were not handed on: their packets count as others.
    pub(super) const fn disown(&mut self, samples: u64) {
        self.samples -= samples;
        self.other += samples;
    }

    /// Calls `sink` with each packet's place and the good sample that it completed, if it did.
    pub(super) fn push(
        &mut self,
        bytes: &[u8],
        arrival: Time,
        sink: &mut dyn FnMut(Option<ImuSample>, Place),
    ) {
        let Self { wire, finisher, samples, not_finite, unusable, other, .. } = self;
        wire.push(bytes, &mut |reading, place| {
            let sample = match finisher.take(reading, arrival) {
                Outcome::Sample(sample) if sample.is_finite() => {
                    *samples += 1;
                    Some(sample)
                }
                Outcome::Sample(_) => {
                    *not_finite += 1;
                    None
                }
                Outcome::Unusable => {
                    *unusable += 1;
                    None
                }
                Outcome::Other => {
                    *other += 1;
                    None
                }
            };
            sink(sample, place);
        });
    }
}
