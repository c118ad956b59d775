//! The scenario's exercise: briefing, rules of engagement, goals, calls and what happens when.

use serde::Deserialize;

use super::{
    keys::{angle, only_true, range, seconds},
    spec::{BoatSpec, place},
};
use crate::{
    act::Act,
    side::Side,
    text::toml::{
        KeyPlace, OptionalKey, Spanned, TomlError, TomlSection, TomlText, ValueRule, key_place, list_of,
        number, one_of, yes_no,
    },
    world::{
        exercise::{
            About, CallSpec, Engagement, ExerciseSpec, Goals, Happening, HappeningCause, HappeningEffect,
            group_of,
        },
        flare::FlareSpec,
    },
};

/// Most calls and most events of a scenario.
const TABLES_MAX: usize = 64;

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawRules {
    engagement: OptionalKey<String>,
    self_defence_m: OptionalKey<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawGoals {
    keep_off_m: OptionalKey<f64>,
    stop: OptionalKey<i64>,
    par: OptionalKey<Vec<f64>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawCall {
    say: OptionalKey<String>,
    about: OptionalKey<String>,
    before_m: OptionalKey<f64>,
    within_s: OptionalKey<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawEvent {
    at_s: OptionalKey<f64>,
    within_m: OptionalKey<f64>,
    struck: OptionalKey<bool>,
    boat: OptionalKey<String>,
    rules: OptionalKey<String>,
    stoppage: OptionalKey<bool>,
    message: OptionalKey<String>,
    flare: Option<Spanned<RawFlare>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawFlare {
    bearing_deg: OptionalKey<f64>,
    range_m: OptionalKey<f64>,
    height_m: OptionalKey<f64>,
    candela: OptionalKey<f64>,
    burns_s: OptionalKey<f64>,
    falls_m_s: OptionalKey<f64>,
}

/// The tables of an exercise as they stand in the text.
#[derive(Default)]
pub(super) struct RawExercise {
    pub briefing: OptionalKey<String>,
    pub rules: Option<Spanned<RawRules>>,
    pub goals: Option<Spanned<RawGoals>>,
    pub call: Vec<Spanned<RawCall>>,
    pub event: Vec<Spanned<RawEvent>>,
}

pub(super) fn exercise(
    text: TomlText<'_>,
    raw: RawExercise,
    boats: &[BoatSpec],
) -> Result<ExerciseSpec, TomlError> {
    let has_rules = raw.rules.is_some();
    let (section, rules) = text.section("rules", raw.rules);
    let engagement = match (&rules.engagement, has_rules) {
        (None, false) => None,
        (engagement, _) => Some(section.required("engagement", engagement, one_of(&engagements()))?),
    };
    let calls = text.sections("call", raw.call, TABLES_MAX)?;
    let events = text.sections("event", raw.event, TABLES_MAX)?;
    Ok(ExerciseSpec {
        briefing: text.given(&raw.briefing, paragraphs())?,
        rules: engagement,
        self_defence_m: text.given(&rules.self_defence_m, number(0.0..=20_000.0, "m"))?.unwrap_or(0.0),
        goals: goals(text, raw.goals, boats)?,
        calls: calls.iter().map(|(section, raw)| call(section, raw, boats)).collect::<Result<_, _>>()?,
        happenings: events
            .iter()
            .map(|(section, raw)| event(section, raw, (boats, has_rules)))
            .collect::<Result<_, _>>()?,
    })
}

fn goals(text: TomlText<'_>, raw: Option<Spanned<RawGoals>>, boats: &[BoatSpec]) -> Result<Goals, TomlError> {
    let (_, raw) = text.section("goals", raw);
    let hostile = boats.iter().filter(|boat| boat.side == Side::Hostile).count() as u32;
    let stop = ValueRule::new(
        format!("a whole number, 0 to {hostile}: as many hostile boats as there are"),
        move |raw: &i64| u32::try_from(*raw).ok().filter(|n| *n <= hostile),
    );
    Ok(Goals {
        keep_off_m: text.given(&raw.keep_off_m, number(0.0..=20_000.0, "m"))?.unwrap_or(Goals::KEEP_OFF_M),
        stop: text.given(&raw.stop, stop)?,
        par: text.given(&raw.par, list_of::<2, _, _>(number(0.0..=100.0, "points")))?,
    })
}

fn call(section: &TomlSection<'_>, raw: &RawCall, boats: &[BoatSpec]) -> Result<CallSpec, TomlError> {
    let text = section.text;
    let calls: Vec<(&str, Act)> = Act::calls().map(|act| (act.name(), act)).collect();
    let call = section.required("say", &raw.say, one_of(&calls))?;
    let (before_m, within_s) = (
        text.given(&raw.before_m, number(1.0..=20_000.0, "m"))?,
        text.given(&raw.within_s, number(1.0..=86_400.0, "s"))?,
    );
    if before_m.is_none() && within_s.is_none() {
        let allowed =
            "the range before which the call is due, in m, or within_s, the time within which, in s";
        return Err(section.missing("before_m", allowed));
    }
    Ok(CallSpec { call, about: section.required("about", &raw.about, boats_of(boats))?, before_m, within_s })
}

fn event(
    section: &TomlSection<'_>,
    raw: &RawEvent,
    (boats, has_rules): (&[BoatSpec], bool),
) -> Result<Happening, TomlError> {
    let text = section.text;
    let causes: [KeyPlace; 3] = [
        key_place("at_s", &raw.at_s),
        key_place("within_m", &raw.within_m),
        key_place("struck", &raw.struck),
    ];
    let mut given = causes.into_iter().filter(|(_, place)| place.is_some());
    let Some((kind, _)) = given.next() else {
        return Err(
            section.missing("at_s", "the second at which it happens, or within_m or struck with boat")
        );
    };
    if let Some((_, Some(second))) = given.next() {
        let problem = format!("stands beside {kind}; an event has one cause: leave out one of them");
        return Err(text.error(&second, problem));
    }
    let about = || section.required("boat", &raw.boat, boats_of(boats));
    let cause = if let Some(at_s) = text.given(&raw.at_s, seconds())? {
        if let Some(boat) = &raw.boat {
            return Err(text.error(boat, "has no meaning beside at_s; leave it out"));
        }
        HappeningCause::At(at_s)
    } else if let Some(within_m) = text.given(&raw.within_m, number(1.0..=20_000.0, "m"))? {
        HappeningCause::Within(about()?, within_m)
    } else {
        text.given(&raw.struck, only_true())?;
        HappeningCause::Struck(about()?)
    };
    let mut effects = Vec::new();
    if let Some(value) = &raw.rules {
        if !has_rules {
            let problem =
                "changes rules that there are not; give those of the beginning: [rules] with engagement";
            return Err(text.error(value, problem));
        }
        effects.push(HappeningEffect::Rules(text.needed(value, one_of(&engagements()))?));
    }
    if text.given(&raw.stoppage, yes_no())?.unwrap_or(false) {
        effects.push(HappeningEffect::Stoppage);
    }
    effects.extend(text.given(&raw.message, caption())?.map(HappeningEffect::Message));
    if let Some(raw) = &raw.flare {
        effects.push(HappeningEffect::Flare(flare(&section.table("flare", raw), raw.get_ref())?));
    }
    if effects.is_empty() {
        return Err(section.missing("message", "what happens: rules, stoppage = true, message or flare"));
    }
    Ok(Happening { cause, effects })
}

/// A flare; what it does not say is that of a hand-fired rocket.
fn flare(section: &TomlSection<'_>, raw: &RawFlare) -> Result<FlareSpec, TomlError> {
    let text = section.text;
    let bearing = section.required("bearing_deg", &raw.bearing_deg, angle())?;
    let range_m = section.required("range_m", &raw.range_m, range())?;
    let usual = FlareSpec::rocket(place(bearing.to_radians(), range_m));
    Ok(FlareSpec {
        height_m: text.given(&raw.height_m, number(10.0..=2000.0, "m"))?.unwrap_or(usual.height_m),
        candela: text.given(&raw.candela, number(100.0..=5e6, "cd"))?.unwrap_or(usual.candela),
        burns_s: text.given(&raw.burns_s, number(1.0..=600.0, "s"))?.unwrap_or(usual.burns_s),
        falls_m_s: text.given(&raw.falls_m_s, number(0.0..=50.0, "m/s"))?.unwrap_or(usual.falls_m_s),
        ..usual
    })
}

/// Rules of engagement by their names.
fn engagements() -> [(&'static str, Engagement); 4] {
    Engagement::ALL.map(|rules| (rules.name(), rules))
}

/// A side, a boat of the scenario or a group of boats.
fn boats_of(boats: &[BoatSpec]) -> ValueRule<'_, String, About> {
    let mut names: Vec<&str> = boats.iter().map(|boat| group_of(&boat.name)).collect();
    names.dedup();
    let more = if names.len() > 8 { ", ..." } else { "" };
    names.truncate(8);
    let allowed = format!(
        "\"hostile\", \"neutral\", or the name of a boat or a group: {}{more}",
        if names.is_empty() { "there is none".to_owned() } else { names.join(", ") }
    );
    ValueRule::new(allowed, |raw: &String| {
        let side = Side::ALL.into_iter().find(|side| side.name() == raw);
        let about = side.map_or_else(|| About::Name(raw.clone()), About::Side);
        boats.iter().any(|boat| about.covers(&boat.name, boat.side)).then_some(about)
    })
}

/// A text that the display shows.
fn caption() -> ValueRule<'static, String, String> {
    const MOST: usize = 60;
    ValueRule::new(format!("a text in quotes, 1 to {MOST} printable ASCII characters"), |raw: &String| {
        let is_plain = raw.bytes().all(|b| b == b' ' || b.is_ascii_graphic());
        (is_plain && !raw.trim().is_empty() && raw.len() <= MOST).then(|| raw.clone())
    })
}

/// A text of some lines.
fn paragraphs() -> ValueRule<'static, String, String> {
    const MOST: usize = 4000;
    ValueRule::new(
        format!("a text in quotes, 1 to {MOST} printable characters and new lines"),
        |raw: &String| {
            let is_plain = !raw.chars().any(|c| c.is_control() && c != '\n');
            (is_plain && !raw.trim().is_empty() && raw.len() <= MOST).then(|| raw.trim().to_owned())
        },
    )
}

#[cfg(test)]
#[path = "exercise_tests.rs"]
mod tests;
