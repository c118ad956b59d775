//! Where two runs diverge: settings, inputs, and what came of them.

use std::path::Path;

use anyhow::Result;
use bowwave_core::{
    event::{ShipFix, ShipSample},
    session::Digest,
    time::Time,
    world::{
        exercise::ExerciseEvent,
        score::{Outcome, ShotRecord},
    },
};
use bowwave_record::{Entry, Properties, RecordError, RecordingReader};
use serde::Serialize;
use sha2::{Digest as _, Sha256};

use crate::replay::{Replayed, replay_noting};

/// First differences between two runs. Seconds count from each run's first tick.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Divergence {
    /// Settings that differ, by name.
    pub settings: Vec<String>,
    /// The first input that differs.
    pub input: Option<InputDivergence>,
    /// Ticks that both have.
    pub ticks: u64,
    /// From when on scenes differ, as they were recorded.
    pub scenes_from_s: Option<f64>,
    /// The first round that ended otherwise.
    pub round: Option<RoundDivergence>,
    /// The first event of the exercise that differs.
    pub event: Option<EventDivergence>,
}

/// An input that differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InputDivergence {
    /// When.
    pub at_s: f64,
    /// The kind of input in either; `None` where a run has ended.
    pub kinds: [Option<&'static str>; 2],
}

/// A round that ended otherwise.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RoundDivergence {
    /// Its number.
    pub shot: u64,
    /// What became of it in either run, in words.
    pub outcomes: [String; 2],
}

/// An event that differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EventDivergence {
    /// When it happened in either run, seconds.
    pub at_s: [Option<f64>; 2],
    /// What happened, as the journal names it.
    pub facts: [Option<String>; 2],
}

impl Divergence {
    /// Tests whether the runs are the same.
    pub fn is_none(&self) -> bool {
        let Self { settings, input, scenes_from_s, round, event, .. } = self;
        settings.is_empty()
            && input.is_none()
            && scenes_from_s.is_none()
            && round.is_none()
            && event.is_none()
    }
}

/// What a run gave.
#[derive(Default)]
struct RunOutput {
    records: Vec<ShotRecord>,
    events: Vec<ExerciseEvent>,
}

/// Compares two runs; the replay of each as well, which tells whether it is that run.
pub fn divergence(paths: [&Path; 2]) -> Result<(Vec<Replayed>, Divergence)> {
    let mut found = Divergence::default();
    let starts = inputs(paths, &mut found)?;
    let mut outputs = [RunOutput::default(), RunOutput::default()];
    let mut replays = Vec::new();
    for (path, output) in paths.iter().zip(&mut outputs) {
        let replayed = replay_noting(path, &mut |_, records, events| {
            output.records.extend_from_slice(records);
            output.events.extend_from_slice(events);
        })?;
        replays.push(replayed);
    }
    let [a, b] = &mut outputs;
    [&mut *a, &mut *b].into_iter().for_each(|run| run.records.sort_by_key(|record| record.shot));
    found.round = rounds(&a.records, &b.records);
    found.event = events(&a.events, &b.events, starts);
    Ok((replays, found))
}

/// Compares settings, inputs and the digests that were recorded; the first tick of either.
fn inputs(paths: [&Path; 2], found: &mut Divergence) -> Result<[Time; 2]> {
    let [a, b] = [RecordingReader::open(paths[0])?, RecordingReader::open(paths[1])?];
    found.settings = settings(a.properties(), b.properties());
    let starts = [a.properties().start, b.properties().start];
    let mut entries = [a.entries_as_written()?, b.entries_as_written()?];
    let mut ticks: [Option<Time>; 2] = [None, None];
    loop {
        let [one, other] = &mut entries;
        let (one, other) = (next(one, starts[0])?, next(other, starts[1])?);
        for (tick, entry) in ticks.iter_mut().zip([&one, &other]) {
            if let Some(Met { tick: Some((time, ..)), .. }) = entry {
                tick.get_or_insert(*time);
            }
        }
        let (at, since) = match (&one, &other) {
            (None, None) => break,
            (Some(met), _) => (met.time, ticks[0].unwrap_or(starts[0])),
            (None, Some(met)) => (met.time, ticks[1].unwrap_or(starts[1])),
        };
        if let (Some((_, _, a)), Some((_, _, b))) =
            (one.as_ref().and_then(|met| met.tick), other.as_ref().and_then(|met| met.tick))
        {
            found.ticks += 1;
            if a != b && found.scenes_from_s.is_none() {
                found.scenes_from_s = Some(at.secs_since(since));
            }
        }
        if one.as_ref().map(|met| (met.kind, met.content))
            != other.as_ref().map(|met| (met.kind, met.content))
        {
            let kinds = [one, other].map(|met| met.map(|met| met.kind));
            found.input = Some(InputDivergence { at_s: at.secs_since(since), kinds });
            break;
        }
    }
    // Events count from a run's first tick, which may come after what differs.
    for run in 0..2 {
        while ticks[run].is_none()
            && let Some(met) = next(&mut entries[run], starts[run])?
        {
            ticks[run] = met.tick.map(|(time, ..)| time);
        }
    }
    Ok([0, 1].map(|run| ticks[run].unwrap_or(starts[run])))
}

