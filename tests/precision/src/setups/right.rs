//! Hours of trainers that are set up rightly, in seas, airs, light and motions of many kinds: how often one says that it is set up wrongly,
//! and how long it is READY. No number of the product was chosen on these recordings.

use std::f64::consts::TAU;

use anyhow::Result;
use bowwave_core::{estimate::attitude::Source, sea::BeaufortForce};
use hw_sim::make::{Periodic, Recipe};
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::{Said, Wrong, replay};
use crate::{
    registration::record,
    ship::{ShipSea, sea_state},
    table::TextTable,
};

/// Length of a recording, seconds.
const LENGTH_S: f64 = 120.0;

/// One recording: its sea state, and what its trainer said.
struct RightRun {
    state: usize,
    gun: &'static str,
    said: Said,
}

/// Replays so many hours of right set-ups, every other one with an orientation that is fused here, and prints what they say.
pub fn run(hours: f64) -> Result<()> {
    let count = (hours * 3600.0 / LENGTH_S).round().max(1.0) as u64;
    let folder = tempfile::tempdir()?;
    let runs: Vec<RightRun> = (0..count)
        .into_par_iter()
        .map(|i| {
            let (recipe, gun) = recipe(i);
            let path = folder.path().join(format!("{i}.mcap"));
            record(&recipe, &path)?;
            let source = if i % 2 == 0 { Source::Auto } else { Source::Fused };
            let said = replay(&path, Wrong::Nothing, source, (LENGTH_S, 30.0), &scenario(&recipe))?;
            std::fs::remove_file(&path)?;
            if let Some((at_s, fault)) = said.first {
                println!(
                    "{} after {at_s:.1} s in recording {i}, {gun}, {source:?}: {:?}, visibility {:.0} m",
                    fault.code(),
                    recipe.sky,
                    recipe.visibility_m
                );
            }
            Ok(RightRun { state: i as usize % STATES, gun, said })
        })
        .collect::<Result<_>>()?;
    print(&runs);
    Ok(())
}

fn print(runs: &[RightRun]) {
    let titles = [("sea", 6), ("gun", 8), ("minutes", 8), ("alarms", 7), ("ready", 6), ("unchecked", 9)];
    let mut table = TextTable::new(2, titles);
    for (state, (gun, _)) in (0..STATES).flat_map(|state| GUNS.map(|gun| (state, gun))) {
        let of = || runs.iter().filter(|r| r.state == state && r.gun == gun);
        let count = of().count();
        if count == 0 {
            continue;
        }
        let mean = |value: fn(&Said) -> f64| of().map(|r| value(&r.said)).sum::<f64>() / count as f64;
        table.row([
            sea_state(state).name.to_owned(),
            gun.to_owned(),
            format!("{:.0}", count as f64 * LENGTH_S / 60.0),
            of().filter(|r| r.said.first.is_some()).count().to_string(),
            format!("{:.2}", mean(|s| s.ready)),
            format!("{:.2}", mean(|s| s.unchecked)),
        ]);
    }
    print!("{}", table.take());
    let alarms = runs.iter().filter(|r| r.said.first.is_some()).count();
    println!(
        "{alarms} of {} right set-ups said to be wrong, in {:.1} h",
        runs.len(),
        runs.len() as f64 * LENGTH_S / 3600.0
    );
}

const STATES: usize = 7;

/// How guns are moved: their names, and deviations of traverse and elevation, degrees.
const GUNS: [(&str, [f64; 2]); 3] =
    [("still", [0.0, 0.0]), ("search", [12.0, 1.0]), ("engaged", [20.0, 2.5])];

/// What the `i`th recording is made of.
fn recipe(i: u64) -> (Recipe, &'static str) {
    /// Force of the wind that makes a fully grown sea of each state.
    const FORCES: [u8; STATES] = [0, 1, 2, 4, 5, 6, 8];
    const VISIBILITIES_M: [f64; 5] = [4_000.0, 8_000.0, 15_000.0, 25_000.0, 40_000.0];
    let mut rng = Pcg64::seed_from_u64(9000 + i);
    let state = i as usize % STATES;
    let (gun, [traverse, elevation]) = GUNS[(i as usize / STATES) % GUNS.len()];
    let ship = sea_state(state);
    let mut recipe = Recipe {
        width: 320,
        height: 180,
        duration_s: LENGTH_S,
        frame_rate_hz: 10.0,
        seed: i,
        trigger: Vec::new(),
        wind_from: rng.random::<f64>() * TAU,
        swell: None,
        visibility_m: VISIBILITIES_M[rng.random_range(0..VISIBILITIES_M.len())],
        eye_height_m: 3.0 + 9.0 * rng.random::<f64>(),
        ..Recipe::default()
    };
    if let Some(force) = BeaufortForce::new(FORCES[state]) {
        recipe.beaufort = force;
    }
    recipe.sky.sun_azimuth = rng.random::<f64>() * TAU;
    // Every third sun is low enough to stand in the picture and on the water.
    recipe.sky.sun_elevation =
        if i.is_multiple_of(3) { 0.05 + 0.2 * rng.random::<f64>() } else { 0.25 + rng.random::<f64>() };
    recipe.sky.turbidity = 2.0 + 5.0 * rng.random::<f64>();
    recipe.sky.cloud_cover = rng.random::<f64>();
    move_ship(&mut recipe, &ship, &mut rng);
    recipe.gun.traverse = waves(&mut rng, 42f64.to_radians(), traverse.to_radians(), 9.0);
    recipe.gun.elevation = waves(&mut rng, -5f64.to_radians(), elevation.to_radians(), 6.0);
    (recipe, gun)
}

fn move_ship(recipe: &mut Recipe, sea: &ShipSea, rng: &mut Pcg64) {
    let [roll, pitch, yaw] = sea.turns_deg.map(f64::to_radians);
    let heading = rng.random::<f64>() * TAU;
    recipe.ship.roll = waves(rng, 0.0, roll, sea.periods_s[0]);
    recipe.ship.pitch = waves(rng, 0.0, pitch, sea.periods_s[1]);
    recipe.ship.heading = waves(rng, heading, yaw, sea.periods_s[2]);
    recipe.ship.heave = waves(rng, 0.0, sea.moves_m[2], sea.periods_s[1]);
}

/// A motion about `mean` by that deviation, in a band of frequencies about that of `period_s`.
fn waves(rng: &mut Pcg64, mean: f64, deviation: f64, period_s: f64) -> Periodic {
    const WAVES: u32 = 5;
    if deviation == 0.0 {
        return Periodic::new(mean, &[]);
    }
    let middle = LENGTH_S / period_s;
    let amplitude = deviation * (2.0 / f64::from(WAVES)).sqrt();
    let wave = |i: u32| {
        let cycles = middle * (0.7 + 0.15 * f64::from(i));
        (cycles.round().max(1.0) as u32, amplitude, rng.random::<f64>() * TAU)
    };
    Periodic::new(mean, &(0..WAVES).map(wave).collect::<Vec<_>>())
}

/// What who sets up the exercise says of it.
fn scenario(recipe: &Recipe) -> String {
    format!(
        "[mount]\neye_height_m = {:?}\n[light]\nsun_azimuth_deg = {:?}\nsun_elevation_deg = {:?}\nvisibility_km = {:?}\n",
        recipe.eye_height_m,
        recipe.sky.sun_azimuth.to_degrees(),
        recipe.sky.sun_elevation.to_degrees(),
        recipe.visibility_m / 1000.0
    )
}
