//! Models that were loaded, and the sun by place and time from a scenario and from the ship's lines.

use std::path::Path;

use anyhow::{Context as _, Result};
use bowwave_core::{
    ephemeris::{Moment, Place, Utc},
    event::ShipFix,
    model::Model,
    time::Time,
    world::scenario::Scenario,
};
use bowwave_devices::nmea::{ShipParser, ShipSaid, fix_lines};
use bowwave_models::{built_in_names, load_glb, resolve};
use glam::DVec3;

use super::{Exhibit, Line, Table, Workshop};

/// glTF files, as the fuzzers begin with them.
const FILES: [(&str, &[u8]); 2] = [
    ("box.glb", include_bytes!("../../../fuzz/corpus/model/box.glb")),
    ("textured.glb", include_bytes!("../../../fuzz/corpus/model/textured.glb")),
];

/// A place and a time.
struct Sighting {
    /// Degrees north and east.
    place: (f64, f64),
    /// The time as TOML has it.
    utc: &'static str,
    /// The same as year, month, day and second of the day.
    day: (i32, u8, u8, f64),
}

const SIGHTINGS: [Sighting; 4] = [
    Sighting { place: (26.5, 56.4), utc: "2026-01-06T05:30:00Z", day: (2026, 1, 6, 19_800.0) },
    Sighting { place: (1.56, 103.64), utc: "2014-01-01T04:00:00Z", day: (2014, 1, 1, 14_400.0) },
    Sighting { place: (48.858, 2.294), utc: "2012-10-06T14:03:00Z", day: (2012, 10, 6, 50_580.0) },
    Sighting { place: (-54.8, -68.3), utc: "2026-06-21T15:00:00Z", day: (2026, 6, 21, 54_000.0) },
];

/// Both tables.
pub fn exhibits(_: &Workshop) -> Result<Vec<Exhibit>> {
    Ok(vec![Exhibit::Table(models()?), Exhibit::Table(suns()?)])
}

fn models() -> Result<Table> {
    let line = |name: &str, source: &str, model: &Model| {
        let size = model.max - model.min;
        Line::new([
            name.into(),
            source.into(),
            f64::from(u32::try_from(model.indices.len() / 3).unwrap_or(u32::MAX)).into(),
            f64::from(u32::try_from(model.parts.len()).unwrap_or(u32::MAX)).into(),
            f64::from(size.x).into(),
            f64::from(size.z).into(),
            if model.texture.is_some() { "yes" } else { "no" }.into(),
        ])
    };
    let mut lines = Vec::new();
    for (name, bytes) in FILES {
        let model = load_glb(bytes, name).with_context(|| name.to_owned())?;
        lines.push(line(name, "glTF", &model).product_if(true));
    }
    for name in built_in_names() {
        lines.push(line(name, "built in", &resolve(name, Path::new(""))?));
    }
    Ok(Table {
        caption: "Models loaded in this run".into(),
        titles: vec!["model", "source", "triangles", "parts", "length, m", "height, m", "texture"],
        lines,
    })
}

/// The sun of a scenario that says place and time.
fn of_scenario(Sighting { place: (latitude, longitude), utc, .. }: &Sighting) -> Result<DVec3> {
    let text =
        format!("[light]\nlatitude_deg = {latitude:?}\nlongitude_deg = {longitude:?}\nutc = \"{utc}\"\n");
    Ok(Scenario::parse(&text, "place and time")?.daylight.sun_direction)
}

/// The sun of the lines that a receiver sends.
fn of_ship(sighting: &Sighting) -> Result<(DVec3, String)> {
    let ((latitude, longitude), (year, month, day, second)) = (sighting.place, sighting.day);
    let fix = ShipFix {
        arrival: Time::from_ns(0),
        place: Place::new(latitude, longitude),
        utc: Utc::of_day(year, month, day, second),
    };
    let text = fix_lines(&fix);
    let (mut place, mut utc) = (None, None);
    for line in ShipParser::new().lines(text.as_bytes(), Time::from_ns(0)) {
        if let ShipSaid::Fix(said) = line.said {
            (place, utc) = (said.place.or(place), said.utc.or(utc));
        }
    }
    let moment =
        Moment { place: place.context("no place in the lines")?, utc: utc.context("no time in the lines")? };
    let sun = moment.sun().context("no sun for that time")?;
    Ok((sun, text.lines().map(str::trim).collect::<Vec<_>>().join(" ")))
}

fn suns() -> Result<Table> {
    let mut lines = Vec::new();
    for sighting in &SIGHTINGS {
        let (typed, (sent, nmea)) = (of_scenario(sighting)?, of_ship(sighting)?);
        let ((latitude, longitude), utc) = (sighting.place, sighting.utc);
        lines.push(Line::new([
            format!("{latitude} N {longitude} E, {utc}").into(),
            typed.x.atan2(typed.y).to_degrees().rem_euclid(360.0).into(),
            typed.z.asin().to_degrees().into(),
            typed.angle_between(sent).to_degrees().into(),
            nmea.into(),
        ]));
    }
    Ok(Table {
        caption:
            "The sun by a scenario's place and time, and by lines of the ship's receiver that say the same"
                .into(),
        titles: vec!["place and time", "azimuth, deg", "elevation, deg", "apart, deg", "lines"],
        lines,
    })
}
