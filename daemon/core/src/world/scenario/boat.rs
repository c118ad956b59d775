//! The scenario's boats.

use glam::DVec2;
use serde::Deserialize;

use super::{
    keys::{M_S_PER_KN, angle},
    spec::{BoatSpec, Side, place},
};
use crate::{
    text::toml::{
        OptionalKey, RequiredKey, Spanned, TomlError, TomlSection, ValueRule, number, one_of, plain_text,
        yes_no,
    },
    world::boats::{Arrival, Behaviour, Course, CourseError},
};

/// Kind of a boat's course.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CourseKind {
    Still,
    Straight,
    Weave,
    Waypoints,
    Closing,
}

const KINDS: [(&str, CourseKind); 5] = [
    ("still", CourseKind::Still),
    ("straight", CourseKind::Straight),
    ("weave", CourseKind::Weave),
    ("waypoints", CourseKind::Waypoints),
    ("closing", CourseKind::Closing),
];

impl CourseKind {
    /// Keys of the boats on such a course besides those of all boats.
    const fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Still => &["heading_deg"],
            Self::Straight => &["heading_deg", "speed_kn"],
            Self::Weave => &["heading_deg", "speed_kn", "weave_amplitude_m", "weave_period_s"],
            Self::Waypoints => &["speed_kn", "waypoints", "repeat"],
            Self::Closing => &["heading_deg", "speed_kn", "stop_m", "arrival"],
        }
    }

    fn name(self) -> &'static str {
        KINDS.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawBoat {
    name: OptionalKey<String>,
    model: OptionalKey<String>,
    side: OptionalKey<String>,
    course: OptionalKey<String>,
    range_m: OptionalKey<f64>,
    bearing_deg: OptionalKey<f64>,
    heading_deg: OptionalKey<f64>,
    speed_kn: OptionalKey<f64>,
    weave_amplitude_m: OptionalKey<f64>,
    weave_period_s: OptionalKey<f64>,
    waypoints: Option<Spanned<Vec<RequiredKey<Vec<f64>>>>>,
    repeat: OptionalKey<bool>,
    stop_m: OptionalKey<f64>,
    arrival: OptionalKey<String>,
}

impl RawBoat {
    /// The keys that some courses have, each with its place where it is there.
    fn of_courses(&self) -> [(&'static str, Option<Spanned<()>>); 8] {
        fn there<T>(value: &Option<Spanned<T>>) -> Option<Spanned<()>> {
            value.as_ref().map(|value| Spanned::new(value.span(), ()))
        }
        [
            ("heading_deg", there(&self.heading_deg)),
            ("speed_kn", there(&self.speed_kn)),
            ("weave_amplitude_m", there(&self.weave_amplitude_m)),
            ("weave_period_s", there(&self.weave_period_s)),
            ("waypoints", there(&self.waypoints)),
            ("repeat", there(&self.repeat)),
            ("stop_m", there(&self.stop_m)),
            ("arrival", there(&self.arrival)),
        ]
    }
}

pub(super) fn boats(tables: Vec<(TomlSection<'_>, RawBoat)>) -> Result<Vec<BoatSpec>, TomlError> {
    let mut boats: Vec<BoatSpec> = Vec::with_capacity(tables.len());
    for (number, (section, raw)) in tables.iter().enumerate() {
        let boat = boat(section, raw, number + 1)?;
        if let (Some(other), Some(name)) = (boats.iter().position(|b| b.name == boat.name), &raw.name) {
            let problem =
                format!("\"{}\" is the name of boat[{}] too; give each boat its own", boat.name, other + 1);
            return Err(section.text.error(name, problem));
        }
        boats.push(boat);
    }
    Ok(boats)
}

fn boat(section: &TomlSection<'_>, raw: &RawBoat, number: usize) -> Result<BoatSpec, TomlError> {
    let text = section.text;
    let kind = section.required("course", &raw.course, one_of(&KINDS))?;
    for (key, value) in raw.of_courses() {
        if let Some(value) = value.filter(|_| !kind.keys().contains(&key)) {
            let problem = format!(
                "has no meaning on a {} course; leave it out (such a boat has {})",
                kind.name(),
                kind.keys().join(", ")
            );
            return Err(text.error(&value, problem));
        }
    }
    let sides = Side::ALL.map(|side| (side.name(), side));
    let named = |key, value: &OptionalKey<String>, what| match value {
        Some(value) => text.needed(value, plain_text()),
        None => Err(section.missing(key, what)),
    };
    let course = course(section, raw, kind)?;
    let range = raw.range_m.as_ref();
    let key = format!("boat[{number}]");
    let stands = range.map_or_else(|| section.place("range_m"), |range| text.place_as(range, key));
    Ok(BoatSpec {
        name: named("name", &raw.name, "the boat a name of its own")?,
        model: named("model", &raw.model, "the name of a model or the path of a glTF or PNG file")?,
        side: text.given(&raw.side, one_of(&sides))?.unwrap_or(Side::Hostile),
        behaviour: Behaviour::ScriptedCourse(course),
        stands,
    })
}

/// Distance of a boat or a point of its course from the camera.
fn range() -> ValueRule<'static, f64, f64> {
    number(1.0..=20_000.0, "m")
}

/// A point of a course by bearing and range.
fn waypoint() -> ValueRule<'static, Vec<f64>, DVec2> {
    let allowed = "pairs [bearing_deg, range_m] within -360 to 360 degrees and 1 to 20000 m";
    ValueRule::new(allowed, |raw: &Vec<f64>| match raw[..] {
        [bearing, range_m] => Some(place(angle().check(&bearing)?.to_radians(), range().check(&range_m)?)),
        _ => None,
    })
}

