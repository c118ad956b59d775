//! Trials of BROAD (Laidig, Caruso, Cereatti & Seel 2021), and what is done to them to judge by.

use anyhow::Result;
use bowwave_core::physics::GRAVITY_M_S2;
use glam::{DMat3, DQuat, DVec3};
use hw_sim::ocean::random::gaussian;
use rand::SeedableRng as _;
use rand_pcg::Pcg64;

use crate::recorded;

/// An estimate of the bias counts from here on, seconds: the trials begin with a rest of this length at least.
pub const STARTED_S: f64 = 15.0;

/// Those of its 39 trials that lie beside the repository.
const NAMES: [&str; 9] = [
    "02_undisturbed_slow_rotation_B",
    "05_undisturbed_slow_rotation_with_breaks_B",
    "08_undisturbed_fast_rotation_with_breaks_A",
    "14_undisturbed_slow_translation_with_breaks_B",
    "16_undisturbed_fast_translation_B",
    "21_undisturbed_fast_combined",
    "24_disturbed_tapping_A",
    "25_disturbed_tapping_B",
    "30_disturbed_stationary_magnet_C",
];

/// What a unit measured, and the truth.
#[derive(Clone, Debug, Default)]
pub struct Trial {
    /// Its name.
    pub name: String,
    /// Times of its samples, seconds.
    pub time_s: Vec<f64>,
    /// Orientation of the unit in the world, where it is known and counts.
    pub truth: Vec<Option<DQuat>>,
    /// Samples a second.
    pub rate_hz: f64,
    /// Angular rate, rad/s, the unit's axes.
    pub rate: Vec<DVec3>,
    /// Specific force, m/s^2, the unit's axes.
    pub force: Vec<DVec3>,
    /// Bias of the gyro, rad/s: the mean of a rest, and between rests what lies between.
    pub bias: Vec<DVec3>,
}

/// The trials beside the repository; none, and a word of it, where there are none.
pub fn trials() -> Result<Vec<Trial>> {
    let Some(folder) = recorded::find("imu_groundtruth/broad") else { return Ok(Vec::new()) };
    let mut all = Vec::new();
    for name in NAMES {
        let path = folder.join(format!("{name}.mat"));
        let [gyro, accel, truth, moving, rate] =
            recorded::arrays(&path, ["imu_gyr", "imu_acc", "opt_quat", "movement", "sampling_rate"])?;
        let rate_hz = rate.values[0];
        let rate: Vec<DVec3> = gyro.rows::<3>()?.into_iter().map(DVec3::from_array).collect();
        let moving: Vec<bool> = moving.values.iter().map(|moving| *moving > 0.5).collect();
        let truth = truth.rows::<4>()?.into_iter().zip(&moving).map(|([w, x, y, z], moving)| {
            let known = *moving && (w + x + y + z).is_finite();
            known.then(|| DQuat::from_xyzw(x, y, z, w).normalize())
        });
        all.push(Trial {
            name: name.to_owned(),
            rate_hz,
            time_s: (0..rate.len()).map(|i| i as f64 / rate_hz).collect(),
            force: accel.rows::<3>()?.into_iter().map(DVec3::from_array).collect(),
            truth: truth.collect(),
            bias: bias(&rate, &moving, rate_hz),
            rate,
        });
    }
    Ok(all)
}

fn bias(rate: &[DVec3], moving: &[bool], rate_hz: f64) -> Vec<DVec3> {
    // Half a second at each end of a rest may still move.
    let end = (0.5 * rate_hz) as usize;
    let mut rests: Vec<(usize, DVec3)> = Vec::new();
    let mut at = 0;
    for run in moving.chunk_by(|a, b| a == b) {
        let (from, to) = (at + end, (at + run.len()).saturating_sub(end));
        if !run[0] && run.len() > 6 * end {
            let mean = rate[from..to].iter().sum::<DVec3>() / (to - from) as f64;
            rests.push((usize::midpoint(from, to), mean));
        }
        at += run.len();
    }
    let between = |i: usize| {
        let after = rests.partition_point(|(middle, _)| *middle < i);
        let Some((first, last)) = rests.first().zip(rests.last()) else { return DVec3::ZERO };
        match (after.checked_sub(1).and_then(|before| rests.get(before)), rests.get(after)) {
            (None, _) => first.1,
            (_, None) => last.1,
            (Some((from, a)), Some((to, b))) => a.lerp(*b, (i - from) as f64 / (to - from) as f64),
        }
    };
    (0..rate.len()).map(between).collect()
}

