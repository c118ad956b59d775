//! The scenario's crews.

use std::sync::Arc;

use glam::DVec2;
use serde::Deserialize;

use super::keys::{M_S_PER_KN, only_true, waypoint};
use crate::{
    text::toml::{
        KeyPlace, OptionalKey, RequiredKey, Spanned, TomlError, TomlSection, TomlText, key_place, number,
        one_of, plain_text, yes_no,
    },
    world::boats::{Act, CrewPlan, CrewState, Exit, Guard},
};

/// Most crews of a scenario, states of a crew and ways out of a state.
const MOST: usize = 32;

/// Text of the crews that every scenario knows.
const BUILT_IN: &str = include_str!("../../../crews/built-in.toml");

/// A crew by its name.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct NamedCrew {
    pub name: String,
    pub plan: Arc<CrewPlan>,
}

/// The kind of an act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ActKind {
    Transit,
    Loiter,
    Fish,
    Anchor,
    Approach,
    Probe,
    Feint,
    Attack,
    Circle,
    Flee,
    Stop,
    Surrender,
    Drift,
    Driven,
}

const KINDS: [(&str, ActKind); 14] = [
    ("transit", ActKind::Transit),
    ("loiter", ActKind::Loiter),
    ("fish", ActKind::Fish),
    ("anchor", ActKind::Anchor),
    ("approach", ActKind::Approach),
    ("probe", ActKind::Probe),
    ("feint", ActKind::Feint),
    ("attack", ActKind::Attack),
    ("circle", ActKind::Circle),
    ("flee", ActKind::Flee),
    ("stop", ActKind::Stop),
    ("surrender", ActKind::Surrender),
    ("drift", ActKind::Drift),
    ("driven", ActKind::Driven),
];

