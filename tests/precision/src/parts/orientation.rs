//! Fusing angular rate and specific force into the unit's orientation.

use anyhow::Result;
use bowwave_core::{
    attitude::{Attitude, AttitudeSettings, Noise, RateKind, Settings, Source, UpSeen},
    event::ImuSample,
    time::Time,
};
use glam::{DMat2, DMat3, DQuat, DVec3};
use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use vqf_rs::{Params, VQF};

use super::About;
use crate::{
    bench::{Bench, Tried, Way},
    recorded,
    ship::{self, Errors, Sea, Ship, inclination_error},
};

/// What is said of this part.
pub const ABOUT: About = About {
    part: "orientation",
    what: "Finds which way is up for the inertial unit from its angular rate and specific force, while ship and gun move.",
    truth: "optical motion capture (three public trials of BROAD, where they are beside the repository), and a simulated ship whose \
            every motion is a closed function of time, with the noise and biases of a unit of the VN-100's class. The error is the root \
            mean square of the angle between the found and the true up; on the ship after a minute",
    rivals: "VQF alone as its authors set it and as it is set here, rates alone, a complementary filter (Mahony's without integral) with two gains",
    why: "VQF with a time constant above the waves' period and limits of rest below a creeping gun's; on it stands a filter that \
          integrates the rates by itself and takes VQF's inclination for what it is, a measurement that errs for seconds on end. On \
          the ship that halves VQF's error, and it tells how wrong it may be. In hands VQF's own settings are better, since hands \
          accelerate for shorter",
};

struct Trial {
    rate_hz: f64,
    /// Rate, specific force, truth where it is known and counts.
    samples: Vec<(DVec3, DVec3, Option<DQuat>)>,
}

/// Three of its 39 trials: a slow rotation, fast rotation and translation, tapping.
const BROAD: [&str; 3] =
    ["02_undisturbed_slow_rotation_B", "21_undisturbed_fast_combined", "24_disturbed_tapping_A"];

fn broad(name: &str) -> Result<Option<Trial>> {
    let Some(path) = recorded::find(&format!("imu_groundtruth/broad/{name}.mat")) else { return Ok(None) };
    let [gyro, accel, truth, moving, rate] =
        recorded::arrays(&path, ["imu_gyr", "imu_acc", "opt_quat", "movement", "sampling_rate"])?;
    let truth = truth.rows::<4>()?;
    let samples = gyro
        .rows::<3>()?
        .into_iter()
        .zip(accel.rows::<3>()?)
        .zip(truth.into_iter().zip(&moving.values))
        .map(|((rate, accel), ([w, x, y, z], moving))| {
            let known = *moving > 0.5 && (w + x + y + z).is_finite();
            let truth = known.then(|| DQuat::from_xyzw(x, y, z, w).normalize());
            (DVec3::from_array(rate), DVec3::from_array(accel), truth)
        })
        .collect();
    Ok(Some(Trial { rate_hz: rate.values[0], samples }))
}

fn ship_trial(sea: Sea, gun: bool, seconds: f64, errors: Errors) -> Trial {
    let samples = ship::samples(&Ship::new(sea, gun, 7), &errors, seconds, 11);
    let samples = samples
        .iter()
        .map(|s| (s.rate, s.accel, (s.time_s > 60.0).then_some(s.truth.world_from_imu)))
        .collect();
    Trial { rate_hz: errors.rate_hz, samples }
}

type Tell<'a> = &'a mut dyn FnMut(usize, DQuat);

fn settings(inclination: Settings, rate: RateKind) -> AttitudeSettings {
    let noise = match inclination {
        Settings::HAND => Noise { bias: DVec3::splat(9e-3), scale: 5e-3, force: 0.02, ..Noise::USUAL },
        _ => Noise::USUAL,
    };
    AttitudeSettings { source: Source::Fused, rate, inclination, noise }
}

