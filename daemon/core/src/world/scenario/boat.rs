//! The scenario's boats.

use super::{BoatSpec, ScenarioError, Side, place, table::Table};
use crate::world::boats::{Arrival, Course, CourseError};

/// m/s in a knot.
const M_S_PER_KN: f64 = 1852.0 / 3600.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Still,
    Straight,
    Weave,
    Waypoints,
    Closing,
}

const KINDS: [(&str, Kind); 5] = [
    ("still", Kind::Still),
    ("straight", Kind::Straight),
    ("weave", Kind::Weave),
    ("waypoints", Kind::Waypoints),
    ("closing", Kind::Closing),
];

/// Keys of every boat.
const COMMON: [&str; 6] = ["name", "model", "side", "course", "range_m", "bearing_deg"];

impl Kind {
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
}

pub(super) fn boats(tables: &[Table<'_>]) -> Result<Vec<BoatSpec>, ScenarioError> {
    let mut boats: Vec<BoatSpec> = Vec::with_capacity(tables.len());
    for table in tables {
        let boat = boat(table)?;
        if let Some(other) = boats.iter().position(|b| b.name == boat.name) {
            let problem =
                format!("\"{}\" is the name of boat[{}] too; give each boat its own", boat.name, other + 1);
            return Err(table.error("name", problem));
        }
        boats.push(boat);
    }
    Ok(boats)
}

fn boat(table: &Table<'_>) -> Result<BoatSpec, ScenarioError> {
    // First of all any key that no course knows, so that a slip of the pen is not taken for a missing key.
    let all: Vec<&str> = KINDS.iter().flat_map(|(_, kind)| kind.keys()).chain(&COMMON).copied().collect();
    let mut known: Vec<&str> = COMMON.to_vec();
    for key in all {
        if !known.contains(&key) {
            known.push(key);
        }
    }
    table.only(&known)?;
    let kind = table.required_choice("course", &KINDS)?;
    for key in known {
        if table.has(key) && !COMMON.contains(&key) && !kind.keys().contains(&key) {
            let name = KINDS.iter().find(|(_, k)| *k == kind).map_or("", |(name, _)| name);
            let problem = format!(
                "has no meaning on a {name} course; leave it out (such a boat has {})",
                kind.keys().join(", ")
            );
            return Err(table.error(key, problem));
        }
    }
    let sides = [("hostile", Side::Hostile), ("neutral", Side::Neutral)];
    Ok(BoatSpec {
        name: table.required_text("name", "the boat a name of its own")?,
        model: table.required_text("model", "the name of a model or the path of a glTF or PNG file")?,
        side: table.choice("side", &sides)?.unwrap_or(Side::Hostile),
        course: course(table, kind)?,
        mark: table.mark("range_m"),
    })
}

fn course(table: &Table<'_>, kind: Kind) -> Result<Course, ScenarioError> {
    let degrees = |key: &str| -> Result<Option<f64>, ScenarioError> {
        Ok(table.number(key, -360.0..=360.0, "degrees")?.map(f64::to_radians))
    };
    let range_m = table.required_number("range_m", 1.0..=20_000.0, "m")?;
    let bearing = degrees("bearing_deg")?
        .ok_or_else(|| table.missing("bearing_deg", "a number, -360 to 360 degrees"))?;
    let start = place(bearing, range_m);
    let heading = degrees("heading_deg")?;
    let required_heading =
        || heading.ok_or_else(|| table.missing("heading_deg", "a number, -360 to 360 degrees"));
    let speed = || Ok(table.required_number("speed_kn", 0.1..=100.0, "kn")? * M_S_PER_KN);
    let built = match kind {
        Kind::Still => Course::still(start, heading.unwrap_or(0.0)),
        Kind::Straight => Course::straight(start, required_heading()?, speed()?),
        Kind::Weave => {
            let amplitude_m = table.required_number("weave_amplitude_m", 0.0..=500.0, "m")?;
            let period_s = table.required_number("weave_period_s", 1.0..=600.0, "s")?;
            Course::weave(start, required_heading()?, speed()?, amplitude_m, period_s)
        }
        Kind::Waypoints => {
            let what = "pairs [bearing_deg, range_m] within -360 to 360 degrees and 1 to 20000 m";
            let pairs = table
                .pairs("waypoints", [-360.0..=360.0, 1.0..=20_000.0], what)?
                .ok_or_else(|| table.missing("waypoints", what))?;
            let points: Vec<_> = pairs.into_iter().map(|[b, r]| place(b.to_radians(), r)).collect();
            Course::waypoints(start, &points, speed()?, table.boolean("repeat")?.unwrap_or(false))
        }
        Kind::Closing => {
            let stop_m = table.number("stop_m", 5.0..=5000.0, "m")?.unwrap_or(50.0);
            let arrivals = [("stop", Arrival::Stop), ("circle", Arrival::Circle)];
            let arrival = table.choice("arrival", &arrivals)?.unwrap_or(Arrival::Stop);
            let inward = bearing + std::f64::consts::PI;
            Course::closing(start, heading.unwrap_or(inward), speed()?, stop_m, arrival)
        }
    };
    built.map_err(|e| table.error(blamed(&e), e.to_string()))
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
