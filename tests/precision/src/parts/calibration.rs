//! Rotation and time offset between camera and inertial unit.

use anyhow::Result;
use bowwave_calibration::{
    alignment::{ImuReading, Observation, Options, closed_form, solve},
    simulated::{Motion, Random, Recipe, Recording},
};
use bowwave_core::time::Time;
use glam::{DQuat, DVec3};

use super::{About, rms};
use crate::bench::{PartBench, PartMethod};

/// Description of this part.
pub const ABOUT: About = About {
    part: "calibration",
    what: "Finds how the inertial unit sits on the camera and how far their clocks are apart, from a minute of pictures of a target.",
    truth: "simulated recordings: poses and rates in closed form (sums of sines for traverse, elevation and roll), noise of 0.1 deg \
            and 2 ms of stamp jitter unless said otherwise, a gyro of 0.005 deg/s/sqrt(Hz) with a bias; errors are the root mean \
            square of several seeds",
    rivals: "the closed form by singular values with the correlated offset (which the product starts from), the same with an offset of \
             nothing, the solver on numbers that went through f32 (stamps six hours after start-up, rates and orientations)",
    why: "least squares weighed by a filter that tells the gyro's drift from the camera's noise: it errs half to three quarters as much as \
          the closed form in rotation and an eighth to a half in offset, says how much, and refuses what the motion does not tell; it \
          takes a fraction of a second once in a calibration, so that its time does not count",
};

type SolvedPair = (DQuat, f64);
type PairSolver = fn(&[ImuReading], &[Observation]) -> Option<SolvedPair>;

fn ours(readings: &[ImuReading], observations: &[Observation]) -> Option<SolvedPair> {
    let options = Options::default();
    solve(readings, observations, &options).ok().map(|a| (a.camera_from_imu, a.offset_s))
}

fn singular_values(readings: &[ImuReading], observations: &[Observation]) -> Option<SolvedPair> {
    let options = Options::default();
    closed_form(readings, observations, &options).ok().map(|s| (s.camera_from_imu, s.offset_s))
}

/// Hand-eye calibration that believes the stamps.
fn hand_eye(readings: &[ImuReading], observations: &[Observation]) -> Option<SolvedPair> {
    let options = Options { offset_range_s: 0.01, ..Options::default() };
    closed_form(readings, observations, &options).ok().map(|s| (s.camera_from_imu, 0.0))
}

/// Everything through single precision, stamps in seconds since a start six hours ago.
fn single(readings: &[ImuReading], observations: &[Observation]) -> Option<SolvedPair> {
    let origin = readings.first()?.time.plus_secs(-6.0 * 3600.0);
    let time = |t: Time| origin.plus_secs(f64::from(t.secs_since(origin) as f32));
    let readings: Vec<ImuReading> = readings
        .iter()
        .map(|r| ImuReading { time: time(r.time), rate: r.rate.as_vec3().as_dvec3(), ..*r })
        .collect();
    let observations: Vec<Observation> = observations
        .iter()
        .map(|o| {
            let mut o = *o;
            if let Observation::Orientation { stamp, reference_from_camera: q, .. } = &mut o {
                (*stamp, *q) = (time(*stamp), q.as_quat().as_dquat());
            }
            o
        })
        .collect();
    ours(&readings, &observations)
}

const METHODS: [PartMethod<PairSolver>; 4] = [
    PartMethod::rival("hand-eye, singular values", "stamps believed", hand_eye),
    PartMethod::rival("hand-eye, singular values", "correlated offset", singular_values),
    PartMethod::rival("filtered least squares", "through f32", single),
    PartMethod::product("filtered least squares", "f64", ours),
];

/// Errors of an answer: milliradians and milliseconds; half a turn and the search's range where there is none.
fn errors(recipe: &Recipe, answer: Option<SolvedPair>) -> (f64, f64) {
    answer.map_or((std::f64::consts::PI * 1e3, 600.0), |(q, offset)| {
        let off = (recipe.camera_from_imu * q.inverse()).to_array();
        let half = off[..3].iter().map(|v| v * v).sum::<f64>().sqrt().min(1.0).asin();
        (2e3 * half, (offset - recipe.offset_s).abs() * 1e3)
    })
}

fn both(recordings: &[Recording], method: PairSolver) -> (f64, f64) {
    let all: Vec<(f64, f64)> =
        recordings.iter().map(|r| errors(&r.recipe, method(&r.readings, &r.orientations))).collect();
    (rms(all.iter().map(|e| e.0)), rms(all.iter().map(|e| e.1)))
}

