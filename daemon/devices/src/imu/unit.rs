//! A unit of a known format: its bytes in, samples out.

use bowwave_core::{event::ImuSample, time::Time};

use super::{
    ImuCounters, ImuFormat,
    assembler::{Assembled, SampleAssembler},
    formats::{PacketPlace, PacketReader},
    reading::Fields,
};

/// A unit of a known format.
#[derive(Debug)]
pub(super) struct ImuUnit {
    reader: PacketReader,
    assembler: SampleAssembler,
    samples: u64,
    not_finite: u64,
    unusable: u64,
    other: u64,
}

impl ImuUnit {
    pub(super) fn new(format: ImuFormat) -> Self {
        Self {
            reader: PacketReader::new(format),
            assembler: SampleAssembler::new(format.period_ns(), format.patience()),
            samples: 0,
            not_finite: 0,
            unusable: 0,
            other: 0,
        }
    }

    pub(super) const fn format(&self) -> ImuFormat {
        self.reader.format()
    }

    pub(super) const fn fields(&self) -> Fields {
        self.assembler.fields()
    }

    pub(super) const fn counters(&self) -> ImuCounters {
        let line = self.reader.counters();
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

    /// Takes bytes in, where [`Self::next_packet`] has no more.
    pub(super) fn insert(&mut self, bytes: &[u8]) {
        self.reader.insert(bytes);
    }

    /// The next packet, of bytes that arrived at `arrival`: the good sample that it completed, if it did, and where it lay. `None`:
    /// more bytes are needed.
    pub(super) fn next_packet(&mut self, arrival: Time) -> Option<(Option<ImuSample>, PacketPlace)> {
        let (reading, place) = self.reader.next_packet()?;
        let (count, sample) = match self.assembler.take(reading, arrival) {
            Assembled::Sample(sample) if sample.is_finite() => (&mut self.samples, Some(sample)),
            Assembled::Sample(_) => (&mut self.not_finite, None),
            Assembled::Unusable => (&mut self.unusable, None),
            Assembled::Other => (&mut self.other, None),
        };
        *count += 1;
        Some((sample, place))
    }
}
