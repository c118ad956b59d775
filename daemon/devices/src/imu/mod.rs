//! From bytes of the inertial unit to samples that can be trusted, sans-io: shared by the serial line and by replays.
//!
//! A format's file in [`formats`] knows its framing, its fields and its axes, and gives a `Reading`; `assembler` makes samples of
//! these, `packet_clock` and `unwrap` see to the clocks, `detect` finds out which format a line carries. All of them are pull
//! decoders: bytes in, and the next event for the asking.

mod assembler;
pub(crate) mod axes;
mod detect;
pub mod formats;
mod packet_clock;
#[cfg(test)]
mod pole_tests;
pub(crate) mod reading;
#[cfg(test)]
pub(crate) mod streams;
#[cfg(test)]
mod tests;
mod unit;
pub(crate) mod unwrap;

use std::collections::VecDeque;

use bowwave_core::{event::ImuSample, time::Time};

use self::{detect::Detection, unit::ImuUnit};
pub use self::{formats::ImuFormat, reading::Fields};
use crate::framing::chunk;

/// So many bytes without a packet put the format in doubt: more than any packet and its gaps.
const DOUBT_BYTES: u64 = 4096;

/// Counts of what came over the line and what became of it.
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

/// An event that [`ImuDecoder::next_event`] gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ImuEvent {
    /// The format of the line is proven. The samples of the packets that proved it follow.
    Recognised(ImuFormat),
    /// A good sample.
    Sample(ImuSample),
}

/// The knowledge of what a line carries.
#[derive(Debug)]
enum LineFormat {
    /// Nothing is proven yet: all formats read along.
    Detecting(Detection),
    /// A unit of this format, and the bytes that came since its last packet.
    Known(Box<ImuUnit>, u64),
}

/// Turns the bytes of a unit's line into samples. Memory is bounded.
#[derive(Debug)]
pub struct ImuDecoder {
    line: LineFormat,
    /// Samples of the packets that proved the format.
    ready: VecDeque<ImuSample>,
    /// The only format that is read; `None`: it is detected.
    fixed: Option<ImuFormat>,
    /// Counts of the units before.
    before: ImuCounters,
    /// It was warned of numbers that are not finite, and of packets that lack something.
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
            ready: VecDeque::new(),
            fixed: format,
            before: ImuCounters::default(),
            warned_not_finite: false,
            warned_unusable: false,
        }
    }

    /// Counts so far. Packets count once their format is known.
    pub fn counters(&self) -> ImuCounters {
        self.before.plus(match &self.line {
            LineFormat::Known(unit, _) => unit.counters(),
            LineFormat::Detecting(detection) => {
                let (bad_crc, skipped_bytes) = detection.least();
                ImuCounters { bad_crc, skipped_bytes, ..ImuCounters::default() }
            }
        })
    }

    /// The format that the line carries, once it is known.
    pub fn format(&self) -> Option<ImuFormat> {
        match &self.line {
            LineFormat::Known(unit, _) => Some(unit.format()),
            LineFormat::Detecting(_) => None,
        }
    }

    /// The fields that the unit sends, as far as it has sent them.
    pub fn fields(&self) -> Fields {
        match &self.line {
            LineFormat::Known(unit, _) => unit.fields(),
            LineFormat::Detecting(_) => Fields::default(),
        }
    }

    /// Another unit may come: the line was opened anew, or its rate changed. Bytes of an unfinished packet are dropped.
    pub fn restart(&mut self) {
        self.before = self.counters();
        self.line = start(self.fixed);
    }

    /// The next event of bytes that arrived together at `arrival`. Bytes are taken from the front of `input` as far as they are
    /// needed; `None`: they are used up. A detected format's first few samples come together, each with its own arrival.
    pub fn next_event(&mut self, input: &mut &[u8], arrival: Time) -> Option<ImuEvent> {
        loop {
            if let Some(sample) = self.ready.pop_front() {
                return Some(ImuEvent::Sample(sample));
            }
            let event = match &mut self.line {
                LineFormat::Known(unit, since_packet) => match unit.next_packet(arrival) {
                    Some((sample, _)) => {
                        *since_packet = 0;
                        sample.map(ImuEvent::Sample)
                    }
                    None if *since_packet > DOUBT_BYTES && self.fixed.is_none() => {
                        self.restart();
                        None
                    }
                    None => {
                        let Some(piece) = chunk(input) else { break };
                        *since_packet += piece.len() as u64;
                        unit.insert(piece);
                        None
                    }
                },
                LineFormat::Detecting(detection) => {
                    let Some(piece) = chunk(input) else { break };
                    detection.take(piece, arrival).map(|(unit, samples)| {
                        let format = unit.format();
                        self.ready.extend(samples);
                        self.line = LineFormat::Known(Box::new(unit), 0);
                        ImuEvent::Recognised(format)
                    })
                }
            };
            if event.is_some() {
                return event;
            }
        }
        self.warn();
        None
    }

    /// The samples alone of bytes that arrived together at `arrival`. The bytes are taken as the samples are.
    pub fn samples<'a>(
        &'a mut self,
        mut bytes: &'a [u8],
        arrival: Time,
    ) -> impl Iterator<Item = ImuSample> + 'a {
        std::iter::from_fn(move || {
            loop {
                match self.next_event(&mut bytes, arrival)? {
                    ImuEvent::Sample(sample) => return Some(sample),
                    ImuEvent::Recognised(_) => {}
                }
            }
        })
    }

    /// Says once what is wrong with what the unit sends.
    fn warn(&mut self) {
        let LineFormat::Known(unit, _) = &self.line else { return };
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

fn start(fixed: Option<ImuFormat>) -> LineFormat {
    match fixed {
        Some(format) => LineFormat::Known(Box::new(ImuUnit::new(format)), 0),
        None => LineFormat::Detecting(Detection::new()),
    }
}