/// An extreme case: its name and how it changes half a minute by hand.
type SpoiltMinute = (&'static str, fn(Recipe) -> Recipe, fn(&mut Recording));

fn same(recipe: Recipe) -> Recipe {
    recipe
}

fn whole(_: &mut Recording) {}

fn every(recording: &mut Recording, keep: impl Fn(usize) -> bool) {
    let mut number = 0;
    recording.orientations.retain(|_| {
        number += 1;
        keep(number)
    });
}

fn wild(recording: &mut Recording) {
    let mut random = Random::new(3);
    for o in recording.orientations.iter_mut().step_by(5) {
        if let Observation::Orientation { reference_from_camera, .. } = o {
            *reference_from_camera *= DQuat::from_scaled_axis(random.vector());
        }
    }
}

fn backward(recording: &mut Recording) {
    for i in (200..recording.readings.len()).step_by(311) {
        recording.readings[i].time = recording.readings[i - 90].time;
    }
    for o in recording.orientations.iter_mut().skip(5).step_by(97) {
        if let Observation::Orientation { stamp, .. } = o {
            *stamp = stamp.plus_ns(-150_000_000);
        }
    }
}

const CASES: [SpoiltMinute; 14] = [
    ("a minute by hand, 0.1 deg, 2 ms", |r| Recipe { seconds: 60.0, ..r }, whole),
    ("500 ms of offset", |r| Recipe { offset_s: 0.5, ..r }, whole),
    (
        "mounted the other way round",
        |r| Recipe { camera_from_imu: DQuat::from_rotation_y(std::f64::consts::PI), ..r },
        whole,
    ),
    ("blur: two thirds of the pictures lost", same, |r| every(r, |i| i % 45 < 15)),
    ("few poses: one in two seconds", same, |r| every(r, |i| i % 60 == 1)),
    ("every fifth pose wild", same, wild),
    ("gyro clipped at 46 deg/s", same, |r| {
        r.readings.iter_mut().for_each(|s| s.rate = s.rate.clamp(DVec3::splat(-0.8), DVec3::splat(0.8)));
    }),
    ("gyro reads 1 % too little about y", same, |r| {
        r.readings.iter_mut().for_each(|s| s.rate.y *= 0.99);
    }),
    ("stamps that repeat and run backwards", same, backward),
    ("rolling shutter of 30 ms left out of account", |r| Recipe { readout_s: 0.03, ..r }, whole),
    ("readings that are no numbers", same, |r| {
        r.readings.iter_mut().step_by(500).for_each(|s| s.rate.x = f64::NAN);
    }),
    ("gyro at 1000 Hz", |r| Recipe { gyro_hz: 1000.0, ..r }, whole),
    ("gun swung about both axes", |r| Recipe { motion: Motion::TraverseAndElevation, ..r }, whole),
    ("gun trained slowly", |r| Recipe { motion: Motion::SlowMount, ..r }, whole),
];

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let seeds = if bench.is_quick() { 3 } else { 12 };
    let record = |motion, seconds, seed| {
        let minute = Recipe::minute(motion, 0.1f64.to_radians(), 2e-3, seed);
        Recipe { seconds, ..minute }
    };
    // Steady stamps and a good target: in more noise than that, single precision would go unnoticed.
    let recordings: Vec<Recording> = (0..seeds)
        .map(|seed| Recipe::minute(Motion::ByHand, 0.02f64.to_radians(), 0.0, seed).record())
        .collect();
    let measured = METHODS.map(|m| both(&recordings, m.run));
    let first = &recordings[..1];
    for (scene, unit, pick) in [
        ("a minute by hand, 0.02 deg, steady stamps, rotation", "mrad", (|e| e.0) as fn((f64, f64)) -> f64),
        ("a minute by hand, 0.02 deg, steady stamps, offset", "ms", |e| e.1),
    ] {
        let ways = METHODS.iter().zip(measured).map(|(m, errors)| {
            let work = || first.iter().map(|r| (m.run)(&r.readings, &r.orientations)).collect::<Vec<_>>();
            m.way(pick(errors), 1, work)
        });
        bench.scene(scene, unit, 1e-6, ways.collect());
    }
    for (case, change, spoil) in CASES {
        let recordings: Vec<Recording> = (0..seeds.min(4))
            .map(|seed| {
                let mut recording = change(record(Motion::ByHand, 30.0, 100 + seed)).record();
                spoil(&mut recording);
                recording
            })
            .collect();
        let measured = METHODS.map(|m| (m, both(&recordings, m.run)));
        for (unit, pick) in [("mrad", (|e| e.0) as fn((f64, f64)) -> f64), ("ms", |e| e.1)] {
            let tried = measured.map(|(m, errors)| m.tried(pick(errors)));
            let what = if unit == "mrad" { "rotation" } else { "offset" };
            bench.extreme(&format!("{case}, {what}"), unit, tried.into());
        }
    }
    refusals(bench, record);
    Ok(())
}

/// Recordings that must be refused: the error is the share that was not.
fn refusals(bench: &mut PartBench, record: impl Fn(Motion, f64, u64) -> Recipe) {
    let count = 4;
    for (case, motion, flip) in [
        ("traverse only must be refused", Motion::TraverseOnly, DVec3::ONE),
        ("elevation only must be refused", Motion::ElevationOnly, DVec3::ONE),
        ("rest must be refused", Motion::Rest, DVec3::ONE),
        ("mirrored axes must be refused", Motion::ByHand, DVec3::new(1.0, 1.0, -1.0)),
    ] {
        let recordings: Vec<Recording> = (0..count)
            .map(|seed| {
                let mut recording = record(motion, 30.0, 200 + seed).record();
                recording.readings.iter_mut().for_each(|r| r.rate *= flip);
                recording
            })
            .collect();
        let taken = |method: PairSolver| {
            let taken = recordings.iter().filter(|r| method(&r.readings, &r.orientations).is_some()).count();
            taken as f64 / count as f64
        };
        bench.extreme(case, "share taken", METHODS.map(|m| m.tried(taken(m.run))).into());
    }
}
