//! The scenario's tables other than the boats. Those of sea, light and reflection serve other texts with boats as well.

use serde::Deserialize;

pub use super::keys::{LightKeys, M_S_PER_KN, ReflectionKeys, SeaKeys, angle, seed};
use super::{
    boat::{self, BoatContext, RawBoat},
    crew::{self, RawCrew},
    exercise::{RawCall, RawEvent, RawExercise, RawGoals, RawRules, exercise},
    spec::{Scenario, place},
    sun,
    weapon::{self, RawWeapon},
};
use crate::{
    daylight::Daylight,
    sea::BeaufortForce,
    text::toml::{
        BareOrQuoted, Loose, OptionalKey, Spanned, TomlError, TomlSection, TomlText, ValueRule, number,
        one_of, plain_text, whole, yes_no,
    },
    water::{ReflectionMethod, ShadowLevel, Water},
    world::{
        searchlight::SearchlightSpec,
        waves::{Spectrum, WaveSpec},
    },
};

/// Most boats of a scenario.
const BOATS_MAX: usize = 64;
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawScenario {
    name: OptionalKey<String>,
    seed: OptionalKey<i64>,
    duration_s: OptionalKey<f64>,
    sea: Option<Spanned<RawSea>>,
    mount: Option<Spanned<RawMount>>,
    light: Option<Spanned<RawLight>>,
    reflection: Option<Spanned<ReflectionKeys>>,
    weapon: Option<Spanned<RawWeapon>>,
    searchlight: Option<Spanned<RawSearchlight>>,
    briefing: OptionalKey<String>,
    rules: Option<Spanned<RawRules>>,
    goals: Option<Spanned<RawGoals>>,
    call: Vec<Spanned<RawCall>>,
    event: Vec<Spanned<RawEvent>>,
    crew: Vec<Spanned<RawCrew>>,
    boat: Vec<Spanned<RawBoat>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawSea {
    beaufort: OptionalKey<i64>,
    wind_from_deg: OptionalKey<f64>,
    significant_wave_height_m: OptionalKey<f64>,
    peak_period_s: OptionalKey<f64>,
    source: OptionalKey<String>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawLight {
    sun_azimuth_deg: OptionalKey<f64>,
    sun_elevation_deg: OptionalKey<f64>,
    latitude_deg: OptionalKey<f64>,
    longitude_deg: OptionalKey<f64>,
    utc: OptionalKey<BareOrQuoted>,
    visibility_km: OptionalKey<f64>,
    source: OptionalKey<String>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawSearchlight {
    candela: OptionalKey<f64>,
    beam_deg: OptionalKey<f64>,
    on: OptionalKey<bool>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawMount {
    eye_height_m: OptionalKey<f64>,
}

pub(super) fn scenario(text: &str, origin: &str) -> Result<Scenario, TomlError> {
    let text = TomlText::new(text, origin)?;
    let (raw, mut warnings) = text.read::<RawScenario>(&[])?;
    let (section, keys) = text.section("sea", raw.sea);
    let RawSea { beaufort, wind_from_deg, significant_wave_height_m, peak_period_s, source } = keys;
    let keys = SeaKeys { beaufort, wind_from_deg, significant_wave_height_m, peak_period_s };
    let (force, waves) = sea(&section, &keys)?;
    let sources = [("scenario", false), ("video", true)];
    let sea_from_video = text.given(&source, one_of(&sources))?.unwrap_or(false);
    let (_, mount) = text.section("mount", raw.mount);
    let (section, keys) = text.section("light", raw.light);
    let daylight = light_of_scenario(&section, keys)?;
    let (_, keys) = text.section("reflection", raw.reflection);
    let water = reflection(text, &keys, force, &mut warnings)?;
    let (section, keys) = text.section("weapon", raw.weapon);
    let weapon = weapon::weapon(&section, &keys)?;
    let searchlight = raw.searchlight.map(|raw| searchlight(text, raw.get_ref())).transpose()?;
    let seed = text.given(&raw.seed, seed())?.unwrap_or(1);
    // A scenario without crews does not read the built-in ones.
    let crewed = raw.boat.iter().any(|boat| boat.get_ref().has_crew());
    let crews = if crewed { crew::known(text, raw.crew)? } else { crew::crews(text, raw.crew)? };
    let context = BoatContext { crews: &crews, seed, boats_max: BOATS_MAX };
    let boats = boat::boats(text.sections("boat", raw.boat, BOATS_MAX)?, &context)?;
    let RawScenario { briefing, rules, goals, call, event, .. } = raw;
    let exercise = exercise(text, RawExercise { briefing, rules, goals, call, event }, &boats)?;
    Ok(Scenario {
        name: text.given(&raw.name, plain_text())?.unwrap_or_else(|| "unnamed".to_owned()),
        seed,
        duration_s: text.given(&raw.duration_s, number(0.1..=86_400.0, "s"))?,
        waves,
        sea_from_video,
        wind: -place(waves.wind_from, force.wind_mean_m_s()).extend(0.0),
        eye_height_m: text.given(&mount.eye_height_m, number(0.5..=100.0, "m"))?.unwrap_or(8.0),
        daylight,
        water,
        weapon,
        searchlight,
        exercise,
        boats,
        warnings,
    })
}

/// The mistakes of a scenario's text, as far as they can be told apart: the line of each is taken out and the rest read again. What may only
/// follow from a line that was taken out is left out. Empty for a sound text.
pub fn mistakes(text: &str, origin: &str) -> Vec<TomlError> {
    const MOST: usize = 20;
    let mut lines: Vec<&str> = text.lines().collect();
    let mut mistakes: Vec<TomlError> = Vec::new();
    for _ in 0..2 * MOST {
        let Err(mistake) = scenario(&lines.join("\n"), origin) else { break };
        let taken = lines_of(&mistake, &lines);
        if mistakes.len() < MOST && !mistakes.iter().any(|before| may_follow(&mistake, before)) {
            mistakes.push(mistake);
        }
        let Some(taken) = lines.get_mut(taken).filter(|taken| !taken.is_empty()) else { break };
        taken.fill("");
    }
    mistakes
}

/// The lines without which the mistake is gone: its own, or all of its table where that lacks something; none where tables after it would be
/// counted otherwise.
fn lines_of(mistake: &TomlError, lines: &[&str]) -> std::ops::Range<usize> {
    let own = mistake.line.saturating_sub(1);
    match lines.get(own) {
        Some(line) if !mistake.key.is_empty() && line.contains('=') => own..own + 1,
        Some(header) if header.starts_with('[') && !header.contains('.') => {
            let rest = lines.iter().skip(own + 1);
            let is_last = !header.starts_with("[[") || !rest.clone().any(|line| line == header);
            let length = rest.take_while(|line| !line.starts_with('[')).count();
            own..if is_last { own + 1 + length } else { own }
        }
        _ => 0..0,
    }
}

/// Tests whether a mistake may come of taking out the line of another: of the same table's keys one may need the other, and boats, groups and
/// crews may go by other names now, or be others.
fn may_follow(mistake: &TomlError, before: &TomlError) -> bool {
    let table = |key: &str| key.rsplit_once('.').map_or("", |(table, _)| table).to_owned();
    let is_about = |error: &TomlError, tables: &[&str]| tables.iter().any(|t| error.key.starts_with(t));
    let names = |keys: &[&str]| keys.iter().any(|key| mistake.key.ends_with(key));
    let is_own = mistake.problem.contains("is not allowed") || mistake.problem.starts_with("unknown key");
    mistake.key.is_empty()
        || table(&mistake.key) == table(&before.key) && !is_own
        || is_about(before, &["boat", "crew"]) && names(&[".about", ".boat", ".stop", ".crew", ".to"])
}

/// Wind force and waves of the table `[sea]`.
///
/// # Errors
/// Names the value that is not allowed, or the key that is missing.
pub fn sea(section: &TomlSection<'_>, keys: &SeaKeys) -> Result<(BeaufortForce, WaveSpec), TomlError> {
    let text = section.text;
    let force = text.given(&keys.beaufort, whole(0..=12u8))?.unwrap_or(2);
    let force = BeaufortForce::new(force).ok_or_else(|| section.error("beaufort", "is beyond the scale"))?;
    let wind_from = text.given(&keys.wind_from_deg, angle())?.unwrap_or(250.0).to_radians();
    let height = text.given(&keys.significant_wave_height_m, number(0.0..=20.0, "m"))?;
    let period = text.given(&keys.peak_period_s, number(0.5..=30.0, "s"))?;
    let spectrum = match (height, period, &keys.significant_wave_height_m) {
        (Some(height), Some(period), Some(value)) => {
            // The measured sea rarely is a fully arisen one: the mean peak enhancement of JONSWAP.
            let spectrum = Spectrum::jonswap(height, period, 3.3);
            spectrum.ok_or_else(|| text.error(value, "makes no sea with that period"))?
        }
        (Some(_), ..) => {
            return Err(section.missing("peak_period_s", "it together with significant_wave_height_m"));
        }
        (None, Some(_), _) => {
            return Err(section.missing("significant_wave_height_m", "it together with peak_period_s"));
        }
        (None, None, _) => Spectrum::of_force(force),
    };
    Ok((force, WaveSpec { spectrum, wind_from }))
}

/// The searchlight of the table `[searchlight]`.
fn searchlight(text: TomlText<'_>, raw: &RawSearchlight) -> Result<SearchlightSpec, TomlError> {
    let usual = SearchlightSpec::default();
    let candela = text.given(&raw.candela, number(100.0..=1e8, "candela"))?;
    let beam_deg = text.given(&raw.beam_deg, number(0.5..=60.0, "degrees"))?;
    Ok(SearchlightSpec {
        candela: candela.unwrap_or(usual.candela),
        beam: beam_deg.map_or(usual.beam, f64::to_radians),
        is_on: text.given(&raw.on, yes_no())?.unwrap_or(usual.is_on),
    })
}

/// The daylight of a scenario: where its text names no sun, that of the ship's place and time once these are told.
fn light_of_scenario(section: &TomlSection<'_>, raw: RawLight) -> Result<Daylight, TomlError> {
    let RawLight {
        sun_azimuth_deg,
        sun_elevation_deg,
        latitude_deg,
        longitude_deg,
        utc,
        visibility_km,
        source,
    } = raw;
    let keys =
        LightKeys { sun_azimuth_deg, sun_elevation_deg, latitude_deg, longitude_deg, utc, visibility_km };
    let daylight = light(section, &keys)?;
    let sources = [("scenario", false), ("ship", true)];
    let from_ship = section.text.given(&source, one_of(&sources))?;
    Ok(Daylight { from_ship: from_ship.unwrap_or(daylight.from_ship), ..daylight })
}

/// The daylight of the table `[light]`: a clear sky's sun.
///
/// # Errors
/// As [`sea`].
pub fn light(section: &TomlSection<'_>, keys: &LightKeys) -> Result<Daylight, TomlError> {
    let visibility_km = section.text.given(&keys.visibility_km, number(0.05..=200.0, "km"))?.unwrap_or(20.0);
    let sun = sun::given(section, keys)?;
    let fixed = Daylight::fixed(sun.direction, 1000.0 * visibility_km);
    Ok(Daylight { moment: sun.moment, from_ship: !sun.named, ..fixed })
}

/// The name of a reflection method, or a former name.
fn method_name() -> ValueRule<'static, String, ReflectionMethod> {
    let allowed = one_of(&ReflectionMethod::ALL.map(|method| (method.name(), method))).allowed;
    ValueRule::new(allowed, |raw: &String| ReflectionMethod::of_name(raw))
}

/// The table `[reflection]`; a former name of a method is warned of.
///
/// # Errors
/// As [`sea`].
pub fn reflection(
    text: TomlText<'_>,
    keys: &ReflectionKeys,
    force: BeaufortForce,
    warnings: &mut Vec<String>,
) -> Result<Water, TomlError> {
    let method = text.given(&keys.method, method_name())?.unwrap_or(ReflectionMethod::Baked);
    if let Some(value) = &keys.method
        && let Loose::Fits(name) = value.get_ref()
        && let Some(warning) = ReflectionMethod::warning(name)
    {
        warnings.push(text.error(value, warning).to_string());
    }
    let shadow = match text.given(&keys.shadow_level, whole(0..=2))? {
        Some(0) => ShadowLevel::None,
        Some(2) => ShadowLevel::Strong,
        _ => ShadowLevel::Gradual,
    };
    Ok(Water { method, force, shadow })
}
