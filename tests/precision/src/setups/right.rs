//! Hours of trainers that are set up rightly, in seas, airs, light and motions of many kinds, with coasts, passing ships and drops on the lens:
//! how often one says that it is set up wrongly, and how long it is READY. Sessions below number 403 were looked at while the weights
//! of a ship's turn and of the sea's drift were chosen (decision 0058); those from 403 on only judge.

use std::{f64::consts::TAU, path::Path};

use anyhow::Result;
use bowwave_core::{
    estimate::attitude::Source,
    event::{Event, ImuSample},
    sea::BeaufortForce,
};
use hw_sim::make::{Harmonic, Periodic, Recipe};
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::{
    Played, Said,
    obstacles::{Obstacles, turning_force},
    replay,
};
use crate::{
    registration::record,
    ship::{ShipSea, sea_state},
    table::TextTable,
};

/// Length of a recording, and of the session that it is played into again and again, seconds.
const LENGTH_S: f64 = 120.0;
const SESSION_S: f64 = 600.0;

/// One session: its sea state, how the gun was moved, what was in the way, and what its trainer said.
struct RightRun {
    state: usize,
    gun: &'static str,
    way: Way,
    said: Said,
}

/// Replays so many hours of right set-ups, every other one with an orientation that is fused here, and prints what they say.
pub fn run(hours: f64, first: u64) -> Result<()> {
    let count = (hours * 3600.0 / SESSION_S).round().max(1.0) as u64;
    let folder = tempfile::tempdir()?;
    let runs: Vec<RightRun> = (first..first + count)
        .into_par_iter()
        .map(|i| right_run(i, &folder.path().join(format!("{i}.mcap"))))
        .collect::<Result<_>>()?;
    print(&runs);
    Ok(())
}

/// Makes the `i`th recording at `path` and plays it.
fn right_run(i: u64, path: &Path) -> Result<RightRun> {
    let RightSetUp { recipe, gun, way, mut obstacles } = RightSetUp::new(i);
    record(&recipe, path)?;
    let source = if i.is_multiple_of(2) { Source::Auto } else { Source::Fused };
    let scenario = scenario(&recipe);
    let played = Played { source, seconds: SESSION_S, rate: 30.0, scenario: &scenario };
    let (motion, lens, camera_from_imu) = (recipe.motion(), recipe.lens(), recipe.camera_from_imu());
    let said = replay(
        path,
        played,
        |own| own,
        |event, replay| match event {
            Event::Imu(sample) if way != Way::Lies => {
                let at_s = sample.arrival.secs_since(replay.origin());
                let [heading, rate, _] = recipe.ship.heading.at(at_s, LENGTH_S);
                let camera_from_world = motion.at(at_s).pose.world_from_camera.inverse();
                let force = camera_from_world * turning_force(heading, rate, way.speed_m_s());
                Event::Imu(ImuSample { accel: sample.accel + camera_from_imu.inverse() * force, ..sample })
            }
            Event::Frame(mut frame) => {
                let at_s = frame.mid_exposure.secs_since(replay.origin());
                let pose = motion.at(at_s + recipe.exposure_delay_s()).pose;
                frame.picture = obstacles.paint(&frame.picture, &lens, &pose, at_s);
                Event::Frame(frame)
            }
            event => event,
        },
    )?;
    std::fs::remove_file(path)?;
    if let Some((at_s, fault)) = said.first {
        println!(
            "{} after {at_s:.1} s in session {i}, {}, {gun}, {way:?}, {}, {source:?}: {:?}, visibility {:.0} m",
            fault.code(),
            sea_state(i as usize % STATES).name,
            obstacles.name(),
            recipe.sky,
            recipe.visibility_m
        );
    }
    Ok(RightRun { state: i as usize % STATES, gun, way, said })
}