impl ActKind {
    /// Keys of its states besides those of all states.
    const fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Transit => &["speed_kn", "waypoints", "repeat"],
            Self::Loiter => &["speed_kn", "radius_m"],
            Self::Fish | Self::Flee => &["speed_kn"],
            Self::Approach => &["speed_kn", "stop_m"],
            Self::Probe | Self::Feint => &["speed_kn", "turn_m"],
            Self::Attack => &["speed_kn", "stop_m", "rams"],
            Self::Circle => &["speed_kn", "radius_m", "clockwise"],
            Self::Anchor | Self::Stop | Self::Surrender | Self::Drift | Self::Driven => &[],
        }
    }

    fn name(self) -> &'static str {
        KINDS.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawCrews {
    crew: Vec<Spanned<RawCrew>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawCrew {
    name: OptionalKey<String>,
    state: Vec<Spanned<RawState>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawState {
    name: OptionalKey<String>,
    does: OptionalKey<String>,
    speed_kn: OptionalKey<f64>,
    radius_m: OptionalKey<f64>,
    stop_m: OptionalKey<f64>,
    turn_m: OptionalKey<f64>,
    clockwise: OptionalKey<bool>,
    rams: OptionalKey<bool>,
    waypoints: Option<Spanned<Vec<RequiredKey<Vec<f64>>>>>,
    repeat: OptionalKey<bool>,
    next: Vec<Spanned<RawExit>>,
}

impl RawState {
    /// The keys that only some acts have, each with its place where it is there.
    fn of_acts(&self) -> [KeyPlace; 8] {
        [
            key_place("speed_kn", &self.speed_kn),
            key_place("radius_m", &self.radius_m),
            key_place("stop_m", &self.stop_m),
            key_place("turn_m", &self.turn_m),
            key_place("clockwise", &self.clockwise),
            key_place("rams", &self.rams),
            key_place("waypoints", &self.waypoints),
            key_place("repeat", &self.repeat),
        ]
    }
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawExit {
    to: OptionalKey<String>,
    chance: OptionalKey<f64>,
    after_s: OptionalKey<f64>,
    within_m: OptionalKey<f64>,
    beyond_m: OptionalKey<f64>,
    arrived: OptionalKey<bool>,
    warned: OptionalKey<bool>,
    hit: OptionalKey<bool>,
    neighbour_hit: OptionalKey<bool>,
    lit: OptionalKey<bool>,
    sees_gun: OptionalKey<bool>,
}

/// The crews that every scenario knows.
fn built_in() -> Result<Vec<NamedCrew>, TomlError> {
    let text = TomlText::new(BUILT_IN, "crews.toml")?;
    let (raw, _) = text.read::<RawCrews>(&[])?;
    crews(text, raw.crew)
}

/// The crews that a text's boats may have: its own, and those that every scenario knows but for the ones that it replaces.
pub(super) fn known(text: TomlText<'_>, tables: Vec<Spanned<RawCrew>>) -> Result<Vec<NamedCrew>, TomlError> {
    let own = crews(text, tables)?;
    let mut known = built_in()?;
    known.retain(|known| own.iter().all(|own| own.name != known.name));
    Ok(own.into_iter().chain(known).collect())
}

/// The crews of a text.
pub(super) fn crews(text: TomlText<'_>, tables: Vec<Spanned<RawCrew>>) -> Result<Vec<NamedCrew>, TomlError> {
    let mut crews: Vec<NamedCrew> = Vec::new();
    for (section, raw) in text.sections("crew", tables, MOST)? {
        let named = raw.name.as_ref().ok_or_else(|| section.missing("name", "the crew a name of its own"))?;
        let name = text.needed(named, plain_text())?;
        if crews.iter().any(|crew| crew.name == name) {
            return Err(
                text.error(named, format!("another crew is called \"{name}\"; give each its own name"))
            );
        }
        let plan = Arc::new(CrewPlan { states: states(&section, raw.state)? });
        crews.push(NamedCrew { name, plan });
    }
    Ok(crews)
}

fn states(section: &TomlSection<'_>, tables: Vec<Spanned<RawState>>) -> Result<Vec<CrewState>, TomlError> {
    let text = section.text;
    let tables = section.sections("state", tables, MOST)?;
    if tables.is_empty() {
        return Err(section
            .missing("state", "at least one table [[crew.state]]; the first is the one that it begins in"));
    }
    let mut names: Vec<String> = Vec::new();
    for (section, raw) in &tables {
        let named =
            raw.name.as_ref().ok_or_else(|| section.missing("name", "the state a name of its own"))?;
        let name = text.needed(named, plain_text())?;
        if names.contains(&name) {
            return Err(
                text.error(named, format!("another state is called \"{name}\"; give each its own name"))
            );
        }
        names.push(name);
    }
    let state = |(i, (section, raw)): (usize, (TomlSection<'_>, RawState))| {
        let (act, speed_m_s) = act(&section, &raw)?;
        let exits = section.sections("next", raw.next, MOST)?;
        let exits =
            exits.iter().map(|(section, raw)| exit(section, raw, &names)).collect::<Result<_, _>>()?;
        Ok(CrewState { name: names[i].clone(), act, speed_m_s, exits })
    };
    tables.into_iter().enumerate().map(state).collect()
}

fn act(section: &TomlSection<'_>, raw: &RawState) -> Result<(Act, f64), TomlError> {
    let text = section.text;
    let kind = section.required("does", &raw.does, one_of(&KINDS))?;
    text.only(raw.of_acts(), kind.keys(), || {
        let has =
            if kind.keys().is_empty() { "no keys of its own".to_owned() } else { kind.keys().join(", ") };
        format!("has no meaning for \"{}\"; leave it out (that has {has})", kind.name())
    })?;
    let speed_m_s = if kind.keys().contains(&"speed_kn") {
        section.required("speed_kn", &raw.speed_kn, number(0.1..=100.0, "kn"))? * M_S_PER_KN
    } else {
        0.0
    };
    let metres = |key, value, low: f64| section.required(key, value, number(low..=20_000.0, "m"));
    let act = match kind {
        ActKind::Transit => Act::Transit {
            points: points(section, raw)?,
            repeat: text.given(&raw.repeat, yes_no())?.unwrap_or(false),
        },
        ActKind::Loiter => Act::Loiter { radius_m: metres("radius_m", &raw.radius_m, 10.0)? },
        ActKind::Fish => Act::Fish,
        ActKind::Anchor => Act::Anchor,
        ActKind::Approach => Act::Approach { stop_m: metres("stop_m", &raw.stop_m, 20.0)? },
        ActKind::Probe | ActKind::Feint => Act::Probe { turn_m: metres("turn_m", &raw.turn_m, 40.0)? },
        ActKind::Attack => attack(section, raw)?,
        ActKind::Circle => Act::Circle {
            radius_m: metres("radius_m", &raw.radius_m, 40.0)?,
            clockwise: text.given(&raw.clockwise, yes_no())?.unwrap_or(true),
        },
        ActKind::Flee => Act::Flee,
        ActKind::Stop => Act::Stop,
        ActKind::Surrender => Act::Surrender,
        ActKind::Drift => Act::Drift,
        ActKind::Driven => Act::Driven,
    };
    Ok((act, speed_m_s))
}

fn attack(section: &TomlSection<'_>, raw: &RawState) -> Result<Act, TomlError> {
    let text = section.text;
    let rams = text.given(&raw.rams, yes_no())?.unwrap_or(false);
    let stop_m = text.given(&raw.stop_m, number(20.0..=20_000.0, "m"))?;
    match (rams, stop_m, &raw.stop_m) {
        (true, Some(_), Some(value)) => {
            Err(text.error(value, "has no meaning for a crew that rams; leave out it or rams"))
        }
        (true, ..) => Ok(Act::Attack { stop_m: None }),
        (false, Some(stop_m), _) => Ok(Act::Attack { stop_m: Some(stop_m) }),
        (false, None, _) => {
            let allowed = "the range at which it stops, 20 to 20000 m, or rams = true";
            Err(section.missing("stop_m", allowed))
        }
    }
}

fn points(section: &TomlSection<'_>, raw: &RawState) -> Result<Vec<DVec2>, TomlError> {
    let points = raw.waypoints.as_ref().ok_or_else(|| section.missing("waypoints", &waypoint().allowed))?;
    if points.get_ref().is_empty() || points.get_ref().len() > 200 {
        return Err(section.text.error(points, "has no points, or more than 200; give at least one"));
    }
    points.get_ref().iter().map(|point| section.text.needed(point, waypoint())).collect()
}

fn exit(section: &TomlSection<'_>, raw: &RawExit, names: &[String]) -> Result<Exit, TomlError> {
    let text = section.text;
    let states: Vec<(&str, usize)> = names.iter().enumerate().map(|(i, name)| (name.as_str(), i)).collect();
    let to = section.required("to", &raw.to, one_of(&states))?;
    let metres = || number(0.0..=20_000.0, "m");
    let asks = |value: &OptionalKey<bool>| Ok(text.given(value, only_true())?.unwrap_or(false));
    let guard = Guard {
        after_s: text.given(&raw.after_s, number(0.0..=86_400.0, "s"))?,
        within_m: text.given(&raw.within_m, metres())?,
        beyond_m: text.given(&raw.beyond_m, metres())?,
        arrived: asks(&raw.arrived)?,
        warned: asks(&raw.warned)?,
        hit: asks(&raw.hit)?,
        neighbour_hit: asks(&raw.neighbour_hit)?,
        lit: asks(&raw.lit)?,
        sees_gun: asks(&raw.sees_gun)?,
    };
    if guard == Guard::default() {
        let allowed =
            "at least one of after_s, within_m, beyond_m, arrived, warned, hit, neighbour_hit, lit, sees_gun";
        return Err(section.missing("after_s", allowed));
    }
    let chance = text.given(&raw.chance, number(0.0..=1.0, ""))?.unwrap_or(1.0);
    Ok(Exit { guard, chance, to })
}

#[cfg(test)]
#[path = "crew_tests.rs"]
mod tests;