/// The trials as other units and lines would have told them: name of what is done, and each trial.
pub fn damages(trials: &[Trial], quick: bool) -> Vec<(String, Vec<Trial>)> {
    let each = |change: &dyn Fn(&mut Trial)| -> Vec<Trial> {
        let changed = |trial: &Trial| {
            let mut trial = trial.clone();
            change(&mut trial);
            trial
        };
        trials.iter().map(changed).collect()
    };
    let mut all = Vec::new();
    let mut rng = Pcg64::seed_from_u64(5);
    for number in 0..if quick { 2 } else { 10 } {
        let bias =
            DVec3::new(gaussian(&mut rng), gaussian(&mut rng), gaussian(&mut rng)) * 0.5f64.to_radians();
        let turned_on = each(&|t| {
            t.rate.iter_mut().for_each(|rate| *rate += bias);
            t.bias.iter_mut().for_each(|of| *of += bias);
        });
        all.push((format!("turn-on bias {number}, {:.2} deg/s", bias.length().to_degrees()), turned_on));
    }
    for (name, gyro, accel) in [
        ("gyro 1 % too fast", DVec3::splat(0.01), DVec3::ZERO),
        ("gyro 1 % too slow", DVec3::splat(-0.01), DVec3::ZERO),
        ("gyro and force by 1 %, signs mixed", DVec3::new(0.01, -0.01, 0.01), DVec3::new(-0.01, 0.01, 0.01)),
    ] {
        let [gyro, accel] = [gyro, accel].map(|scale| DMat3::IDENTITY + DMat3::from_diagonal(scale));
        let scaled = each(&|t| {
            t.rate.iter_mut().for_each(|rate| *rate = gyro * *rate);
            t.force.iter_mut().for_each(|force| *force = accel * *force);
        });
        all.push((name.to_owned(), scaled));
    }
    let range = DVec3::splat(16.0 * GRAVITY_M_S2);
    let clip = |t: &mut Trial| t.force.iter_mut().for_each(|f| *f = f.clamp(-range, range));
    all.push(("force clips at 16 g".to_owned(), each(&clip)));
    for (every_s, missing_s) in [(1.0, 0.01), (5.0, 0.1)] {
        let name = format!("{} ms missing in each {every_s} s", missing_s * 1e3);
        all.push((name, each(&|t| keep(t, |time_s| time_s % every_s > missing_s))));
    }
    for hz in [100.0, 800.0] {
        all.push((format!("{hz} Hz"), trials.iter().map(|t| resampled(t, hz)).collect()));
    }
    all
}

fn keep(trial: &mut Trial, keeps: impl Fn(f64) -> bool) {
    let kept: Vec<usize> = (0..trial.time_s.len()).filter(|i| keeps(trial.time_s[*i])).collect();
    let of = |all: &[DVec3]| kept.iter().map(|i| all[*i]).collect();
    *trial = Trial {
        name: trial.name.clone(),
        rate_hz: trial.rate_hz,
        rate: of(&trial.rate),
        force: of(&trial.force),
        bias: of(&trial.bias),
        truth: kept.iter().map(|i| trial.truth[*i]).collect(),
        time_s: kept.iter().map(|i| trial.time_s[*i]).collect(),
    };
}

/// As a unit that integrates by itself tells it at another rate: means over its own periods.
fn resampled(trial: &Trial, hz: f64) -> Trial {
    let step = 1.0 / trial.rate_hz;
    let integral = |all: &[DVec3]| {
        let mut sum = vec![DVec3::ZERO];
        all.iter().for_each(|value| sum.push(sum[sum.len() - 1] + *value * step));
        sum
    };
    let at = |sum: &[DVec3], time_s: f64| {
        let place = (time_s * trial.rate_hz).clamp(0.0, (sum.len() - 2) as f64);
        sum[place as usize].lerp(sum[place as usize + 1], place.fract())
    };
    let (turned, pushed) = (integral(&trial.rate), integral(&trial.force));
    let mut out = Trial { name: trial.name.clone(), rate_hz: hz, ..Trial::default() };
    let count = (trial.time_s.len() as f64 * step * hz) as usize;
    for i in 1..count.saturating_sub(3) {
        let time_s = i as f64 / hz;
        // A sample tells of the time up to it.
        let mean = |sum: &[DVec3]| (at(sum, time_s + step) - at(sum, time_s + step - 1.0 / hz)) * hz;
        let near = ((time_s * trial.rate_hz).round() as usize).min(trial.truth.len() - 1);
        out.time_s.push(time_s);
        out.rate.push(mean(&turned));
        out.force.push(mean(&pushed));
        out.truth.push(trial.truth[near]);
        out.bias.push(trial.bias[near]);
    }
    out
}
