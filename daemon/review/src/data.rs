//! Data of a run for the page's scripts.

use std::{collections::BTreeMap, path::Path};

use bowwave_core::{
    side::Side,
    world::{
        exercise::ExerciseFact,
        track::{RoundPath, TrackPose, TrackSample},
    },
};
use bowwave_record::{BoatDetails, CameraDetails, RunDetails};
use serde::Serialize;

use crate::{
    meshes::{self, Mesh, base64_of},
    run::ReviewedRun,
    video::{PageVideo, RunVideo},
    words::{self, Weight},
};

/// Everything that scripts need. Times are seconds from the run's beginning.
#[derive(Debug, Serialize)]
pub struct PageData<'a> {
    end_s: f64,
    boats: &'a [BoatDetails],
    camera: CameraDetails,
    keep_off_m: f64,
    eye_height_m: f64,
    tracks: PageTracks,
    rounds: Vec<PageRound>,
    events: Vec<PageEvent>,
    /// From when to when the exercise stood still.
    pauses: Vec<[f64; 2]>,
    meshes: BTreeMap<&'a str, Mesh>,
    video: Option<PageVideo<'a>>,
}

/// Samples: arrays in base64 of little-endian numbers. NaN where there is none.
#[derive(Debug, Serialize)]
struct PageTracks {
    /// f64 seconds a sample.
    time_s: String,
    /// Seven f32 a sample: place, then attitude x, y, z, w.
    camera: String,
    /// The same for each boat of a sample, in the scenario's order.
    boats: String,
}

/// A round. Whoever wants its numbers finds them in the page's table, from the same record.
#[derive(Debug, Serialize)]
struct PageRound {
    shot: u64,
    fired_s: f64,
    weight: Weight,
    words: String,
    /// Number of the boat that it struck or came closest to.
    boat: Option<usize>,
    /// Error at the target, metres to the right and over, where a miss was explained.
    error_m: Option<[f64; 2]>,
    /// Seven f32 a point: seconds since it was fired, place, velocity. Empty where its path was not kept.
    path: String,
}

#[derive(Debug, Serialize)]
struct PageEvent {
    time_s: f64,
    weight: Weight,
    words: String,
    boat: Option<usize>,
}

/// The data of `run` and its video, and what there is to say of it.
pub fn of<'a>(run: &'a ReviewedRun, video: Option<&'a RunVideo>) -> (PageData<'a>, Vec<String>) {
    let RunDetails { boats, camera, keep_off_m, eye_height_m, .. } = &run.details;
    let (meshes, notes) = meshes::of_boats(boats, Path::new(&run.details.models_base));
    let data = PageData {
        end_s: run.seconds(run.end_ns()),
        boats,
        camera: *camera,
        keep_off_m: *keep_off_m,
        eye_height_m: *eye_height_m,
        tracks: tracks(run),
        rounds: rounds(run),
        events: events(run),
        pauses: pauses(run),
        meshes,
        video: video.map(|video| video.for_page(run)),
    };
    (data, notes)
}

/// The times for which the exercise stood still: nothing moved then, and nothing was sampled.
fn pauses(run: &ReviewedRun) -> Vec<[f64; 2]> {
    let mut pauses = Vec::new();
    let mut since = None;
    for event in &run.scored.events {
        match event.fact {
            ExerciseFact::Paused => since = Some(run.seconds(event.time.ns())),
            ExerciseFact::Resumed => {
                pauses.extend(since.take().map(|since| [since, run.seconds(event.time.ns())]));
            }
            _ => {}
        }
    }
    pauses.extend(since.map(|since| [since, run.seconds(run.end_ns())]));
    pauses
}

fn tracks(run: &ReviewedRun) -> PageTracks {
    let samples = &run.tracks.tracks.samples;
    let times: Vec<f64> = samples.iter().map(|sample| run.seconds(sample.time_ns)).collect();
    let cameras: Vec<[f32; 7]> = samples.iter().map(|sample| numbers(sample.camera)).collect();
    let count = run.details.boats.len();
    let of_sample = |sample: &TrackSample| -> Vec<[f32; 7]> {
        (0..count).map(|boat| numbers(sample.boats.get(boat).copied().flatten())).collect()
    };
    let boats: Vec<[f32; 7]> = samples.iter().flat_map(of_sample).collect();
    PageTracks { time_s: base64_of(&times), camera: base64_of(&cameras), boats: base64_of(&boats) }
}

fn numbers(pose: Option<TrackPose>) -> [f32; 7] {
    let Some(TrackPose { position: [x, y, z], attitude: [i, j, k, w] }) = pose else { return [f32::NAN; 7] };
    [x, y, z, i, j, k, w]
}

fn rounds(run: &ReviewedRun) -> Vec<PageRound> {
    let paths: BTreeMap<u64, &RoundPath> =
        run.tracks.tracks.rounds.iter().map(|path| (path.shot, path)).collect();
    let of_shot = |stored: &bowwave_record::StoredShot| {
        let record = &stored.record;
        let explained = run.scored.explanation(record.shot).map(|(_, round)| round);
        let (weight, words) = words::round(record, explained);
        let point = |p: &bowwave_core::world::track::PathPoint| {
            let ([x, y, z], [u, v, w]) = (p.position, p.velocity);
            [p.after_s, x, y, z, u, v, w]
        };
        let path: Vec<[f32; 7]> =
            paths.get(&record.shot).map_or_else(Vec::new, |path| path.points.iter().map(point).collect());
        PageRound {
            shot: record.shot,
            fired_s: run.seconds(record.fired.ns()),
            weight,
            words,
            boat: words::boat_of(record).and_then(|name| run.boat(name)),
            error_m: explained.filter(|round| round.was_aimed).map(|round| round.error_m),
            path: base64_of(&path),
        }
    };
    run.scored.shots.iter().map(of_shot).collect()
}

fn events(run: &ReviewedRun) -> Vec<PageEvent> {
    let of_event = |event: &bowwave_core::world::exercise::ExerciseEvent| {
        let (weight, words, boat) = words::event(&event.fact)?;
        let boat = boat.and_then(|name| run.boat(name));
        // Success with a hostile boat is none with a neutral one.
        let is_neutral = boat.is_some_and(|i| run.details.boats[i].side == Side::Neutral.name());
        let weight = if weight == Weight::Good && is_neutral { Weight::Alarm } else { weight };
        Some(PageEvent { time_s: run.seconds(event.time.ns()), weight, words, boat })
    };
    run.scored.events.iter().filter_map(of_event).collect()
}
