//! Which format a line carries, found from the bytes alone.
//!
//! Every format reads along. The first of which so many packets stand close together that chance cannot have put them there
//! is the line's; the samples that it has made meanwhile are not lost. What lies between packets (text of a receiver on the
//! same line, noise) may be as much as the packets themselves.

use std::collections::VecDeque;

use bowwave_core::{event::ImuSample, time::Time};

use super::{
    ImuFormat,
    unit::{Place, Unit},
};

/// Samples kept of a format that is not proven yet.
const SAMPLES: usize = 16;

/// Packets that prove a format. Chance makes a packet of random bytes with a check sum of sixteen bits (and a preamble) less
/// than once in 10^8 bytes, one of eight bits about once in 10^6: as many close together never.
pub(super) const fn proof(format: ImuFormat) -> usize {
    match format {
        ImuFormat::VectorNav | ImuFormat::VectorNavAscii | ImuFormat::MicroStrain | ImuFormat::Sbg => 2,
        ImuFormat::Xsens => 3,
        ImuFormat::Bno08x => 5,
        ImuFormat::Witmotion => 6,
    }
}

/// One format that reads along.
#[derive(Debug)]
struct Candidate {
    unit: Unit,
    /// The newest packets' places, as many as prove the format.
    places: VecDeque<Place>,
    samples: VecDeque<ImuSample>,
}

impl Candidate {
    fn new(format: ImuFormat) -> Self {
        Self { unit: Unit::new(format), places: VecDeque::new(), samples: VecDeque::new() }
    }

    fn push(&mut self, bytes: &[u8], arrival: Time) {
        let Self { unit, places, samples } = self;
        let proof = proof(unit.format());
        let mut proven = is_proven(places, proof);
        unit.push(bytes, arrival, &mut |sample, place| {
            if let Some(sample) = sample {
                // What comes behind the proof belongs to the line whatever there is of it; before, memory is bounded.
                if samples.len() >= SAMPLES && !proven {
                    samples.pop_front();
                }
                samples.push_back(sample);
            }
            if !proven {
                if places.len() >= proof {
                    places.pop_front();
                }
                places.push_back(place);
                proven = is_proven(places, proof);
            }
        });
    }

    fn proven(&self) -> bool {
        is_proven(&self.places, proof(self.unit.format()))
    }
}

/// As many packets as prove it, with fewer bytes skipped between them than are in them.
fn is_proven(places: &VecDeque<Place>, proof: usize) -> bool {
    let (Some(first), Some(last)) = (places.front(), places.back()) else { return false };
    let bytes: usize = places.iter().map(|p| p.bytes).sum();
    places.len() >= proof && last.skipped_bytes - first.skipped_bytes <= bytes as u64
}

/// A line whose format is not known yet.
#[derive(Debug)]
pub(super) struct Detection {
    candidates: Vec<Candidate>,
}

impl Detection {
    pub(super) fn new() -> Self {
        Self { candidates: ImuFormat::ALL.into_iter().map(Candidate::new).collect() }
    }

    /// Takes bytes that arrived together; the unit once its format is proven, with the samples that it has made so far.
    pub(super) fn push(&mut self, bytes: &[u8], arrival: Time) -> Option<(Unit, VecDeque<ImuSample>)> {
        for candidate in &mut self.candidates {
            candidate.push(bytes, arrival);
        }
        let place = self.candidates.iter().position(Candidate::proven)?;
        let Candidate { unit, samples, .. } = self.candidates.swap_remove(place);
        Some((unit, samples))
    }

    /// Bytes that belong to no packet of any format, and damaged packets: the fewest that any format counts.
    pub(super) fn least(&self) -> (u64, u64) {
        let counters = || self.candidates.iter().map(|c| c.unit.counters());
        let bad = counters().map(|c| c.bad_crc).min().unwrap_or(0);
        (bad, counters().map(|c| c.skipped_bytes).min().unwrap_or(0))
    }
}