/// An input as it is compared.
struct Met {
    time: Time,
    kind: &'static str,
    content: u64,
    /// Of a tick: its time, and the hashes over records and scenes before it.
    tick: Option<(Time, u64, u64)>,
}

/// The next input of a session in a recording that begins at `start`; `None` at its end.
fn next(
    entries: &mut impl Iterator<Item = std::result::Result<Entry, RecordError>>,
    start: Time,
) -> Result<Option<Met>> {
    for entry in entries {
        let entry = match entry {
            Err(RecordError::Truncated { .. }) => return Ok(None),
            entry => entry?,
        };
        let (time, mut tick) = (entry.time(), None);
        let since = |time: Time| time.ns_since(start);
        let mut digest = Digest::default();
        let kind = match &entry {
            Entry::Imu(sample) => {
                digest.take(&(sample.device_time_ns, sample.rate, sample.accel, sample.world_from_imu));
                "sample of the inertial unit"
            }
            Entry::Frame(frame) => {
                digest.take(&(frame.sequence, Sha256::digest(&frame.jpeg)));
                "picture"
            }
            Entry::Picture(picture) => {
                let seen = &picture.picture;
                let size = (seen.format(), seen.width(), seen.height());
                digest.take(&(
                    picture.sequence,
                    since(picture.mid_exposure),
                    size,
                    Sha256::digest(seen.bytes()),
                ));
                "picture"
            }
            Entry::Trigger(edge) => {
                digest.take(&(since(edge.time), edge.pressed));
                "edge of the trigger"
            }
            Entry::Mark(mark) => {
                digest.take(&since(mark.time));
                "mark"
            }
            Entry::Act(act) => {
                digest.take(&(since(act.time), act.act));
                "act"
            }
            Entry::Order(order) => {
                digest.take(&(since(order.time), &order.order));
                "order"
            }
            Entry::ShipValues(sample) => {
                digest.take(&ShipSample { arrival: Time::from_ns(since(sample.arrival)), ..*sample });
                "sample of the ship"
            }
            Entry::ShipFix(fix) => {
                digest.take(&ShipFix { arrival: Time::from_ns(since(fix.arrival)), ..*fix });
                "place or time of the ship"
            }
            Entry::Fault(fault) => {
                let change = &fault.change;
                digest.take(&(since(change.time), change.fault, &change.change));
                "fault"
            }
            Entry::Tick(entry) => {
                tick = Some((time, entry.records, entry.scenes));
                digest.take(&since(entry.tick.time));
                "tick"
            }
            Entry::Ship(_) | Entry::Truth(_) | Entry::Pose(_) => continue,
        };
        return Ok(Some(Met { time, kind, content: digest.get(), tick }));
    }
    Ok(None)
}

/// Settings that differ, by name.
fn settings(a: &Properties, b: &Properties) -> Vec<String> {
    let mut differ = Vec::new();
    let mut compare = |name: &str, same: bool| {
        if !same {
            differ.push(name.to_owned());
        }
    };
    compare("calibration", a.calibration_toml == b.calibration_toml);
    compare("scenario", a.scenario_toml == b.scenario_toml);
    let names = a.extra.keys().chain(b.extra.keys()).filter_map(|key| key.strip_prefix("session."));
    let names: std::collections::BTreeSet<&str> = names.collect();
    for name in names {
        let key = format!("session.{name}");
        compare(name, a.extra.get(&key) == b.extra.get(&key));
    }
    differ
}

fn rounds(a: &[ShotRecord], b: &[ShotRecord]) -> Option<RoundDivergence> {
    let words = |record: Option<&ShotRecord>| record.map_or_else(|| "not fired".to_owned(), outcome);
    (0..a.len().max(b.len())).find_map(|i| {
        let [one, other] = [a.get(i), b.get(i)];
        let shot = one.or(other)?.shot;
        let outcomes = [words(one), words(other)];
        (outcomes[0] != outcomes[1]).then_some(RoundDivergence { shot, outcomes })
    })
}

fn outcome(record: &ShotRecord) -> String {
    match &record.outcome {
        Outcome::Hit { boat, zone, range_m, .. } => {
            format!("struck {boat} ({}) at {range_m:.1} m", zone.name())
        }
        Outcome::Miss { boat: Some(boat), miss_m, .. } => format!("missed {boat} by {miss_m:.2} m"),
        Outcome::Miss { boat: None, .. } => "missed all".to_owned(),
        Outcome::NotScored { .. } => "not scored".to_owned(),
    }
}

fn events(a: &[ExerciseEvent], b: &[ExerciseEvent], starts: [Time; 2]) -> Option<EventDivergence> {
    let told = |event: Option<&ExerciseEvent>, start: Time| {
        let event = event?;
        let fact = serde_json::to_string(&event.fact).unwrap_or_default();
        Some((event.time.secs_since(start), fact))
    };
    (0..a.len().max(b.len())).find_map(|i| {
        let [one, other] = [told(a.get(i), starts[0]), told(b.get(i), starts[1])];
        (one != other).then(|| EventDivergence {
            at_s: [one.as_ref().map(|e| e.0), other.as_ref().map(|e| e.0)],
            facts: [one.map(|e| e.1), other.map(|e| e.1)],
        })
    })
}
