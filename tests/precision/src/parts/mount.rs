//! Further measurements on the mount: boresight, the trigger's latency, and whether a calibration still holds.

use anyhow::Result;
use bowwave_calibration::{
    alignment::{Compared, ImuReading, Judgement, Options, Parameter, compare, solve},
    boresight::{self, Shot},
    simulated::{Motion, Random, Recipe, Recording},
    trigger,
};
use bowwave_core::{
    calibration::Calibration,
    event::TriggerEdge,
    geometry::Lens,
    time::{Time, secs_to_ns},
};
use glam::{DQuat, DVec2, DVec3};

use super::{About, rms};
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "mount",
    what: "Finds where the barrel points from pulls at a mark and when rounds leave from dry shots, and tells a stale calibration from a good one.",
    truth: "pulls, jolts and recordings made by formulas with known truth: aims that scatter by 0.5 mrad and marks seen to half a pixel; jolts \
            that ring down within 30 ms in a force of 0.05 m/s^2 of noise; half minutes by hand with 0.1 deg and 2 ms of noise",
    rivals: "boresight: the mean direction of the mark without its parallax, the first pull alone; trigger: the largest force after the edge, \
             the first force beyond a fixed limit; check: fixed limits of 2 mrad and 1 ms",
    why: "parallax at 100 m is worth several milliradians; a jolt stands out of what the gun did before the press, whatever that was; a \
          change is told by the covariances of both sides, which tell a poor recording from a moved camera",
};

/// Muzzle in the camera's space, metres.
const MUZZLE: DVec3 = DVec3::new(0.25, 0.4, 1.1);
const BORE: DVec2 = DVec2::new(4e-3, -7e-3);
/// A pixel of 1920 over 60 degrees, radians.
const PIXEL: f64 = 0.6e-3;

/// Pulls at a mark, each aimed anew.
fn pulls(count: usize, range_m: f64, wild: bool, seed: u64) -> Vec<Shot> {
    let mut random = Random::new(seed);
    let mut two = |sigma: f64| DVec2::new(random.gauss(), random.gauss()) * sigma;
    (0..count)
        .map(|i| {
            let aim = if wild && i == 1 { DVec2::splat(4e-3) } else { two(0.5e-3) };
            let bore = DVec3::new((BORE + aim).x.tan(), (BORE + aim).y.tan(), 1.0);
            let mark = MUZZLE + bore * range_m;
            let seen = mark / mark.z + two(0.5 * PIXEL).extend(0.0);
            Shot { hit_in_camera: seen, range_m: mark.length(), drop_in_camera_m: DVec3::ZERO }
        })
        .collect()
}

type Bore = fn(&[Shot]) -> Option<DVec2>;

const BORES: [(&str, &str, Bore); 3] = [
    ("mean of the pulls", "parallax taken off", |s| {
        Some(boresight::solve(s, MUZZLE, 0.5 * PIXEL).ok()?.angles)
    }),
    ("mean of the pulls", "no parallax", |s| {
        Some(boresight::solve(s, DVec3::ZERO, 0.5 * PIXEL).ok()?.angles)
    }),
    ("first pull", "parallax taken off", |s| {
        let hit = s.first()?.hit_in_camera.normalize() * s.first()?.range_m - MUZZLE;
        Some(DVec2::new((hit.x / hit.z).atan(), (hit.y / hit.z).atan()))
    }),
];

fn bores(bench: &mut PartBench) {
    let off = |way: Bore, count, range_m, wild| {
        let one =
            |seed: u64| way(&pulls(count, range_m, wild, seed)).map_or(f64::NAN, |a| a.distance(BORE) * 1e3);
        rms((0..200).map(one))
    };
    let shots = pulls(5, 100.0, false, 0);
    let ways = BORES.iter().enumerate().map(|(i, (method, setting, way))| {
        let work = || way(&shots);
        Way::new(method, setting, off(*way, 5, 100.0, false), 1, work).default_if(i == 0)
    });
    bench.scene("boresight, five pulls at 100 m", "mrad rms", 0.02, ways.collect());
    for (case, count, range_m, wild) in [
        ("boresight, three pulls at 100 m", 3, 100.0, false),
        ("boresight, five pulls at 10 m", 5, 10.0, false),
        ("boresight, five pulls at 1000 m", 5, 1000.0, false),
        ("boresight, one of five pulls is 6 mrad off", 5, 100.0, true),
    ] {
        let tried = BORES.iter().enumerate().map(|(i, (method, setting, way))| ExtremeResult {
            default: i == 0,
            ..ExtremeResult::rival(method, setting, off(*way, count, range_m, wild))
        });
        bench.extreme(case, "mrad rms", tried.collect());
    }
}