fn ours(settings: AttitudeSettings, trial: &Trial, tell: Tell<'_>) {
    let mut attitude = Attitude::new(settings, DVec3::ZERO, DQuat::IDENTITY);
    for (i, (rate, accel, _)) in trial.samples.iter().enumerate() {
        let time = Time::from_ns(0).plus_secs(i as f64 / trial.rate_hz);
        let sample = ImuSample {
            arrival: time,
            device_time_ns: time.ns(),
            rate: *rate,
            accel: *accel,
            world_from_imu: None,
        };
        if let Some(o) = attitude.observe(time, &sample) {
            tell(i, o.world_from_imu);
        }
    }
}

fn vqf(params: Params, trial: &Trial, tell: Tell<'_>) {
    let mut filter = VQF::new(1.0 / trial.rate_hz, None, None, Some(params));
    for (i, (rate, accel, _)) in trial.samples.iter().enumerate() {
        filter.update(rate.to_array(), accel.to_array(), None);
        let q = filter.quat_6d();
        tell(i, DQuat::from_xyzw(q.1, q.2, q.3, q.0));
    }
}

/// Mahony, Hamel & Pflimlin 2008, the passive complementary filter with that gain and no integral, 1/s.
fn complementary(gain: f64, trial: &Trial, tell: Tell<'_>) {
    let dt = 1.0 / trial.rate_hz;
    let mut q: Option<DQuat> = None;
    for (i, (rate, accel, _)) in trial.samples.iter().enumerate() {
        let start = || DQuat::from_rotation_arc(accel.normalize_or(DVec3::Z), DVec3::Z);
        let now = q.get_or_insert_with(start);
        let up = now.inverse() * DVec3::Z;
        let correction = accel.normalize_or(up).cross(up) * gain;
        *now = (*now * DQuat::from_scaled_axis((*rate + correction) * dt)).normalize();
        tell(i, *now);
    }
}

/// The same with rates alone after a levelled start.
fn rates_alone(trial: &Trial, tell: Tell<'_>) {
    complementary(0.0, trial, tell);
}

/// VQF as it is set for a gun here.
fn gun_params() -> Params {
    Params { tau_acc: 10.0, rest_th_gyr: 0.2, rest_th_acc: 0.05, bias_clip: 0.5, ..Params::default() }
}

type Run<'a> = Box<dyn Fn(&Trial, Tell<'_>) + 'a>;

/// Method, setting, whether the product uses it, itself.
fn ways<'a>(default: Settings, rate: RateKind) -> Vec<(&'static str, &'static str, bool, Run<'a>)> {
    let (gun, hand) = (settings(Settings::GUN, rate), settings(Settings::HAND, rate));
    vec![
        (
            "VQF and error-state filter",
            "for a gun",
            default == Settings::GUN,
            Box::new(move |t, tell| ours(gun, t, tell)),
        ),
        (
            "VQF and error-state filter",
            "in hands",
            default == Settings::HAND,
            Box::new(move |t, tell| ours(hand, t, tell)),
        ),
        ("VQF", "its authors'", false, Box::new(|t, tell| vqf(Params::default(), t, tell))),
        ("VQF", "for a gun", false, Box::new(|t, tell| vqf(gun_params(), t, tell))),
        ("complementary filter", "0.2 /s", false, Box::new(|t, tell| complementary(0.2, t, tell))),
        ("complementary filter", "0.7 /s", false, Box::new(|t, tell| complementary(0.7, t, tell))),
        ("rates alone", "f64", false, Box::new(rates_alone)),
    ]
}

/// What a camera sees of the horizon on that ship: up, with so much noise on each axis, ten times a second for `seen_s`, then nothing for
/// as long.
struct Horizon {
    seen_s: f64,
    sigma: f64,
}

/// How the calibration has the camera against the unit, and how it is.
const CAMERA_FROM_IMU: DQuat = DQuat::from_xyzw(-0.5, -0.5, -0.5, 0.5);
const MOUNTED_WRONG: DVec3 = DVec3::new(7e-4, -6e-4, 5e-4);
/// From exposure to the horizon's being known, seconds.
const HORIZON_LATE_S: f64 = 0.045;
/// Chi squared with two degrees of freedom at 99.9 %.
const LIMIT: f64 = 13.8;

