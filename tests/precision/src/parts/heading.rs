//! The gun's heading by the ship's: what it is worth while nothing measures the gun on its mount.

use std::f64::consts::{PI, TAU};

use anyhow::Result;
use bowwave_core::{
    calibration::Calibration,
    estimate::{HeadingSettings, Sensors, attitude::Source},
    event::{ImuSample, ShipSample},
    geometry::{look, rotation_vector, wrapped},
    time::Time,
};
use glam::{DQuat, DVec3};
use hw_sim::make::{Recipe, calibration};
use hw_sim::ocean::random::gaussian;
use rand::SeedableRng as _;
use rand_pcg::Pcg64;

use super::{About, rms, worst};
use crate::{
    aided::CAMERA_FROM_IMU,
    bench::{ExtremeResult, PartBench},
    ship::GRAVITY,
};

/// Description of this part.
pub const ABOUT: About = About {
    part: "heading",
    what: "Holds the gun's heading by the ship's compass (ten lines a second in tenths of a degree) while the gun rests on its mount, which \
           nothing measures.",
    truth: "ship and gun as closed functions of time, five minutes, roll 5 and pitch 2 deg; the gyro has 0.05 deg/s of bias that no \
            calibration knows; errors count from the heading of the fifth second on",
    rivals: "the gyro alone, and the ship's heading with the gun's first bearing on it",
    why: "it holds a gun that rests or moves visibly. A bearing that goes on by more than 0.075 deg/s counts as a gun that creeps and not as \
          bias: nothing is tied then, the gyro coasts and its deviation says so. A gyro with more bias than that, of which no calibration \
          knows, is not helped by a ship",
};

const DEG: f64 = PI / 180.0;
const RATE_HZ: f64 = 200.0;
const SECONDS: f64 = 300.0;
const START_S: f64 = 5.0;

/// A motion and a feed: the gun's bearing on its mount and the ship's heading (degrees) over time, and what the line says of the latter.
struct HeadingCase {
    name: &'static str,
    bearing: fn(f64) -> f64,
    ship: fn(f64) -> f64,
    line: fn(f64, f64) -> Option<f64>,
}

fn yaws(t: f64) -> f64 {
    355.0 + 3.0 * (t * 0.04).sin() + 0.7 * (t * 0.7).sin()
}

fn rests(_: f64) -> f64 {
    45.0
}

/// Rests of 25 s between moves by 30 deg within 5 s.
fn moves(t: f64) -> f64 {
    let (turns, rest) = ((t / 30.0).floor(), t % 30.0);
    let to = |turns: f64| if turns as i64 % 2 == 0 { 0.0 } else { 30.0 };
    let share = ((rest - 25.0) / 5.0).clamp(0.0, 1.0);
    30.0 + to(turns) + (to(turns + 1.0) - to(turns)) * share * share * (3.0 - 2.0 * share)
}

fn turns(t: f64) -> f64 {
    yaws(t) + 90.0 * ((t - 100.0) / 30.0).clamp(0.0, 1.0)
}

fn every(_: f64, deg: f64) -> Option<f64> {
    Some(deg)
}

const CASES: [HeadingCase; 10] = [
    HeadingCase { name: "the gun rests", bearing: rests, ship: yaws, line: every },
    HeadingCase {
        name: "the gun moves by 30 deg every half minute",
        bearing: moves,
        ship: yaws,
        line: every,
    },
    HeadingCase { name: "the gun creeps by 0.1 deg/s", bearing: |t| 0.1 * t, ship: yaws, line: every },
    HeadingCase { name: "the gun creeps by 0.5 deg/s", bearing: |t| 0.5 * t, ship: yaws, line: every },
    HeadingCase { name: "the gun creeps by 2 deg/s", bearing: |t| 2.0 * t, ship: yaws, line: every },
    HeadingCase { name: "the ship turns by 90 deg", bearing: rests, ship: turns, line: every },
    HeadingCase {
        name: "drop-outs of 5 s every 20 s",
        bearing: rests,
        ship: yaws,
        line: |t, deg| (t % 20.0 < 15.0).then_some(deg),
    },
    HeadingCase {
        name: "a drop-out of 60 s",
        bearing: rests,
        ship: yaws,
        line: |t, deg| (!(100.0..160.0).contains(&t)).then_some(deg),
    },
    HeadingCase {
        name: "the feed freezes after 100 s",
        bearing: rests,
        ship: yaws,
        line: |t, deg| Some(if t > 100.0 { 354.0 } else { deg }),
    },
    HeadingCase {
        name: "the feed is off by 20 deg",
        bearing: rests,
        ship: yaws,
        line: |_, deg| Some(deg + 20.0),
    },
];

impl HeadingCase {
    fn roll_pitch(t: f64) -> (f64, f64) {
        (7.0 * DEG * (t * 0.7).sin(), 2.8 * DEG * (t * 0.84 + 1.0).sin())
    }

