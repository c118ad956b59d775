//! Fusing angular rate and specific force into the unit's orientation.

use anyhow::Result;
use bowwave_core::{
    estimate::attitude::{Attitude, AttitudeSettings, Noise, OWN_GROWTH, RateKind, Source},
    event::ImuSample,
    time::Time,
};
use glam::{DQuat, DVec3};
use vqf_rs::{Params, VQF};

use super::About;
use crate::{
    bench::{ExtremeResult, PartBench, Way},
    broad::{self, Trial},
    ship::{self, Ship, ShipSea, UnitErrors, heading_error, inclination_error},
};

/// Description of this part.
pub const ABOUT: About = About {
    part: "orientation",
    what: "Finds which way is up for the inertial unit from its angular rate and specific force, while ship and gun move, and holds its heading.",
    truth: "optical motion capture (nine public trials of BROAD, where they are beside the repository; the gyro's bias there is its mean while \
            the unit rests), and a simulated ship whose every motion is a closed function of time, with the noise and biases of a unit of the \
            VN-100's class. The error is the root mean square of the angle between the found and the true up; on the ship after a minute. \
            The total, in the notes, is that of the whole turn without the heading's mean",
    rivals: "VQF as its authors publish it, with its estimates of the bias at rest and in motion (vqf-rs, which gives what their own C++ gives \
             to 5e-6 deg), the same without, rates alone, a complementary filter (Mahony's without integral) with two gains",
    why: "one setting for hands and guns: velocity is integrated from specific force and held to come back, as what carries a unit does; how fast \
         it moves and how soon it comes back is watched. Biases and gains of the gyro are learnt from that as fast as the evidence has it, and \
         from rests. Plain VQF runs beside it, and is fallen back to where the filter errs by more than it says. Which settings were chosen \
         on which trials, and which trials only judge, is said in each row",
};

fn ship_trial(sea: ShipSea, gun: bool, seconds: f64, errors: UnitErrors) -> Trial {
    let samples = ship::samples(&Ship::new(sea, gun, 7), &errors, seconds, 11);
    let mut trial = Trial { name: sea.name.to_owned(), rate_hz: errors.rate_hz, ..Trial::default() };
    for s in &samples {
        trial.time_s.push(s.time_s);
        trial.rate.push(s.rate);
        trial.force.push(s.accel);
        trial.truth.push((s.time_s > 60.0).then_some(s.truth.world_from_imu));
        trial.bias.push(errors.gyro_bias);
    }
    trial
}

/// Told the number of a sample, the orientation and the gyro's bias as they are found then.
type TellAttitude<'a> = &'a mut dyn FnMut(usize, DQuat, DVec3);

fn ours(noise: Noise, rate: RateKind, trial: &Trial, tell: TellAttitude<'_>) {
    let settings = AttitudeSettings { source: Source::Fused, rate, noise, own_growth: OWN_GROWTH };
    let mut attitude = Attitude::new(settings, DVec3::ZERO, DQuat::IDENTITY);
    for (i, (rate, accel)) in trial.rate.iter().zip(&trial.force).enumerate() {
        let time = Time::from_ns(0).plus_secs(trial.time_s[i]);
        let sample = ImuSample {
            arrival: time,
            device_time_ns: time.ns(),
            rate: *rate,
            accel: *accel,
            world_from_imu: None,
        };
        if let Some(o) = attitude.observe(time, &sample) {
            tell(i, o.world_from_imu, *rate - o.rate);
        }
    }
}

fn vqf(params: Params, trial: &Trial, tell: TellAttitude<'_>) {
    let mut filter = VQF::new(1.0 / trial.rate_hz, None, None, Some(params));
    let mut before_s = None;
    for (i, (rate, accel)) in trial.rate.iter().zip(&trial.force).enumerate() {
        let step_s = before_s.replace(trial.time_s[i]).map_or(1.0 / trial.rate_hz, |s| trial.time_s[i] - s);
        filter.update_gyr_with_ts(rate.to_array(), step_s);
        filter.update_acc(accel.to_array());
        let q = filter.quat_6d();
        tell(i, DQuat::from_xyzw(q.1, q.2, q.3, q.0), DVec3::from_array(filter.bias_estimate().0));
    }
}

