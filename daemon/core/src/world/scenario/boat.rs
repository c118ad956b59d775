//! The scenario's boats.

use serde::Deserialize;

use super::{
    crew::NamedCrew,
    group::{self, Formation},
    keys::{M_S_PER_KN, angle, range, seconds, waypoint},
    spec::{BoatSpec, place},
};
use crate::{
    side::Side,
    text::toml::{
        KeyPlace, OptionalKey, RequiredKey, Spanned, TomlError, TomlSection, ValueRule, key_place, number,
        one_of, plain_text, whole, yes_no,
    },
    world::boats::{Arrival, Behaviour, Course, CourseError, CrewedStart, LightsKept, Propulsor},
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
    crew: OptionalKey<String>,
    engine: OptionalKey<String>,
    speed_max_kn: OptionalKey<f64>,
    keeps_rules: OptionalKey<bool>,
    lights: OptionalKey<String>,
    burns_at_s: OptionalKey<f64>,
    reserve: OptionalKey<bool>,
    count: OptionalKey<i64>,
    formation: OptionalKey<String>,
    spacing_m: OptionalKey<f64>,
    axes_deg: OptionalKey<Vec<f64>>,
    on_target_s: OptionalKey<f64>,
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
    fn of_courses(&self) -> [KeyPlace; 8] {
        [
            key_place("heading_deg", &self.heading_deg),
            key_place("speed_kn", &self.speed_kn),
            key_place("weave_amplitude_m", &self.weave_amplitude_m),
            key_place("weave_period_s", &self.weave_period_s),
            key_place("waypoints", &self.waypoints),
            key_place("repeat", &self.repeat),
            key_place("stop_m", &self.stop_m),
            key_place("arrival", &self.arrival),
        ]
    }

    /// The keys that only boats with a crew have.
    fn of_crews(&self) -> [KeyPlace; 8] {
        [
            key_place("engine", &self.engine),
            key_place("speed_max_kn", &self.speed_max_kn),
            key_place("keeps_rules", &self.keeps_rules),
            key_place("count", &self.count),
            key_place("formation", &self.formation),
            key_place("spacing_m", &self.spacing_m),
            key_place("axes_deg", &self.axes_deg),
            key_place("on_target_s", &self.on_target_s),
        ]
    }

    /// Whether it asks for a crew.
    pub fn has_crew(&self) -> bool {
        self.crew.is_some()
    }
}

/// Context that boats are read in besides their own tables.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoatContext<'a> {
    /// The crews that the scenario knows.
    pub crews: &'a [NamedCrew],
    /// Its seed, by which groups are scattered.
    pub seed: u64,
    /// Most boats of all groups together.
    pub boats_max: usize,
}

