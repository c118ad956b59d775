//! The scenario's tables other than the boats.

use glam::DVec3;
use toml::{Spanned, de::DeTable};

use super::{
    Scenario, ScenarioError, WeaponSpec, boat, place, sun,
    table::{Mark, Source, Table},
};
use crate::{
    sea::BeaufortForce,
    water::{ReflectionMethod, ShadowLevel, Water},
    world::{
        gunnery::Projectile,
        waves::{Spectrum, WaveSpec},
    },
};

/// Most boats of a scenario.
const BOATS_MAX: usize = 64;

pub(super) fn scenario(text: &str, origin: &str) -> Result<Scenario, ScenarioError> {
    let document = document(text, origin)?;
    let root = Table::root(Source { text, origin }, &document);
    root.only(&["name", "seed", "duration_s", "sea", "mount", "light", "reflection", "weapon", "boat"])?;
    let sea_table = root.table("sea")?;
    let (force, waves) = sea(&sea_table, &["source"])?;
    let sources = [("scenario", false), ("video", true)];
    let mount = root.table("mount")?;
    mount.only(&["eye_height_m"])?;
    let (sun_direction, visibility_m) = light(&root.table("light")?, &[])?;
    let water = reflection(&root.table("reflection")?, force)?;
    let boats = boat::boats(&root.tables("boat", BOATS_MAX)?)?;
    Ok(Scenario {
        name: root.text("name")?.unwrap_or_else(|| "unnamed".to_owned()),
        seed: root.integer("seed", 0..=i64::MAX)?.map_or(1, i64::unsigned_abs),
        duration_s: root.number("duration_s", 0.1..=86_400.0, "s")?,
        waves,
        sea_from_video: sea_table.choice("source", &sources)?.unwrap_or(false),
        wind: -place(waves.wind_from, force.wind_mean_m_s()).extend(0.0),
        eye_height_m: mount.number("eye_height_m", 0.5..=100.0, "m")?.unwrap_or(8.0),
        sun_direction,
        visibility_m,
        water,
        weapon: weapon(&root.table("weapon")?)?,
        boats,
        origin: origin.to_owned(),
    })
}

/// The text as TOML.
pub fn document<'a>(text: &'a str, origin: &str) -> Result<Spanned<DeTable<'a>>, ScenarioError> {
    DeTable::parse(text).map_err(|e| {
        let place = Mark::at(text, e.span().map_or(0, |span| span.start));
        place.error(origin, "", e.message().to_owned())
    })
}

/// The table `[sea]`, in which the keys `more` are the caller's.
pub fn sea(table: &Table<'_>, more: &[&str]) -> Result<(BeaufortForce, WaveSpec), ScenarioError> {
    let keys = ["beaufort", "wind_from_deg", "significant_wave_height_m", "peak_period_s"];
    table.only(&[&keys, more].concat())?;
    let number = table.integer("beaufort", 0..=12)?.unwrap_or(2);
    let force = u8::try_from(number)
        .ok()
        .and_then(BeaufortForce::new)
        .ok_or_else(|| table.error("beaufort", "is beyond the scale"))?;
    let wind_from = table.number("wind_from_deg", -360.0..=360.0, "degrees")?.unwrap_or(250.0).to_radians();
    let height = table.number("significant_wave_height_m", 0.0..=20.0, "m")?;
    let period = table.number("peak_period_s", 0.5..=30.0, "s")?;
    let spectrum = match (height, period) {
        (None, None) => Spectrum::of_force(force),
        // The measured sea rarely is a fully arisen one: the mean peak enhancement of JONSWAP.
        (Some(height), Some(period)) => Spectrum::jonswap(height, period, 3.3)
            .ok_or_else(|| table.error("significant_wave_height_m", "makes no sea with that period"))?,
        (Some(_), None) => {
            return Err(table.missing("peak_period_s", "it together with significant_wave_height_m"));
        }
        (None, Some(_)) => {
            return Err(table.missing("significant_wave_height_m", "it together with peak_period_s"));
        }
    };
    Ok((force, WaveSpec { spectrum, wind_from }))
}

/// The table `[light]`, in which the keys `more` are the caller's: the unit vector towards the sun, world, and the meteorological
/// visibility, metres.
pub fn light(table: &Table<'_>, more: &[&str]) -> Result<(DVec3, f64), ScenarioError> {
    table.only(&[&sun::KEYS, more, &["visibility_km"]].concat())?;
    let visibility_km = table.number("visibility_km", 0.05..=200.0, "km")?.unwrap_or(20.0);
    Ok((sun::direction(table)?, 1000.0 * visibility_km))
}

/// The table `[reflection]`.
pub fn reflection(table: &Table<'_>, force: BeaufortForce) -> Result<Water, ScenarioError> {
    table.only(&["method", "shadow_level"])?;
    let methods = ReflectionMethod::ALL.map(|method| (method.name(), method));
    let method = table.choice("method", &methods)?.unwrap_or(ReflectionMethod::Waves);
    let shadow = match table.integer("shadow_level", 0..=2)? {
        Some(0) => ShadowLevel::None,
        Some(2) => ShadowLevel::Strong,
        _ => ShadowLevel::Gradual,
    };
    Ok(Water { method, force, shadow })
}

fn weapon(table: &Table<'_>) -> Result<WeaponSpec, ScenarioError> {
    table.only(&[
        "rounds_per_minute",
        "belt",
        "muzzle_velocity_m_s",
        "ballistic_coefficient_g7_lb_in2",
        "dispersion_mrad",
        "tracer_every",
    ])?;
    let velocity = table.number("muzzle_velocity_m_s", 50.0..=2000.0, "m/s")?.unwrap_or(890.0);
    let coefficient = table.number("ballistic_coefficient_g7_lb_in2", 0.05..=2.0, "lb/in^2")?.unwrap_or(0.33);
    let projectile = Projectile::new(coefficient, velocity).ok_or_else(|| {
        table.error("muzzle_velocity_m_s", "makes no round with that ballistic coefficient")
    })?;
    let whole = |key: &str, max: i64, default: u32| -> Result<u32, ScenarioError> {
        Ok(table.integer(key, 0..=max)?.and_then(|n| u32::try_from(n).ok()).unwrap_or(default))
    };
    let tracer_every = whole("tracer_every", 1000, 5)?;
    Ok(WeaponSpec {
        rounds_per_minute: table.number("rounds_per_minute", 1.0..=6000.0, "a minute")?.unwrap_or(500.0),
        belt: whole("belt", 100_000, 100)?,
        projectile,
        dispersion_mrad: table.number("dispersion_mrad", 0.0..=50.0, "mrad")?.unwrap_or(0.6),
        tracer_every: (tracer_every > 0).then_some(tracer_every),
    })
}