/// Readings and edges of eight dry shots whose jolt of `jolt` m/s^2 comes `late_s` after the edge.
fn dry(late_s: f64, jolt: f64, sway: f64, seed: u64) -> (Vec<ImuReading>, Vec<TriggerEdge>) {
    let mut random = Random::new(seed);
    let presses: Vec<f64> = (0..8).map(|i| 1.0 + 1.5 * f64::from(i) + 0.2 * random.unit()).collect();
    let readings = (0..15 * 200).map(|i| {
        let t = f64::from(i) / 200.0;
        let since = presses.iter().map(|p| t - p - late_s).filter(|s| *s >= 0.0);
        let ring: f64 = since.map(|s| jolt * (-s / 0.03).exp() * (250.0 * s).cos()).sum();
        let swing = DVec3::Y * sway * (4.0 * t).sin();
        let force = DVec3::new(ring, 0.3 * ring, 9.81) + swing + random.vector() * 0.05;
        ImuReading { time: Time::from_ns(0).plus_secs(t), rate: DVec3::ZERO, specific_force: Some(force) }
    });
    let readings = readings.collect();
    let edges = presses.iter().map(|p| TriggerEdge { time: Time::from_ns(0).plus_secs(*p), pressed: true });
    (readings, edges.collect())
}

type LatePress = fn(&[ImuReading], &[TriggerEdge]) -> Option<f64>;

/// The median over the presses of when `is_it` first holds of the force less gravity.
fn first_where(
    readings: &[ImuReading],
    edges: &[TriggerEdge],
    is_it: impl Fn(f64, f64) -> bool,
) -> Option<f64> {
    let force = |r: &ImuReading| (r.specific_force.unwrap_or(DVec3::ZERO).length() - 9.81).abs();
    let mut all: Vec<f64> = edges
        .iter()
        .filter_map(|e| {
            let after: Vec<(f64, f64)> = readings
                .iter()
                .map(|r| (r.time.secs_since(e.time), force(r)))
                .filter(|(t, _)| (0.0..0.25).contains(t))
                .collect();
            let most = after.iter().map(|a| a.1).fold(0.0, f64::max);
            after.iter().find(|a| is_it(a.1, most)).map(|a| a.0)
        })
        .collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied()
}

const LATES: [(&str, &str, LatePress); 3] = [
    ("stands out of what was before", "", |r, e| Some(trigger::solve(r, e).ok()?.latency_s)),
    ("largest force", "", |r, e| first_where(r, e, |force, most| force >= most)),
    ("first force beyond a limit", "2 m/s^2", |r, e| first_where(r, e, |force, _| force > 2.0)),
];

fn triggers(bench: &mut PartBench) {
    let off = |way: LatePress, jolt, sway| {
        let one = |seed: u64| {
            let (late_s, (readings, edges)) = (0.02, dry(0.02, jolt, sway, seed));
            // Nothing found is as wrong as what is looked at is long.
            way(&readings, &edges).map_or(250.0, |found| (found - late_s).abs() * 1e3)
        };
        rms((0..20).map(one))
    };
    let (readings, edges) = dry(0.02, 30.0, 0.0, 0);
    let ways = LATES.iter().enumerate().map(|(i, (method, setting, way))| {
        let work = || way(&readings, &edges);
        let way = Way::new(method, setting, off(*way, 30.0, 0.0), 1, work);
        if i == 0 {
            way.default_although("a fixed limit is met by a gun that sways, too; once in a calibration")
        } else {
            way
        }
    });
    bench.scene("trigger, eight dry shots", "ms rms", 2.5, ways.collect());
    for (case, jolt, sway) in
        [("trigger, a weak jolt of 4 m/s^2", 4.0, 0.0), ("trigger, a gun that sways by 3 m/s^2", 30.0, 3.0)]
    {
        let tried = LATES.iter().enumerate().map(|(i, (method, setting, way))| ExtremeResult {
            default: i == 0,
            ..ExtremeResult::rival(method, setting, off(*way, jolt, sway))
        });
        bench.extreme(case, "ms rms", tried.collect());
    }
}

