//! The scenario's weapon: a built-in kind, and what the scenario has otherwise.

use serde::Deserialize;

use super::spec::WeaponSpec;
use crate::{
    text::toml::{
        OptionalKey, Spanned, TomlError, TomlSection, TomlText, ValueRule, number, one_of, plain_text, whole,
    },
    world::{
        burst::BurstSpec,
        gunnery::{DragModel, DragTable, Projectile},
        weapon::BarrelHeat,
    },
};

/// The built-in weapons, for whom the sources stand beside.
pub const BUILT_IN: &str = include_str!("../../../weapons/built-in.toml");

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawWeapon {
    kind: OptionalKey<String>,
    rounds_per_minute: OptionalKey<f64>,
    belt: OptionalKey<i64>,
    spare_belts: OptionalKey<i64>,
    reload_s: OptionalKey<f64>,
    stoppage_every: OptionalKey<f64>,
    muzzle_velocity_m_s: OptionalKey<f64>,
    ballistic_coefficient_g7_lb_in2: OptionalKey<f64>,
    ballistic_coefficient_g1_lb_in2: OptionalKey<f64>,
    ballistic_coefficient_sphere_lb_in2: OptionalKey<f64>,
    sectional_density_lb_in2: OptionalKey<f64>,
    drag_table: OptionalKey<Vec<Vec<f64>>>,
    dispersion_mrad: OptionalKey<f64>,
    tracer_every: OptionalKey<i64>,
    tracer_burnout_m: OptionalKey<f64>,
    splash_height_m: OptionalKey<f64>,
    splash_life_s: OptionalKey<f64>,
    ricochet_below_deg: OptionalKey<f64>,
    barrel_heat_k: OptionalKey<f64>,
    barrel_cooling_s: OptionalKey<f64>,
    barrel_hot_k: OptionalKey<f64>,
    hole_cm2: OptionalKey<f64>,
    fragments_m: OptionalKey<f64>,
    arming_m: OptionalKey<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawWeapons {
    weapon: Vec<Spanned<RawWeapon>>,
}

/// The built-in weapons by name.
///
/// # Errors
/// Never for the text that is built in: a test reads it.
pub fn built_in() -> Result<Vec<(String, WeaponSpec)>, TomlError> {
    let text = TomlText::new(BUILT_IN, "the built-in weapons")?;
    let (raw, _) = text.read::<RawWeapons>(&[])?;
    let tables = text.sections("weapon", raw.weapon, 32)?;
    tables
        .iter()
        .map(|(section, keys)| {
            let name = section.required("kind", &keys.kind, plain_text())?;
            Ok((name, over(section, keys, &WeaponSpec::default())?))
        })
        .collect()
}

pub(super) fn weapon(section: &TomlSection<'_>, keys: &RawWeapon) -> Result<WeaponSpec, TomlError> {
    let Some(kind) = &keys.kind else { return over(section, keys, &WeaponSpec::default()) };
    let known = built_in()?;
    let names: Vec<(&str, usize)> =
        known.iter().enumerate().map(|(i, (name, _))| (name.as_str(), i)).collect();
    let (name, base) = &known[section.text.needed(kind, one_of(&names))?];
    Ok(WeaponSpec { kind: Some(name.clone()), ..over(section, keys, base)? })
}

/// A weapon that is as `base` but for the keys that are given.
fn over(section: &TomlSection<'_>, keys: &RawWeapon, base: &WeaponSpec) -> Result<WeaponSpec, TomlError> {
    let text = section.text;
    let projectile = projectile(section, keys, &base.projectile)?;
    let tracer_every = text.given(&keys.tracer_every, whole(0..=1000))?.or(base.tracer_every);
    let stoppage_every =
        text.given(&keys.stoppage_every, number(0.0..=1e6, "rounds"))?.or(base.stoppage_every);
    let given = |value: &OptionalKey<f64>, low: f64, high: f64, unit: &str, usual: f64| {
        Ok::<f64, TomlError>(text.given(value, number(low..=high, unit))?.unwrap_or(usual))
    };
    Ok(WeaponSpec {
        kind: None,
        rounds_per_minute: given(&keys.rounds_per_minute, 1.0, 6000.0, "a minute", base.rounds_per_minute)?,
        belt: text.given(&keys.belt, whole(0..=100_000))?.unwrap_or(base.belt),
        spare_belts: text.given(&keys.spare_belts, whole(0..=1000))?.unwrap_or(base.spare_belts),
        reload_s: given(&keys.reload_s, 0.0, 600.0, "s", base.reload_s)?,
        stoppage_every: stoppage_every.filter(|every| *every > 0.0),
        projectile,
        dispersion_mrad: given(&keys.dispersion_mrad, 0.0, 50.0, "mrad", base.dispersion_mrad)?,
        tracer_every: tracer_every.filter(|every| *every > 0),
        tracer_burnout_m: given(&keys.tracer_burnout_m, 0.0, 20_000.0, "m", base.tracer_burnout_m)?,
        splash_height_m: given(&keys.splash_height_m, 0.0, 60.0, "m", base.splash_height_m)?,
        splash_life_s: given(&keys.splash_life_s, 0.1, 10.0, "s", base.splash_life_s)?,
        ricochet_below_deg: given(&keys.ricochet_below_deg, 0.0, 45.0, "degrees", base.ricochet_below_deg)?,
        hole_cm2: given(&keys.hole_cm2, 0.0, 10_000.0, "cm^2", base.hole_cm2)?,
        heat: heat(section, keys, base.heat)?,
        burst: burst(section, keys, base.burst)?,
    })
}

/// The round: one of the keys of drag says which drag it has.
fn projectile(
    section: &TomlSection<'_>,
    keys: &RawWeapon,
    base: &Projectile,
) -> Result<Projectile, TomlError> {
    let text = section.text;
    let velocity = text
        .given(&keys.muzzle_velocity_m_s, number(50.0..=2000.0, "m/s"))?
        .unwrap_or(base.muzzle_velocity_m_s());
    let table = text.given(&keys.drag_table, drag_table())?;
    if let (Some(given), None) = (&keys.drag_table, &keys.sectional_density_lb_in2) {
        return Err(text
            .error(given, "needs sectional_density_lb_in2 beside it: weight by the square of the diameter"));
    }
    if let (Some(given), None) = (&keys.sectional_density_lb_in2, &table) {
        return Err(text.error(given, "needs drag_table beside it: [[mach, coefficient], ...]"));
    }
    let coefficients = [
        (&keys.ballistic_coefficient_g7_lb_in2, Some(DragModel::G7)),
        (&keys.ballistic_coefficient_g1_lb_in2, Some(DragModel::G1)),
        (&keys.ballistic_coefficient_sphere_lb_in2, Some(DragModel::Sphere)),
        (&keys.sectional_density_lb_in2, table.map(DragModel::Table)),
    ];
    let (mut drag, mut coefficient, mut is_given) =
        (*base.drag(), base.ballistic_coefficient_lb_in2(), false);
    for (key, model) in coefficients {
        let value = text.given(key, number(0.05..=2.0, "lb/in^2"))?;
        let (Some(value), Some(model)) = (value, model) else { continue };
        if let (Some(key), true) = (key, is_given) {
            return Err(text.error(key, "gives the round a second drag: leave one of the two out"));
        }
        (drag, coefficient, is_given) = (model, value, true);
    }
    Projectile::with_drag(drag, coefficient, velocity).ok_or_else(|| {
        section.error(
            "muzzle_velocity_m_s",
            "makes no round: speed and ballistic coefficient do not go together",
        )
    })
}

/// Mach numbers, rising, each with its drag coefficient.
fn drag_table() -> ValueRule<'static, Vec<Vec<f64>>, DragTable> {
    let most = DragTable::MOST;
    let allowed = format!(
        "a list of 2 to {most} pairs [mach, coefficient], mach rising from 0 to 10, coefficients .01 to 5"
    );
    ValueRule::new(allowed, |raw: &Vec<Vec<f64>>| {
        let pair = |pair: &Vec<f64>| <[f64; 2]>::try_from(pair.as_slice()).ok().map(|[m, c]| (m, c));
        DragTable::new(&raw.iter().map(pair).collect::<Option<Vec<_>>>()?)
    })
}

