//! ACMI 2.2, the text format of flight recordings that debriefers open in Tacview.
//!
//! Places are degrees from the gun, which stands at 0 N 0 E where its place on the Earth is not known.

use std::{collections::BTreeMap, fmt::Write as _};

use bowwave_core::{
    ephemeris::Place,
    geometry::bearing_and_elevation_deg,
    text::one_line,
    world::track::{RoundPath, TrackPose},
};
use glam::{DQuat, DVec3};
use jiff::Timestamp;

use super::earth::longitude_latitude;
use crate::{run::ReviewedRun, words};

/// Numbers of objects: the own gun, the first boat, the first round.
const GUN: u64 = 1;
const BOATS: u64 = 0x100;
const ROUNDS: u64 = 0x1_0000;

/// The run as text of that format.
pub fn acmi(run: &ReviewedRun) -> String {
    let mut text = header(run);
    let frames = frames(run);
    for (time_ns, lines) in frames {
        // Writing to a text does not fail.
        let _ = writeln!(text, "#{:.3}", run.seconds(time_ns));
        lines.iter().for_each(|line| {
            text.push_str(line);
            text.push('\n');
        });
    }
    text
}

fn header(run: &ReviewedRun) -> String {
    let started = run.stored.run.started_wall_ns.unwrap_or(0);
    let place = run.place;
    format!(
        "FileType=text/acmi/tacview\nFileVersion=2.2\n0,ReferenceTime={}\n0,ReferenceLongitude={}\n0,ReferenceLatitude={}\n0,Title={}\n\
         0,DataSource=Bowwave {}\n0,Category=Virtual gunnery training\n",
        utc(started),
        place.map_or(0.0, Place::longitude_deg),
        place.map_or(0.0, Place::latitude_deg),
        value(&run.stored.run.scenario),
        value(&run.stored.run.version)
    )
}

/// Lines by time, nanoseconds of the session's clock.
fn frames(run: &ReviewedRun) -> BTreeMap<i64, Vec<String>> {
    let mut frames: BTreeMap<i64, Vec<String>> = BTreeMap::new();
    let mut known = vec![false; run.details.boats.len()];
    let mut put = |time_ns: i64, line: String| frames.entry(time_ns).or_default().push(line);
    for (i, sample) in run.tracks.tracks.samples.iter().enumerate() {
        if i == 0 {
            put(
                sample.time_ns,
                format!(
                    "{GUN:x},T=0|0|{:.2},Name=gun,Type=Sea+Watercraft,Color=Blue",
                    run.details.eye_height_m
                ),
            );
        }
        if let Some(camera) = sample.camera {
            put(sample.time_ns, gun(&camera, run));
        }
        for (boat, details) in run.details.boats.iter().enumerate() {
            let id = BOATS + boat as u64;
            match sample.boats.get(boat).copied().flatten() {
                Some(pose) => {
                    let mut line = format!("{id:x},{}", placed(&pose, run));
                    if !known[boat] {
                        known[boat] = true;
                        let colour = if details.side == "neutral" { "Green" } else { "Red" };
                        let _ =
                            write!(line, ",Name={},Type=Sea+Watercraft,Color={colour}", value(&details.name));
                    }
                    put(sample.time_ns, line);
                }
                None if known[boat] => {
                    known[boat] = false;
                    put(sample.time_ns, format!("-{id:x}"));
                }
                None => {}
            }
        }
    }
    run.tracks.tracks.rounds.iter().for_each(|path| round(path, run, &mut put));
    for event in &run.scored.events {
        if let Some((_, words, boat)) = words::event(&event.fact) {
            let about = boat.map_or_else(String::new, |name| format!("{} ", one_line(name)));
            put(
                event.time.ns(),
                format!("0,Event=Bookmark|{}", value(&format!("{about}{words}")).replace('|', "/")),
            );
        }
    }
    frames
}

fn gun(camera: &TrackPose, run: &ReviewedRun) -> String {
    let [bearing, elevation] =
        bearing_and_elevation_deg(attitude(camera) * DVec3::from(run.details.camera.bore));
    let [lon, lat] = degrees(run, camera.position);
    format!("{GUN:x},T={lon:.9}|{lat:.9}|{:.3}|0|{elevation:.3}|{bearing:.3}", camera.position[2])
}

/// Place and attitude of a boat: roll is positive with starboard down, pitch with the bow up.
fn placed(pose: &TrackPose, run: &ReviewedRun) -> String {
    let turn = attitude(pose);
    let [heading, pitch] = bearing_and_elevation_deg(turn * DVec3::X);
    let roll = (turn * DVec3::Y).z.atan2((turn * DVec3::Z).z).to_degrees();
    let [lon, lat] = degrees(run, pose.position);
    format!("T={lon:.9}|{lat:.9}|{:.3}|{roll:.2}|{pitch:.2}|{heading:.2}", pose.position[2])
}

fn round(path: &RoundPath, run: &ReviewedRun, put: &mut impl FnMut(i64, String)) {
    let id = ROUNDS + path.shot;
    let mut time_ns = path.fired_ns;
    for (i, point) in path.points.iter().enumerate() {
        time_ns = path.fired_ns + (f64::from(point.after_s) * 1e9) as i64;
        let [lon, lat] = degrees(run, point.position);
        let mut line = format!("{id:x},T={lon:.9}|{lat:.9}|{:.3}", point.position[2]);
        if i == 0 {
            let _ = write!(line, ",Name=round {},Type=Projectile+Bullet,Color=Blue", path.shot);
        }
        put(time_ns, line);
    }
    // It is taken away a moment after its last place.
    put(time_ns.saturating_add(1_000_000), format!("-{id:x}"));
}

fn attitude(pose: &TrackPose) -> DQuat {
    DQuat::from_array(pose.attitude.map(f64::from))
}

/// Degrees of longitude and latitude from the gun.
fn degrees(run: &ReviewedRun, [x, y, _]: [f32; 3]) -> [f64; 2] {
    let offset = [f64::from(x), f64::from(y)];
    let Some(gun) = run.place.or_else(|| Place::new(0.0, 0.0)) else { return [0.0; 2] };
    let [lon, lat] = longitude_latitude(gun, offset);
    // West of 180 E is east of 180 W.
    [(lon - gun.longitude_deg() + 540.0).rem_euclid(360.0) - 180.0, lat - gun.latitude_deg()]
}

/// A text as a property's value.
fn value(text: &str) -> String {
    one_line(text).replace('\\', "/").replace(',', "\\,")
}

/// Wall time, nanoseconds since 1970, as ISO 8601 in UTC to the second.
fn utc(wall_ns: i64) -> String {
    Timestamp::from_second(wall_ns.div_euclid(1_000_000_000)).unwrap_or_default().to_string()
}