pub(super) fn boats(
    tables: Vec<(TomlSection<'_>, RawBoat)>,
    context: &BoatContext<'_>,
) -> Result<Vec<BoatSpec>, TomlError> {
    let mut boats: Vec<BoatSpec> = Vec::with_capacity(tables.len());
    for (number, (section, raw)) in tables.iter().enumerate() {
        for boat in group(section, raw, number + 1, context)? {
            if let (Some(other), Some(name)) = (boats.iter().position(|b| b.name == boat.name), &raw.name) {
                let problem = format!(
                    "\"{}\" is the name of boat[{}] too; give each boat its own",
                    boat.name,
                    other + 1
                );
                return Err(section.text.error(name, problem));
            }
            if boats.len() == context.boats_max {
                let problem = format!("makes more than {} boats in all; ask for fewer", context.boats_max);
                return Err(section.error("count", problem));
            }
            boats.push(boat);
        }
    }
    Ok(boats)
}

/// The boats of one table: one, or as many as it counts.
fn group(
    section: &TomlSection<'_>,
    raw: &RawBoat,
    number: usize,
    context: &BoatContext<'_>,
) -> Result<Vec<BoatSpec>, TomlError> {
    let text = section.text;
    let sides = Side::ALL.map(|side| (side.name(), side));
    let named = |key, value: &OptionalKey<String>, what| match value {
        Some(value) => text.needed(value, plain_text()),
        None => Err(section.missing(key, what)),
    };
    let range = raw.range_m.as_ref();
    let key = format!("boat[{number}]");
    let stands = range.map_or_else(|| section.place("range_m"), |range| text.place_as(range, key));
    let side = text.given(&raw.side, one_of(&sides))?.unwrap_or(Side::Hostile);
    let usual = if side == Side::Neutral { LightsKept::ByConduct } else { LightsKept::None };
    let lights = text.given(&raw.lights, one_of(&LightsKept::NAMES))?.unwrap_or(usual);
    let burns_at_s = text.given(&raw.burns_at_s, seconds())?;
    let in_reserve = text.given(&raw.reserve, yes_no())?.unwrap_or(false);
    let boat = |name: String, behaviour| {
        let model = named("model", &raw.model, "the name of a model or the path of a glTF or PNG file")?;
        Ok(BoatSpec { name, model, side, behaviour, lights, burns_at_s, in_reserve, stands: stands.clone() })
    };
    let behaviours = match (&raw.course, &raw.crew) {
        (Some(_), Some(crew)) => {
            return Err(text.error(crew, "a boat has a course or a crew; leave out one of them"));
        }
        (_, None) => {
            text.only(raw.of_crews(), &[], || {
                "has no meaning without crew; leave it out, or give the boat a crew".to_owned()
            })?;
            vec![Behaviour::ScriptedCourse(scripted(section, raw)?)]
        }
        (None, Some(_)) => crewed(section, raw, number, side, context)?,
    };
    let name = named("name", &raw.name, "the boat a name of its own")?;
    match &behaviours[..] {
        [_] => behaviours.into_iter().map(|behaviour| boat(name.clone(), behaviour)).collect(),
        _ => {
            let numbered = |(i, behaviour)| boat(format!("{name}-{}", i + 1), behaviour);
            behaviours.into_iter().enumerate().map(numbered).collect()
        }
    }
}

fn scripted(section: &TomlSection<'_>, raw: &RawBoat) -> Result<Course, TomlError> {
    if raw.course.is_none() {
        let allowed = format!("{}, or a crew by the key crew", one_of(&KINDS).allowed);
        return Err(section.missing("course", &allowed));
    }
    let kind = section.required("course", &raw.course, one_of(&KINDS))?;
    section.text.only(raw.of_courses(), kind.keys(), || {
        format!(
            "has no meaning on a {} course; leave it out (such a boat has {})",
            kind.name(),
            kind.keys().join(", ")
        )
    })?;
    course(section, raw, kind)
}

/// The boats of a table with a crew.
fn crewed(
    section: &TomlSection<'_>,
    raw: &RawBoat,
    table: usize,
    side: Side,
    context: &BoatContext<'_>,
) -> Result<Vec<Behaviour>, TomlError> {
    /// Knots that a boat makes where nothing else is said, by its engine.
    const USUAL_KN: [(Propulsor, f64); 3] =
        [(Propulsor::Outboard, 28.0), (Propulsor::Jet, 35.0), (Propulsor::Shaft, 10.0)];
    let text = section.text;
    text.only(raw.of_courses(), &["heading_deg", "speed_kn"], || {
        "has no meaning for a boat with a crew; leave it out, or write it into the crew's state".to_owned()
    })?;
    let names: Vec<(&str, usize)> =
        context.crews.iter().enumerate().map(|(i, c)| (c.name.as_str(), i)).collect();
    let crew = section.required("crew", &raw.crew, one_of(&names))?;
    let engines = Propulsor::ALL.map(|engine| (engine.name(), engine));
    let propulsor = text.given(&raw.engine, one_of(&engines))?.unwrap_or(Propulsor::Outboard);
    let usual_kn = USUAL_KN.iter().find(|(engine, _)| *engine == propulsor).map_or(28.0, |(_, kn)| *kn);
    let speed_max = text.given(&raw.speed_max_kn, number(1.0..=60.0, "kn"))?.unwrap_or(usual_kn);
    let speed = text.given(&raw.speed_kn, number(0.0..=speed_max, "kn (speed_max_kn)"))?.unwrap_or(0.0);
    let axes = axes(section, raw)?;
    let range_m = section.required("range_m", &raw.range_m, range())?;
    let heading = text.given(&raw.heading_deg, angle())?.map(f64::to_radians);
    let count = text.given(&raw.count, whole(1..=40_u32))?.unwrap_or(1);
    let formation = text.given(&raw.formation, one_of(&Formation::NAMES))?.unwrap_or(Formation::Abreast);
    let spacing_m = text.given(&raw.spacing_m, number(10.0..=2000.0, "m"))?.unwrap_or(40.0);
    let keeps_rules = text.given(&raw.keeps_rules, yes_no())?.unwrap_or(side == Side::Neutral);
    let on_target_s = text.given(&raw.on_target_s, number(1.0..=86_400.0, "s"))?;
    let number = (table as u64) << 32;
    let mut starts = Vec::with_capacity(count as usize);
    for (axis, bearing) in axes.iter().enumerate() {
        // What does not divide goes to the first axes.
        let on_axis = group::share(count, axes.len() as u32, axis as u32);
        let middle = place(*bearing, range_m);
        let heading = heading.unwrap_or(bearing + std::f64::consts::PI);
        let seed = context.seed.wrapping_add(number).wrapping_add((axis as u64) << 16);
        for off in group::places(formation, on_axis, spacing_m, heading, seed) {
            starts.push(Behaviour::Crewed(CrewedStart {
                plan: std::sync::Arc::clone(&context.crews[crew].plan),
                chance: number + starts.len() as u64,
                keeps_rules,
                propulsor,
                speed_max_m_s: speed_max * M_S_PER_KN,
                position: middle + off,
                heading,
                speed_m_s: speed * M_S_PER_KN,
                on_target_s,
                begins_s: 0.0,
            }));
        }
    }
    Ok(starts)
}

/// Bearings that the boats of a table come from, radians.
fn axes(section: &TomlSection<'_>, raw: &RawBoat) -> Result<Vec<f64>, TomlError> {
    let text = section.text;
    let rule =
        ValueRule::new("a list of 1 to 8 bearings, each a number, -360 to 360 degrees", |raw: &Vec<f64>| {
            let fits = (1..=8).contains(&raw.len()) && raw.iter().all(|deg| deg.abs() <= 360.0);
            fits.then(|| raw.iter().map(|deg| deg.to_radians()).collect::<Vec<f64>>())
        });
    match (text.given(&raw.axes_deg, rule)?, &raw.bearing_deg) {
        (Some(_), Some(bearing)) => {
            Err(text.error(bearing, "a group has a bearing or axes_deg; leave out one of them"))
        }
        (Some(axes), None) => Ok(axes),
        (None, _) => Ok(vec![section.required("bearing_deg", &raw.bearing_deg, angle())?.to_radians()]),
    }
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
            "range_m" => key_place(key, &raw.range_m).1,
            _ => key_place(key, &raw.course).1,
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