fn heat(
    section: &TomlSection<'_>,
    keys: &RawWeapon,
    base: Option<BarrelHeat>,
) -> Result<Option<BarrelHeat>, TomlError> {
    /// A barrel that is heated by rounds, and nothing else is said of it.
    const USUAL: BarrelHeat = BarrelHeat { round_k: 0.0, cooling_s: 600.0, hot_k: 300.0 };
    let (text, base) = (section.text, base.unwrap_or(USUAL));
    let heat = BarrelHeat {
        round_k: text.given(&keys.barrel_heat_k, number(0.0..=100.0, "K"))?.unwrap_or(base.round_k),
        cooling_s: text.given(&keys.barrel_cooling_s, number(1.0..=1e5, "s"))?.unwrap_or(base.cooling_s),
        hot_k: text.given(&keys.barrel_hot_k, number(1.0..=2000.0, "K"))?.unwrap_or(base.hot_k),
    };
    Ok((heat.round_k > 0.0).then_some(heat))
}

fn burst(
    section: &TomlSection<'_>,
    keys: &RawWeapon,
    base: Option<BurstSpec>,
) -> Result<Option<BurstSpec>, TomlError> {
    let (text, base) = (section.text, base.unwrap_or(BurstSpec { arming_m: 0.0, lethal_m: 0.0 }));
    let burst = BurstSpec {
        arming_m: text.given(&keys.arming_m, number(0.0..=1000.0, "m"))?.unwrap_or(base.arming_m),
        lethal_m: text.given(&keys.fragments_m, number(0.0..=30.0, "m"))?.unwrap_or(base.lethal_m),
    };
    Ok((burst.lethal_m > 0.0).then_some(burst))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_weapons_can_be_read_and_differ() {
        let weapons = built_in().expect("sound");
        assert!(weapons.len() >= 4, "{weapons:?}");
        for (i, (name, weapon)) in weapons.iter().enumerate() {
            assert!(weapons[..i].iter().all(|(other, spec)| other != name && spec != weapon), "{name}");
        }
    }
}