fn course(section: &TomlSection<'_>, raw: &RawBoat, kind: CourseKind) -> Result<Course, TomlError> {
    let text = section.text;
    let range_m = section.required("range_m", &raw.range_m, range())?;
    let bearing = section.required("bearing_deg", &raw.bearing_deg, angle())?.to_radians();
    let start = place(bearing, range_m);
    let heading = text.given(&raw.heading_deg, angle())?.map(f64::to_radians);
    let required_heading = || heading.ok_or_else(|| section.missing("heading_deg", &angle().allowed));
    let speed = || {
        let speed_kn = section.required("speed_kn", &raw.speed_kn, number(0.1..=100.0, "kn"))?;
        Ok(speed_kn * M_S_PER_KN)
    };
    let built = match kind {
        CourseKind::Still => Course::still(start, heading.unwrap_or(0.0)),
        CourseKind::Straight => Course::straight(start, required_heading()?, speed()?),
        CourseKind::Weave => {
            let amplitude = number(0.0..=500.0, "m");
            let amplitude_m = section.required("weave_amplitude_m", &raw.weave_amplitude_m, amplitude)?;
            let period = number(1.0..=600.0, "s");
            let period_s = section.required("weave_period_s", &raw.weave_period_s, period)?;
            Course::weave(start, required_heading()?, speed()?, amplitude_m, period_s)
        }
        CourseKind::Waypoints => {
            let points = raw.waypoints.as_ref();
            let points = points.ok_or_else(|| section.missing("waypoints", &waypoint().allowed))?.get_ref();
            let points =
                points.iter().map(|point| text.needed(point, waypoint())).collect::<Result<Vec<_>, _>>()?;
            let repeat = text.given(&raw.repeat, yes_no())?.unwrap_or(false);
            Course::waypoints(start, &points, speed()?, repeat)
        }
        CourseKind::Closing => {
            let stop_m = text.given(&raw.stop_m, number(5.0..=5000.0, "m"))?.unwrap_or(50.0);
            let arrivals = [("stop", Arrival::Stop), ("circle", Arrival::Circle)];
            let arrival = text.given(&raw.arrival, one_of(&arrivals))?.unwrap_or(Arrival::Stop);
            let inward = bearing + std::f64::consts::PI;
            Course::closing(start, heading.unwrap_or(inward), speed()?, stop_m, arrival)
        }
    };
    built.map_err(|e| {
        let key = blamed(&e);
        let value = raw.of_courses().into_iter().find(|(name, _)| *name == key).and_then(|(_, value)| value);
        let value = value.or_else(|| match key {
            "range_m" => raw.range_m.as_ref().map(|range| Spanned::new(range.span(), ())),
            _ => raw.course.as_ref().map(|course| Spanned::new(course.span(), ())),
        });
        value.map_or_else(|| section.error(key, e), |value| text.error(&value, e))
    })
}

/// The key that a course's error is about.
const fn blamed(error: &CourseError) -> &'static str {
    match error {
        CourseError::NotFinite => "course",
        CourseError::Weave { .. } => "weave_amplitude_m",
        CourseError::PointsCoincide { .. } | CourseError::SharpCorner { .. } | CourseError::TooFewPoints => {
            "waypoints"
        }
        CourseError::TooClose { .. } => "range_m",
    }
}
