//! The entries of a recording, round after round, on the replay's clock.

use std::{
    collections::BTreeMap,
    path::Path,
    sync::{Arc, Mutex, PoisonError},
};

use bowwave_core::time::{NS_PER_S, Time};
use bowwave_record::{Entries, Entry, FrameEntry, PictureEntry, RecordError, RecordingReader};

use super::{ReplayError, rate::ClockRate, truth::Truth};

/// How far entries may reach beyond the recording's period: what was exposed before its end and arrived after.
const TAIL_MAX_NS: i64 = NS_PER_S;

/// Where a replay's clock stands to the recording's.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timeline {
    /// Recorded time at which the first round begins.
    pub(super) base: Time,
    /// Replay time at which the first round begins.
    pub(super) origin: Time,
    /// Length of a round, where the recording loops.
    pub(super) period_ns: Option<i64>,
    /// Replay time at which the replay ends, if it was asked to.
    pub(super) end: Option<Time>,
}

impl Timeline {
    /// Takes the recording's times as they are, checked.
    pub(super) fn of(reader: &RecordingReader, looped: bool) -> Result<Self, ReplayError> {
        let (start, first) = (reader.properties().start, reader.first());
        // A start that belongs to other entries would have the replay wait, or begin before them.
        let base = if (0..=10 * NS_PER_S).contains(&first.ns_since(start)) { start } else { first };
        // A file that was cut short has no whole round.
        let period_ns = reader.properties().loop_ns.filter(|_| looped && reader.cut_at().is_none());
        if let Some(period) = period_ns {
            let last = first.plus_ns(reader.duration_ns());
            let fits =
                first.ns_since(base) < period && last.ns_since(base) <= period.saturating_add(TAIL_MAX_NS);
            if period < NS_PER_S / 10 || !fits {
                return Err(ReplayError::Loop {
                    path: reader.path().to_owned(),
                    period_s: period as f64 * 1e-9,
                    length_s: last.secs_since(base),
                });
            }
        }
        Ok(Self { base, origin: base, period_ns, end: None })
    }
}

/// Entries by replay time, without end where the recording loops.
pub(super) struct Laps {
    reader: RecordingReader,
    timeline: Timeline,
    truth: Arc<Mutex<Truth>>,
    entries: Entries,
    lap: i64,
    rate: ClockRate,
    /// Added to device times in this round.
    device_shift_ns: i64,
    /// First and newest sequence number of the first round.
    sequences: Option<(u32, u32)>,
    /// Next entry of the file.
    next: Option<Entry>,
    /// Entries beyond the end of their round, by time and order, to be merged with the round after.
    tail: BTreeMap<(Time, u64), Entry>,
    tail_count: u64,
    /// The file has nothing more to give.
    ended: bool,
    error: Option<RecordError>,
}

impl Laps {
    pub(super) fn new(
        reader: RecordingReader,
        timeline: Timeline,
        truth: Arc<Mutex<Truth>>,
    ) -> Result<Self, RecordError> {
        Ok(Self {
            entries: reader.entries()?,
            reader,
            timeline,
            truth,
            lap: 0,
            rate: ClockRate::default(),
            device_shift_ns: 0,
            sequences: None,
            next: None,
            tail: BTreeMap::new(),
            tail_count: 0,
            ended: false,
            error: None,
        })
    }

    /// The file, for messages.
    pub(super) fn path(&self) -> &Path {
        self.reader.path()
    }

    /// Rounds begun.
    pub(super) const fn rounds(&self) -> u64 {
        self.lap as u64 + 1
    }

    /// Whether there are lines of a ship's instruments.
    pub(super) const fn has_ship(&self) -> bool {
        self.reader.counts().ship > 0
    }

    /// Size of the pictures, as the recording states it.
    pub(super) const fn picture(&self) -> (u32, u32) {
        self.reader.properties().picture
    }

    /// Reads until `next` is filled or the file has nothing more.
    fn fill(&mut self) {
        while self.next.is_none() && !self.ended {
            match self.entries.next() {
                Some(Ok(entry)) => {
                    let entry = self.placed(entry);
                    if self.round_end().is_some_and(|end| entry.time() >= end) {
                        self.tail.insert((entry.time(), self.tail_count), entry);
                        self.tail_count += 1;
                    } else {
                        self.next = Some(entry);
                    }
                }
                Some(Err(error)) => {
                    self.error = Some(error);
                    self.ended = true;
                }
                None => self.begin_round(),
            }
        }
    }

    fn round_end(&self) -> Option<Time> {
        self.timeline.period_ns.map(|p| self.timeline.origin.plus_ns(p.saturating_mul(self.lap + 1)))
    }

