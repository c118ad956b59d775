use std::sync::Arc;

use super::*;
use crate::world::scenario::WeaponSpec;

const START: Time = Time::from_ns(1_000_000_000);

fn rounds(ricochet_below_deg: f64) -> Rounds {
    let weapon = WeaponSpec {
        ricochet_below_deg,
        dispersion_mrad: 0.0,
        tracer_every: Some(1),
        tracer_burnout_m: 150.0,
        ..WeaponSpec::default()
    };
    Rounds::new(Ammunition { weapon, wind: DVec3::ZERO, seed: 3 }, WaveField::FLAT, START)
}

fn nobody() -> Fleet {
    Fleet::new(Vec::new(), Arc::new([]), WaveField::FLAT, START)
}

/// Fires downwards at an angle; how often the water is struck, and how far the last splash is.
fn splashes(ricochet_below_deg: f64, down_deg: f64) -> (usize, f64) {
    let (mut rounds, mut fleet, mut records) = (rounds(ricochet_below_deg), nobody(), Vec::new());
    let (sin, cos) = down_deg.to_radians().sin_cos();
    let (muzzle, bore) = (DVec3::new(0.0, 0.0, 8.0), DVec3::new(0.0, cos, -sin));
    rounds.launch(
        Launch { shot: 1, fired: START, muzzle, bore, pose_age_ns: 0 },
        Vec::new(),
        START,
        &mut records,
    );
    let mut places: Vec<DVec3> = Vec::new();
    for frame in 1..700 {
        let now = START.plus_secs(f64::from(frame) / 30.0);
        rounds.advance(now, START, &mut fleet, &mut records);
        for impact in rounds.impacts(now, &fleet) {
            if places.iter().all(|place| place.distance(impact.at) > 1e-6) {
                places.push(impact.at);
            }
        }
    }
    assert_eq!(records.len(), 1, "one round, one record");
    (places.len(), places.last().expect("a splash").y)
}

#[test]
fn a_round_that_meets_the_water_flatly_bounces_on() {
    let (once, near_m) = splashes(0.0, 3.0);
    assert_eq!(once, 1);
    let (often, far_m) = splashes(6.0, 3.0);
    assert!(often > 1 && far_m > 2.0 * near_m, "{often} splashes, {far_m} m");
    assert_eq!(splashes(6.0, 8.0).0, 1, "too steep");
}

#[test]
fn tracers_burn_out() {
    let (mut rounds, mut fleet) = (rounds(0.0), nobody());
    let (muzzle, bore) = (DVec3::new(0.0, 0.0, 8.0), DVec3::Y);
    rounds.launch(
        Launch { shot: 1, fired: START, muzzle, bore, pose_age_ns: 0 },
        Vec::new(),
        START,
        &mut Vec::new(),
    );
    let mut seen = |seconds: f64| {
        let now = START.plus_secs(seconds);
        rounds.advance(now, START, &mut fleet, &mut Vec::new());
        rounds.tracers(now, START, 1.0 / 60.0).count()
    };
    assert_eq!([0.02, 0.1, 0.15, 0.2, 0.3].map(&mut seen), [0, 1, 1, 0, 0]);
}
