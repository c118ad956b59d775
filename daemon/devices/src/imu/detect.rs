//! Which format a line carries, found from the bytes alone.
//!
//! Every format reads along. The first of which so many packets stand close together that chance cannot have put them there
//! is the line's; the samples of those packets are not lost. What lies between packets (text of a receiver on the
//! same line, noise) may be as much as the packets themselves.

use std::collections::VecDeque;

use bowwave_core::{event::ImuSample, time::Time};

use super::{ImuFormat, formats::PacketPlace, unit::ImuUnit};

/// One format that reads along.
#[derive(Debug)]
struct FormatCandidate {
    unit: ImuUnit,
    /// The newest packets, as many as prove the format, and the samples that they completed.
    newest: VecDeque<(PacketPlace, Option<ImuSample>)>,
    /// Samples of packets before: chance made them, or they came long before the proof.
    dropped: u64,
    /// Samples from the proof on; `None`: it is not proven.
    proven: Option<Vec<ImuSample>>,
}

impl FormatCandidate {
    fn new(format: ImuFormat) -> Self {
        Self { unit: ImuUnit::new(format), newest: VecDeque::new(), dropped: 0, proven: None }
    }

    fn take(&mut self, bytes: &[u8], arrival: Time) {
        let Self { unit, newest, dropped, proven } = self;
        let proof = unit.format().proof_packets();
        unit.insert(bytes);
        while let Some((sample, place)) = unit.next_packet(arrival) {
            if let Some(samples) = proven {
                samples.extend(sample);
                continue;
            }
            if newest.len() >= proof
                && let Some((_, Some(_))) = newest.pop_front()
            {
                *dropped += 1;
            }
            newest.push_back((place, sample));
            if is_proof(newest, proof) {
                *proven = Some(newest.iter().filter_map(|(_, sample)| *sample).collect());
            }
        }
    }
}

/// As many packets as prove it, with fewer bytes skipped between them than are in them.
fn is_proof(newest: &VecDeque<(PacketPlace, Option<ImuSample>)>, proof: usize) -> bool {
    let (Some((first, _)), Some((last, _))) = (newest.front(), newest.back()) else { return false };
    let bytes: usize = newest.iter().map(|(place, _)| place.bytes).sum();
    newest.len() >= proof && last.skipped_bytes - first.skipped_bytes <= bytes as u64
}

/// A line whose format is not known yet.
#[derive(Debug)]
pub(super) struct Detection {
    candidates: Vec<FormatCandidate>,
}

impl Detection {
    pub(super) fn new() -> Self {
        Self { candidates: ImuFormat::ALL.into_iter().map(FormatCandidate::new).collect() }
    }

    /// Takes bytes that arrived together; the unit once its format is proven, with the samples of the packets that proved it
    /// and those behind.
    pub(super) fn take(&mut self, bytes: &[u8], arrival: Time) -> Option<(ImuUnit, Vec<ImuSample>)> {
        for candidate in &mut self.candidates {
            candidate.take(bytes, arrival);
        }
        let place = self.candidates.iter().position(|c| c.proven.is_some())?;
        let FormatCandidate { mut unit, dropped, proven, .. } = self.candidates.swap_remove(place);
        unit.disown(dropped);
        Some((unit, proven.unwrap_or_default()))
    }

    /// Bytes that belong to no packet of any format, and damaged packets: the fewest that any format counts.
    pub(super) fn least(&self) -> (u64, u64) {
        let counters = || self.candidates.iter().map(|c| c.unit.counters());
        let bad = counters().map(|c| c.bad_crc).min().unwrap_or(0);
        (bad, counters().map(|c| c.skipped_bytes).min().unwrap_or(0))
    }
}