/// Errors of a run with a horizon: root mean square and worst angle of up, degrees, and mean of its square over the filter's variance
/// (two where that is right).
struct Aided {
    rms_deg: f64,
    worst_deg: f64,
    surprise: f64,
}

fn aided(sea: Sea, horizon: &Horizon, seconds: f64, seed: u64) -> Aided {
    let samples = ship::samples(&Ship::new(sea, true, seed), &Errors::usual(), seconds, seed + 100);
    let mut rng = Pcg64::seed_from_u64(seed);
    let imu_from_camera = (DQuat::from_scaled_axis(MOUNTED_WRONG) * CAMERA_FROM_IMU).inverse();
    let mut attitude =
        Attitude::new(settings(Settings::GUN, RateKind::Instant), DVec3::ZERO, CAMERA_FROM_IMU);
    let mut waiting: Option<UpSeen> = None;
    let (mut sum, mut worst, mut surprise, mut count) = (0.0, 0.0f64, 0.0, 0.0);
    for (i, s) in samples.iter().enumerate() {
        let time = Time::from_ns(0).plus_secs(s.time_s);
        let sample = ImuSample {
            arrival: time,
            device_time_ns: time.ns(),
            rate: s.rate,
            accel: s.accel,
            world_from_imu: None,
        };
        let Some(found) = attitude.observe(time, &sample) else { continue };
        let truth = s.truth.world_from_imu;
        if i % 20 == 0 && s.time_s % (2.0 * horizon.seen_s) < horizon.seen_s {
            let noise = DVec3::new(ship::gaussian(&mut rng), ship::gaussian(&mut rng), 0.0) * horizon.sigma;
            let up_world = DQuat::from_scaled_axis(noise) * DVec3::Z;
            let up_camera = (truth * imu_from_camera).inverse() * up_world;
            let covariance = DMat3::IDENTITY * horizon.sigma * horizon.sigma;
            waiting = Some(UpSeen { time, up_camera, covariance });
        }
        if let Some(seen) = waiting.take_if(|seen| time.secs_since(seen.time) > HORIZON_LATE_S) {
            attitude.see_up(&seen, LIMIT);
        }
        if s.time_s > 60.0 {
            let off = inclination_error(truth, found.world_from_imu);
            let turn = (truth * found.world_from_imu.inverse()).to_scaled_axis().truncate();
            let expected = attitude
                .covariance()
                .map_or(DMat2::NAN, |c| DMat2::from_cols(c.x_axis.truncate(), c.y_axis.truncate()));
            sum += off * off;
            worst = worst.max(off);
            surprise += turn.dot(expected.inverse() * turn);
            count += 1.0;
        }
    }
    Aided {
        rms_deg: (sum / count).sqrt().to_degrees(),
        worst_deg: worst.to_degrees(),
        surprise: surprise / count,
    }
}