fn print(runs: &[RightRun]) {
    let titles =
        [("sea", 6), ("gun", 8), ("ship", 10), ("minutes", 8), ("alarms", 7), ("ready", 6), ("unchecked", 9)];
    let mut table = TextTable::new(3, titles);
    let kinds = GUNS.iter().flat_map(|(gun, _)| Way::ALL.map(|way| (*gun, way)));
    for (state, (gun, way)) in (0..STATES).flat_map(|state| kinds.clone().map(move |kind| (state, kind))) {
        let of = || runs.iter().filter(|r| r.state == state && r.gun == gun && r.way == way);
        let count = of().count();
        if count == 0 {
            continue;
        }
        let mean = |value: fn(&Said) -> f64| of().map(|r| value(&r.said)).sum::<f64>() / count as f64;
        table.row([
            sea_state(state).name.to_owned(),
            gun.to_owned(),
            way.name().to_owned(),
            format!("{:.0}", count as f64 * SESSION_S / 60.0),
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
        runs.len() as f64 * SESSION_S / 3600.0
    );
}

const STATES: usize = 7;

/// How guns are moved: their names, and deviations of traverse and elevation, degrees.
const GUNS: [(&str, [f64; 2]); 3] =
    [("still", [0.0, 0.0]), ("search", [12.0, 1.0]), ("engaged", [20.0, 2.5])];

/// How the ship goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    /// It lies in the waves.
    Lies,
    /// It turns to and fro as a frigate does: by 60 deg at 8 m/s, at up to 3 deg/s, half a minute to each side.
    Turns,
    /// As a patrol boat does: by 100 deg at 12 m/s, at up to 5 deg/s.
    TurnsHard,
}

impl Way {
    const ALL: [Self; 3] = [Self::Lies, Self::Turns, Self::TurnsHard];

    const fn name(self) -> &'static str {
        match self {
            Self::Lies => "lies",
            Self::Turns => "turns",
            Self::TurnsHard => "turns hard",
        }
    }

    const fn speed_m_s(self) -> f64 {
        match self {
            Self::Lies => 0.0,
            Self::Turns => 8.0,
            Self::TurnsHard => 12.0,
        }
    }

    /// How far it turns to either side of its mean course, radians.
    const fn turns(self) -> f64 {
        match self {
            Self::Lies => 0.0,
            Self::Turns => 60f64.to_radians(),
            Self::TurnsHard => 100f64.to_radians(),
        }
    }
}

/// What the `i`th session is made of.
struct RightSetUp {
    recipe: Recipe,
    gun: &'static str,
    way: Way,
    obstacles: Obstacles,
}

impl RightSetUp {
    fn new(i: u64) -> Self {
        /// Force of the wind that makes a fully grown sea of each state.
        const FORCES: [u8; STATES] = [0, 1, 2, 4, 5, 6, 8];
        const VISIBILITIES_M: [f64; 5] = [4_000.0, 8_000.0, 15_000.0, 25_000.0, 40_000.0];
        let mut rng = Pcg64::seed_from_u64(9000 + i);
        let state = i as usize % STATES;
        let (gun, [traverse, elevation]) = GUNS[(i as usize / STATES) % GUNS.len()];
        // Every other ship lies.
        let way = [Way::Lies, Way::Turns, Way::Lies, Way::TurnsHard][(i as usize / STATES / GUNS.len()) % 4];
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
        // No gun stands so low that such a sea goes over it.
        recipe.eye_height_m = recipe.eye_height_m.max(recipe.eye_height_least_m());
        recipe.sky.sun_azimuth = rng.random::<f64>() * TAU;
        // Every third sun is low enough to stand in the picture and on the water.
        recipe.sky.sun_elevation =
            if i.is_multiple_of(3) { 0.05 + 0.2 * rng.random::<f64>() } else { 0.25 + rng.random::<f64>() };
        recipe.sky.turbidity = 2.0 + 5.0 * rng.random::<f64>();
        recipe.sky.cloud_cover = rng.random::<f64>();
        move_ship(&mut recipe, &ship, way, &mut rng);
        recipe.gun.traverse = waves(&mut rng, 42f64.to_radians(), traverse.to_radians(), 9.0);
        recipe.gun.elevation = waves(&mut rng, -5f64.to_radians(), elevation.to_radians(), 6.0);
        let obstacles = Obstacles::by_chance(&mut rng, SESSION_S, recipe.visibility_m);
        Self { recipe, gun, way, obstacles }
    }
}

fn move_ship(recipe: &mut Recipe, sea: &ShipSea, way: Way, rng: &mut Pcg64) {
    let [roll, pitch, yaw] = sea.turns_deg.map(f64::to_radians);
    let heading = rng.random::<f64>() * TAU;
    recipe.ship.roll = waves(rng, 0.0, roll, sea.periods_s[0]);
    recipe.ship.pitch = waves(rng, 0.0, pitch, sea.periods_s[1]);
    recipe.ship.heading = waves(rng, heading, yaw, sea.periods_s[2]);
    recipe.ship.heave = waves(rng, 0.0, sea.moves_m[2], sea.periods_s[1]);
    let turn = Harmonic { cycles: 1, amplitude: way.turns(), phase: rng.random::<f64>() * TAU };
    recipe.ship.heading.harmonics.push(turn);
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