/// Standard deviations that a calibration states, radians and seconds.
const STATED: (f64, f64) = (0.25e-3, 0.1e-3);

/// A calibration with an error of its own deviation, and changed since.
fn known(recording: &Recording, turn: DVec3, late_s: f64) -> Calibration {
    let recipe = &recording.recipe;
    let mut random = Random::new(recipe.seed ^ 0x57a1e);
    let own = DQuat::from_scaled_axis(random.vector() * STATED.0 + turn);
    let offset_s = recipe.offset_s + STATED.1 * random.gauss() + late_s;
    Calibration {
        camera_from_imu: own * recipe.camera_from_imu,
        camera_from_imu_sigma: DVec3::splat(STATED.0),
        time_offset_ns: secs_to_ns(offset_s),
        time_offset_sigma_ns: secs_to_ns(STATED.1),
        gyro_bias: recipe.gyro_bias,
        ..Calibration::nominal(Lens::pinhole(1280, 720, 1.0))
    }
}

fn by_covariance(recording: &Recording, known: &Calibration) -> Option<bool> {
    let seen = Compared {
        readings: &recording.readings,
        observations: &recording.orientations,
        sight: &[],
        lens: None,
    };
    let told = compare(&seen, known, &Options::default()).ok()?;
    let asked = [Parameter::Elevation, Parameter::Traverse, Parameter::Roll, Parameter::Offset];
    let is_wrong =
        |p: &Parameter| told.deviations.iter().any(|d| d.parameter == *p && d.judgement == Judgement::Wrong);
    Some(asked.iter().any(is_wrong))
}

fn by_limits(recording: &Recording, known: &Calibration) -> Option<bool> {
    let found = solve(&recording.readings, &recording.orientations, &Options::default()).ok()?;
    let turn = found.camera_from_imu.angle_between(known.camera_from_imu);
    let late_s = found.offset_s - known.time_offset_ns as f64 * 1e-9;
    Some(turn > 2e-3 || late_s.abs() > 1e-3)
}

fn checks(bench: &mut PartBench) {
    let count: u64 = if bench.is_quick() { 6 } else { 60 };
    let noise = 0.1f64.to_radians();
    for (movement, motion) in [("by hand", Motion::ByHand), ("trained slowly", Motion::SlowMount)] {
        let record =
            |seed: u64| Recipe { seconds: 30.0, ..Recipe::minute(motion, noise, 2e-3, 700 + seed) }.record();
        let recordings: Vec<Recording> = (0..count).map(record).collect();
        for (case, turn, late_s) in [
            ("nothing has changed", DVec3::ZERO, 0.0),
            ("turned by 1 mrad", DVec3::Y * 1e-3, 0.0),
            ("turned by 3 mrad", DVec3::X * 3e-3, 0.0),
            ("0.5 ms later", DVec3::ZERO, 0.5e-3),
            ("2 ms later", DVec3::ZERO, 2e-3),
        ] {
            let has_changed = turn != DVec3::ZERO || late_s != 0.0;
            let wrong = |tells: fn(&Recording, &Calibration) -> Option<bool>| {
                let wrong =
                    recordings.iter().filter(|r| tells(r, &known(r, turn, late_s)) != Some(has_changed));
                100.0 * wrong.count() as f64 / count as f64
            };
            let tried = vec![
                ExtremeResult::product("by the covariances", "", wrong(by_covariance)),
                ExtremeResult::rival("by limits", "2 mrad, 1 ms", wrong(by_limits)),
            ];
            bench.extreme(&format!("check, {movement}: {case}"), "% told wrong", tried);
        }
    }
}

/// Measures all of it.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    bores(bench);
    triggers(bench);
    checks(bench);
    Ok(())
}