fn aided_cases(bench: &mut Bench) {
    let sigma = 0.03f64.to_radians();
    for (case, sea, seen_s) in [
        ("sea 4, horizon seen for 10 s of 20", ship::SEA_4, 10.0),
        ("sea 6, horizon seen for 10 s of 20", ship::SEA_6, 10.0),
        ("calm, horizon seen for 60 s of 120", ship::CALM, 60.0),
        ("sea 6, horizon seen for 60 s of 120", ship::SEA_6, 60.0),
    ] {
        let run = aided(sea, &Horizon { seen_s, sigma }, 400.0, 3);
        let note = format!(
            "worst {:.3} deg; square over its variance {:.2} in the mean",
            run.worst_deg, run.surprise
        );
        let tried =
            Tried::product("VQF and error-state filter", "for a gun, with horizon", run.rms_deg).note(note);
        bench.extreme(case, "deg", vec![tried]);
    }
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut Bench) -> Result<()> {
    let mut trials = Vec::new();
    for name in BROAD {
        let Some(trial) = broad(name)? else { continue };
        extreme(bench, &format!("BROAD {name}"), &trial, Settings::HAND, RateKind::Mean);
        trials.push(trial);
    }
    if !trials.is_empty() {
        scene(bench, "in hands, trials of BROAD", &trials, Settings::HAND, RateKind::Mean);
    }
    for sea in [ship::SEA_4, ship::SEA_6] {
        let trial = ship_trial(sea, true, 300.0, Errors::usual());
        scene(bench, &format!("gun on a ship, {}", sea.name), &[trial], Settings::GUN, RateKind::Instant);
    }
    let usual = Errors::usual();
    let slow = Errors { rate_hz: 100.0, ..usual };
    let fast = Errors { rate_hz: 1000.0, ..usual };
    let biased = Errors { gyro_bias: usual.gyro_bias * 6.0, ..usual };
    for (case, sea, errors) in [
        ("calm, creep of 0.1 to 2 deg/s", ship::CALM, usual),
        ("sea 6 at 100 Hz", ship::SEA_6, slow),
        ("sea 6 at 1000 Hz", ship::SEA_6, fast),
        ("sea 4, bias of 0.3 deg/s on each axis", ship::SEA_4, biased),
    ] {
        let trial = ship_trial(sea, true, 300.0, errors);
        extreme(bench, case, &trial, Settings::GUN, RateKind::Instant);
    }
    aided_cases(bench);
    Ok(())
}

fn extreme(bench: &mut Bench, case: &str, trial: &Trial, default: Settings, rate: RateKind) {
    let tried = ways(default, rate).into_iter().map(|(method, setting, default, run)| Tried {
        default,
        ..Tried::rival(method, setting, error_deg(trial, run))
    });
    bench.extreme(case, "deg", tried.collect());
}

/// The error is the mean over the trials.
fn scene(bench: &mut Bench, name: &str, trials: &[Trial], default: Settings, rate: RateKind) {
    let samples = trials.iter().map(|t| t.samples.len()).sum();
    let ways = ways(default, rate).into_iter().map(|(method, setting, is_default, run)| {
        let error = trials.iter().map(|t| error_deg(t, &run)).sum::<f64>() / trials.len() as f64;
        let work = move || {
            let mut last = DQuat::IDENTITY;
            trials.iter().for_each(|t| run(t, &mut |_, q| last = q));
            last
        };
        let way = Way::new(method, setting, error, samples, work).holds(size_of::<Attitude>());
        way.default_if(is_default)
    });
    bench.scene(name, "deg", 1e-3, ways.collect());
}

/// Root mean square of the inclination's error, degrees.
fn error_deg(trial: &Trial, run: impl Fn(&Trial, Tell<'_>)) -> f64 {
    let (mut sum, mut count) = (0.0, 0u32);
    run(trial, &mut |i, q| {
        if let Some(truth) = trial.samples[i].2 {
            sum += inclination_error(truth, q).powi(2);
            count += 1;
        }
    });
    (sum / f64::from(count)).sqrt().to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The filter must know how wrong it is: the mean of the squares over their variances lies about two, on the safe side rather than
    /// on the other.
    #[test]
    fn a_horizon_half_of_the_time_is_enough_and_the_filter_knows_its_error() {
        for (sea, seed) in [(ship::CALM, 1), (ship::SEA_4, 2), (ship::SEA_6, 3)] {
            let run = aided(sea, &Horizon { seen_s: 20.0, sigma: 0.03f64.to_radians() }, 300.0, seed);
            assert!(
                run.rms_deg < 0.08 && run.worst_deg < 0.25,
                "{}: {} {}",
                sea.name,
                run.rms_deg,
                run.worst_deg
            );
            assert!((0.3..3.0).contains(&run.surprise), "{}: {}", sea.name, run.surprise);
        }
    }
}