/// Mahony, Hamel & Pflimlin 2008, the passive complementary filter with that gain and no integral, 1/s.
fn complementary(gain: f64, trial: &Trial, tell: TellAttitude<'_>) {
    let dt = 1.0 / trial.rate_hz;
    let mut q: Option<DQuat> = None;
    for (i, (rate, accel)) in trial.rate.iter().zip(&trial.force).enumerate() {
        let start = || DQuat::from_rotation_arc(accel.normalize_or(DVec3::Z), DVec3::Z);
        let now = q.get_or_insert_with(start);
        let up = now.inverse() * DVec3::Z;
        let correction = accel.normalize_or(up).cross(up) * gain;
        *now = (*now * DQuat::from_scaled_axis((*rate + correction) * dt)).normalize();
        tell(i, *now, DVec3::ZERO);
    }
}

/// VQF without its estimates of the bias.
fn basic() -> Params {
    Params { rest_bias_est_enabled: false, motion_bias_est_enabled: false, ..Params::default() }
}

type AttitudeRun<'a> = Box<dyn Fn(&Trial, TellAttitude<'_>) + 'a>;

/// Method, setting, whether the product uses it, itself.
fn ways<'a>(rate: RateKind) -> Vec<(&'static str, &'static str, bool, AttitudeRun<'a>)> {
    vec![
        (
            "error-state filter",
            "default",
            true,
            Box::new(move |t: &Trial, tell: TellAttitude<'_>| ours(Noise::USUAL, rate, t, tell)),
        ),
        ("VQF", "as published", false, Box::new(|t, tell| vqf(Params::default(), t, tell))),
        ("VQF", "without bias", false, Box::new(|t, tell| vqf(basic(), t, tell))),
        ("complementary filter", "0.2 /s", false, Box::new(|t, tell| complementary(0.2, t, tell))),
        ("complementary filter", "0.7 /s", false, Box::new(|t, tell| complementary(0.7, t, tell))),
        ("rates alone", "f64", false, Box::new(|t, tell| complementary(0.0, t, tell))),
    ]
}

/// How wrong a run was, degrees and degrees a second.
#[derive(Clone, Copy, Debug)]
struct Errors {
    inclination: f64,
    total: f64,
    /// Largest on an axis, once [`broad::STARTED_S`] have passed.
    bias: f64,
}

fn errors(trial: &Trial, run: impl Fn(&Trial, TellAttitude<'_>)) -> Errors {
    let mut found = vec![None; trial.rate.len()];
    run(trial, &mut |i, q, bias| found[i] = Some((q, bias)));
    let judged =
        || found.iter().zip(&trial.truth).filter_map(|(found, truth)| Some(((*found)?.0, (*truth)?)));
    let (sin, cos) = judged().fold((0.0, 0.0), |(sin, cos), (q, truth)| {
        let off = heading_error(truth, q);
        (sin + off.sin(), cos + off.cos())
    });
    let turned = DQuat::from_rotation_z(-f64::atan2(sin, cos));
    let (mut up, mut total, mut count) = (0.0, 0.0, 0.0f64);
    for (q, truth) in judged() {
        up += inclination_error(truth, q).powi(2);
        let off = turned * q * truth.inverse();
        total += (2.0 * DVec3::new(off.x, off.y, off.z).length().min(1.0).asin()).powi(2);
        count += 1.0;
    }
    let started = found.iter().enumerate().filter(|(i, _)| trial.time_s[*i] > broad::STARTED_S);
    let off = started.filter_map(|(i, found)| Some(((*found)?.1 - trial.bias[i]).abs().max_element()));
    let rms = |sum: f64| (sum / count.max(1.0)).sqrt().to_degrees();
    Errors { inclination: rms(up), total: rms(total), bias: off.fold(0.0, f64::max).to_degrees() }
}

/// Means over trials, the worst trial's and the largest errors of a bias, as a row's note.
fn note(all: &[Errors], published: &[Errors]) -> String {
    let mean = |of: fn(&Errors) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
    let worst = |of: fn(&Errors) -> f64| all.iter().map(of).fold(0.0, f64::max);
    let ratio = |of: fn(&Errors) -> f64| {
        all.iter().zip(published).map(|(ours, theirs)| of(ours) / of(theirs)).fold(0.0, f64::max)
    };
    format!(
        "total {:.2} deg; worst trial {:.2} and {:.2} deg; at most {:.2} and {:.2} times published VQF's in a trial; bias within {:.3} deg/s",
        mean(|e| e.total),
        worst(|e| e.inclination),
        worst(|e| e.total),
        ratio(|e| e.inclination),
        ratio(|e| e.total),
        worst(|e| e.bias)
    )
}

fn mean_inclination(all: &[Errors]) -> f64 {
    all.iter().map(|e| e.inclination).sum::<f64>() / all.len() as f64
}

/// Settings among which leave-one-out chooses: gyro's scale, walk of its bias, bias of the specific force.
fn candidates(quick: bool) -> Vec<Noise> {
    let mut all = Vec::new();
    for scale in [7.5e-4, 1.5e-3, 3e-3] {
        for bias_walk in [3.5e-6, 7e-6, 1.4e-5] {
            for force in [0.01, 0.02, 0.04] {
                all.push(Noise { scale, bias_walk, force, ..Noise::USUAL });
            }
        }
    }
    all.retain(|noise| !quick || (noise.force == 0.02 && noise.bias_walk == 7e-6));
    all
}

/// Each trial by the setting that is best on all the others.
fn left_out(trials: &[Trial], published: &[Errors], quick: bool) -> Vec<Errors> {
    let runs: Vec<Vec<Errors>> = candidates(quick)
        .into_iter()
        .map(|noise| {
            trials.iter().map(|t| errors(t, |t, tell| ours(noise, RateKind::Mean, t, tell))).collect()
        })
        .collect();
    let score = |run: &[Errors], without: usize| {
        let others = run.iter().zip(published).enumerate().filter(|(i, _)| *i != without);
        let ratio = |(_, (ours, theirs)): (usize, (&Errors, &Errors))| {
            2.0 * (ours.inclination / theirs.inclination).ln() + (ours.total / theirs.total).ln()
        };
        others.map(ratio).sum::<f64>()
    };
    (0..trials.len())
        .filter_map(|i| runs.iter().min_by(|a, b| score(a, i).total_cmp(&score(b, i))).map(|run| run[i]))
        .collect()
}

fn of_broad(bench: &mut PartBench) -> Result<()> {
    let trials = broad::trials()?;
    if trials.is_empty() {
        return Ok(());
    }
    let all = |trials: &[Trial], run: &dyn Fn(&Trial, TellAttitude<'_>)| -> Vec<Errors> {
        trials.iter().map(|t| errors(t, run)).collect()
    };
    let theirs = |trials: &[Trial]| all(trials, &|t, tell| vqf(Params::default(), t, tell));
    let published = theirs(&trials);
    let samples = trials.iter().map(|t| t.rate.len()).sum();
    let rows = ways(RateKind::Mean).into_iter().map(|(method, setting, default, run)| {
        let found = all(&trials, &run);
        let trials = &trials;
        let work = move || {
            let mut last = DQuat::IDENTITY;
            trials.iter().for_each(|t| run(t, &mut |_, q, _| last = q));
            last
        };
        let way = Way::new(method, setting, mean_inclination(&found), samples, work);
        way.holds(size_of::<Attitude>()).default_if(default).note(note(&found, &published))
    });
    bench.scene("in hands, nine trials of BROAD", "deg", 1e-3, rows.collect());
    let chosen = left_out(&trials, &published, bench.is_quick());
    let case = "in hands, BROAD, each trial by the setting that is best on the others";
    let tried =
        [("error-state filter", "left out", true, &chosen), ("VQF", "as published", false, &published)];
    let rows = tried.map(|(method, setting, default, found)| {
        ExtremeResult { default, ..ExtremeResult::rival(method, setting, mean_inclination(found)) }
            .note(note(found, &published))
    });
    bench.extreme(case, "deg", rows.into());
    for (trial, theirs) in trials.iter().zip(&published) {
        let rows = ways(RateKind::Mean).into_iter().map(|(method, setting, default, run)| {
            let found = errors(trial, run);
            ExtremeResult { default, ..ExtremeResult::rival(method, setting, found.inclination) }
                .note(note(&[found], std::slice::from_ref(theirs)))
        });
        bench.extreme(&format!("BROAD {}", trial.name), "deg", rows.collect());
    }
    for (name, damaged) in broad::damages(&trials, bench.is_quick()) {
        let published = theirs(&damaged);
        let found = all(&damaged, &|t, tell| ours(Noise::USUAL, RateKind::Mean, t, tell));
        let tried =
            [("error-state filter", "default", true, &found), ("VQF", "as published", false, &published)];
        let rows = tried.map(|(method, setting, default, found)| {
            ExtremeResult { default, ..ExtremeResult::rival(method, setting, mean_inclination(found)) }
                .note(note(found, &published))
        });
        bench.extreme(&format!("BROAD, only judged: {name}"), "deg", rows.into());
    }
    Ok(())
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    of_broad(bench)?;
    for sea in [ship::SEA_4, ship::SEA_6] {
        let trial = &ship_trial(sea, true, 300.0, UnitErrors::usual());
        let rows = ways(RateKind::Instant).into_iter().map(|(method, setting, default, run)| {
            let error = errors(trial, &run).inclination;
            let work = move || {
                let mut last = DQuat::IDENTITY;
                run(trial, &mut |_, q, _| last = q);
                last
            };
            Way::new(method, setting, error, trial.rate.len(), work)
                .holds(size_of::<Attitude>())
                .default_if(default)
        });
        bench.scene(&format!("gun on a ship, {}", sea.name), "deg", 1e-3, rows.collect());
    }
    let usual = UnitErrors::usual();
    let slow = UnitErrors { rate_hz: 100.0, ..usual };
    let fast = UnitErrors { rate_hz: 1000.0, ..usual };
    let biased = UnitErrors { gyro_bias: usual.gyro_bias * 6.0, ..usual };
    for (case, sea, unit) in [
        ("calm, creep of 0.1 to 2 deg/s", ship::CALM, usual),
        ("sea 6 at 100 Hz", ship::SEA_6, slow),
        ("sea 6 at 1000 Hz", ship::SEA_6, fast),
        ("sea 4, bias of 0.3 deg/s on each axis", ship::SEA_4, biased),
    ] {
        let trial = ship_trial(sea, true, 300.0, unit);
        let rows = ways(RateKind::Instant).into_iter().map(|(method, setting, default, run)| {
            let error = errors(&trial, run).inclination;
            ExtremeResult { default, ..ExtremeResult::rival(method, setting, error) }
        });
        bench.extreme(case, "deg", rows.collect());
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use super::*;

    #[test]
    fn strangers_are_no_worse_than_by_vqf_and_no_bias_is_invented() {
        for trial in broad::trials().unwrap() {
            let found = errors(&trial, |t, tell| ours(Noise::USUAL, RateKind::Mean, t, tell));
            let theirs = errors(&trial, |t, tell| vqf(Params::default(), t, tell));
            let name = &trial.name;
            assert!(found.inclination <= 1.1 * theirs.inclination, "{name}: {found:?} {theirs:?}");
            assert!(found.total <= 1.3 * theirs.total, "{name}: {found:?} {theirs:?}");
            assert!(found.bias < 0.1, "{name}: {found:?}");
        }
    }
}
