use std::sync::Arc;

use glam::Vec3;

use super::*;
use crate::{
    model::{Model, ModelId, ModelKind},
    world::{
        burst::BurstSpec,
        scenario::{Scenario, WeaponSpec},
        score::boxed_model,
    },
};

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
        Launch { shot: 1, fired: START, muzzle, bore, pose_age_ns: 0, scatter: 1.0 },
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
        Launch { shot: 1, fired: START, muzzle, bore, pose_age_ns: 0, scatter: 1.0 },
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

/// Fires so many rounds into the water, `off_m` off a helmsman; those that struck its crew.
fn bursts_beside(burst: Option<BurstSpec>, off_m: f64) -> (usize, Vec<ShotRecord>) {
    let model = Model { kind: ModelKind::Mesh, ..boxed_model(Vec3::splat(-2.0), Vec3::splat(2.0)) };
    let text =
        "[[boat]]\nname = \"skiff\"\nmodel = \"skiff\"\ncourse = \"still\"\nrange_m = 300\nbearing_deg = 0\n";
    let scenario = Scenario::parse(text, "x").expect("sound");
    let mut fleet = Fleet::of_scenario(&scenario, Arc::new([model]), &[ModelId(0)], START);
    let mut rounds = rounds(0.0);
    rounds.ammunition.weapon.burst = burst;
    let target = fleet.middle(0, START).expect("a boat").with_z(0.0) + DVec3::X * off_m;
    let muzzle = target + DVec3::new(0.0, -50.0, 50.0);
    let mut records = Vec::new();
    for shot in 1..=200 {
        let launch =
            Launch { shot, fired: START, muzzle, bore: target - muzzle, pose_age_ns: 0, scatter: 1.0 };
        rounds.launch(launch, Vec::new(), START, &mut records);
    }
    rounds.advance(START.plus_secs(2.0), START, &mut fleet, &mut records);
    let hits = records.iter().filter(|r| matches!(r.outcome, Outcome::Hit { zone: Zone::Helm, .. })).count();
    (hits, records)
}

#[test]
fn a_round_that_bursts_beside_a_boat_strikes_its_crew() {
    let burst = BurstSpec { arming_m: 25.0, lethal_m: 5.0 };
    let (half, records) = bursts_beside(Some(burst), 5.0);
    assert!((70..130).contains(&half), "{half} of 200");
    assert_eq!(records.len(), 200, "each round leaves one record");
    assert_eq!(bursts_beside(None, 5.0).0, 0, "a solid round");
    assert_eq!(bursts_beside(Some(BurstSpec { arming_m: 100.0, ..burst }), 5.0).0, 0, "not armed yet");
    assert_eq!(bursts_beside(Some(burst), 30.0).0, 0, "too far");
}
