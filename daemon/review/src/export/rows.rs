//! A run as rows: everything that happened, and where everything was, one line each.

use bowwave_core::{
    text::plain_cell,
    world::track::{RoundPath, TrackPose},
};
use serde::Serialize;

use crate::{run::ReviewedRun, words};

/// A row. Times are seconds from the run's beginning; places are metres from the gun's foot: east, north, up.
#[derive(Clone, Debug, Default, Serialize)]
struct Row<'a> {
    time_s: f64,
    /// `boat`, `camera`, `round`, `event` or `outcome`.
    kind: &'static str,
    /// The boat's name, or the round's number.
    name: String,
    east_m: Option<f32>,
    north_m: Option<f32>,
    up_m: Option<f32>,
    /// Rotation from the body's axes to the world's.
    qx: Option<f32>,
    qy: Option<f32>,
    qz: Option<f32>,
    qw: Option<f32>,
    words: Option<&'a str>,
}

/// The run as CSV, a header line first.
pub fn csv(run: &ReviewedRun) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    each(run, &mut |row| {
        let words = row.words.map(plain_cell);
        let row = Row { name: plain_cell(&row.name), words: words.as_deref(), ..row.clone() };
        // Writing to memory does not fail, and each row has the same fields.
        drop(writer.serialize(row));
    });
    let bytes = writer.into_inner().unwrap_or_default();
    String::from_utf8(bytes).unwrap_or_default()
}

/// The run as JSON, one object a line; fields that do not apply are null.
pub fn json_lines(run: &ReviewedRun) -> String {
    let mut text = String::new();
    each(run, &mut |row| {
        text.push_str(&serde_json::to_string(row).unwrap_or_default());
        text.push('\n');
    });
    text
}

/// Hands over all rows: what happened, then tracks of boats and gun, then paths of rounds.
fn each(run: &ReviewedRun, put: &mut impl FnMut(&Row<'_>)) {
    for event in &run.scored.events {
        if let Some((_, words, boat)) = words::event(&event.fact) {
            put(&said(run.seconds(event.time.ns()), "event", boat.unwrap_or_default().to_owned(), &words));
        }
    }
    for stored in &run.scored.shots {
        let explained = run.scored.explanation(stored.record.shot);
        let (_, words) = words::round(&stored.record, explained.map(|(_, round)| round));
        put(&said(run.seconds(stored.record.fired.ns()), "outcome", stored.record.shot.to_string(), &words));
    }
    for sample in &run.tracks.tracks.samples {
        let time_s = run.seconds(sample.time_ns);
        if let Some(camera) = sample.camera {
            put(&placed(time_s, "camera", String::new(), camera));
        }
        for (boat, pose) in run.details.boats.iter().zip(&sample.boats) {
            if let Some(pose) = pose {
                put(&placed(time_s, "boat", boat.name.clone(), *pose));
            }
        }
    }
    run.tracks.tracks.rounds.iter().for_each(|path| round(run, path, put));
}

fn said<'a>(time_s: f64, kind: &'static str, name: String, words: &'a str) -> Row<'a> {
    Row { time_s, kind, name, words: Some(words), ..Row::default() }
}

/// A row of a body at a place.
fn at<'a>(time_s: f64, kind: &'static str, name: String, [x, y, z]: [f32; 3]) -> Row<'a> {
    Row { time_s, kind, name, east_m: Some(x), north_m: Some(y), up_m: Some(z), ..Row::default() }
}

fn placed<'a>(time_s: f64, kind: &'static str, name: String, pose: TrackPose) -> Row<'a> {
    let [i, j, k, w] = pose.attitude;
    Row { qx: Some(i), qy: Some(j), qz: Some(k), qw: Some(w), ..at(time_s, kind, name, pose.position) }
}

fn round(run: &ReviewedRun, path: &RoundPath, put: &mut impl FnMut(&Row<'_>)) {
    for point in &path.points {
        let time_s = run.seconds(path.fired_ns) + f64::from(point.after_s);
        put(&at(time_s, "round", path.shot.to_string(), point.position));
    }
}
