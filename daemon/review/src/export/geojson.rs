//! GeoJSON (RFC 7946): tracks of boats and paths of rounds on the Earth, for maps.
//!
//! Heights are left out: the format counts them from the ellipsoid, and a run from the sea.

use bowwave_core::{ephemeris::Place, text::one_line};
use jiff::Timestamp;
use serde_json::{Value, json};

use super::earth::longitude_latitude;
use crate::{run::ReviewedRun, words};

/// Longer between two samples is a gap, seconds: two steps, and a little more.
const GAP_S: f64 = 0.12;

/// Parts of a line, each with its times, which a gap or the meridian of 180 degrees parts.
#[derive(Debug, Default)]
struct Line {
    parts: Vec<Vec<[f64; 2]>>,
    times_s: Vec<Vec<f64>>,
}

/// The run as text of that format; `None` where its place on the Earth is not known.
pub fn geojson(run: &ReviewedRun) -> Option<String> {
    let gun = run.place?;
    let boats = (0..run.details.boats.len()).map(|boat| boat_feature(run, gun, boat));
    let rounds = run.tracks.tracks.rounds.iter().map(|path| {
        let fired_s = run.seconds(path.fired_ns);
        let line = Line::of(
            gun,
            f64::INFINITY,
            path.points.iter().map(|point| (fired_s + f64::from(point.after_s), point.position)),
        );
        line.feature(round_properties(run, path.shot, fired_s))
    });
    let features: Vec<Value> = std::iter::once(gun_feature(run, gun)).chain(boats).chain(rounds).collect();
    Some(json!({ "type": "FeatureCollection", "features": features }).to_string())
}

/// The gun, with what is to be said of the run.
fn gun_feature(run: &ReviewedRun, gun: Place) -> Value {
    let began = run.stored.run.started_wall_ns.map(|wall_ns| {
        Timestamp::from_second(wall_ns.div_euclid(1_000_000_000)).unwrap_or_default().to_string()
    });
    let properties = json!({
        "kind": "gun",
        "name": "gun",
        "scenario": one_line(&run.stored.run.scenario),
        "run": run.stored.id,
        "began": began,
        "points": run.scored.sheet.points,
    });
    let place = rounded(longitude_latitude(gun, [0.0; 2]));
    json!({ "type": "Feature", "geometry": { "type": "Point", "coordinates": place }, "properties": properties })
}

fn boat_feature(run: &ReviewedRun, gun: Place, boat: usize) -> Value {
    let details = &run.details.boats[boat];
    let places = run.tracks.tracks.samples.iter().filter_map(|sample| {
        let pose = sample.boats.get(boat).copied().flatten()?;
        Some((run.seconds(sample.time_ns), pose.position))
    });
    let (name, model) = (one_line(&details.name), one_line(&details.model));
    let properties = json!({ "kind": "boat", "name": name, "side": details.side, "model": model });
    Line::of(gun, GAP_S, places).feature(properties)
}

fn round_properties(run: &ReviewedRun, shot: u64, fired_s: f64) -> Value {
    let stored = run.scored.shots.iter().find(|stored| stored.record.shot == shot);
    let said = stored.map(|stored| {
        let explained = run.scored.explanation(shot).map(|(_, round)| round);
        words::round(&stored.record, explained).1
    });
    json!({ "kind": "round", "name": format!("round {shot}"), "shot": shot, "fired_s": fired_s, "outcome": said })
}

impl Line {
    /// The line through places with their times, seconds; one that comes later than `gap_s` after the last begins a new part.
    fn of(gun: Place, gap_s: f64, places: impl Iterator<Item = (f64, [f32; 3])>) -> Self {
        let mut line = Self::default();
        let mut before: Option<(f64, [f64; 2])> = None;
        for (time_s, [x, y, _]) in places {
            let here = longitude_latitude(gun, [f64::from(x), f64::from(y)]);
            match before {
                Some((last_s, last)) if time_s - last_s <= gap_s => line.cross(last, here, time_s),
                _ => line.begin(),
            }
            line.put(here, time_s);
            before = Some((time_s, here));
        }
        line
    }

    fn begin(&mut self) {
        self.parts.push(Vec::new());
        self.times_s.push(Vec::new());
    }

    fn put(&mut self, place: [f64; 2], time_s: f64) {
        if let (Some(part), Some(times_s)) = (self.parts.last_mut(), self.times_s.last_mut()) {
            part.push(rounded(place));
            times_s.push(time_s);
        }
    }

    /// Cuts the line where it crosses the meridian of 180 degrees, as the format asks for.
    fn cross(&mut self, from: [f64; 2], to: [f64; 2], time_s: f64) {
        if (from[0] - to[0]).abs() <= 180.0 {
            return;
        }
        let edge = 180f64.copysign(from[0]);
        let there = to[0] + 2.0 * edge;
        let part = (edge - from[0]) / (there - from[0]);
        let latitude = from[1] + part * (to[1] - from[1]);
        self.put([edge, latitude], time_s);
        self.begin();
        self.put([-edge, latitude], time_s);
    }

    /// The feature of this line. A part of one place alone is no line.
    fn feature(self, mut properties: Value) -> Value {
        let (parts, times_s): (Vec<_>, Vec<_>) =
            self.parts.into_iter().zip(self.times_s).filter(|(part, _)| part.len() > 1).unzip();
        properties["times_s"] = json!(times_s);
        let geometry = match parts.is_empty() {
            true => Value::Null,
            false => json!({ "type": "MultiLineString", "coordinates": parts }),
        };
        json!({ "type": "Feature", "geometry": geometry, "properties": properties })
    }
}

/// Degrees to a millimetre.
fn rounded(place: [f64; 2]) -> [f64; 2] {
    place.map(|degrees| (degrees * 1e8).round() / 1e8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_cut_at_gaps_and_at_the_edge_of_the_map() {
        let gun = Place::new(-17.0, 179.9999).expect("a place");
        let places = [(0.0, 0.0), (0.05, 20.0), (0.1, 40.0), (5.0, 60.0), (5.05, 80.0)];
        let line = Line::of(gun, GAP_S, places.into_iter().map(|(time_s, x)| (time_s, [x, 0.0, 0.0])));
        let ends: Vec<[f64; 2]> =
            line.parts.iter().map(|part| [part[0][0], part[part.len() - 1][0]]).collect();
        assert_eq!(line.parts.len(), 3, "{ends:?}");
        assert!(ends[0][1] == 180.0 && ends[1][0] == -180.0, "{ends:?}");
        assert!(line.parts.iter().zip(&line.times_s).all(|(part, times)| part.len() == times.len()));
    }
}