    fn world_from_camera(&self, t: f64) -> DQuat {
        let (roll, pitch) = Self::roll_pitch(t);
        let ship = DQuat::from_rotation_z(-(self.ship)(t) * DEG)
            * DQuat::from_rotation_x(pitch)
            * DQuat::from_rotation_y(roll);
        ship * look((self.bearing)(t) * DEG, -3.0 * DEG, 0.0)
    }

    /// Heading errors, degrees, of the product and of the naive rival, once a second; with a feed or none, that tells roll and pitch or not.
    fn run(&self, known: &Calibration, fed: bool, attitude: bool) -> HeadingErrors {
        let mut settings = HeadingSettings::default();
        settings.ship.latency_ns = 60_000_000;
        let mut sensors = Sensors::new(known, Source::Fused, &settings, None, 8.0, 20_000.0);
        let mut rng = Pcg64::seed_from_u64(5);
        let mut found = HeadingErrors::default();
        let (mut first, mut naive) = (None, None);
        for i in 0..(SECONDS * RATE_HZ) as i64 {
            let t = i as f64 / RATE_HZ;
            let at = |t: f64| self.world_from_camera(t) * CAMERA_FROM_IMU;
            let (before, after) = (at(t - 1e-3), at(t + 1e-3));
            let mut noise =
                |sigma: f64| DVec3::new(gaussian(&mut rng), gaussian(&mut rng), gaussian(&mut rng)) * sigma;
            let arrival = Time::from_ns(1_000_000_000).plus_secs(t);
            sensors.imu(&ImuSample {
                arrival,
                device_time_ns: arrival.ns(),
                rate: rotation_vector(before.inverse() * after) / 2e-3
                    + noise(0.035 * DEG)
                    + DVec3::splat(0.05 * DEG),
                accel: at(t).inverse() * (DVec3::Z * GRAVITY) + noise(0.014),
                world_from_imu: None,
            });
            // A line of what was 60 ms ago.
            if fed && i % 20 == 7 {
                let then = t - 0.06;
                let told = (self.line)(then, (self.ship)(then));
                let (roll, pitch) = Self::roll_pitch(then);
                if let Some(deg) = told {
                    let deg = ((deg + 0.05 * gaussian(&mut rng)) * 10.0).round() / 10.0;
                    let sample = ShipSample {
                        arrival,
                        heading: Some((deg * DEG).rem_euclid(TAU)),
                        roll: attitude.then_some(roll),
                        pitch: attitude.then_some(pitch),
                        heading_sigma: None,
                        reduced: false,
                    };
                    sensors.ship(&sample);
                    naive = Some(deg);
                }
            }
            if i % 200 != 199 || t < START_S - 0.1 {
                continue;
            }
            let Ok(now) = sensors.orientation(arrival) else { continue };
            let error =
                heading(sensors.world_from_camera(now.world_from_imu)) - heading(self.world_from_camera(t));
            let first = *first.get_or_insert(error);
            found.ours.push(wrapped(error - first) / DEG);
            let by_ship = naive
                .map(|deg| wrapped((deg + (self.bearing)(0.0)) * DEG - heading(self.world_from_camera(t))));
            found.naive.extend(by_ship.map(|error| error / DEG));
            found.sigma_deg = sensors.heading_sigma().unwrap_or(f64::NAN) / DEG;
        }
        found
    }
}

#[derive(Default)]
struct HeadingErrors {
    ours: Vec<f64>,
    naive: Vec<f64>,
    sigma_deg: f64,
}

fn heading(world_from_camera: DQuat) -> f64 {
    let ahead = world_from_camera * DVec3::Z;
    ahead.x.atan2(ahead.y)
}

/// Measures the cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let mut known = calibration(&Recipe::default()).calibration;
    known.camera_from_imu = CAMERA_FROM_IMU;
    known.gyro_bias = DVec3::ZERO;
    known.gyro_bias_sigma = DVec3::splat(0.1 * DEG);
    for case in &CASES {
        let (ours, with, alone) =
            (case.run(&known, true, false), case.run(&known, true, true), case.run(&known, false, false));
        let said = |found: &HeadingErrors, errors: &[f64]| {
            let most = worst(errors.iter().map(|e| e.abs()));
            format!("worst {most:.2} deg, at the end its own sigma is {:.2} deg", found.sigma_deg)
        };
        let of = |errors: &[f64]| rms(errors.iter().copied());
        let tried = vec![
            ExtremeResult::product("mount's bearing as a state", "heading", of(&ours.ours))
                .note(said(&ours, &ours.ours)),
            ExtremeResult::rival("mount's bearing as a state", "heading, roll and pitch", of(&with.ours))
                .note(said(&with, &with.ours)),
            ExtremeResult::rival("gyro alone", "", of(&alone.ours)).note(said(&alone, &alone.ours)),
            ExtremeResult::rival("ship and first bearing", "", of(&ours.naive))
                .note(format!("worst {:.2} deg", worst(ours.naive.iter().map(|e| e.abs())))),
        ];
        bench.extreme(case.name, "deg", tried);
    }
    Ok(())
}