    /// Begins the next round, where there is one.
    fn begin_round(&mut self) {
        // Nothing of a round arrives before it begins.
        let after_end = self.timeline.end.zip(self.round_end()).is_some_and(|(end, begin)| begin >= end);
        let Some(period) = self.timeline.period_ns.filter(|_| !after_end) else {
            self.ended = true;
            return;
        };
        match self.reader.entries() {
            Ok(entries) => self.entries = entries,
            Err(error) => {
                self.error = Some(error);
                self.ended = true;
                return;
            }
        }
        self.lap += 1;
        // The unit's clock runs on at its own rate, so that the line between the clocks has no kink at the seam; it never
        // runs backwards, whatever was recorded.
        let round_ns = self.rate.device_ns(period).max(self.rate.span_ns().saturating_add(1));
        self.device_shift_ns = round_ns.saturating_mul(self.lap);
    }

    /// The entry on the replay's clock, in this round.
    fn placed(&mut self, mut entry: Entry) -> Entry {
        if self.lap == 0 {
            self.note(&entry);
        }
        let Timeline { base, origin, period_ns, .. } = self.timeline;
        let shift = origin.ns_since(base).saturating_add(period_ns.unwrap_or(0).saturating_mul(self.lap));
        match &mut entry {
            Entry::Imu(sample) => {
                sample.arrival = sample.arrival.plus_ns(shift);
                sample.device_time_ns = sample.device_time_ns.saturating_add(self.device_shift_ns);
            }
            Entry::Frame(FrameEntry { arrival, mid_exposure, sequence, .. })
            | Entry::Picture(PictureEntry { arrival, mid_exposure, sequence, .. }) => {
                *arrival = arrival.plus_ns(shift);
                *mid_exposure = mid_exposure.plus_ns(shift);
                *sequence = sequence.wrapping_add(self.later_sequence());
            }
            Entry::Trigger(edge) => edge.time = edge.time.plus_ns(shift),
            Entry::Ship(line) => line.arrival = line.arrival.plus_ns(shift),
            Entry::Mark(mark) => mark.time = mark.time.plus_ns(shift),
            Entry::Act(act) => act.time = act.time.plus_ns(shift),
            Entry::Order(order) => order.time = order.time.plus_ns(shift),
            Entry::Truth(pose) => {
                pose.time = pose.time.plus_ns(shift);
                if self.lap == 0 {
                    self.truth.lock().unwrap_or_else(PoisonError::into_inner).push(pose.time, pose.pose);
                }
            }
            Entry::Pose(pose) => pose.time = pose.time.plus_ns(shift),
            // Belong to the run that was recorded.
            Entry::ShipValues(sample) => sample.arrival = sample.arrival.plus_ns(shift),
            Entry::ShipFix(fix) => fix.arrival = fix.arrival.plus_ns(shift),
            Entry::Fault(fault) => fault.logged = fault.logged.plus_ns(shift),
            Entry::Tick(entry) => entry.tick.time = entry.tick.time.plus_ns(shift),
        }
        entry
    }

    /// How much higher the camera's counter is in this round than in the first.
    fn later_sequence(&self) -> u32 {
        let (first, last) = self.sequences.unwrap_or_default();
        last.wrapping_sub(first).wrapping_add(1).wrapping_mul(self.lap as u32)
    }

    /// Learns from the first round what later ones need.
    fn note(&mut self, entry: &Entry) {
        match entry {
            Entry::Imu(sample) => self.rate.note(sample.device_time_ns, sample.arrival.ns()),
            Entry::Frame(FrameEntry { sequence, .. }) | Entry::Picture(PictureEntry { sequence, .. }) => {
                let first = self.sequences.map_or(*sequence, |(first, _)| first);
                self.sequences = Some((first, *sequence));
            }
            _ => {}
        }
    }
}

impl Iterator for Laps {
    type Item = Result<Entry, RecordError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.fill();
        let tail_first = match (self.tail.first_key_value(), &self.next) {
            (Some(((late, _), _)), Some(next)) => *late <= next.time(),
            (tail, _) => tail.is_some(),
        };
        let entry = if tail_first { self.tail.pop_first().map(|(_, late)| late) } else { self.next.take() };
        match entry {
            Some(entry) if self.timeline.end.is_some_and(|end| entry.time() >= end) => {
                self.ended = true;
                self.next = None;
                self.tail.clear();
                self.error = None;
                None
            }
            Some(entry) => Some(Ok(entry)),
            None => self.error.take().map(Err),
        }
    }
}
