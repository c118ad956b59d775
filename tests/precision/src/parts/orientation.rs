//! Fusing angular rate and specific force into the unit's orientation.

use anyhow::Result;
use bowwave_core::{
    estimate::attitude::{
        Attitude, AttitudeSettings, InclinationSettings, Noise, OWN_GROWTH, RateKind, Source,
    },
    event::ImuSample,
    time::Time,
};
use glam::{DQuat, DVec3};
use vqf_rs::{Params, VQF};

use super::About;
use crate::{
    bench::{ExtremeResult, PartBench, Way},
    recorded,
    ship::{self, Ship, ShipSea, UnitErrors, inclination_error},
};

/// Description of this part.
pub const ABOUT: About = About {
    part: "orientation",
    what: "Finds which way is up for the inertial unit from its angular rate and specific force, while ship and gun move.",
    truth: "optical motion capture (three public trials of BROAD, where they are beside the repository), and a simulated ship whose \
            every motion is a closed function of time, with the noise and biases of a unit of the VN-100's class. The error is the root \
            mean square of the angle between the found and the true up; on the ship after a minute",
    rivals: "VQF alone as its authors set it and as it is set here, rates alone, a complementary filter (Mahony's without integral) with two gains",
    why: "VQF with a time constant above the waves' period; on it stands a filter that integrates the rates by itself and takes VQF's \
          inclination for what it is: specific force through a low-pass filter, in which waves show as what comes and goes, and biases of \
          gyro and specific force and a gyro's axes that are not square as what that filter makes of them. VQF's own bias estimate is off: \
          a creeping gun looks like one at rest. On the ship that errs a fourth as much as VQF, and it tells how wrong it may be. In hands, \
          which accelerate for shorter, a shorter time constant is better",
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

fn ship_trial(sea: ShipSea, gun: bool, seconds: f64, errors: UnitErrors) -> Trial {
    let samples = ship::samples(&Ship::new(sea, gun, 7), &errors, seconds, 11);
    let samples = samples
        .iter()
        .map(|s| (s.rate, s.accel, (s.time_s > 60.0).then_some(s.truth.world_from_imu)))
        .collect();
    Trial { rate_hz: errors.rate_hz, samples }
}

type TellAttitude<'a> = &'a mut dyn FnMut(usize, DQuat);

fn settings(inclination: InclinationSettings, rate: RateKind) -> AttitudeSettings {
    let noise = match inclination {
        InclinationSettings::HAND => {
            Noise { bias: DVec3::splat(9e-3), scale: 5e-3, force: 0.02, ..Noise::USUAL }
        }
        _ => Noise::USUAL,
    };
    AttitudeSettings { source: Source::Fused, rate, inclination, noise, own_growth: OWN_GROWTH }
}

fn ours(settings: AttitudeSettings, trial: &Trial, tell: TellAttitude<'_>) {
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

fn vqf(params: Params, trial: &Trial, tell: TellAttitude<'_>) {
    let mut filter = VQF::new(1.0 / trial.rate_hz, None, None, Some(params));
    for (i, (rate, accel, _)) in trial.samples.iter().enumerate() {
        filter.update(rate.to_array(), accel.to_array(), None);
        let q = filter.quat_6d();
        tell(i, DQuat::from_xyzw(q.1, q.2, q.3, q.0));
    }
}

/// Mahony, Hamel & Pflimlin 2008, the passive complementary filter with that gain and no integral, 1/s.
fn complementary(gain: f64, trial: &Trial, tell: TellAttitude<'_>) {
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
fn rates_alone(trial: &Trial, tell: TellAttitude<'_>) {
    complementary(0.0, trial, tell);
}

/// VQF as it is set for a gun here.
fn gun_params() -> Params {
    Params { tau_acc: 10.0, rest_th_gyr: 0.2, rest_th_acc: 0.05, bias_clip: 0.5, ..Params::default() }
}

type AttitudeRun<'a> = Box<dyn Fn(&Trial, TellAttitude<'_>) + 'a>;

/// Method, setting, whether the product uses it, itself.
fn ways<'a>(
    default: InclinationSettings,
    rate: RateKind,
) -> Vec<(&'static str, &'static str, bool, AttitudeRun<'a>)> {
    let (gun, hand) = (settings(InclinationSettings::GUN, rate), settings(InclinationSettings::HAND, rate));
    vec![
        (
            "VQF and error-state filter",
            "for a gun",
            default == InclinationSettings::GUN,
            Box::new(move |t, tell| ours(gun, t, tell)),
        ),
        (
            "VQF and error-state filter",
            "in hands",
            default == InclinationSettings::HAND,
            Box::new(move |t, tell| ours(hand, t, tell)),
        ),
        ("VQF", "its authors'", false, Box::new(|t, tell| vqf(Params::default(), t, tell))),
        ("VQF", "for a gun", false, Box::new(|t, tell| vqf(gun_params(), t, tell))),
        ("complementary filter", "0.2 /s", false, Box::new(|t, tell| complementary(0.2, t, tell))),
        ("complementary filter", "0.7 /s", false, Box::new(|t, tell| complementary(0.7, t, tell))),
        ("rates alone", "f64", false, Box::new(rates_alone)),
    ]
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let mut trials = Vec::new();
    for name in BROAD {
        let Some(trial) = broad(name)? else { continue };
        extreme(bench, &format!("BROAD {name}"), &trial, InclinationSettings::HAND, RateKind::Mean);
        trials.push(trial);
    }
    if !trials.is_empty() {
        scene(bench, "in hands, trials of BROAD", &trials, InclinationSettings::HAND, RateKind::Mean);
    }
    for sea in [ship::SEA_4, ship::SEA_6] {
        let trial = ship_trial(sea, true, 300.0, UnitErrors::usual());
        scene(
            bench,
            &format!("gun on a ship, {}", sea.name),
            &[trial],
            InclinationSettings::GUN,
            RateKind::Instant,
        );
    }
    let usual = UnitErrors::usual();
    let slow = UnitErrors { rate_hz: 100.0, ..usual };
    let fast = UnitErrors { rate_hz: 1000.0, ..usual };
    let biased = UnitErrors { gyro_bias: usual.gyro_bias * 6.0, ..usual };
    for (case, sea, errors) in [
        ("calm, creep of 0.1 to 2 deg/s", ship::CALM, usual),
        ("sea 6 at 100 Hz", ship::SEA_6, slow),
        ("sea 6 at 1000 Hz", ship::SEA_6, fast),
        ("sea 4, bias of 0.3 deg/s on each axis", ship::SEA_4, biased),
    ] {
        let trial = ship_trial(sea, true, 300.0, errors);
        extreme(bench, case, &trial, InclinationSettings::GUN, RateKind::Instant);
    }
    Ok(())
}

fn extreme(bench: &mut PartBench, case: &str, trial: &Trial, default: InclinationSettings, rate: RateKind) {
    let tried = ways(default, rate).into_iter().map(|(method, setting, default, run)| ExtremeResult {
        default,
        ..ExtremeResult::rival(method, setting, error_deg(trial, run))
    });
    bench.extreme(case, "deg", tried.collect());
}

/// The error is the mean over the trials.
fn scene(bench: &mut PartBench, name: &str, trials: &[Trial], default: InclinationSettings, rate: RateKind) {
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
fn error_deg(trial: &Trial, run: impl Fn(&Trial, TellAttitude<'_>)) -> f64 {
    let (mut sum, mut count) = (0.0, 0u32);
    run(trial, &mut |i, q| {
        if let Some(truth) = trial.samples[i].2 {
            sum += inclination_error(truth, q).powi(2);
            count += 1;
        }
    });
    (sum / f64::from(count)).sqrt().to_degrees()
}
